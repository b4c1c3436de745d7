"""Chapter 2: the 76-story building in wind, with an active tuned mass damper.

    load      seeded across-wind load on 76 floors, or a record (--wind)
    plant     DampedTower as a native FMU: 77 DOF, 77 forces in, 9 floors and the damper out
    measured  accelerations of floors 50, 76 and of the damper, with noise
    control   12-state observer, then LQG, sliding mode control, the same with the low-pass
              filter (2.17), or the continuous sliding mode control that stands in for MSMC
    judged    by the 16 criteria of appendix A (criteria.py)

README.md compares printed and computed numbers and says which parameters were fitted to the print.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal

from cosim import CosimError, Participant, Result, Statistics, System, simulate
from cosim.blocks import (
    AnalogToDigital,
    Delay,
    FirstOrderActuator,
    LowPass,
    MeasurementNoise,
    Saturation,
    SensorDynamics,
)
from fmus.export import as_fmu
from fmus.loads.wind import FloorLoad
from fmus.plants.damped_tower import DampedTower
from fmus.plants.modal_structure import ModalStructure
from scenarios.measurement import measure

from .building import Damper
from .control import PERIOD, Controller, add_controller, tower_observer
from .criteria import FLOORS, LIMITS, UNITS, Power, TowerResult, uncontrolled_figures
from .plant import DURATION, LOAD_EVERY, SEED, building, load, model_of, uncontrolled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Plant = Literal["fmu", "python"]


@dataclass(frozen=True, kw_only=True)
class Study:
    """Run the tall building in wind."""

    controller: Controller = "filtered-smc"
    """control law; passive is the damper without force, none the building without damper; the
    last three combine the equivalent control with a gain law of chapter 4"""
    a: float = 1.065
    """gain on the distance from the sliding surface, 1/s"""
    delta: float = 0.001
    """least gain, m/s^2"""
    tau: float = 0.1
    """time constant of the low-pass filter of filtered-smc, s"""
    stiffness_error: float = 0.0
    """relative error of the building's stiffness, unknown to the controllers; the thesis has 0.15, -0.15"""
    noise: float = 0.001
    """standard deviation of every measured acceleration, m/s^2 at 1 kHz"""
    noise_seed: int = 1
    """seed of the measurement noise"""
    sensor_dynamics: bool = False
    """add accelerometers with 1/(0.008 s + 1)^2"""
    bits: int = 0
    """bits of the converter, range +-2 m/s^2; 0 for no converter"""
    delay: int = 0
    """computation delay in steps of 1 ms"""
    saturation: bool = False
    """limit the force to 300 kN"""
    actuator: float = 0.0
    """time constant of a first-order actuator, s; 0 for no actuator"""
    floors: tuple[int, ...] = FLOORS
    """floors with outputs; the criteria need the default ones"""
    data: str | None = None
    """.npz file with the matrices M, C, K in t, kN*s/m, kN/m"""
    wind: str | None = None
    """.npz or .csv file with forces on the floors"""
    seed: int = SEED
    """seed of the default wind"""
    duration: float = DURATION
    """length of the run, s"""
    plant: Plant = "fmu"
    """run the plant as a native FMU, or as Python in the loop"""
    profile: bool = False
    """run also without control and with LQG, all floors, and draw the response over the height"""
    record: bool = True
    """record signals every 0.1 s for the figures"""

    def build(self) -> System:
        """Return the load, the tower, and the control loop around it."""
        structure = building(self.data)
        table, dt = load(self.wind, self.seed, self.duration, structure.dof)
        system = System({"load": FloorLoad(table=table, dt=dt, every=LOAD_EVERY)})
        stiffness = 1.0 + self.stiffness_error
        if self.controller == "none":
            tower: Participant = ModalStructure.build(structure, self.floors, stiffness)
        else:
            tower = DampedTower.build(structure, self.floors, stiffness=stiffness, **asdict(Damper()))
        system.add("tower", as_fmu(tower) if self.plant == "fmu" else tower)
        system.connect("load.w", "tower.w")
        if self.controller not in ("none", "passive"):
            self._close_the_loop(system)
        return system

    def _close_the_loop(self, system: System) -> None:
        """Measured accelerations -> observer -> control law -> force of the actuator."""
        model = model_of(self.data)
        system.add("observer", tower_observer(model))
        measure(system, self._measured(), self._measurement_chain(), "observer.y")
        force = add_controller(system, self.controller, model, self.a, self.delta)
        if self.controller == "filtered-smc":
            force = _append(system, force, "filter", LowPass(self.tau, unit="N"), "u", "y")
        if self.delay:
            force = _append(system, force, "computation", Delay(self.delay, unit="N"), "u", "y")
        if self.saturation:
            force = _append(system, force, "limit", Saturation(1e3 * LIMITS["max_u"]), "u", "y")
        # The observer uses the command of the last step, u_{k-1} at t_k.
        system.connect(force, "observer.u_last", initial=0.0)
        if self.actuator:
            force = _append(system, force, "actuator", FirstOrderActuator(self.actuator), "u", "F")
        system.connect(force, "tower.u")
        system.add("power", Power())
        system.connect("tower.v_m", "power.v")
        system.connect(force, "power.u")

    def _measured(self) -> list[str]:
        """Accelerations of floors 50, 76 and of the damper."""
        missing = [f for f in (50, 76) if f not in self.floors]
        if missing:
            raise CosimError(
                f"tall_building: floor {missing[0]} is measured; it must be among the floors {self.floors}"
            )
        return [*(f"tower.a[{self.floors.index(f) + 1}]" for f in (50, 76)), "tower.a_m"]

    def _measurement_chain(self) -> dict[str, Participant]:
        chain: dict[str, Participant] = {}
        unit = "m/s^2"
        if self.sensor_dynamics:
            chain["sensors"] = SensorDynamics(n=3, unit=unit)
        if self.noise:
            chain["noise"] = MeasurementNoise(
                [self.noise] * 3, sample_period=PERIOD, seed=self.noise_seed, unit=unit
            )
        if self.bits:
            chain["converter"] = AnalogToDigital([2.0] * 3, bits=self.bits, unit=unit)
        return chain

    def run(self, progress: Any = None) -> TowerResult:
        """Run at steps of 1 ms, with the response without control as reference."""
        system = self.build()
        watched = ["tower.x", "tower.a"]
        if self.controller != "none":
            watched += ["tower.x_m", "tower.u"]
        if "power" in system.participants:
            watched.append("power.p")
        result = simulate(
            system,
            step=PERIOD,
            stop=self.duration,
            statistics=watched,
            decimation=100,
            progress=progress,
            record=["load.w", *watched] if self.record else [],
        )
        name = f"filtered SMC, a = {self.a:g}" if self.controller == "filtered-smc" else self.controller
        return TowerResult(
            **{f.name: getattr(result, f.name) for f in fields(Result)},
            uncontrolled=uncontrolled(self.data, self.wind, self.seed, self.duration),
            controller=name,
            profiles=self._profiles() if self.profile else {},
        )

    def _profiles(self) -> dict[str, dict[str, Statistics]]:
        """Return statistics of all floors without control, with LQG and with this controller."""
        every_floor = tuple(range(1, building(self.data).dof + 1))
        watched = ["tower.x", "tower.a"]
        found: dict[str, dict[str, Statistics]] = {}
        names: tuple[Controller, ...] = ("none", "lqg", self.controller)
        for name in dict.fromkeys(names):
            system = replace(self, controller=name, floors=every_floor).build()
            result = simulate(system, step=PERIOD, stop=self.duration, record=[], statistics=watched)
            found[name] = result.statistics
        return found

    def metrics(self, result: TowerResult) -> dict[str, tuple[float, str]]:
        """Return the criteria, and the uncontrolled response to which they refer."""
        found = {name: (value, UNITS.get(name, "1")) for name, value in result.criteria().items()}
        for name, value in uncontrolled_figures(result.uncontrolled.statistics).items():
            found[f"uncontrolled {name}"] = (value, "cm/s^2" if "_a" in name else "cm")
        return found

    def figures(self, result: TowerResult) -> dict[str, Figure]:
        """Return wind, response and force over time, as figures 2.3, 2.5 and 2.6."""
        from .figures import figures  # loads Matplotlib, half a second

        return figures(result)


def _append(system: System, source: str, name: str, member: Participant, into: str, out: str) -> str:
    """Add a participant with one input behind a port; return its output port."""
    system.add(name, member)
    system.connect(source, f"{name}.{into}")
    return f"{name}.{out}"
