"""A controller of your own on an FMU made by another tool: copy this file and change it.

    cosim inspect theirs.fmu        names, units, start values, capabilities
    cosim run external_plant --fmu theirs.fmu --velocity v --force u --start.m 2.0

Without --fmu, the oscillator of chapter 4 is exported and then used like any other FMU.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from cosim import FMU, Block, Input, Output, Parameter, Result, System, simulate
from cosim.functions import clip
from fmus.export import as_fmu
from fmus.plants.oscillator import Oscillator


class Damping(Block):
    """F = -c v, limited"""

    c = Parameter(0.4e-3, "damping", unit="kN*s/m", min=0.0)
    limit = Parameter(8e-3, "largest force", unit="kN", min=0.0)
    v = Input("velocity", unit="m/s")
    F = Output("force", unit="kN")  # converted on the connection if the plant states a unit

    def step(self, t: float, h: float) -> None:
        self.F = clip(-self.c * self.v, -self.limit, self.limit)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Run a damping controller on an FMU."""

    fmu: Path | None = None
    """the FMU [the oscillator of chapter 4]"""
    velocity: str = "v"
    """output of the FMU that the controller measures"""
    force: str = "u"
    """input of the FMU that the controller drives"""
    start: dict[str, float | str] = field(default_factory=dict)
    """start values of the FMU by name, such as --start.m 2.0 or --start.m 1.2t"""
    damping: float = 0.4e-3
    """damping of the controller, kN*s/m"""
    step: float = 0.01
    """communication step, s"""
    stop: float = 30.0
    """time at which the run stops, s"""

    def build(self) -> System:
        """Return the FMU with the controller around it."""
        plant = FMU(self.fmu or as_fmu(Oscillator()).path, start=self.start)
        return System(
            {"plant": plant, "control": Damping(c=self.damping)},
            [(f"plant.{self.velocity}", "control.v"), ("control.F", f"plant.{self.force}")],
        )

    def run(self) -> Result:
        """Run the system."""
        return simulate(self.build(), step=self.step, stop=self.stop)
