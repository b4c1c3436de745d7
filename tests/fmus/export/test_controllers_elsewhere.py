"""Controllers and plants, all as FMUs, close the loop in ecos (C++) and in a loop of FMPy's calls.

Two schedules, and they differ by far more than any tolerance here:

    Jacobi       every FMU steps from t_k with what all FMUs gave at t_k. Ours when no FMU is a
                 block, ecos, and the loop below. A block's FMU is one step late then: what it
                 works out of its inputs at t_k is read at t_{k+1}
    sequential   controllers act at t_k in the order of their connections, each with the outputs
                 that the one before has just computed, then the plants step. Ours with
                 as_block=True, and the same order in FMPy's calls

A switching law amplifies the last bit of anything, so with another compiler's binary no horizon
would be short enough for a bound. Here every master calls the same binaries with the same
numbers (1e-9 is asked for) and the trajectories are the same bits. ecos adds up its time, which these
FMUs do not use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from controllers.adaptive.scwnn import SCWNN
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from controllers.laws.sliding_mode import SlidingMode
from controllers.laws.state_feedback import StateFeedback
from controllers.laws.switching import SaturationControl
from controllers.observers.kinematic_observer import KinematicObserver
from controllers.observers.observer import Observer
from cosim import FMU, Array, Block, Participant, System, simulate
from cosim.blocks import LowPass, WhiteNoise
from cosim.core.port import Port
from fmus.export import export
from fmus.packaging.other_tools import ecospy
from fmus.plants.damped_tower import DampedTower
from fmus.plants.oscillator import Oscillator
from scenarios.tall_building.building import Damper
from tests.fmus.export.every_class import model
from tests.fmus.export.host import building
from tests.fmus.plants.towers import small_tower
from tests.others import tool


@dataclass
class Loop:
    """Participants, connections, and the ports to compare."""

    members: Callable[[], dict[str, Participant]]
    connections: list[tuple[str, str]]
    compared: list[str]
    h: float
    steps: int
    #: connections that would close a cycle of blocks where they act at t_k
    delayed: tuple[tuple[str, str], ...] = ()


def tower(law: Callable[[], Participant], *, filtered: bool) -> Loop:
    """Chapter 2: wind, tower with damper, observer of two accelerations, law, filter."""
    force = "filter.y[1]" if filtered else "law.u[1]"

    def members() -> dict[str, Participant]:
        found: dict[str, Participant] = {
            "wind": WhiteNoise(sample_period=0.005, seed=4, sigma=[2e5, 4e5]),
            "tower": DampedTower.build(small_tower(), [5], **asdict(Damper())),
            "observer": Observer.design(model(), np.eye(5), 1e-14 * np.eye(2), 0.005),
            "law": law(),
        }
        return found | ({"filter": LowPass(0.1, n=1, unit="N")} if filtered else {})

    connections = [
        ("wind.y", "tower.w[4:5]"),
        ("tower.a[1]", "observer.y[1]"),
        ("tower.a_m", "observer.y[2]"),
        ("observer.x_hat", "law.x_hat"),
        (force, "tower.u"),
    ]
    if filtered:
        connections.append(("law.u", "filter.u"))
    compared = ["tower.x", "tower.x_m", "observer.x_hat", "law.u"]
    return Loop(members, connections, compared, 0.005, 600, ((force, "observer.u_last[1]"),))


def network() -> Loop:
    """Chapter 3: a network behind its kinematic observer moves two floors of a building that is shaken."""
    return Loop(
        lambda: {
            "noise": WhiteNoise(sample_period=0.002, seed=4, sigma=20.0, n=2, unit="m/s^2"),
            "building": building(),
            "observer": KinematicObserver(T=[[1.0, 0.01], [0.02, 0.99]]),
            "law": SCWNN.design(2, 30, k1=5.0, k2=1.0, g_min=2.0, s_max=2.0, u_max=100.0, d_max=0.001),
        },
        [
            ("noise.y[1]", "building.ground_acceleration"),
            ("building.x[1:2]", "observer.y"),
            ("observer.x", "law.x"),
            ("observer.v", "law.v"),
            ("law.u", "building.force[1:2]"),
        ],
        ["building.x", "building.drift", "observer.v", "law.u", "law.s", "law.nodes", "law.r"],
        0.002,
        1000,
    )


def boundary_layer() -> Loop:
    """Chapter 4 with scalar ports only, the ports of FMI 3.0 that ecos supports."""
    return Loop(
        lambda: {
            "plant": Oscillator(),
            "surface": PhasePlaneSurface(),
            "law": SaturationControl(scaled=1.0, gamma=20.0),
        },
        [
            ("plant.x", "surface.x1"),
            ("plant.v", "surface.x2"),
            ("surface.s", "law.s"),
            ("law.u", "plant.u"),
        ],
        ["plant.x", "plant.v", "surface.s", "law.u"],
        0.01,
        1000,
    )


LOOPS: dict[str, Callable[[], Loop]] = {
    "filtered SMC": lambda: tower(lambda: SlidingMode.design(model(), np.eye(4)), filtered=True),
    "LQG": lambda: tower(lambda: StateFeedback.lqr(model(), np.eye(4), np.array([[1e-12]])), filtered=False),
    "wavelet network": network,
    "boundary layer": boundary_layer,
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], tuple[Loop, dict[str, Path]]]:
    folder, made = tmp_path_factory.mktemp("loops"), {}

    def give(name: str, version: str) -> tuple[Loop, dict[str, Path]]:
        if (name, version) not in made:
            loop = LOOPS[name]()
            paths = {
                n: export(m, folder / name / version / f"{n}.fmu", fmi_version=version)
                for n, m in loop.members().items()
            }
            made[name, version] = loop, paths
        return made[name, version]

    return give


def system_of(loop: Loop, paths: dict[str, Path], as_block: bool) -> System:
    """Return the loop with FMUs only; FMUs of blocks act as blocks."""
    blocks = {n for n, m in loop.members().items() if isinstance(m, Block)} if as_block else set()
    system = System({n: FMU(p, as_block=n in blocks) for n, p in paths.items()}, loop.connections)
    for source, target in loop.delayed:
        system.connect(source, target, initial=0.0 if as_block else None)
    return system


def ours(loop: Loop, system: System) -> dict[str, Array]:
    result = simulate(system, step=loop.h, stop=loop.steps * loop.h, record=loop.compared)
    return {port: result[port].reshape(loop.steps + 1, -1) for port in loop.compared}


def elements(port: Port) -> list[str]:
    """Return the names of a port's elements in FMI 2.0."""
    if not port.shape:
        return [port.name]
    return [f"{port.name}[{i + 1}]" for i in range(port.first, port.first + port.count)]


