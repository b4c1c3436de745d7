"""Building and wind of chapter 2, and the response without control, each computed once per process."""

from __future__ import annotations

from functools import lru_cache

from controllers.design.design_model import DesignModel
from cosim import Array, CosimError, Result, System, simulate
from fmus.loads.wind import FloorLoad, across_wind, load_forces
from fmus.plants.modal_structure import ModalStructure
from fmus.structures.structure import Structure

from .building import STORY_HEIGHTS, default_building, load_building
from .control import PERIOD, reduced_model
from .criteria import FLOORS

DURATION = 900.0
"""Length of a run, s."""
SEED = 722
"""Seed of the default wind; calibrate.py says how it was chosen."""
LOAD_EVERY = 10
"""The load changes every 10 ms (its samples are 0.1 s apart, linear in between)."""


@lru_cache(maxsize=4)
def building(data: str | None = None) -> Structure:
    """Return the default building, or that of a file."""
    return default_building() if data is None else load_building(data)


@lru_cache(maxsize=4)
def load(wind: str | None, seed: int, duration: float, floors: int) -> tuple[Array, float]:
    """Return forces (samples, floors) in N and their sample period in s."""
    if wind is not None:
        return load_forces(wind, floors)
    if floors != len(STORY_HEIGHTS):
        raise CosimError(
            f"the default wind is for {len(STORY_HEIGHTS)} floors, the building has {floors}; "
            "give forces with --wind"
        )
    # always the whole 900 s: a shorter run sees the beginning of the same storm
    return across_wind(STORY_HEIGHTS, max(duration, DURATION), seed), 0.1


@lru_cache(maxsize=4)
def model_of(data: str | None) -> DesignModel:
    """Return the model on which the controllers are designed."""
    return reduced_model(building(data))


@lru_cache(maxsize=8)
def uncontrolled(data: str | None, wind: str | None, seed: int, duration: float) -> Result:
    """Run the building without damper and control, at nominal stiffness, recorded every 0.1 s."""
    structure = building(data)
    table, dt = load(wind, seed, duration, structure.dof)
    system = System(
        {"load": FloorLoad(table=table, dt=dt), "tower": ModalStructure.build(structure, FLOORS)},
        [("load.w", "tower.w")],
    )
    step = PERIOD * LOAD_EVERY
    ports = ["tower.x", "tower.a"]
    return simulate(system, step=step, stop=duration, record=ports, decimation=10)
