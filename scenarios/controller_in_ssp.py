"""Your controller in other tools: plant, load and controller as FMUs, wired in one SSP file.

    cosim run controller_in_ssp --ssp loop.ssp        write the file, read it back, run it
    cosim table controller_in_ssp                     compare the loop with that of ecos
    cosim run loop.ssp --replace control=mine.py:Mine

A tool such as ecos exchanges all values and then steps all FMUs, so that each block on the way adds
one step of delay. `late` builds the same loop here: the outputs of blocks arrive one step later.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from cosim import Block, CosimError, Input, Output, Parameter, Result, System, read_ssp, simulate
from cosim.blocks import function_source
from fmus.packaging.other_tools import ecospy
from fmus.packaging.ssp import PARAMETER_SET, export_ssp
from fmus.plants.shear_building import ShearBuilding

STEP, STOP = 0.01, 10.0


class RoofDamper(Block):
    """F = -c v / (1 + |v| / v_0): a damper that gives way"""

    c = Parameter(0.06, "damping", unit="kN*s/m", min=0.0)
    v_0 = Parameter(0.2, "velocity of half the damping", unit="m/s", min=1e-6)
    v = Input("velocity", unit="m/s")
    F = Output("force", unit="kN")  # the building takes N: the file states the factor for tools without units

    def step(self, t: float, h: float) -> None:
        self.F = -self.c * self.v / (1.0 + abs(self.v) / self.v_0)


def build(*, late: bool = False) -> System:
    """Return the system; `late` adds the delays of a master that does not order its blocks."""
    building = ShearBuilding.build([3.0, 2.0, 1.5], [3000.0, 2000.0, 1000.0], 0.02)
    ground = function_source(lambda t: 2.0 * math.sin(9.0 * t) * math.exp(-0.5 * t), unit="m/s^2")
    system = System({"building": building, "ground": ground, "control": RoofDamper()})
    system.connect("building.v[3]", "control.v")
    initial = 0.0 if late else None
    system.connect("control.F", "building.force[3]", initial=initial)
    system.connect("ground.y", "building.ground_acceleration", initial=initial)
    return system


def run(*, ssp: Path = Path("out/controller_in_ssp/loop.ssp"), late: bool = False) -> Result:
    """Write the file `ssp` and run it; `late` adds the delays of other tools."""
    return simulate(read_ssp(export_ssp(build(late=late), ssp, step=STEP, stop=STOP)), step=STEP, stop=STOP)


def ecos(ssp: Path) -> list[float]:
    """Return the roof displacement at all communication points, computed by ecos."""
    with ecospy().EcosSimulation(step_size=STEP, ssp_path=str(ssp)) as simulation:
        simulation.init(parameter_set=PARAMETER_SET)
        roof = [simulation.get_real("building::x[3]")]
        for _ in range(round(STOP / STEP)):
            simulation.step()
            roof.append(simulation.get_real("building::x[3]"))
    return roof


def table(*, ssp: Path = Path("out/controller_in_ssp/loop.ssp")) -> list[dict[str, Any]]:
    """Run the file here, with and without the delays of other tools, and in ecos if it is installed."""
    loops = {"here, late": True, "here": False}
    runs = {name: run(ssp=ssp, late=late)["building.x"][:, 2] for name, late in loops.items()}
    try:
        runs["ecos"] = np.array(ecos(ssp))
    except CosimError as error:
        print(error)
    return [{"loop": n, "peak_mm": 1e3 * np.abs(x).max(), "end_mm": 1e3 * x[-1]} for n, x in runs.items()]
