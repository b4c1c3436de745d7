"""Participants at the edge (nothing in, nothing kept, no limit), and FMUs of ours in our own loop."""

from __future__ import annotations

import io
import itertools
import math
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from cosim import FMU, Block, Continuous, Input, Output, Parameter, State, System, simulate
from fmus.export import ExportError, export
from fmus.export.fmu import FMI_VERSIONS
from fmus.plants.oscillator import Oscillator
from tests.fmus.export.host import OK, Host, building


class Sine(Block):
    """u = a sin t: no input, no state"""

    a = Parameter(2.0, "amplitude", unit="N", max=math.inf)
    u = Output("force", unit="N")

    def step(self, t: float, h: float) -> None:
        self.u = self.a * math.sin(t)


class Limiter(Continuous):
    """y = max(-limit, min(u, limit)): no state, and no limit unless one is set"""

    limit = Parameter(math.inf, "limit", unit="N", min=0.0)
    u = Input(unit="N")
    y = Output(unit="N")

    def outputs(self, t: float) -> None:
        self.y = max(-self.limit, min(self.u, self.limit))

    def derivatives(self, t: float) -> None:
        pass


class Sink(Block):
    """Counts what is positive: no output"""

    u = Input(unit="N")
    n = State(0.0, "count", unit="1")

    def step(self, t: float, h: float) -> None:
        if self.u > 0.0:
            self.n += 1.0


class Delicate(Continuous):
    """x' = sqrt(u - 0.5): not a number when u swings below 0.5"""

    u = Input(unit="1", start=1.0)
    x = State(unit="1")

    def derivatives(self, t: float) -> None:
        self.der_x = math.sqrt(self.u - 0.5)


class Prepared(Continuous):
    """x' = -w x with w = 2 pi / T from `initialize`"""

    T = Parameter(2.0, "period", unit="s", min=1e-9)
    x = State(1.0, unit="m")
    w = Output("rate", unit="1/s")

    def initialize(self) -> None:
        self.w = 2.0 * math.pi / self.T

    def derivatives(self, t: float) -> None:
        self.der_x = -self.w * self.x


@pytest.mark.parametrize("version", FMI_VERSIONS)
@pytest.mark.parametrize("make", [Sine, Limiter, Sink, Delicate, Prepared])
def test_the_edge_is_valid_too(tmp_path: Path, make: Callable[[], Block], version: str) -> None:
    path = export(make(), tmp_path / "edge.fmu", fmi_version=version)
    assert validate_fmu(str(path)) == []
    simulate_fmu(str(path), stop_time=0.1, output_interval=0.01)


def test_a_source_computes_at_the_beginning_of_its_step(tmp_path: Path) -> None:
    result = simulate_fmu(str(export(Sine(), tmp_path / "s.fmu")), stop_time=1.0, output_interval=0.25)
    assert list(result["u"][1:]) == [2.0 * math.sin(t) for t in (0.0, 0.25, 0.5, 0.75)]


def test_a_parameter_may_be_infinite_within_its_bounds(tmp_path: Path) -> None:
    path = str(export(Limiter(), tmp_path / "l.fmu"))
    limit = next(v for v in read_model_description(path).modelVariables if v.name == "limit")
    assert limit.start == "INF"
    for given, expected in ((math.inf, 7.0), (3.0, 3.0)):
        result = simulate_fmu(path, stop_time=0.1, start_values={"u": 7.0, "limit": given})
        assert result["y"][-1] == expected


def test_a_model_that_cannot_swing_has_a_reference_with_held_inputs(tmp_path: Path) -> None:
    path = export(Delicate(), tmp_path / "d.fmu")
    with zipfile.ZipFile(path) as archive:
        stimuli = archive.read("extra/org.fmi-standard.fmi-ls-ref/stimuli.csv").decode()
        reference = archive.read("extra/org.fmi-standard.fmi-ls-ref/reference.csv").decode()
    assert set(np.loadtxt(io.StringIO(stimuli), delimiter=",", skiprows=1)[:, 1]) == {1.0}
    assert float(reference.splitlines()[-1].split(",")[1]) == pytest.approx(math.sqrt(0.5), rel=1e-12)


