"""What the versions of FMI have in common: the base of their adapters, fmi2.py and fmi3.py.

An adapter is one instance of an FMU behind FMPy's object for its version. It knows what
the versions name or order differently: types, loading, the way into initialization,
counts, and which operation of the loop calls a function.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...core.variables import Array
from ...errors import FMUError
from ...loop.fmi_operations import FMI2Values
from ...loop.numbers import Number
from ...loop.signals import RunSignals, ctrl_c
from ...result import SimulationError
from ..file.shared_library import check_library, library_name
from ..isolation.isolation import Isolation, support_library
from ..ports import Shape

if TYPE_CHECKING:
    from ..fmu import FMU

_LOADING = Lock()
_LABELS = {1: "warning", 2: "discard", 3: "error", 4: "fatal", 5: "pending"}


class StepAnswer:
    """What fmi3DoStep answers, in memory that the loop hands to it."""

    def __init__(self) -> None:
        #: event handling needed, terminate, early return
        self.flags = np.zeros(3, dtype=np.uint8)
        #: the last successful time, and when the next time event is due
        self.times = np.array([0.0, np.inf])

    @property
    def event(self) -> bool:
        """Whether the FMU asks for event handling."""
        return bool(self.flags[0])

    @property
    def terminate(self) -> bool:
        """Whether the FMU asks to end the simulation."""
        return bool(self.flags[1])

    @property
    def event_time(self) -> Array:
        """When the next time event is due, as (1,)."""
        return self.times[1:]

    def came_to(self, until: float) -> float:
        """Return how far a step until `until` came."""
        return min(float(self.times[0]), until) if self.flags[1:].any() else until

    def take(self, event: bool, terminate: bool, early: bool, last: float) -> None:
        """Keep what FMPy's doStep returned."""
        self.flags[:] = event, terminate, early
        self.times[0] = last


