"""The highway bridge's loop: records, plant, sensors, controllers (thesis.txt, 3.6.3 and 3.6.4).

    displacement sensors   10 V = 0.33 m
    velocity sensors       10 V = 3.3 m/s (not printed: ten times the displacement's number)
    all: noise 0.03 V rms, 16 bit over +-10 V, sampled every 5 ms; actuators 1000 kN

Controllers
    none                no force
    passive             a viscous damper at every actuator's place
    lqg                 28 states (14 modes of the initial tangent), 12 displacement sensors at the bearings
    scwnn               the network with the thesis' parameters, 32 sensors
    scwnn-searched      with parameters searched on three of the records, see SEARCHED
    scwnn-six-sensors   the same, behind an observer of six displacement sensors
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from controllers.adaptive.scwnn import SCWNN
from controllers.design.reduction import modal_state_space
from controllers.design.state_space import StateSpace
from controllers.laws.state_feedback import StateFeedback
from controllers.laws.viscous_dampers import ViscousDampers
from controllers.observers.kinematic_observer import KinematicObserver
from controllers.observers.observer import Observer
from cosim import System
from cosim.blocks import AnalogToDigital, MeasurementNoise, RecordSource, Saturation
from fmus.plants.nonlinear_structure import NonlinearStructure
from scenarios.highway_bridge.earthquakes import Earthquake

from .benchmark import benchmark_bridge
from .bridge import highway_bridge

Controller = Literal["none", "passive", "lqg", "scwnn", "scwnn-searched", "scwnn-six-sensors"]

STEP, STEP_UNCONTROLLED = 0.005, 0.002  # s
DURATION = 100.0  # s, every run: the thesis' T_t
LIMIT = 1e6  # N
BEARINGS = 16
DISPLACEMENT_RANGE, VELOCITY_RANGE = 0.33, 3.3  # of 10 V
NOISE = 0.003  # of the range
#: of the bearings that the observer in front of the network measures: x, y of one, x of another, by end
SENSORS = (0, 1, 6, 8, 9, 14)
#: of the three bearings by end that LQG measures, x and y
LQG_SENSORS = (0, 1, 2, 3, 6, 7, 8, 9, 10, 11, 14, 15)
MODES = 14
NODES = 40  # the network's largest number
UNMODELLED = 1e5  # N
#: what tests/benchmarks/search_scwnn.py draws from, and the records it looks at
SEARCH_SPACE = {
    "k1": (30.0, 300.0),
    "k2": (1.0, 300.0),
    "g_min": (10.0, 300.0),
    "s_max": (1.0, 100.0),
    "eta_r": (0.1, 30.0),
    "leak": (0.01, 3.0),
    "eta_iw": (0.001, 0.1),
    "eta_ib": (0.001, 0.1),
}
SEARCH_RECORDS = ("el-centro", "northridge", "chi-chi")
#: what it found
SEARCHED: dict[str, float] = {
    "k1": 40.8, "k2": 9.97, "g_min": 20.0, "s_max": 3.35,
    "eta_r": 7.22, "leak": 0.0495, "eta_iw": 0.00934, "eta_ib": 0.0915,
}  # fmt: skip


def plant(data: Path | None, late_events: bool = False) -> NonlinearStructure:
    """The reduced bridge, or the full model from a folder with the benchmark's data."""
    if data is None:
        return highway_bridge(late_events=late_events)
    return benchmark_bridge(data, late_events=late_events)


def bridge_system(
    bridge: NonlinearStructure,
    quake: Earthquake,
    controller: Controller,
    seed: int,
    step: float | None = None,
) -> System:
    """The bridge under an earthquake, with a controller; without one, at steps of 2 ms unless told."""
    if step is None:
        step = STEP_UNCONTROLLED if controller == "none" else STEP
    means = quake.step_means(step, DURATION)
    system = System({"bridge": bridge})
    for i, axis in enumerate("xy"):
        source = RecordSource(means[:, i], step, interpolation="hold", unit="m/s2")
        system.add(f"ground_{axis}", source)
        system.connect(f"ground_{axis}.y", f"bridge.ground[{i + 1}]")
    if controller == "passive":
        system.add("control", ViscousDampers(p=BEARINGS))
        system.connect("bridge.stroke_rate", "control.v")
    elif controller == "lqg":
        _lqg(system, bridge, seed)
    elif controller == "scwnn-six-sensors":
        _network_behind_observer(system, bridge, seed)
    elif controller != "none":
        _network(system, seed, SEARCHED if controller == "scwnn-searched" else {})
    if "control" in system.participants:
        system.connect("control.u", "bridge.u")
    return system


