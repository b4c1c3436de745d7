"""The driver of FMI 2.0. All variables are scalar; integers and Booleans are C ints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..versions import FMI2
from .driver import Driver
from .fmi2_log import callbacks

_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # fmi2StatusKind


class Driver2(Driver):
    """An instance of an FMI 2.0 FMU."""

    VERSION = FMI2

    def _instantiate(self) -> None:
        self.api.instantiate(callbacks=callbacks(self), loggingOn=True)

    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Do nothing: FMI 2.0 has no structural parameters."""

    def _enter_initialization(self, t0: float, set_start: Callable[[], None]) -> None:
        self.attempt("set up the experiment", lambda: self.api.setupExperiment(startTime=t0))
        set_start()
        self.attempt("enter initialization", self.api.enterInitializationMode)

    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get values."""
        values = self.attempt("get its values", getattr(self.api, f"get{access}"), references)
        return [(v or b"").decode(errors="replace") for v in values] if access == "String" else list(values)

    def asks_to_end(self) -> float | None:
        """Return the last successful time if the FMU discarded a step to end the run, else None."""
        try:
            terminated = self.api.getBooleanStatus(_TERMINATED)
            last = self.api.getRealStatus(_LAST_SUCCESSFUL_TIME)
        except Exception:  # an FMU need not be able to tell the reason; FMPy raises bare Exception
            return None
        return float(last) if terminated else None
