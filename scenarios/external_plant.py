"""A controller of your own on an FMU that somebody else made: copy this file and change it.

    cosim inspect theirs.fmu        names, units, start values, capabilities
    cosim run external_plant --fmu theirs.fmu --velocity v --force u --start m=2.0

Without --fmu, chapter 4's oscillator is exported and then treated as if it were not ours.
"""

from __future__ import annotations

from pathlib import Path

from cosim import FMU, Block, Input, Output, Parameter, Result, System, simulate
from cosim.cli.fmu_scenario import start_values
from cosim.functions import clip
from fmus.export import as_fmu
from fmus.plants.oscillator import Oscillator


class Damping(Block):
    """F = -c v, limited"""

    c = Parameter(0.4e-3, "damping", unit="kN*s/m", min=0.0)
    limit = Parameter(8e-3, "largest force", unit="kN", min=0.0)
    v = Input("velocity", unit="m/s")
    F = Output("force", unit="kN")  # the connection converts to the plant's unit, if it states one

    def step(self, t: float, h: float) -> None:
        self.F = clip(-self.c * self.v, -self.limit, self.limit)


def build(
    *,
    fmu: Path | None = None,
    velocity: str = "v",
    force: str = "u",
    start: tuple[str, ...] = (),
    damping: float = 0.4e-3,
) -> System:
    """Return the system; the options are those of `run`."""
    path = fmu or as_fmu(Oscillator()).path
    plant = FMU(path, start=start_values(FMU(path), start))
    return System(
        {"plant": plant, "control": Damping(c=damping)},
        [(f"plant.{velocity}", "control.v"), ("control.F", f"plant.{force}")],
    )


def run(
    *,
    fmu: Path | None = None,
    velocity: str = "v",
    force: str = "u",
    start: tuple[str, ...] = (),
    damping: float = 0.4e-3,
    step: float = 0.01,
    stop: float = 30.0,
) -> Result:
    """Run a damping controller on an FMU; fmu: its path, start: values such as m=2.0, damping in kN s/m."""
    system = build(fmu=fmu, velocity=velocity, force=force, start=start, damping=damping)
    return simulate(system, step=step, stop=stop)