def test_a_model_that_does_not_run_is_not_exported(tmp_path: Path) -> None:
    plant = Delicate()
    plant.u = 0.0
    with pytest.raises(ExportError, match=r"Delicate fails in its default.*der\(x\) became -?nan at t = 0"):
        export(plant, tmp_path / "d.fmu")
    assert not (tmp_path / "d.fmu").exists()


def test_initialize_runs_after_parameters_are_set(tmp_path: Path) -> None:
    path = str(export(Prepared(), tmp_path / "p.fmu"))
    for period in (2.0, 0.5):
        result = simulate_fmu(path, stop_time=0.1, output_interval=0.1, start_values={"T": period})
        assert list(result["w"]) == [2.0 * math.pi / period] * 2
    initial = {u.variable.name: u.dependencies for u in read_model_description(path).initialUnknowns}
    assert [v.name for v in initial["w"]] == ["T"]


def test_matrices_of_an_earlier_advance_stay_behind(tmp_path: Path) -> None:
    """An oscillator that has been stepped in Python, exported, and given another stiffness."""
    used = Oscillator()
    used.advance(0.0, 0.1)
    path = export(used, tmp_path / "used.fmu")
    fresh = export(Oscillator(x=used.x, v=used.v), tmp_path / "fresh.fmu")
    results = [
        simulate_fmu(str(p), stop_time=1.0, output_interval=0.1, start_values={"k": 4.0}, output=["x", "v"])
        for p in (path, fresh)
    ]
    assert np.array_equal(*results)


def test_the_step_of_a_host_that_rounds_is_one_step(host_of: Callable[[str], Host]) -> None:
    """Differences of times differ in their last digits; what belongs to a step is not computed anew."""
    h = host_of("building")
    states = []
    for start in (0.0, 1000.0):
        h.setup(start=start)
        times = start + np.arange(200) * 0.01
        h.set(("ground_acceleration", 1.0))
        for t, following in itertools.pairwise(times):
            assert h.step(float(t), float(following - t)) == OK
        states.append(h.get("x[1]", "x[3]"))
        h.free()
    # 1000.01 - 1000 is 0.01 to 1e-13 / 0.01 = 1e-11 of it; the state is off by as much of its rate, not more
    assert states[1] == pytest.approx(states[0], rel=1e-9)


STEPS = 10_000


class Drive(Block):
    """A force and a disturbance that do not repeat"""

    u = Output("force", unit="N")
    d = Output("disturbance", unit="m/s^2")

    def step(self, t: float, h: float) -> None:
        self.u = 3.0 * math.sin(0.7 * t) - 0.02 * t
        self.d = 2.0 * math.cos(1.3 * t)


def test_interpreted_compiled_and_as_fmu_it_is_the_same_plant(fmu_of: Callable[..., Path]) -> None:
    """Over 10,000 steps in our own loop; rounding of 1e-16 a step adds up to less than 1e-12."""
    found = []
    for plant, jit in ((Oscillator(), False), (Oscillator(), True), (FMU(fmu_of("oscillator")), True)):
        system = System({"drive": Drive(), "plant": plant}, [("drive.u", "plant.u"), ("drive.d", "plant.d")])
        result = simulate(
            system, step=0.01, stop=STEPS * 0.01, record=["plant.x", "plant.v", "plant.a"], jit=jit
        )
        found.append(np.column_stack([result[f"plant.{n}"] for n in ("x", "v", "a")]))
    assert found[0].shape == (STEPS + 1, 3)
    for other in found[1:]:
        assert np.abs(other - found[0]).max() < 1e-12 * np.abs(found[0]).max()


def test_a_building_of_many_stories_has_all_its_ports(tmp_path: Path) -> None:
    n = 24
    plant = type(building()).build(np.full(n, 2.0), np.full(n, 900.0), 0.02)
    path = export(plant, tmp_path / "tall.fmu")
    assert validate_fmu(str(path)) == []
    description = read_model_description(str(path))
    assert len(description.modelVariables) == 1 + n + 3 * n + 1 + 4 * n + 2 * n