def same_bits(found: dict[str, Array], expected: dict[str, Array]) -> None:
    for port, values in expected.items():
        assert np.array_equal(found[port], values), f"{port}: {np.abs(found[port] - values).max()}"
        assert not np.array_equal(found[port][1:], values[:-1]), f"{port} is the same one sample late"


# ------------------------------------------------------------------------------ ecos


def in_ecos(loop: Loop, system: System, paths: dict[str, Path]) -> dict[str, Array]:
    """Return values after each step, when ecos has set the next inputs: not for outputs with feedthrough."""
    ecos = tool(ecospy)
    structure = ecos.EcosSimulationStructure()
    for name, path in paths.items():
        structure.add_model(name, str(path))
    for c in system.connections:
        for source, target in zip(elements(c.source), elements(c.target), strict=True):
            structure.make_real_connection(
                f"{c.source.participant}::{source}", f"{c.target.participant}::{target}"
            )
    ports = {name: system.port(name, "output") for name in loop.compared}
    rows: dict[str, list[list[float]]] = {name: [] for name in ports}
    with ecos.EcosSimulation(step_size=loop.h, structure=structure) as simulation:
        simulation.init(0.0)
        for _ in range(loop.steps):
            simulation.step(1)
            for name, port in ports.items():
                row = [simulation.get_real(f"{port.participant}::{e}") for e in elements(port)]
                rows[name].append(row)
        simulation.terminate()
    return {name: np.array(values) for name, values in rows.items()}


@pytest.mark.parametrize(("name", "version"), [*((n, "2.0") for n in LOOPS), ("boundary layer", "3.0")])
def test_ecos_closes_the_loop(exported: Any, name: str, version: str) -> None:
    """All loops in FMI 2.0; in FMI 3.0 those with scalar ports, since ecos has no arrays."""
    loop, paths = exported(name, version)
    system = system_of(loop, paths, as_block=False)
    expected = {port: values[1:] for port, values in ours(loop, system).items()}
    same_bits(in_ecos(loop, system, paths), expected)


# ------------------------------------------------------------------------------ FMPy


