"""The driver of one FMU instance, call by call: the part that both versions of FMI share.

A run and the doctor use the same driver. It loads the library, takes the instance through
initialization, iterates events, finishes steps that return early, and turns every failure into an
error with the FMU's log. `api` is FMPy's object with the functions of FMI; fmi2.py and fmi3.py
make the calls that differ between the versions. The order of calls:

    make (constructor), configure, initialize
    event mode after initialization, and at every event:
        enter_event_mode, set what changes, update_discrete_states, leave_event_mode
    Co-Simulation: do_step, then finish_step if the step returned early
    Model Exchange: continuous_time.py and event_steps.py
    close
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar, Protocol
from weakref import WeakValueDictionary

import numpy as np

from ...arrays import Array
from ...errors import FMUError, WiringError
from ...loop.operations import SLACK
from ...loop.signals import RunSignals, ctrl_c
from ...result import SimulationError
from ..file.shared_library import check_library, library_name
from ..fmu_file import FMUFile
from ..isolation.isolation import Isolation, support_library
from ..versions import Version

OK, WARNING, DISCARD, ERROR, FATAL = range(5)  # of fmi2Status and fmi3Status
EVENT_ITERATIONS = 1000  # at one instant; more is a chain of events without end

_LOADING = Lock()
#: instances of FMUs that can be instantiated only once per process, by token
_ALONE: WeakValueDictionary[str, Driver] = WeakValueDictionary()
_LABELS = {1: "warning", 2: "discard", 3: "error", 4: "fatal", 5: "pending"}


class StepAnswer:
    """The answer of fmi3DoStep, in memory that the loop passes to it."""

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
        """The time of the next time event, as (1,)."""
        return self.times[1:]

    def came_to(self, until: float) -> float:
        """Return the time at which a step until `until` ended."""
        return min(float(self.times[0]), until) if self.flags[1:].any() else until


class Interrupts(Protocol):
    """The owner of a driver, which acts when a step is interrupted; times in s."""

    def handle_event(self, t: float, at_end: bool) -> None:
        """Handle an event at t, inside the step or at its end."""

    def end_run(self, t: float, at_end: bool) -> None:
        """Note that the FMU asks at t to end the run."""


class Driver(ABC):
    """An instance of an FMU of one FMI version.

    Raises FMUError if the FMU cannot be loaded or instantiated, and WiringError if this process must
    not have another instance of it.
    """

    VERSION: ClassVar[Version]

    def __init__(
        self,
        file: FMUFile,
        name: str,
        model_exchange: bool,
        signals: RunSignals,
        event_mode: bool = False,
        isolated: bool = False,
    ) -> None:
        self.file = file
        self.name = name
        self.signals = signals
        self.model_exchange = model_exchange
        #: whether events are handled outside the steps: always with Model Exchange
        self.event_mode = event_mode or model_exchange
        self.isolated = isolated
        self.messages: list[str] = []
        #: status of the call that ended the run
        self.status = OK
        #: the answer of doStep, from FMI 3.0 on
        self.answer: StepAnswer | None = None
        #: (1,) time of the next time event, in s
        self.event_time: Array = np.array([np.inf])
        description = file.description
        self.interface = description.modelExchange if model_exchange else description.coSimulation
        #: the process in which the FMU runs, if it is isolated
        self.process: Isolation | None = None
        library = file.directory / library_name(self.VERSION.platform, self.interface.modelIdentifier)
        check_library(library)
        self._check_alone()
        try:
            with ctrl_c(signals):
                self._load(library)
                self.make()
            if signals.interrupted:
                raise KeyboardInterrupt
        except BaseException:
            self.close()
            raise

    # ------------------------------------------------------------------------- loading

    def _check_alone(self) -> None:
        """Refuse a second instance in this process of an FMU that allows only one."""
        if self.isolated:
            return
        guid, file = self.file.description.guid, self.file.path.name
        other = _ALONE.get(guid)
        if other is not None and other.signals is self.signals:
            raise WiringError(
                f"{self.name} and {other.name} are the same FMU, {file}, which can be instantiated only once "
                "per process; run each in a process of its own, FMU(..., isolated=True)"
            )
        if other is not None and self.interface.canBeInstantiatedOnlyOncePerProcess:
            raise WiringError(
                f"{self.name} ({file}) can be instantiated only once per process, and a simulation "
                "that is open has it; close that first, or use FMU(..., isolated=True)"
            )
        if self.interface.canBeInstantiatedOnlyOncePerProcess:
            _ALONE[guid] = self

    def _load(self, library: Path) -> None:
        identifier, fmi = self.interface.modelIdentifier, self.VERSION.prefix
        kind = f"FMU{fmi[-1]}{'Model' if self.model_exchange else 'Slave'}"
        made = getattr(import_module(f"fmpy.{fmi}"), kind)  # not in the folder of an untrusted FMU
        try:
            if self.isolated:
                self.process = Isolation(self.name, library, self.signals)
                # FMPy joins it to the folder of binaries, which an absolute path replaces
                identifier = str(support_library().with_suffix(""))
            # FMPy changes to the library's folder, a property of the process, and stays there if it fails
            with _LOADING, chdir(self.file.directory):
                self.api: Any = made(
                    guid=self.file.description.guid,
                    unzipDirectory=str(self.file.directory),
                    modelIdentifier=identifier,
                    instanceName=self.name,
                )
            self.api._call = partial(_checked, self.api._call)
        except Exception as error:  # FMPy raises bare Exception when a library does not load
            raise FMUError(
                f"{self.name}: the binary of {self.file.path} cannot be loaded: {error}"
            ) from error

    def make(self) -> None:
        """Instantiate the FMU, for the first time or again after the instance was freed."""
        try:
            self.attempt("instantiate", self._instantiate)
        except FMUError as error:
            if not self.interface.needsExecutionTool:
                raise
            tool = self.file.description.generationTool or "whose name it does not state"
            raise FMUError(
                f"{error}\n{self.file.path.name} needs its tool ({tool}) to run; install it on this machine, "
                "with a licence if it needs one"
            ) from error

    def free(self) -> None:
        """Free the instance."""
        self.api.freeInstance()

    def close(self) -> None:
        """Release the instance, and end the process of an isolated FMU."""
        if _ALONE.get(self.file.description.guid) is self:
            del _ALONE[self.file.description.guid]
        if self.process is not None:
            self.process.close()

    def address(self, name: str, in_loop: bool = True) -> int:
        """Return the address of a function of FMI, given its name without prefix.

        `in_loop` selects the functions of an isolated FMU that only the loop of a run may call.
        """
        name = self.VERSION.prefix + name
        function = getattr(self.api.dll, name)
        if in_loop and self.process is not None:
            function = getattr(self.api.dll, f"loop_{name}", function)
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    def initialize(
        self, t0: float, set_start: Callable[[], None], settle: Callable[[], None] = lambda: None
    ) -> None:
        """Initialize at t0, in s: `set_start` sets start values, `settle` runs in initialization mode."""
        self._enter_initialization(t0, set_start)
        settle()
        self.attempt("exit initialization", self.api.exitInitializationMode)

    def counts(self) -> tuple[int, int]:
        """Return the number of continuous states and of event indicators."""
        description = self.file.description
        return int(description.numberOfContinuousStates), int(description.numberOfEventIndicators or 0)

    # -------------------------------------------------- differences between the versions

    @abstractmethod
    def _instantiate(self) -> None:
        """Call FMPy's instantiate."""

    @abstractmethod
    def configure(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Set structural parameters, right after the instance is made."""

    @abstractmethod
    def _enter_initialization(self, t0: float, set_start: Callable[[], None]) -> None:
        """Set the start values and enter initialization mode."""

    @abstractmethod
    def get(self, access: str, references: Sequence[int], count: int) -> list[Any]:
        """Get `count` values by get{access}; strings are str from both versions."""

    def asks_to_end(self) -> float | None:
        """Return the time that a discarded step reached if it was discarded to end the run, else None."""
        return None

    # ---------------------------------------------------------------- values and events

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """Set the values of a variable."""
        numbers = self.VERSION.numbers
        access = numbers[variable.type][0] if variable.type in numbers else variable.type
        setter = getattr(self.api, f"set{access}")
        shown = values[0] if len(values) == 1 else list(values)
        self.attempt(f"set {variable.name} = {shown}", setter, [variable.valueReference], list(values))

    def enter_event_mode(self) -> None:
        """Enter event mode."""
        self.attempt("enter event mode", self.api.enterEventMode)

    def update_discrete_states(self, t: float, exchange: Callable[[], None] = lambda: None) -> bool:
        """Update the discrete states until they no longer change; `exchange` runs before each update.

        Returns whether the FMU asks to end the run; `event_time` is then the next one.
        """
        update = getattr(self.api, self.VERSION.update_discrete_states)
        for _ in range(EVENT_ITERATIONS):
            exchange()
            again, end, _, _, timed, time = self.attempt("update its discrete states", update)
            if end or not again:
                self.event_time[0] = time if timed else np.inf
                return bool(end)
        raise FMUError(f"{self.name}: the event at t = {t:g} s does not end in {EVENT_ITERATIONS} iterations")

    def leave_event_mode(self) -> None:
        """Return to continuous time or to step mode."""
        if self.model_exchange:
            self.attempt("enter continuous-time mode", self.api.enterContinuousTimeMode)
        else:
            self.attempt("enter step mode", self.api.enterStepMode)

    # ------------------------------------------------------------- steps of Co-Simulation

    def do_step(self, t: float, h: float) -> None:
        """Do one step from t over h, in s; from FMI 3.0 on it may return early, as `answer` then states."""
        done = self.attempt("do its step", self.api.doStep, t, h, False)
        if self.answer is not None:
            self.answer.flags[:] = done[:3]
            self.answer.times[0] = done[3]

    def finish_step(self, t: float, h: float, owner: Interrupts) -> None:
        """Continue a step over [t, t + h] from its answer until its end.

        A step that returned early at t' is continued from there. In event mode, an event that ended
        it is handled at t', and a time event inside the step splits it.
        """
        answer = self.answer
        if answer is None:
            return
        end, near = t + h, SLACK * h
        now, stuck = answer.came_to(end), 0
        while True:
            if answer.terminate:
                owner.end_run(now, now >= end - near)
            if self.event_mode and (answer.event or self.event_time[0] <= now):
                owner.handle_event(now, now >= end - near)
            if now >= end - near:
                answer.flags[:] = 0
                return
            if self.signals.interrupted:
                raise KeyboardInterrupt
            event = float(self.event_time[0])
            # a time event at the end of the step, to rounding, is handled at its own instant
            before, until = now, event if now < event <= end + near else end
            self.do_step(before, until - before)
            now = answer.came_to(until)
            stuck = 0 if now > before else stuck + 1
            if stuck > (EVENT_ITERATIONS if self.event_mode and answer.event else 0):
                raise FMUError(
                    f"{self.name} returns early from its step at t = {before:g} s without making progress "
                    f"(the communication step is from {t:g} s to {end:g} s); look at its inputs and its log"
                )

    # ------------------------------------------------------------------------- signals

    @property
    def is_gone(self) -> bool:
        """Whether the process of an isolated FMU has ended, or was abandoned after Ctrl-C."""
        return self.process is not None and self.process.is_gone

    @property
    def takes_calls(self) -> bool:
        """Whether functions may still be called: not after a fatal error or the end of the process."""
        return self.status != FATAL and not self.is_gone

    def crash(self) -> str:
        """Return how an isolated FMU crashed, or ""."""
        if self.process is None or not self.process.crash:
            return ""
        return f"{self.name} ({self.file.path.name}) {self.process.crash}"

    def attempt(self, what: str, call: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of FMPy and return its result.

        Raises FMUError with `what` was attempted and the FMU's log, or SimulationError if an isolated
        FMU crashed.
        """
        try:
            result = call(*arguments)
        except Exception as error:  # FMPy raises FMICallException and bare Exception alike
            self.status = getattr(error, "status", self.status)
            if self.process is not None:
                self.process.raise_interrupted()
            log = "".join(f"\n  {line}" for line in self.messages[-8:])
            if crash := self.crash():
                raise SimulationError(f"{crash}, when it was to {what}{log}") from error
            raise FMUError(
                f"{self.name} ({self.file.path.name}) failed to {what}: {_reason(error)}{log}"
            ) from error
        return result

    def note(self, status: int, message: bytes | None) -> None:
        """Keep a line of the FMU's log, at warning level and above."""
        if status > 0 and len(self.messages) < 1000:
            text = (message or b"").decode(errors="replace")
            self.messages.append(f"[{_LABELS.get(status, 'warning')}] {text}")

    def failure(self, status: int, t: float, what: str = "") -> str:
        """Return the message of a status that a function returned at t, and keep the status."""
        self.status = status
        if self.process is not None:
            self.process.raise_interrupted()
        if crash := self.crash():
            return f"{crash}; look at its inputs and at its log"
        label = _LABELS.get(status)
        named = f"{self.VERSION.prefix}{label.capitalize()}" if label else f"status {status}"
        return f"{self.name} failed{what} at t = {t:g} s with {named}; look at its inputs and at its log"

    def logged(self, text: str) -> str:
        """Return an error message with the end of the FMU's log."""
        lines = self.messages[-8:]
        return text + "".join(["\n  log of the FMU:", *(f"\n  {line}" for line in lines)]) if lines else text


def _checked(call: Callable[..., Any], name: str, *arguments: Any) -> Any:
    """Make a call of FMPy; a negative status, which FMPy takes for success, is an error."""
    status = call(name, *arguments)
    if isinstance(status, int) and status < 0:
        from fmpy.fmi1 import FMICallException  # loading FMPy takes 0.15 s, in runs without FMUs, too

        raise FMICallException(function=name, status=status)
    return status


def _reason(error: BaseException) -> str:
    """Return the text of an exception, or its type where it has no text or comes from inside FMPy."""
    if isinstance(error, (AttributeError, TypeError)):
        return f"FMPy cannot read its answer ({error})"
    return str(error) or f"{type(error).__name__} without a message"
