"""A first building of your own: five stories, El Centro, and a controller on the roof. Copy this file.

    cosim run first_building --limit 20000 --out out/mine

An LQR pulls at the roof; an observer estimates its state from one noisy accelerometer there.
"""

from dataclasses import dataclass, replace

import numpy as np

from controllers.design.design_model import DesignModel, first_order
from controllers.laws.state_feedback import StateFeedback
from controllers.observers.observer import Observer
from cosim import Result, System, el_centro, simulate
from cosim.blocks import MeasurementNoise, RecordSource, Saturation
from fmus.export import as_fmu
from fmus.plants.shear_building import ShearBuilding, stiffness_matrix

STEP, STOP = 0.005, 40.0  # s
MASS, STIFFNESS, DAMPING = [20e3] * 5, [30e6, 28e6, 25e6, 20e6, 15e6], 0.02  # kg, N/m, of critical


def design_model(building: ShearBuilding) -> DesignModel:
    """Return x' = A x + B u + E a_g of displacements and velocities; the roof's acceleration is measured."""
    A = first_order(np.diag(MASS), building.C, stiffness_matrix(np.array(STIFFNESS)))
    B, E = np.eye(10)[:, -1:] / MASS[-1], np.repeat([[0.0], [-1.0]], 5, axis=0)
    return DesignModel(A=A, B=B, E=E, C=A[-1:], D=B[-1:], F=np.zeros((1, 1)))


@dataclass(frozen=True, kw_only=True)
class Study:
    """Run a five-story building under El Centro."""

    control: bool = True
    """with the controller, or without it"""
    limit: float = 50e3
    """largest force at the roof, N"""
    R: float = 1e-11
    """weight of the squared force against the squared velocities of the floors, m^2/(s^2*N^2)"""

    def build(self) -> System:
        """Return building, ground motion and control loop."""
        building = ShearBuilding.build(MASS, STIFFNESS, DAMPING)
        system = System({"building": as_fmu(building), "ground": RecordSource(el_centro())})
        system.connect("ground.y", "building.ground_acceleration")
        if self.control:
            model, Q = design_model(building), np.diag([0.0] * 5 + [1.0] * 5)
            system.add("sensor", MeasurementNoise([0.01], sample_period=STEP, unit="m/s^2"))
            system.add("observer", Observer.design(model, np.eye(1), 1e-3 * np.eye(1), STEP))
            system.add("control", StateFeedback.lqr(model, Q, np.array([[self.R]])))
            system.add("actuator", Saturation(self.limit))
            chain = [("building.acceleration[5]", "sensor.u[1]"), ("sensor.y", "observer.y")]
            chain += [("observer.x_hat", "control.x_hat"), ("control.u", "actuator.u[1]")]
            for source, target in [*chain, ("actuator.y[1]", "building.force[5]")]:
                system.connect(source, target)
            system.connect("actuator.y", "observer.u_last", initial=0.0)  # the force of the last step
        return system

    def run(self) -> Result:
        return simulate(self.build(), step=STEP, stop=STOP)

    def metrics(self, result: Result) -> dict[str, tuple[float, str]]:
        """Return peaks over those of the same building without control."""
        both = [run.statistics for run in (result, replace(self, control=False).run())]
        peaks = {p: [np.max(s[f"building.{p}"].peak) for s in both] for p in ("drift", "acceleration")}
        return {f"{p} over uncontrolled": (own / free, "1") for p, (own, free) in peaks.items()}

    def figures(self, result: Result) -> dict[str, object]:
        """Return the roof's displacement with and without control."""
        from matplotlib.figure import Figure  # half a second

        axes = (figure := Figure(figsize=(8.0, 3.5), layout="constrained")).subplots()
        for run, label in ((replace(self, control=False).run(), "uncontrolled"), (result, "this run")):
            axes.plot(run.time, 1e3 * run["building.x"][:, -1], linewidth=0.8, label=label)
        axes.set(xlabel="time (s)", ylabel="roof displacement (mm)")
        axes.legend()
        return {"roof": figure}