class Slave:
    """An FMU through FMPy's own calls: ports of floats by name, in either version of FMI."""

    def __init__(self, path: Path, folder: Path, name: str) -> None:
        description = fmpy.read_model_description(str(path))
        self.new = description.fmiVersion == "3.0"
        self.references: dict[str, list[int]] = {}
        self.size: dict[str, int] = {}
        for v in description.modelVariables:
            port = v.name.split("[")[0]
            self.references.setdefault(port, []).append(v.valueReference)
            self.size[port] = self.size.get(port, 0) + int(np.prod(v.shape or (1,)))
        fmpy.extract(str(path), str(folder))
        self.fmu: Any = (FMU3Slave if self.new else FMU2Slave)(
            guid=description.guid, unzipDirectory=str(folder), instanceName=name,
            modelIdentifier=description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.fmu.instantiate()
        if self.new:
            self.fmu.enterInitializationMode(startTime=0.0)
        else:
            self.fmu.setupExperiment(startTime=0.0)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, port: str) -> Array:
        if self.new:
            return np.array(self.fmu.getFloat64(self.references[port], nValues=self.size[port]))
        return np.array(self.fmu.getReal(self.references[port]))

    def set(self, port: str, values: Array) -> None:
        setter = self.fmu.setFloat64 if self.new else self.fmu.setReal
        setter(self.references[port], values.tolist())

    def step(self, t: float, h: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)


@contextmanager
def slaves(paths: dict[str, Path], folder: Path) -> Iterator[dict[str, Slave]]:
    made = {name: Slave(path, folder / name, name) for name, path in paths.items()}
    try:
        yield made
    finally:
        for slave in made.values():
            slave.fmu.terminate()
            slave.fmu.freeInstance()


def feed(
    system: System, fmus: dict[str, Slave], values: dict[str, Array], before: dict[str, Array], to: str
) -> None:
    """Set the inputs of one FMU from the others' outputs, of a delayed connection from those at t_{k-1}."""
    inputs: dict[str, Array] = {}
    for c in system.connections:
        if c.target.participant == to:
            target = inputs.setdefault(c.target.name, fmus[to].get(c.target.name))
            known = values if c.initial is None else before
            source = known[f"{c.source.participant}.{c.source.name}"]
            target[c.target.first : c.target.first + c.target.count] = source[
                c.source.first : c.source.first + c.source.count
            ]
    for port, value in inputs.items():
        fmus[to].set(port, value)


def in_fmpy(
    loop: Loop, system: System, paths: dict[str, Path], folder: Path, blocks: list[str]
) -> dict[str, Array]:
    """At t_k: get the outputs of plants; blocks one after the other; record; then the plants step.

    Without blocks all are plants, which is Jacobi.
    """
    read = [(c.source.participant, c.source.name) for c in system.connections]
    read += [(n, port) for n, _, port in (name.partition(".") for name in loop.compared)]
    rows: dict[str, list[Array]] = {name: [] for name in loop.compared}
    with slaves(paths, folder) as fmus:
        plants = [n for n in fmus if n not in blocks]
        values = {f"{n}.{port}": np.zeros(fmus[n].size[port]) for n, port in read}
        for k in range(loop.steps + 1):
            before = dict(values)
            values |= {f"{n}.{port}": fmus[n].get(port) for n, port in read if n in plants}
            for block in blocks:
                feed(system, fmus, values, before, block)
                fmus[block].step(k * loop.h, loop.h)
                values |= {f"{n}.{port}": fmus[n].get(port) for n, port in read if n == block}
            for name in loop.compared:
                rows[name].append(values[name])
            if k < loop.steps:
                for plant in plants:
                    feed(system, fmus, values, before, plant)
                for plant in plants:
                    fmus[plant].step(k * loop.h, loop.h)
    return {name: np.array(values) for name, values in rows.items()}


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("schedule", ["Jacobi", "sequential"])
def test_a_loop_of_fmpys_calls_closes_the_loop(
    exported: Any, tmp_path: Path, name: str, version: str, schedule: str
) -> None:
    loop, paths = exported(name, version)
    system = system_of(loop, paths, as_block=schedule == "sequential")
    found = in_fmpy(loop, system, paths, tmp_path, system.block_order())
    expected = ours(loop, system)
    same_bits(found, expected)
    first, last = (np.abs(expected["law.u"][part]).max() for part in (slice(100, 300), slice(-200, None)))
    assert last < 3.0 * first, "this loop is unstable, and no comparison at all"
