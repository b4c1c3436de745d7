"""A simulation that is continued, restored and branched gives the same numbers, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import (
    FMU,
    Block,
    Continuous,
    Input,
    Interrupted,
    Output,
    Simulation,
    SimulationError,
    SnapshotError,
    State,
    System,
    TimeError,
    WiringError,
    simulate,
)
from cosim.blocks import SensorDynamics, WhiteNoise
from fmus.export import export
from tests.cosim.fmi.probe import changed, probe
from tests.cosim.parts import Chain, Gain, Mass


class Remembers(Block):
    """A block in Python: a list of its inputs besides the declared variables."""

    compiled = False
    x = Input()
    y = Output()

    def __init__(self) -> None:
        self.seen: list[float] = []
        super().__init__()

    def step(self, t: float, h: float) -> None:
        self.seen.append(self.x)
        self.y = sum(self.seen) / len(self.seen)


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chains")
    return {v: export(Chain(), folder / f"chain{v[0]}.fmu", fmi_version=v) for v in ("2.0", "3.0")}


def loop(plant) -> System:
    """Everything that has a state: plant, noise, sensor, a block in Python, a delayed connection."""
    system = System(
        {
            "plant": plant,
            "noise": WhiteNoise(sigma=[0.2], seed=3, sample_period=0.01),
            "sensor": SensorDynamics(n=1),
            "mean": Remembers(),
            "g": Gain(K=-0.8),
        },
        [
            ("plant.x[2]", "sensor.u"),
            ("sensor.y", "mean.x"),
            ("noise.y", "plant.u[2]"),
            ("g.u", "plant.u[1]"),
        ],
    )
    system.connect("mean.y", "g.x", initial=0.3)
    return system


RECORD = ["plant.a", "plant.x", "noise.y", "sensor.y", "mean.y", "g.u"]
KINDS = ["python", "2.0", "3.0"]
COUPLINGS = [{}, {"coupling": "continuous", "solver": "ode4"}]


def plant_of(kind, paths):
    return Chain() if kind == "python" else FMU(paths[kind])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("coupling", COUPLINGS)
def test_a_run_in_pieces_is_the_run_in_one(kind, coupling, paths):
    """Exactly: pieces share the last point of one and the first of the next."""
    system = loop(plant_of(kind, paths))
    whole = simulate(system, step=0.01, stop=1.0, record=RECORD, decimation=3, **coupling)
    with Simulation(system, step=0.01, record=RECORD, decimation=3, **coupling) as simulation:
        pieces = [simulation.run(until) for until in (0.07, 0.08, 0.51, 1.0)]
        assert simulation.time == 1.0
    rows = [
        slice(0, 3),
        slice(3, 3),
        slice(3, 18),
        slice(17, 34),
    ]  # points 0..7, 7..8, 8..51, 51..100, every third
    for piece, part in zip(pieces, rows, strict=True):
        assert np.array_equal(piece.time, whole.time[part])
        for name in RECORD:
            assert np.array_equal(piece[name], whole[name][part]), name
    assert sum(p.steps for p in pieces) == whole.steps == 100
    peaks = [p.statistics["g.u"].peak for p in pieces]
    assert max(peaks) == whole.statistics["g.u"].peak


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("coupling", COUPLINGS)
def test_a_snapshot_is_returned_to_exactly_and_a_branch_goes_its_own_way(kind, coupling, paths):
    with Simulation(loop(plant_of(kind, paths)), step=0.01, record=RECORD, **coupling) as simulation:
        simulation.run(0.3)
        there = simulation.snapshot()
        first = simulation.run(0.9)
        for _ in range(2):  # any number of times
            simulation.restore(there)
            assert simulation.time == there.time == 0.3
            again = simulation.run(0.9)
            assert all(np.array_equal(first[name], again[name]) for name in RECORD)
        simulation.restore(there)
        with simulation.branch() as branch:
            other = branch.run(0.6)  # in turns: neither sees the other
            simulation.run(0.4)
            rest = branch.run(0.9)
        for name in RECORD:
            assert np.array_equal(np.concatenate([other[name], rest[name][1:]]), first[name]), name


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 9)), max_size=8))
@settings(max_examples=25, deadline=None)
def test_any_walk_of_runs_and_returns_ends_where_the_straight_run_ends(walk):
    system = System({"m": Mass(), "g": Gain(K=-2.0)}, [("m.x", "g.x"), ("g.u", "m.u")])
    straight = simulate(system, step=0.1, stop=10.0)["m.x"]
    with Simulation(system, step=0.1) as simulation:
        k, kept = 0, simulation.snapshot()
        for back, n in walk:
            if back:
                simulation.restore(kept)
                k = round(kept.time * 10)
            else:
                k += n
                assert simulation.run(0.1 * k)["m.x"][-1] == straight[k]
                kept = simulation.snapshot() if n % 2 else kept


def test_a_simulation_goes_on_after_a_failure_only_from_a_snapshot():
    class Fails(Block):
        compiled = False
        y = Output()
        armed = State(0.0)

        def step(self, t, h):
            if self.armed and t > 0.55:
                raise ValueError("too late")
            self.y = t

    with Simulation(System({"f": Fails(armed=1.0)}), step=0.1) as simulation:
        simulation.run(0.3)
        there = simulation.snapshot()
        with pytest.raises(SimulationError, match="too late") as caught:
            simulation.run(1.0)
        assert caught.value.result["f.y"] == pytest.approx([0.3, 0.4, 0.5])
        with pytest.raises(SimulationError, match="ended within a step; restore a snapshot"):
            simulation.run(1.0)
        with pytest.raises(SimulationError, match="cannot take a snapshot: it ended within a step"):
            simulation.snapshot()
        simulation.restore(there)
        assert simulation.run(0.5)["f.y"] == pytest.approx([0.3, 0.4, 0.5])
    with pytest.raises(SimulationError, match="it is closed; make a new one"):
        simulation.run(1.0)


class Falling(Block):
    """y = 1 - t"""

    y = Output()

    def step(self, t, h):
        self.y = 1.0 - t


class Root(Continuous):
    """x' = -x, y = sqrt(u) x: not a number for u < 0"""

    u = Input(start=1.0)
    x = State(2.0)
    y = Output()

    def derivatives(self, t):
        self.der_x = -self.x

    def outputs(self, t):
        self.y = np.sqrt(self.u) * self.x


