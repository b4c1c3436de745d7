"""The master: `simulate` runs a system over fixed communication steps, from start to stop.

What a run is made of is in simulation.py; it can also be stopped and carried on there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..core.time_grid import steps_between
from ..result import Result
from ..system.system import System
from .plan import Coupling, Solver, check_choices, check_stop, check_system, check_time
from .program import Program
from .simulation import Simulation


def simulate(
    system: System,
    *,
    step: float,
    stop: float,
    start: float = 0.0,
    coupling: Coupling = "sampled",
    solver: Solver = "ode3",
    record: Iterable[str] | None = None,
    statistics: Iterable[str] | None = None,
    decimation: int = 1,
    jit: bool = True,
    tolerance: float = 1e-8,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Run a system from `start` to `stop` with the communication step `step`, in s.

    coupling
        "sampled": what a real controller does; inputs are held over a step.
        "continuous": stage coupling, everything with continuous state is integrated
        together by `solver` (ode1 to ode4), blocks run at every stage
        "iterated": as sampled, but FMUs and Continuous participants that are connected
        directly agree at every communication point, by repeating steps (iterated.py)
    record
        ports to record, such as "plant.x"; None records every output and state
    statistics
        ports to keep statistics of; None takes the recorded ones
    decimation
        record every so many-th communication point
    jit
        False calls every kernel as Python: for a debugger
    tolerance
        of iterated coupling, relative to the size of each value exchanged
    progress
        called with (steps done, steps in all) some ten times a second

    Raises CosimError for what can be checked before the run, SimulationError (with
    `result`, what was computed) when a participant fails or gives a value that is not
    finite, Interrupted (with `result`) on Ctrl-C. When a participant asks to end the run,
    that is no error: the result up to there is returned, `result.ended` says who and when,
    and SimulationEndedWarning is warned.
    """
    check_time(step, start)
    check_stop(stop, start)
    steps_between(stop - start, step, "the time from start to stop")  # before FMUs are loaded
    with Simulation(
        system,
        step=step,
        start=start,
        coupling=coupling,
        solver=solver,
        record=record,
        statistics=statistics,
        decimation=decimation,
        jit=jit,
        tolerance=tolerance,
    ) as simulation:
        return simulation.run(stop, progress)


def schedule(system: System, *, step: float, coupling: Coupling = "sampled", solver: Solver = "ode3") -> str:
    """Return what happens in one communication step, a line an operation."""
    check_system(system)
    check_time(step, 0.0)
    check_choices(coupling, solver, 1, 1e-8)
    program = Program(system, float(step), coupling, solver, [], [], 1, True)
    program.close()
    return program.schedule()
