"""The driver of FMI 3.0. Booleans are bytes, enumerations Int64.

A Co-Simulation FMU may return early from a step and may have an event mode. Structural parameters
are set in configuration mode, before initialization.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..versions import FMI3
from .driver import Driver, StepAnswer


class Driver3(Driver):
    """An instance of an FMI 3.0 FMU."""

    VERSION = FMI3

    def _instantiate(self) -> None:
        def log(_: Any, status: int, category: bytes, message: bytes) -> None:
            self.note(status, message)

        self.answer = StepAnswer()
        self.event_time = self.answer.event_time
        #: whether structural parameters were set, which may change the numbers of states and indicators
        self.configured = False
        if self.model_exchange:
            self.api.instantiate(loggingOn=True, logMessage=log)
            return
        early = (
            self.interface.mightReturnEarlyFromDoStep or self.interface.canReturnEarlyAfterIntermediateUpdate
        )
        self.api.instantiate(
            loggingOn=True, logMessage=log, eventModeUsed=self.event_mode, earlyReturnAllowed=early
        )

    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Set structural parameters in configuration mode."""
        if not values:
            return
        self.configured = True
        component = self.api.component
        self.attempt("enter configuration mode", self.api.fmi3EnterConfigurationMode, component)
        for name, value in values.items():
            self.set(self.file.variables[name], value)
        self.attempt("exit configuration mode", self.api.fmi3ExitConfigurationMode, component)

    def _enter_initialization(self, t0: float, set_start: Callable[[], None]) -> None:
        set_start()
        self.attempt("enter initialization", lambda: self.api.enterInitializationMode(startTime=t0))

    def counts(self) -> tuple[int, int]:
        """Return the numbers of the model description, or those of the instance if it was configured."""
        if not self.configured:
            return super().counts()
        states = self.attempt("count its states", self.api.getNumberOfContinuousStates)
        return int(states), int(self.attempt("count its events", self.api.getNumberOfEventIndicators))

    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get values."""
        getter = getattr(self.api, f"get{access}")
        return self.attempt("get its values", getter, references, count)  # type: ignore[no-any-return]