def test_an_fmu_that_failed_is_taken_back(tmp_path):
    """At t = 1.1 the input is negative; the output of the FMU is refused, and its state is restored."""
    system = System({"f": Falling(), "r": FMU(export(Root(), tmp_path / "root.fmu"))}, [("f.y", "r.u")])
    with Simulation(system, step=0.1, record=["r.y"]) as simulation:
        simulation.run(0.5)
        there = simulation.snapshot()
        with pytest.raises(SimulationError, match=r"not finite|fmi2Error") as caught:
            simulation.run(2.0)
        simulation.restore(there)
        again = simulation.run(1.0)
        assert np.array_equal(again["r.y"], caught.value.result["r.y"][: len(again.time)])


def test_components_that_cannot_keep_their_state_are_named(tmp_path):
    system = System({"theirs": FMU(probe(tmp_path / "p.fmu", "2.0")), "m": Mass()})
    with Simulation(system, step=0.1) as simulation:
        simulation.run(0.2)
        with pytest.raises(SnapshotError, match="theirs cannot get and set its state"):
            simulation.snapshot()
        assert simulation.run(0.4).time[-1] == pytest.approx(0.4)


def test_running_back_is_refused():
    with Simulation(System({"m": Mass()}), step=0.1) as simulation:
        simulation.run(0.5)
        with pytest.raises(TimeError, match=r"the simulation is already at 0\.5 s"):
            simulation.run(0.4)
        with pytest.raises(TimeError, match=r"0\.64 s is 6\.4 communication steps"):
            simulation.run(0.64)
        assert simulation.run(0.6).steps == 1


def test_a_simulation_goes_on_after_progress_was_stopped():
    """What `progress` raises leaves the simulation at a communication point."""
    system = System({"m": Mass()})
    whole = simulate(system, step=1e-3, stop=1.0, record=["m.x"])
    with Simulation(system, step=1e-3, record=["m.x"]) as simulation:

        def stop(done, of):
            raise KeyboardInterrupt

        with pytest.raises(Interrupted) as caught:
            simulation.run(1.0, progress=stop)
        rest = simulation.run(1.0)
    assert np.array_equal(np.concatenate([caught.value.result["m.x"], rest["m.x"]]), whole["m.x"])


def test_without_records_there_are_no_recorded_times():
    with Simulation(System({"m": Mass()}), step=0.1, record=[], statistics=["m.x"]) as simulation:
        assert [len(simulation.run(until).time) for until in (0.5, 1.0)] == [0, 0]


def test_a_snapshot_of_another_simulation_is_refused(paths):
    """Unless it has the same components and options, so that the saved values have the same meaning."""

    def standing(plant, **options) -> Simulation:
        return Simulation(System({"p": plant}), **({"step": 0.1} | options))

    with standing(FMU(paths["2.0"])) as simulation, standing(Mass()) as other:
        wanted = simulation.run(0.5)["p.x"][-1]
        there, mass = simulation.snapshot(), other.snapshot()
    with standing(FMU(paths["2.0"], isolated=True)) as same:
        same.restore(there)
        assert np.array_equal(same.run(0.6)["p.x"][0], wanted)
    for plant, options in (
        (FMU(paths["2.0"]), {"step": 0.2}),
        (FMU(paths["2.0"]), {"start": 1.0}),
        (FMU(paths["2.0"]), {"record": ["p.a"]}),
        (FMU(paths["2.0"], interface="ModelExchange"), {}),
        (FMU(paths["3.0"]), {}),
        (Mass(), {}),
    ):
        with (
            standing(plant, **options) as simulation,
            pytest.raises(SnapshotError, match=r"the snapshot at t = 0\.5 s belongs to another simulation"),
        ):
            simulation.restore(there)
    for options in ({"jit": False}, {"coupling": "continuous"}):
        with standing(Mass(), **options) as simulation, pytest.raises(SnapshotError, match="another simul"):
            simulation.restore(mass)
    with standing(Mass()) as simulation, pytest.raises(SnapshotError, match="None must be a snapshot"):
        simulation.restore(None)


def test_an_fmu_that_can_be_instantiated_once_is_not_branched(paths, tmp_path):
    """A second simulation would be a second instance in this process."""

    def once(name: str, content: bytes) -> bytes:
        says = b'canBeInstantiatedOnlyOncePerProcess="true" canGetAndSetFMUstate'
        return content.replace(b"canGetAndSetFMUstate", says) if name == "modelDescription.xml" else content

    path = changed(tmp_path / "once.fmu", paths["2.0"], once)
    for _ in range(2):  # closed, it may be made again
        with Simulation(System({"p": FMU(path)}), step=0.1) as simulation:
            simulation.run(0.5)
            with pytest.raises(WiringError, match=r"p \(once\.fmu\) can be instantiated only once .* open"):
                simulation.branch()
            assert simulation.run(0.6).steps == 1
    with Simulation(System({"p": FMU(path, isolated=True)}), step=0.1) as simulation:
        simulation.branch().close()
