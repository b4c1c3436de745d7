"""Many runs of the tall building at the same time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, replace
from multiprocessing import get_context

from cosim import SimulationError

from .control import PERIOD
from .study import Study

DIVERGED = 1e4
"""A stroke above this value, in cm, shows an instability."""


def run_all(studies: Sequence[Study], workers: int = 0) -> list[dict[str, float] | None]:
    """Return the criteria of several runs, None for a run that diverges; 0 workers: one per core.

    Runs are processes, not threads: FMPy changes the working directory, which all threads
    share, while it loads a library.
    """
    count = workers or os.cpu_count() or 1
    if count == 1:
        return [_criteria(study) for study in studies]
    # studies with the same features share their compiled kernels: compile before the processes start
    for study in {(s.controller, *map(bool, astuple(s))): s for s in studies}.values():
        replace(study, duration=10 * PERIOD).run()
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:
        return list(pool.map(_criteria, studies))


def _criteria(study: Study) -> dict[str, float] | None:
    try:
        found = study.run().criteria()
    except SimulationError as error:
        if "not finite" in str(error):
            return None
        raise
    return found if found["max_xm"] < DIVERGED else None
