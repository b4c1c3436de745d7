"""Chapter 4: chattering of sliding mode control in six cases, and gains that reduce it.

Plant (4.1), (4.2), as a native FMU: x1' = x2, x2' = -(k/m) x1 - (c/m) x2 + u + d, from
(14, 25). Controller: s = x2 + a x1, u = -M sgn(s) (4.4). README.md has the cases, and how
the printed and the computed numbers compare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.algorithm_2 import AlgorithmII
from controllers.laws.constant_gain import ConstantGain
from controllers.laws.equivalent_control import EquivalentControlGain
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from controllers.laws.state_dependent import StateDependentGain
from controllers.laws.switching import HysteresisControl, SaturationControl
from cosim import Block, G, Result, System, el_centro, simulate
from cosim.blocks import RecordSource, SensorDynamics, WeightedSum, WhiteNoise, function_source
from fmus.export import as_fmu
from fmus.plants.oscillator import Oscillator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CaseNumber = Literal[1, 2, 3, 4, 5, 6]
Gain = Literal[
    "constant", "algorithm-1", "algorithm-2", "state-dependent", "equivalent-control",
    "saturation", "hysteresis",
]  # fmt: skip
GAINS: tuple[Gain, ...] = get_args(Gain)
Coupling = Literal["sampled", "continuous"]
Plant = Literal["fmu", "python"]
GroundUnit = Literal["g", "m/s^2"]
STEP, STOP = 0.01, 40.0
RECORDED = ("plant.x", "plant.v", "control.u", "control.M", "control.sgn")


@dataclass(frozen=True)
class Case:
    """One case of chapter 4: the thesis' gain law for it, its constant gain M, and its disturbances."""

    tuned: Gain
    M: float
    sensor: bool = False
    noise: bool = False
    ground: bool = False
    disturbance: bool = False
    beta: float = 300.0


CASES: dict[int, Case] = {
    1: Case("algorithm-1", 100.0),
    2: Case("algorithm-1", 100.0, sensor=True),
    3: Case("algorithm-2", 300.0, noise=True),
    4: Case("algorithm-2", 300.0, ground=True),
    5: Case("algorithm-2", 300.0, disturbance=True, beta=100.0),
    6: Case("algorithm-2", 150.0, sensor=True, noise=True, ground=True, disturbance=True),
}


def disturbance(t: float) -> float:
    """Return the disturbance of case 5, 25 (sin t + 1), m/s^2."""
    return 25.0 * (math.sin(t) + 1.0)


def gain_law(case: Case, gain: Gain) -> Block:
    """Return the controller u = -M sgn(s) with a gain law; its numbers are those of the thesis."""
    laws: dict[str, Block] = {
        "constant": ConstantGain(M_0=case.M),
        "algorithm-1": AlgorithmI(M=case.M),
        "algorithm-2": AlgorithmII(beta=case.beta),
        "state-dependent": StateDependentGain(),
        "equivalent-control": EquivalentControlGain(M_0=case.M),
        "saturation": SaturationControl(M_0=case.M, scaled=1.0),
        "hysteresis": HysteresisControl(M_0=case.M),
    }
    return laws[gain]


@dataclass(frozen=True, kw_only=True)
class Study:
    """Run one of the six cases of chapter 4."""

    case: CaseNumber = 1
    """1 nothing unmodelled, 2 sensor dynamics, 3 noise, 4 El Centro, 5 disturbance, 6 all of 2 to 5"""
    gain: Gain | Literal["tuned"] = "tuned"
    """gain law; tuned is the thesis' algorithm for the case"""
    coupling: Coupling = "continuous"
    """continuous: the controller acts at every solver stage, as in the thesis; sampled: once a step"""
    seed: int = 1
    """seed of the white noise in cases 3 and 6"""
    plant: Plant = "fmu"
    """run the plant as a native FMU, or as Python in the loop"""
    ground_unit: GroundUnit = "g"
    """add the earthquake to x2' as numbers in g, as figure 4.28 suggests, or in m/s^2"""

    @property
    def law(self) -> Gain:
        """The gain law of this run."""
        return CASES[self.case].tuned if self.gain == "tuned" else self.gain

    def build(self) -> System:
        """Return plant, sliding surface, controller, and the disturbances of the case."""
        case = CASES[self.case]
        oscillator = Oscillator()
        system = System({"plant": as_fmu(oscillator) if self.plant == "fmu" else oscillator})
        system.add("surface", PhasePlaneSurface())
        system.add("control", gain_law(case, self.law))
        system.connect("plant.x", "surface.x1")
        system.connect("plant.v", "surface.x2")
        if self.law == "state-dependent":
            system.connect("plant.x", "control.x[1]")
            system.connect("plant.v", "control.x[2]")
        if case.sensor:
            system.add("sensor", SensorDynamics())
            system.connect("surface.s", "sensor.u")
            system.connect("sensor.y", "control.s")
        else:
            system.connect("surface.s", "control.s")
        self._connect_disturbances(system, case)
        system.connect("control.u", "plant.u")
        return system

    def _connect_disturbances(self, system: System, case: Case) -> None:
        """Add noise, earthquake and force of the case to x2'."""
        if not (case.noise or case.ground or case.disturbance):
            return
        system.add("total", WeightedSum([1.0, 1.0, 1.0], unit="m/s^2"))
        if case.noise:
            system.add("noise", WhiteNoise(seed=self.seed, sample_period=STEP, unit="m/s^2"))
            system.connect("noise.y", "total.u[1]")
        if case.ground:
            scale = 1.0 / G if self.ground_unit == "g" else 1.0
            system.add("ground", RecordSource(el_centro(), scale=scale))
            system.connect("ground.y", "total.u[2]")
        if case.disturbance:
            system.add("force", function_source(disturbance, unit="m/s^2"))
            system.connect("force.y", "total.u[3]")
        system.connect("total.y", "plant.d")

    def run(self, progress: Any = None) -> Result:
        """Run 40 s at steps of 0.01 s."""
        return simulate(
            self.build(), step=STEP, stop=STOP, record=RECORDED,
            coupling=self.coupling, solver="ode3", progress=progress,
        )  # fmt: skip

    def metrics(self, result: Result) -> dict[str, tuple[float, str]]:
        """Return the numbers that the thesis prints, and the chattering of u."""
        u, x = result["control.u"], result["plant.x"]
        return {
            "norm(u)": (result.statistics["control.u"].norm, "N"),
            "mean(sgn s)": (result.statistics["control.sgn"].mean, "1"),
            "changes of sign of u": (float(np.sum(u[1:] * u[:-1] < 0)), "1"),
            "final M": (float(result["control.M"][-1]), "N"),
            "final x": (float(x[-1]), "m"),
        }

    def figures(self, result: Result) -> dict[str, Figure]:
        """Return the thesis' figures of a case."""
        from .figures import figures  # loads Matplotlib, half a second

        return figures(result)
