"""The interface through which an FMU is used, with its options.

FMU("plant.fmu", interface=ModelExchange(solver="cvode", tolerance=1e-8))
FMU("plant.fmu", interface=ModelExchange(solver="ode4", substeps=10))
FMU("drive.fmu", interface=CoSimulation(event_mode=True))
FMU("plant.fmu", interface="ModelExchange")         short for ModelExchange()
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Literal, TypeAlias, get_args

from ..core.whole_number import whole_number
from ..errors import FMUError, did_you_mean

Solver = Literal["ode1", "ode2", "ode3", "ode4", "cvode"]
InterfaceName = Literal["CoSimulation", "ModelExchange"]

DEFAULT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class CoSimulation:
    """Co-Simulation, in which the FMU brings its own solver.

    event_mode
        FMI 3.0: whether the importer handles events at their instants, and sets discrete inputs in
        events; otherwise the FMU handles its events inside its steps. None means True for an FMU with
        clocks, which need it
    """

    event_mode: bool | None = None


@dataclass(frozen=True)
class ModelExchange:
    """Model Exchange, in which the importer integrates the FMU.

    With every solver, the inputs are held over the communication step, and an event is not a
    communication point. Under stage coupling, the solver of the run integrates all components.
    Raises FMUError if an option is not valid or excludes another.

    solver
        "ode1" to "ode4": fixed steps in the compiled loop; a step is split at a time event, and state
        events are handled at its end. "cvode": variable steps and order from event to event, for
        stiff plants; state events are located, and its steps run as a Python callback. None means
        ode4, or cvode for an FMU with event indicators
    substeps
        the number of steps of a fixed-step solver in one communication step
    tolerance
        for cvode, the intended relative error of a run, 1e-6 by default (its steps are controlled
        tighter); the absolute error of a state is that times its nominal value
    """

    solver: Solver | None = None
    substeps: int = 1
    tolerance: float | None = None

    def __post_init__(self) -> None:
        solver, tolerance = self.solver, self.tolerance
        if solver is not None and solver not in get_args(Solver):
            raise FMUError(f"solver '{solver}' is not known" + did_you_mean(solver, get_args(Solver)))
        object.__setattr__(self, "substeps", whole_number("substeps", self.substeps, error=FMUError))
        if tolerance is not None and not (isinstance(tolerance, Real) and 1e-14 <= tolerance < 1.0):
            raise FMUError(f"tolerance={tolerance!r} must be a number from 1e-14 to 1, such as 1e-6")
        if solver == "cvode" and self.substeps != 1:
            raise FMUError(
                'substeps belong to solvers with fixed steps, and solver="cvode" chooses its own; '
                "omit substeps, or choose a fixed-step solver"
            )
        if solver not in (None, "cvode") and tolerance is not None:
            raise FMUError(
                f'tolerance belongs to solver="cvode", and {solver} has fixed steps; '
                "make substeps larger instead"
            )

    def resolved(self, has_indicators: bool) -> ModelExchange:
        """Return the options with a solver: the given one, or the default."""
        return self if self.solver else replace(self, solver="cvode" if has_indicators else "ode4")


Interface: TypeAlias = CoSimulation | ModelExchange


def interface_of(
    where: str,
    name: str | None,
    *,
    solver: Any = None,
    substeps: int | None = None,
    tolerance: float | None = None,
    event_mode: bool | None = None,
) -> Interface | None:
    """Return an interface from its name and flat options, as files and the command line give them.

    An option that is None counts as omitted. Without a name, the options choose their interface; without
    options, the result is None. Raises FMUError for options that exclude each other; `where` begins its text.
    """
    integration = {"solver": solver, "substeps": substeps, "tolerance": tolerance}
    given = {option: value for option, value in integration.items() if value is not None}
    names = get_args(InterfaceName)
    if name is not None and name not in names:
        raise FMUError(f"{where}: interface '{name}' is not known" + did_you_mean(name, names))
    is_exchange = name == "ModelExchange" or (name is None and bool(given))
    if event_mode is not None and is_exchange:
        raise FMUError(
            f"{where}: event_mode belongs to CoSimulation, and ModelExchange, which always has it, is used; "
            "omit event_mode"
        )
    if given and not is_exchange:
        raise FMUError(
            f"{where}: {next(iter(given))} belongs to ModelExchange, and CoSimulation, which has a solver of "
            "its own, is used; omit one of the two"
        )
    if name is None and not given and event_mode is None:
        return None
    return ModelExchange(**given) if is_exchange else CoSimulation(event_mode)
