"""The highway bridge's loop: records, plant, sensors, controllers (thesis, 3.6.3 and 3.6.4).

    displacement sensors   10 V = 0.33 m
    velocity sensors       10 V = 3.3 m/s (not printed: ten times the displacement's number)
    all sensors            noise 0.03 V rms, 16 bit over +-10 V, sampled every 5 ms
    actuators              1000 kN

Controllers
    none                no force
    passive             a viscous damper of 1 MN*s/m in place of every actuator
    lqg                 28 states (14 modes of the initial tangent), 12 displacement sensors at the bearings
    scwnn               the network with the thesis' parameters, 32 sensors
    scwnn-not-learning  the same with all learning rates of the network zero; the fuzzy compensation r stays
    scwnn-searched      with parameters searched on three of the records, see calibrate.py
    scwnn-six-sensors   the network behind an observer of six displacement sensors
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from controllers.adaptive.scwnn import SCWNN
from controllers.design.design_model import DesignModel
from controllers.design.reduction import modal_state_space
from controllers.laws.state_feedback import StateFeedback
from controllers.laws.viscous_dampers import ViscousDampers
from controllers.observers.kinematic_observer import KinematicObserver
from controllers.observers.observer import Observer
from cosim import System
from cosim.blocks import AnalogToDigital, MeasurementNoise, RecordSource, Saturation
from fmus.plants.nonlinear_structure import NonlinearStructure
from scenarios.measurement import measure

from .benchmark import benchmark_bridge
from .bridge import highway_bridge
from .criteria import BEARINGS, Equipment
from .earthquakes import Earthquake

Controller = Literal[
    "none", "passive", "lqg", "scwnn", "scwnn-not-learning", "scwnn-searched", "scwnn-six-sensors"
]

STEP, STEP_UNCONTROLLED = 0.005, 0.002  # s
DURATION = 100.0  # s, of every run: the thesis' T_t
LIMIT = 1e6  # N
#: kind of sensor -> port of the bridge, its unit, and the range at 10 V in that unit
RANGES = {"displacement": ("stroke", "m", 0.33), "velocity": ("stroke_rate", "m/s", 3.3)}
NOISE = 0.003  # of the range
#: bearing displacements that the observer before the network measures: x, y of one bearing, x of
#: another, at either end
SENSORS = (0, 1, 6, 8, 9, 14)
#: bearing displacements that LQG measures: x and y of three bearings at either end
LQG_SENSORS = (0, 1, 2, 3, 6, 7, 8, 9, 10, 11, 14, 15)
MODES = 14
NODES = 40  # largest number of the network's nodes
UNMODELLED = 1e5  # N

#: parameters that calibrate.py found on three of the six records
SEARCHED: dict[str, float] = {
    "k1": 40.8, "k2": 9.97, "g_min": 20.0, "s_max": 3.35,
    "eta_r": 7.22, "leak": 0.0495, "eta_iw": 0.00934, "eta_ib": 0.0915,
}  # fmt: skip
#: all rates by which the network learns
NOT_LEARNING = dict.fromkeys(
    ("eta_sigma", "eta_c", "eta_pw", "eta_iw", "eta_pb", "eta_ib", "eta_pt", "eta_it"), 0.0
)
#: parameters of the network that differ from the thesis'
NETWORKS: dict[Controller, Mapping[str, float]] = {
    "scwnn": {},
    "scwnn-not-learning": NOT_LEARNING,
    "scwnn-searched": SEARCHED,
    "scwnn-six-sensors": {},
}
EQUIPMENT: dict[Controller, Equipment] = {
    "none": Equipment(devices=0, sensors=0, states=0),
    "passive": Equipment(devices=16, sensors=0, states=0),
    "lqg": Equipment(devices=16, sensors=12, states=2 * MODES),
    "scwnn": Equipment(devices=16, sensors=32, states=None),
    "scwnn-not-learning": Equipment(devices=16, sensors=32, states=None),
    "scwnn-searched": Equipment(devices=16, sensors=32, states=None),
    "scwnn-six-sensors": Equipment(devices=16, sensors=6, states=None),
}


def plant(data: Path | None, late_events: bool = False) -> NonlinearStructure:
    """Return the reduced bridge, or the full model from a folder with the benchmark's data."""
    if data is None:
        return highway_bridge(late_events=late_events)
    return benchmark_bridge(data, late_events=late_events)