class Adapter(ABC):
    """An instance of an FMU of one FMI version."""

    PREFIX: ClassVar[str]
    #: of every numeric type the part of the function name (fmi2GetReal, fmi3GetFloat64), and its memory
    NUMBERS: ClassVar[dict[str, tuple[str, Number]]]
    DERIVATIVES: ClassVar[str]
    #: operations of the loop, and the type of the flags that functions return
    VALUES: ClassVar[type[FMI2Values]]
    FLAG: ClassVar[str]

    def __init__(self, fmu: FMU, name: str, model_exchange: bool, failures: RunSignals) -> None:
        self.fmu = fmu
        self.name = name
        self.messages: list[str] = []
        #: what the call that ended the run returned; 3 is an error, 4 a fatal one
        self.status = 0
        self.model_exchange = model_exchange
        #: where doStep answers, from FMI 3.0 on
        self.answer: StepAnswer | None = None
        description = fmu.description
        self.interface = description.modelExchange if model_exchange else description.coSimulation
        #: where the FMU runs, if not in this process
        self.process: Isolation | None = None
        library = fmu.directory / library_name(self.platform(), self.interface.modelIdentifier)
        check_library(library)
        try:
            with ctrl_c(failures):
                self._load(library, failures)
                self._make()
            if failures.interrupted:
                raise KeyboardInterrupt
        except BaseException:
            self.close()
            raise

    def _load(self, library: Path, failures: RunSignals) -> None:
        identifier = self.interface.modelIdentifier
        try:
            if self.fmu.isolated:
                self.process = Isolation(self.name, library, failures)
                # which FMPy joins to the folder of binaries: of an absolute path nothing else remains
                identifier = str(support_library().with_suffix(""))
            # FMPy goes to the library's folder, of which a process has one, and stays there if it fails
            with _LOADING, chdir(self.fmu.directory):
                self.api: Any = self._class(self.model_exchange)(
                    guid=self.fmu.description.guid,
                    unzipDirectory=str(self.fmu.directory),
                    modelIdentifier=identifier,
                    instanceName=self.name,
                )
        except Exception as error:  # FMPy raises bare Exception when a library does not load
            raise FMUError(f"{self.name}: the binary of {self.fmu.path} cannot be loaded: {error}") from error

    def _make(self) -> None:
        """Instantiate the FMU."""
        try:
            self.attempt("instantiate", self._instantiate)
        except FMUError as error:
            if not self.interface.needsExecutionTool:
                raise
            tool = self.fmu.description.generationTool or "which it does not name"
            raise FMUError(
                f"{error}\n{self.fmu.path.name} needs its tool ({tool}) to run, which has to be installed on "
                "this machine, with a licence if it needs one"
            ) from error

    def function(self, name: str) -> Any:
        """Return a function of FMI for the loop."""
        function = getattr(self.api.dll, name)
        return function if self.process is None else getattr(self.api.dll, f"loop_{name}", function)

    def close(self) -> None:
        """End the process of an isolated FMU."""
        if self.process is not None:
            self.process.close()

    @property
    def is_gone(self) -> bool:
        """Tell whether the process of an isolated FMU has ended, or has been given up."""
        return self.process is not None and self.process.is_gone

    def crash(self) -> str:
        """Return how an isolated FMU crashed, or ""."""
        if self.process is None or not self.process.crash:
            return ""
        return f"{self.name} ({self.fmu.path.name}) {self.process.crash}"

    @staticmethod
    @abstractmethod
    def platform() -> str:
        """Return the folder of this machine's binary."""

    @staticmethod
    @abstractmethod
    def shape(variable: Any, start: Mapping[str, Any]) -> Shape:
        """Return the shape of a variable, with the start values that were given."""

    @abstractmethod
    def _class(self, model_exchange: bool) -> Any: ...

    @abstractmethod
    def _instantiate(self) -> None: ...

    @abstractmethod
    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Set structural parameters; right after the instance is made."""

    @abstractmethod
    def initialize(
        self, t0: float, set_start: Callable[[], None], settle: Callable[[], None] = lambda: None
    ) -> None:
        """Go through initialization; start values are set where they have to be, `settle` called inside."""

    @abstractmethod
    def discrete_states(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """Update the discrete states: again, end, nominals changed, states changed, timed, time."""

    @abstractmethod
    def counts(self) -> tuple[int, int]:
        """Return the number of continuous states and of event indicators."""

    @abstractmethod
    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get values."""

    def asks_to_end(self) -> float | None:
        """Return the time that a discarded step came to if that means that the FMU asks to end the run."""
        return None

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """Set the values of a variable."""
        access = self.NUMBERS[variable.type][0] if variable.type in self.NUMBERS else variable.type
        setter = getattr(self.api, f"set{access}")
        shown = values[0] if len(values) == 1 else list(values)
        self.attempt(
            f"set {variable.name} = {shown}", lambda: setter([variable.valueReference], list(values))
        )

    def attempt(self, what: str, call: Callable[[], Any]) -> Any:
        """Call a function of FMPy; what it raises becomes an error with the FMU's log."""
        try:
            return call()
        except Exception as error:  # FMPy raises FMICallException and bare Exception alike
            self.status = getattr(error, "status", self.status)
            if self.process is not None:
                self.process.raise_interrupted()
            log = "".join(f"\n  {line}" for line in self.messages[-8:])
            if crash := self.crash():
                raise SimulationError(f"{crash}, when it was to {what}{log}") from error
            raise FMUError(f"{self.name} ({self.fmu.path.name}) failed to {what}: {error}{log}") from error

    def note(self, status: int, message: bytes | None) -> None:
        """Keep a line of the FMU's log, at warning level and above."""
        if status > 0 and len(self.messages) < 1000:
            text = (message or b"").decode(errors="replace")
            self.messages.append(f"[{_LABELS.get(status, 'warning')}] {text}")

    def failure(self, status: int, t: float, what: str = "") -> str:
        """Return what it means that a function returned a status at t, and remember it for the end."""
        self.status = status
        if self.process is not None:
            self.process.raise_interrupted()
        if crash := self.crash():
            return f"{crash}; look at its inputs and at its log"
        label = _LABELS.get(status)
        named = f"{self.PREFIX}{label.capitalize()}" if label else f"status {status}"
        return f"{self.name} failed{what} at t = {t:g} s with {named}; look at its inputs and at its log"

    def logged(self, text: str) -> str:
        """Return an error message with the end of the FMU's log."""
        lines = self.messages[-8:]
        return text + "".join(["\n  log of the FMU:", *(f"\n  {line}" for line in lines)]) if lines else text
