"""How to make one small instance, at least, of every Block and Continuous of ours.

The packages are walked. What can be made without arguments needs no entry in `MAKE`; for any other
class `test_every_class.py` fails until it has one. A class made from a template (`function_source`)
stands here under the template's name. Where compiling takes seconds, sizes are those of other
tests, so that a session compiles once.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable
from dataclasses import asdict
from functools import lru_cache

import numpy as np

from controllers.adaptive.scwnn import SCWNN
from controllers.design.design_model import DesignModel
from controllers.design.reduction import dominant_modes
from controllers.laws.continuous_sliding_mode import ContinuousSlidingMode
from controllers.laws.equivalent_force import EquivalentForce, StateSurface
from controllers.laws.equivalent_force import design as equivalent_force
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from controllers.laws.sliding_mode import SlidingMode
from controllers.laws.state_dependent import StateDependentGain
from controllers.laws.state_feedback import StateFeedback
from controllers.laws.switching import SaturationControl
from controllers.laws.viscous_dampers import ViscousDampers
from controllers.observers.kinematic_observer import KinematicObserver
from controllers.observers.observer import Observer
from cosim import Participant
from cosim.blocks.actuator import FirstOrderActuator, Saturation
from cosim.blocks.adc import AnalogToDigital
from cosim.blocks.delay import Delay
from cosim.blocks.lowpass import DiscreteLowPass, LowPass
from cosim.blocks.noise import MeasurementNoise
from cosim.blocks.sensor import SensorDynamics, StateSpace, StrictlyProper, transfer_function
from cosim.blocks.sources import Constant, RecordSource, WhiteNoise, _FunctionOfTime, function_source
from cosim.blocks.sum import WeightedSum
from cosim.blocks.table_source import TableSource
from fmus.loads.wind import FloorLoad
from fmus.packaging.container import Conversion, Late
from fmus.plants.damped_tower import DampedTower
from fmus.plants.modal_structure import ModalStructure
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.plants.shear_building import ShearBuilding
from fmus.plants.tuned_mass_damper import TunedMassDamper
from scenarios.highway_bridge.benchmark import benchmark_bridge
from scenarios.tall_building.building import Damper, default_building, with_damper
from tests.benchmark_data import BRIDGE
from tests.fmus.plants.chains import yielding_plant
from tests.fmus.plants.towers import small_tower

H = 0.01
PACKAGES = ("controllers", "cosim.blocks", "fmus", "scenarios")


def classes() -> dict[str, type[Participant]]:
    """Every participant class that a module of ours defines, by module and name."""
    found: dict[str, type[Participant]] = {}
    for package in PACKAGES:
        top = importlib.import_module(package)
        for entry in pkgutil.walk_packages(top.__path__, f"{package}."):
            module = importlib.import_module(entry.name)
            for value in vars(module).values():
                own = isinstance(value, type) and value.__module__ == entry.name
                if own and issubclass(value, Participant) and not _is_shared_base(value):
                    found[f"{entry.name}.{value.__name__}"] = value
    return found


def _is_shared_base(kind: type[Participant]) -> bool:
    """Tell whether a class only holds what its subclasses share: a private one that has subclasses."""
    return kind.__name__.startswith("_") and bool(kind.__subclasses__())


@lru_cache(maxsize=1)
def model() -> DesignModel:
    """A tower with damper: four states, and two accelerations, of the top and of the damper."""
    coupled, n = with_damper(small_tower(), Damper()), small_tower().dof
    return dominant_modes(
        coupled.M, coupled.C, coupled.K, np.eye(n + 1)[:, n:], np.eye(n + 1)[:, :n], [n - 1, n], [n - 1, n]
    )


def _random(*shape: int) -> np.ndarray:
    return np.random.default_rng(11).normal(size=shape)


#: classes that need arguments, or show more with some; several where constructors differ in what they compute
MAKE: dict[type[Participant], list[Callable[[], Participant]]] = {
    # control laws of chapter 2, their filter, observer and estimator
    SlidingMode: [lambda: SlidingMode.design(model(), np.eye(4))],
    ContinuousSlidingMode: [lambda: ContinuousSlidingMode.design(model(), np.eye(4), 1.2)],
    StateFeedback: [lambda: StateFeedback.lqr(model(), np.eye(4), np.array([[1e-9]]), every=2)],
    Observer: [lambda: Observer.design(model(), np.eye(5), 1e-6 * np.eye(2), H)],
    StateSurface: [lambda: equivalent_force(model(), np.eye(4))[0]],
    EquivalentForce: [lambda: equivalent_force(model(), np.eye(4))[1]],
    # chapter 3
    SCWNN: [lambda: SCWNN.design(2, 30)],
    KinematicObserver: [lambda: KinematicObserver(T=_random(2, 2))],
    ViscousDampers: [lambda: ViscousDampers(p=3)],
    # gain laws of chapter 4
    PhasePlaneSurface: [lambda: PhasePlaneSurface(a=1.5)],
    StateDependentGain: [lambda: StateDependentGain(n=3)],
    SaturationControl: [SaturationControl, lambda: SaturationControl(scaled=1.0, gamma=0.4)],
    # filters, sensors, actuators, converters, sources
    LowPass: [lambda: LowPass(0.07, n=2)],
    DiscreteLowPass: [lambda: DiscreteLowPass(0.07, n=2)],
    SensorDynamics: [lambda: SensorDynamics(n=2)],
    StrictlyProper: [lambda: transfer_function(([2.0, 1.0], [0.001, 0.08, 1.3, 4.0]))],
    StateSpace: [lambda: StateSpace([[0, 1], [-4, -0.3]], _random(2, 3), _random(1, 2), _random(1, 3))],
    Saturation: [lambda: Saturation([0.4, 1.1])],
    FirstOrderActuator: [lambda: FirstOrderActuator(0.03, [0.4, 1.1])],
    AnalogToDigital: [lambda: AnalogToDigital([1.0, 2.0], bits=5)],
    Conversion: [lambda: Conversion(n=2, factor=1e-3, offset=0.5)],
    Late: [lambda: Late(kept=[1.0, 2.0], factor=3.0), lambda: Late(kept=[1.0, 2.0], of_block=1.0)],
    Delay: [lambda: Delay(3, initial=[1.0, 2.0])],
    MeasurementNoise: [lambda: MeasurementNoise([0.1, 3.0], sample_period=2 * H, seed=2)],
    WhiteNoise: [lambda: WhiteNoise(sample_period=H, seed=5, sigma=[1.0, 2.0], mean=0.5)],
    Constant: [lambda: Constant([1.5, -2.25])],
    RecordSource: [
        lambda: RecordSource(_random(40), 0.013, scale=1.7, start=0.1),
        lambda: RecordSource(_random(40), 0.013, interpolation="hold"),
    ],
    TableSource: [
        lambda: TableSource([0.0, 0.113, 0.113, 0.7], _random(4, 2)),
        lambda: TableSource([0.0, 0.113, 0.3], _random(3), interpolation="hold"),
    ],
    _FunctionOfTime: [lambda: function_source(lambda t: 25.0 * (math.sin(t) + 1.0))],
    WeightedSum: [lambda: WeightedSum([1.0, -0.3, 7.0])],
    # plants and their load
    ShearBuilding: [lambda: ShearBuilding.build([3.0, 2.0, 1.5], [3e3, 2e3, 1e3], [0.02, 0.03, 0.05])],
    TunedMassDamper: [lambda: TunedMassDamper(m=50.0, c=20.0, k=500.0)],
    ModalStructure: [lambda: ModalStructure.build(small_tower(), [2, 5])],
    DampedTower: [lambda: DampedTower.build(small_tower(), [5], stiffness=1.15, **asdict(Damper()))],
    NonlinearStructure: [yielding_plant],
    FloorLoad: [lambda: FloorLoad(table=_random(60, 3), dt=0.025)],
}


def makers(kind: type[Participant]) -> list[Callable[[], Participant]]:
    """How to make instances of a class."""
    return MAKE.get(kind, [kind])


def whole_tower() -> Participant:
    """76 floors and the damper: 154 states."""
    return DampedTower.build(default_building(), (1, 30, 50, 76), **asdict(Damper()))


def whole_bridge() -> Participant:
    """The highway bridge's benchmark model, 430 degrees of freedom."""
    return benchmark_bridge(BRIDGE)