def bridge_system(
    bridge: NonlinearStructure,
    quake: Earthquake,
    controller: Controller,
    seed: int,
    step: float | None = None,
    network: Mapping[str, float] | None = None,
) -> System:
    """Return the bridge under an earthquake, with a controller.

    `step` is the step of the run, s, by default 2 ms without control and 5 ms with control; `network`
    gives parameters of the network, by default those of the controller.
    """
    if step is None:
        step = STEP_UNCONTROLLED if controller == "none" else STEP
    means = quake.step_means(step, DURATION)
    system = System({"bridge": bridge})
    for i, axis in enumerate("xy"):
        source = RecordSource(means[:, i], step, interpolation="hold", unit="m/s^2")
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
        _network(system, seed, NETWORKS[controller] if network is None else network)
    if "control" in system.participants:
        system.connect("control.u", "bridge.u")
    return system


def _sensors(system: System, kind: str, bearings: Sequence[int], seed: int, reader: str) -> None:
    """Connect a motion at the bearings (0, 1, ...) to a port through sensors: noise, then conversion."""
    port, unit, reach = RANGES[kind]
    n = len(bearings)
    noise = MeasurementNoise(np.full(n, NOISE * reach), sample_period=STEP, seed=seed, unit=unit)
    chain = {f"{kind}_noise": noise, kind: AnalogToDigital(np.full(n, reach), unit=unit)}
    measure(system, [f"bridge.{port}[{i + 1}]" for i in bearings], chain, reader)


def _network(system: System, seed: int, parameters: Mapping[str, float]) -> None:
    system.add("control", SCWNN.design(BEARINGS, NODES, **parameters))
    _sensors(system, "displacement", range(BEARINGS), seed, "control.x")
    _sensors(system, "velocity", range(BEARINGS), seed + 1, "control.v")


def _network_behind_observer(system: System, bridge: NonlinearStructure, seed: int) -> None:
    rows = bridge.linear_model().actuators
    system.add("observer", KinematicObserver.design(rows, rows[list(SENSORS)]))
    _sensors(system, "displacement", SENSORS, seed, "observer.y")
    system.add("control", SCWNN.design(BEARINGS, NODES))
    system.connect("observer.x", "control.x")
    system.connect("observer.v", "control.v")


def _lqg(system: System, bridge: NonlinearStructure, seed: int) -> None:
    """Add LQG: weights are (0.1 m)^-2 for bearings, (0.05 m)^-2 for the midspan, LIMIT^-2 for forces.

    The observer takes two disturbances as white over 10 Hz: the ground, 1 m/s^2 rms in each
    direction, and the nonlinear part of the bearings' forces, UNMODELLED rms each.
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
    measured = list(LQG_SENSORS)
    sensed = DesignModel(
        A=model.A, B=model.B, E=np.hstack([model.E, model.B]),
        C=model.C[measured], D=model.D[measured], F=np.hstack([model.F, model.D])[measured],
    )  # fmt: skip
    unknown = np.diag([1.0**2] * 2 + [UNMODELLED**2] * BEARINGS) / (2.0 * 10.0)
    noise = np.eye(len(measured)) * (NOISE * RANGES["displacement"][2]) ** 2 * STEP
    system.add("observer", Observer.design(sensed, unknown, noise, STEP))
    system.add("regulator", StateFeedback.lqr(model, seen.T @ weight @ seen, R))
    system.add("limit", Saturation(np.full(BEARINGS, LIMIT)))
    _sensors(system, "displacement", LQG_SENSORS, seed, "observer.y")
    system.connect("observer.x_hat", "regulator.x_hat")
    system.connect("regulator.u", "limit.u")
    system.connect("limit.y", "observer.u_last", initial=0.0)
    system.connect("limit.y", "bridge.u")
