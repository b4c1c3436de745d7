"""Signals that end a run early: exceptions of callbacks, requests to end, Ctrl-C, operations that fail.

The compiled loop cannot carry an exception. A callback leaves it here and returns status 1;
the simulation raises it, with the result until then, once the loop has returned.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from ..result import SimulationError
from .operations import Operation

#: a kernel: the address of its storage, t and h in s; status 0 when all went well
KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double, ctypes.c_double)


class EndOfRun(Exception):
    """A component asks, inside a step, to end the run: a normal end, but the step is not completed."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text


class RunSignals:
    """Exceptions and requests to end that callbacks leave for the simulation, and Ctrl-C."""

    def __init__(self) -> None:
        self.exception: BaseException | None = None
        #: the component that raised it, and when
        self.place = ""
        #: Ctrl-C was pressed; the next callback or the end of the chunk ends the run
        self.interrupted = False
        #: the component that asked to end the run, and when; "" while none does
        self.end = ""
        #: (1,) 1 when the loop is to end at the next point
        self.stop = np.zeros(1, dtype=np.int64)
        self._callbacks: list[Any] = []

    def clear(self) -> None:
        """Clear all signals: the simulation continues from the present point, or from a snapshot."""
        self.exception, self.interrupted = None, False
        self.set_end("")

    def set_end(self, text: str) -> None:
        """Let the run end at the next point, or continue if the text is empty."""
        self.end, self.stop[0] = text, bool(text)

    def ask_to_end(self, name: str, t: float, at_end: bool) -> None:
        """Note that a component asks at t to end the run.

        At the end of a step the run continues to the communication point that is reached;
        inside a step, EndOfRun leaves it.
        """
        text = f"{name} asked to end the simulation at t = {t:.10g} s"
        if not at_end:
            raise EndOfRun(text)
        self.set_end(self.end or text)

    def note(self, exception: BaseException, name: str, t: float, when: str = "at") -> None:
        """Keep an exception that a component raised, for the simulation."""
        self.exception, self.place = exception, f"{name} failed {when} t = {t:g} s"

    def error(self) -> SimulationError:
        """Return the exception that a callback left as an error of the run."""
        text = str(self.exception)
        if not isinstance(self.exception, SimulationError):  # which names place and time itself
            kind = type(self.exception).__name__
            text = f"{self.place}: {kind}: {text}"
        error = SimulationError(text)
        error.__cause__ = self.exception
        return error

    def callback(self, name: str, function: Callable[[float, float], None], when: str = "at") -> int:
        """Return the address of a C callback for `function(t, h)`, which turns any exception into status 1.

        `when` says in an error how the exception is related to t. The callback lives as long as these
        signals.
        """

        def guarded(_: int, t: float, h: float) -> int:
            try:
                function(t, h)
                if self.interrupted:
                    raise KeyboardInterrupt
            except BaseException as exception:
                self.note(exception, name, t, when)
                return 1
            return 0

        self._callbacks.append(KERNEL(guarded))
        return ctypes.cast(self._callbacks[-1], ctypes.c_void_p).value or 0


@contextmanager
def ctrl_c(signals: RunSignals) -> Iterator[None]:
    """Note Ctrl-C, to be acted upon between chunks or after a callback.

    KeyboardInterrupt might otherwise be raised while Python enters a callback from C, where it is
    printed and lost, and the run continues. A second Ctrl-C is raised at once.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def note(number: int, frame: object) -> None:
        if signals.interrupted:
            raise KeyboardInterrupt
        signals.interrupted = True

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class Failing(Protocol):
    """The part of an instance that an error message needs."""

    name: str

    def locate(self, address: int, /) -> str:
        """Return the name of the variable at an address."""

    def failed(self, status: int, t: float, /) -> str:
        """Return the meaning of a status of one of its operations at t."""

    def log(self) -> list[str]:
        """Return the messages that it logged at warning level and above."""


def operation_error(op: Operation, instance: Failing, t: float, k: int, status: int) -> SimulationError:
    """Return the error of an operation of an instance that failed at t, in step k, with a status."""
    if status < 0 and op.checked():
        variable = instance.locate(op.checked() + 8 * (-status - 1))
        what, remedy = op.fault()
        text = f"{instance.name}.{variable} {what} at t = {t:g} s (step {k}); {remedy}"
    else:
        text = f"{instance.failed(ctypes.c_int32(status).value, t)} (step {k})"
    log = "".join(f"\n  {line}" for line in instance.log()[-8:])
    return SimulationError(f"{text}\n  log of the FMU:{log}" if log else text)