def _sensors(system: System, name: str, sources: list[str], reach: float, unit: str, seed: int) -> str:
    """Sensors in a row with one range: noise, then conversion; returns the port of what they say."""
    n = len(sources)
    noise = MeasurementNoise(np.full(n, NOISE * reach), sample_period=STEP, seed=seed, unit=unit)
    system.add(f"{name}_noise", noise)
    system.add(name, AnalogToDigital(np.full(n, reach), unit=unit))
    for i, source in enumerate(sources):
        system.connect(source, f"{name}_noise.u[{i + 1}]")
    system.connect(f"{name}_noise.y", f"{name}.u")
    return f"{name}.y"


def _network(system: System, seed: int, parameters: dict[str, float]) -> None:
    system.add("control", SCWNN.design(BEARINGS, NODES, **parameters))
    every = range(1, BEARINGS + 1)
    strokes, rates = [f"bridge.stroke[{i}]" for i in every], [f"bridge.stroke_rate[{i}]" for i in every]
    system.connect(_sensors(system, "displacement", strokes, DISPLACEMENT_RANGE, "m", seed), "control.x")
    system.connect(_sensors(system, "velocity", rates, VELOCITY_RANGE, "m/s", seed + 1), "control.v")


def _network_behind_observer(system: System, bridge: NonlinearStructure, seed: int) -> None:
    rows = bridge.linear_model().actuators
    system.add("observer", KinematicObserver.design(rows, rows[list(SENSORS)]))
    strokes = [f"bridge.stroke[{i + 1}]" for i in SENSORS]
    system.connect(_sensors(system, "displacement", strokes, DISPLACEMENT_RANGE, "m", seed), "observer.y")
    system.add("control", SCWNN.design(BEARINGS, NODES))
    system.connect("observer.x", "control.x")
    system.connect("observer.v", "control.v")


def _lqg(system: System, bridge: NonlinearStructure, seed: int) -> None:
    """Bearings weighted by (0.1 m)^-2, midspan by (0.05 m)^-2, forces by LIMIT^-2.

    To the observer, two things are white over 10 Hz: the ground, 1 m/s2 rms in each direction,
    and what yielding bearings do beyond linear, UNMODELLED rms each.
    """
    structure = bridge.linear_model()
    displacements = np.vstack([structure.actuators, structure.displacements])
    model, _ = modal_state_space(
        structure.M, structure.C, structure.K, structure.influence, structure.actuators,
        displacements, structure.accelerations, MODES,
    )  # fmt: skip
    n = len(displacements)
    weight = np.diag([0.1**-2.0] * BEARINGS + [0.05**-2.0] * (n - BEARINGS))
    seen = model.C[:n]
    R = np.eye(BEARINGS) / LIMIT**2
    feedback = StateFeedback.lqr(model, seen.T @ weight @ seen, R)
    measured = list(LQG_SENSORS)
    sensed = StateSpace(
        A=model.A, B=model.B, E=np.hstack([model.E, model.B]),
        C=model.C[measured], D=model.D[measured], F=np.hstack([model.F, model.D])[measured],
    )  # fmt: skip
    unknown = np.diag([1.0**2] * 2 + [UNMODELLED**2] * BEARINGS) / (2.0 * 10.0)
    noise = np.eye(len(measured)) * (NOISE * DISPLACEMENT_RANGE) ** 2 * STEP
    observer = Observer.design(sensed, unknown, noise, STEP)
    system.add("observer", observer)
    system.add("regulator", feedback)
    system.add("limit", Saturation(np.full(BEARINGS, LIMIT)))
    strokes = [f"bridge.stroke[{i + 1}]" for i in measured]
    system.connect(_sensors(system, "displacement", strokes, DISPLACEMENT_RANGE, "m", seed), "observer.y")
    system.connect("observer.x_hat", "regulator.x_hat")
    system.connect("regulator.u", "limit.u")
    system.connect("limit.y", "observer.u_last", initial=0.0)
    system.connect("limit.y", "bridge.u")
