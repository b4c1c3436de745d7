"""FMI 3.0: the adapter.

A Co-Simulation FMU may return early from a step, and has an event mode where the FMU says
so. Structural parameters that are given are set in configuration mode, at the start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...errors import FMUError
from ...loop.fmi_operations import FMI3Values
from ...loop.numbers import NUMBERS, Number
from ..ports import Shape
from .adapter import Adapter, StepAnswer


class Fmi3(Adapter):
    """An instance of an FMI 3.0 FMU. Booleans are bytes, enumerations Int64."""

    PREFIX = "fmi3"
    NUMBERS = {
        **{name: (name, number) for name, number in NUMBERS.items()},
        "Enumeration": ("Int64", NUMBERS["Int64"]),
        "Boolean": ("Boolean", Number("i8", "uint8", 0, 1)),
        "Clock": ("Clock", NUMBERS["Float64"]),  # as a port; its start value is an interval
    }
    DERIVATIVES = "fmi3GetContinuousStateDerivatives"
    VALUES = FMI3Values
    FLAG = "uint8"

    @staticmethod
    def platform() -> str:
        """Return the folder of this machine's binary."""
        import fmpy

        return str(fmpy.platform_tuple)

    @staticmethod
    def shape(variable: Any, start: Mapping[str, Any]) -> Shape:
        """Return the shape: fixed dimensions, or those of structural parameters."""
        sizes = []
        for d in variable.dimensions:
            size = d.start if d.start is not None else start.get(d.variable.name, d.variable.start)
            try:
                sizes.append(int(size))
            except (TypeError, ValueError):
                raise FMUError(
                    f"{variable.name}: its dimension {d.variable.name} = {size!r} is no whole number"
                ) from None
        return tuple(sizes)

    def _class(self, model_exchange: bool) -> Any:
        from fmpy.fmi3 import FMU3Model, FMU3Slave

        return FMU3Model if model_exchange else FMU3Slave

    def _instantiate(self) -> None:
        def log(_: Any, status: int, category: bytes, message: bytes) -> None:
            self.note(status, message)

        self.answer = StepAnswer()
        self.configured = False  # then arrays, and so states, may be of another size than described
        if self.model_exchange:
            self.api.instantiate(loggingOn=True, logMessage=log)
            return
        can = self.fmu.description.coSimulation
        early = can.mightReturnEarlyFromDoStep or can.canReturnEarlyAfterIntermediateUpdate
        self.api.instantiate(
            loggingOn=True, logMessage=log, eventModeUsed=self.fmu.event_mode, earlyReturnAllowed=early
        )

    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Set structural parameters in configuration mode."""
        if not values:
            return
        self.configured = True
        component = self.api.component
        self.attempt("enter configuration mode", lambda: self.api.fmi3EnterConfigurationMode(component))
        for name, value in values.items():
            self.set(self.fmu.variables[name], value)
        self.attempt("exit configuration mode", lambda: self.api.fmi3ExitConfigurationMode(component))

    def initialize(
        self, t0: float, set_start: Callable[[], None], settle: Callable[[], None] = lambda: None
    ) -> None:
        """Set start values, initialize from t0."""
        set_start()
        self.attempt("enter initialization", lambda: self.api.enterInitializationMode(startTime=t0))
        settle()
        self.attempt("exit initialization", self.api.exitInitializationMode)

    def discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """Update the discrete states."""
        return self.api.updateDiscreteStates()  # type: ignore[no-any-return]

    def counts(self) -> tuple[int, int]:
        """Return the numbers of the model description, or the instance's if it was configured."""
        if not self.configured:
            description = self.fmu.description
            return int(description.numberOfContinuousStates), int(description.numberOfEventIndicators)
        states = self.attempt("count its states", self.api.getNumberOfContinuousStates)
        return int(states), int(self.attempt("count its events", self.api.getNumberOfEventIndicators))

    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get values."""
        return self.attempt("get its values", lambda: getattr(self.api, f"get{access}")(references, count))  # type: ignore[no-any-return]
