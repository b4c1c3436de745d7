"""The errors and warnings of cosim; the text of an error gives the place, the fault and the remedy.

Every error that a user can cause derives from `CosimError`. The command line prints its
text and ends with exit code 2; a traceback means a defect of structcosim itself.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from difflib import get_close_matches


class CosimError(Exception):
    """An error with a place, a fault and a remedy."""


class DeclarationError(CosimError):
    """A block or plant is declared or constructed wrongly."""


class WiringError(CosimError):
    """Ports that cannot be connected: unknown name, different shape, incompatible unit, or a cycle."""


class CompilationError(CosimError):
    """A kernel that Numba cannot compile, or that needs the Python runtime."""


class FMUError(CosimError):
    """An FMU that cannot be read, loaded or instantiated."""


class RecordError(CosimError):
    """A ground motion, table or result file that cannot be read or written."""


class TimeError(CosimError):
    """A step, stop time or sample period that does not fit the communication grid."""


class OptionError(CosimError):
    """An option of a run that does not exist or does not fit."""


class SnapshotError(CosimError):
    """A state that cannot be saved or restored."""


class SimulationEndedWarning(UserWarning):
    """A component asked to end the run before its stop time: a normal end; see `Result.ended`."""


class CompiledKernelsWarning(UserWarning):
    """A block runs as a Python callback because Numba cannot compile it."""


class LateEventWarning(UserWarning):
    """An event was handled at the end of the step in which it occurs."""


def check_known(
    what: str, value: object, known: Collection[str], error: type[CosimError] = OptionError
) -> None:
    """Raise `error` if a value is not one of the known names."""
    if value not in known:
        raise error(f"{what} '{value}' is not known" + did_you_mean(value, known))


def did_you_mean(name: object, candidates: Iterable[str]) -> str:
    """Return "; did you mean 'x'? (available: ...)" for an unknown name."""
    known = list(candidates)
    lowered = {k.lower(): k for k in known}
    close = get_close_matches(str(name).lower(), lowered, n=1, cutoff=0.6)
    hint = f"; did you mean '{lowered[close[0]]}'?" if close else ""
    shown = ", ".join(known[:20]) + (f", ... ({len(known)} in all)" if len(known) > 20 else "")
    return f"{hint} (available: {shown or 'none'})"
