"""Chapter 3: the 91/5 highway overcrossing in six earthquakes, with a network, LQG or dampers.

A nonlinear bridge, two-directional records, 16 actuators of 1000 kN between deck and
abutments. The default plant is the project's reduced bridge; `--data` takes the full
430-degree-of-freedom model from a folder with the benchmark's files. Records come from
installed packages or from a folder (`--records`, or `records` within `--data`).
README.md compares printed and computed numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from cosim import Result, SimulationError, System, simulate

from .control import DURATION, STEP, STEP_UNCONTROLLED, Controller, bridge_system, plant
from .criteria import PORTS, response
from .earthquakes import Earthquake, earthquake, records_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Record = Literal["n-palm-springs", "chi-chi", "el-centro", "northridge", "turkey", "kobe"]
Progress = Callable[[int, int], None]
UNITS = {
    "shear": "N",
    "moment": "N*m",
    "midspan": "m",
    "acceleration": "m/s^2",
    "bearing": "m",
    "curvature": "1/m",
}


@dataclass(frozen=True, kw_only=True)
class Study:
    """Run the bridge under an earthquake."""

    record: Record = "el-centro"
    """earthquake, in two directions"""
    controller: Controller = "scwnn"
    """none, passive (viscous dampers), lqg, scwnn (the thesis' network), scwnn-not-learning (its
    learning rates zero), scwnn-searched (parameters searched on three records), scwnn-six-sensors
    (behind an observer)"""
    data: Path | None = None
    """folder with the benchmark's phase1_430dof.npz: the full model"""
    records: Path | None = None
    """folder with the six records (.csv or .AT2) [installed packages]"""
    late_events: bool = False
    """columns yield a step late, as in the benchmark's own code"""
    seed: int = 1
    """seed of the sensors' noise"""
    duration: float = DURATION
    """length of the run, s"""
    compare: bool = True
    """run without control and with LQG too, for figures 3.7 and 3.8"""

    @property
    def earthquake(self) -> Earthquake:
        """The earthquake of this run."""
        return earthquake(self.record, records_folder(self.records, self.data))

    def build(self) -> System:
        """Return the bridge with its records, sensors and controller."""
        return bridge_system(plant(self.data, self.late_events), self.earthquake, self.controller, self.seed)

    def run(self, progress: Progress | None = None) -> Result:
        """Run the bridge; add the bearings' displacements of the runs to compare with."""
        result = simulate_bridge(self.build(), self.controller, self.duration, progress)
        compared = self.compare and self.controller not in ("none", "lqg")
        others: tuple[Controller, ...] = ("none", "lqg") if compared else ()
        for other in others:
            bridge = plant(self.data, self.late_events)
            system = bridge_system(bridge, self.earthquake, other, self.seed, step=STEP)
            run = simulate(system, step=STEP, stop=self.duration, record=["bridge.deformation"])
            result.signals[f"{other}.deformation"] = run["bridge.deformation"]
            result.units[f"{other}.deformation"] = None
        return result

    def metrics(self, result: Result) -> dict[str, tuple[float, str]]:
        """Return peaks of the response, yielded column ends, and the gap of the energy balance."""
        own = response(result, float(result.time[-1]))
        energy = result["bridge.energy"]
        gap = np.abs(energy[:, :2].sum(axis=1) - energy[:, 2:].sum(axis=1)).max()
        found = {f"peak {name}": (value, UNITS[name]) for name, value in own.peak.items()}
        found["plastic energy of a column end"] = (own.plastic_energy, "J")
        found["yielded column ends"] = (float(own.yielded), "1")
        found["peak force"] = (float(np.abs(result["bridge.u"]).max()), "N")
        found["energy balance, gap over input"] = (float(gap / np.abs(energy).max()), "1")
        if "control.nodes" in result:
            found["most nodes"] = (float(result["control.nodes"].max()), "1")
            found["nodes wanted beyond the largest number"] = (float(result["control.full"][-1]), "1")
        return found

    def figures(self, result: Result) -> dict[str, Figure]:
        """Return figures 3.7 to 3.9, hysteresis loops of a bearing and a column, and the yield map."""
        from .figures import figures  # loads Matplotlib, half a second

        return figures(result)


def simulate_bridge(
    system: System, controller: Controller, duration: float, progress: Progress | None = None
) -> Result:
    """Run a system of the bridge; an element that does not converge is named with time and residual."""
    ports = [f"bridge.{port}" for port in PORTS]
    if controller.startswith("scwnn"):
        ports += ["control.nodes", "control.full", "control.s", "control.r"]
    step = STEP_UNCONTROLLED if controller == "none" else STEP
    try:
        return simulate(system, step=step, stop=duration, record=ports, progress=progress)
    except SimulationError as error:
        found = error.result
        if found is None or "bridge.failure" not in found or found["bridge.failure"][-1, 0] < 0.0:
            raise
        element, time, residual = found["bridge.failure"][-1]
        named = SimulationError(
            f"bridge: element {int(element)} did not converge in the step after t = {time:.4f} s, residual "
            f"{residual:.2g} of its scale; take a smaller step, or more bisections"
        )
        named.result = found
        raise named from error
