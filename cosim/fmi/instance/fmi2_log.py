"""The logger of FMI 2.0 FMUs: one per process, because FMPy's native proxy has room for one only.

The proxy formats the lines of an FMU's log as printf does, and passes those of all FMUs to the
logger that was added last. So this logger stays, and finds the instance by the environment that
the FMU passes back. Lines of FMUs that FMPy itself runs are printed, as FMPy prints them.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from itertools import count
from typing import Any, Protocol
from weakref import WeakValueDictionary


class Noting(Protocol):
    """An instance that keeps the lines of its log."""

    def note(self, status: int, message: bytes | None) -> None:
        """Keep a line."""


_instances: WeakValueDictionary[int, Noting] = WeakValueDictionary()
_numbers = count(1)


def callbacks(instance: Noting | None = None) -> Any:
    """Return the callbacks for a new instance of an FMU, including its logger.

    Without an instance, this puts the logger of the process back in use after FMPy has added another.
    """
    from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions
    from fmpy.logging import addLoggerProxy

    made = fmi2CallbackFunctions()
    made.logger = _logger()
    made.allocateMemory = defaultCallbacks.allocateMemory
    made.freeMemory = defaultCallbacks.freeMemory
    if instance is not None:
        made.componentEnvironment = number = next(_numbers)
        _instances[number] = instance
    addLoggerProxy(ctypes.byref(made))
    return made


@lru_cache(maxsize=1)
def _logger() -> Any:
    from fmpy.fmi2 import fmi2CallbackLoggerTYPE

    return fmi2CallbackLoggerTYPE(_pass_on)


def _pass_on(environment: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    instance = _instances.get(environment or 0)
    if instance is not None:
        instance.note(status, message)
    elif environment is None:
        from fmpy.fmi1 import printLogMessage

        printLogMessage(environment, name, status, category, message)
