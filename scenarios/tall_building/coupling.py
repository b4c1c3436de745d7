"""The error of the coupling between damper and building, two FMUs that exchange motion and force.

    damper.x_top, damper.v_top <- building.x[76], building.v[76]
    building.top               <- damper.reaction

Under sampled coupling each side holds its inputs over the step, and the error falls in
proportion to the step. Under iterated coupling both sides agree at every communication
point, and the error falls with the square of the step. The single plant `DampedTower` is
exact for held loads and serves as reference.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, Literal, get_args

import numpy as np

from cosim import Result, System, simulate
from fmus.export import as_fmu
from fmus.loads.wind import FloorLoad
from fmus.plants.damped_tower import DampedTower
from fmus.plants.modal_structure import ModalStructure
from fmus.plants.tuned_mass_damper import TunedMassDamper

from .building import STORY_HEIGHTS, Damper
from .plant import building, load

Coupling = Literal["sampled", "iterated"]
STEPS = (0.02, 0.01, 0.005, 0.002, 0.001)
SPAN = 60.0


def coupling_errors(
    data: str | None, wind: str | None, seed: int, duration: float, steps: tuple[float, ...] = STEPS
) -> list[dict[str, Any]]:
    """Return the peak errors of x_76 and x_m over the peak response, by step and coupling."""
    structure = building(data)
    table, dt = load(wind, seed, duration, structure.dof)
    top = [len(STORY_HEIGHTS) if data is None else structure.dof]
    span = min(SPAN, duration)
    rows: list[dict[str, Any]] = []
    for step in steps:
        one = _run({"tower": DampedTower.build(structure, top, **asdict(Damper()))}, table, dt, step, span)
        for coupling in get_args(Coupling):
            plants = {
                "tower": ModalStructure.build(structure, top),
                "damper": TunedMassDamper(**asdict(Damper())),
            }
            two = _run(plants, table, dt, step, span, coupling)
            x76, x_m = [
                float(np.max(np.abs(one[a] - two[b])) / np.max(np.abs(one[a])))
                for a, b in (("tower.x", "tower.x"), ("tower.x_m", "damper.x_m"))
            ]
            before = [r for r in rows if r["coupling"] == coupling]
            order = None
            if before:
                order = math.log(before[-1]["x76"] / x76) / math.log(before[-1]["step"] / step)
            rows.append({"step": step, "coupling": coupling, "x76": x76, "x_m": x_m, "order": order})
    return rows


def _run(
    plants: dict[str, Any], table: Any, dt: float, step: float, span: float, coupling: Coupling = "sampled"
) -> Result:
    """Run the plants; the load is held over 20 ms, so that it is the same for all steps."""
    system = System({"load": FloorLoad(table=table, dt=dt, sample_period=STEPS[0])})
    for name, plant in plants.items():
        system.add(name, as_fmu(plant))
    system.connect("load.w", "tower.w")
    if "damper" in plants:
        system.connect("tower.x", "damper.x_top")
        system.connect("tower.v", "damper.v_top")
        system.connect("damper.reaction", "tower.top")
    record, every = ["tower.x", f"{list(plants)[-1]}.x_m"], round(STEPS[0] / step)
    return simulate(system, step=step, stop=span, record=record, decimation=every, coupling=coupling)
