"""FMI 2.0: the adapter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...loop.fmi_operations import FMI2Values
from ...loop.numbers import NUMBERS, Number
from ..ports import Shape
from .adapter import Adapter
from .fmi2_log import callbacks

_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # fmi2StatusKind


class Fmi2(Adapter):
    """An instance of an FMI 2.0 FMU. All variables are scalar, integers and Booleans are C ints."""

    PREFIX = "fmi2"
    NUMBERS = {
        "Real": ("Real", NUMBERS["Float64"]),
        "Integer": ("Integer", NUMBERS["Int32"]),
        "Enumeration": ("Integer", NUMBERS["Int32"]),
        "Boolean": ("Boolean", Number("i32", "int32", 0, 1)),
    }
    DERIVATIVES = "fmi2GetDerivatives"
    VALUES = FMI2Values
    FLAG = "int32"

    @staticmethod
    def platform() -> str:
        """Return the folder of this machine's binary."""
        import fmpy

        return str(fmpy.platform)

    @staticmethod
    def shape(variable: Any, start: Mapping[str, Any]) -> Shape:
        """Return (): there are no arrays."""
        return ()

    def _class(self, model_exchange: bool) -> Any:
        from fmpy.fmi2 import FMU2Model, FMU2Slave

        return FMU2Model if model_exchange else FMU2Slave

    def _instantiate(self) -> None:
        self.api.instantiate(callbacks=callbacks(self), loggingOn=True)

    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """There are no structural parameters."""

    def initialize(
        self, t0: float, set_start: Callable[[], None], settle: Callable[[], None] = lambda: None
    ) -> None:
        """Set up the experiment, set start values, initialize."""
        self.attempt("set up the experiment", lambda: self.api.setupExperiment(startTime=t0))
        set_start()
        self.attempt("enter initialization", self.api.enterInitializationMode)
        settle()
        self.attempt("exit initialization", self.api.exitInitializationMode)

    def discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """Update the discrete states."""
        return self.api.newDiscreteStates()  # type: ignore[no-any-return]

    def counts(self) -> tuple[int, int]:
        """Return the numbers of the model description."""
        description = self.fmu.description
        return int(description.numberOfContinuousStates), int(description.numberOfEventIndicators or 0)

    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get values."""
        values = self.attempt("get its values", lambda: getattr(self.api, f"get{access}")(references))
        return [v.decode(errors="replace") for v in values] if access == "String" else list(values)

    def asks_to_end(self) -> float | None:
        """Ask an FMU that discarded a step whether it wants to end the run."""
        try:
            terminated = self.api.getBooleanStatus(_TERMINATED)
            last = self.api.getRealStatus(_LAST_SUCCESSFUL_TIME)
        except Exception:  # an FMU need not be able to say why; FMPy raises bare Exception
            return None
        return float(last) if terminated else None
