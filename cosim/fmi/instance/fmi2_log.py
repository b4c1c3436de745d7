"""The logger of FMI 2.0 FMUs: one for the process, since FMPy's native proxy knows only one.

The proxy formats what an FMU logs, as printf does, and hands it to the logger that was added
last, whichever FMU it comes from. So the one that is added here stays, and finds the instance by
the environment that the FMU hands back; lines of FMUs that FMPy itself runs are printed, as FMPy does.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from itertools import count
from typing import Any
from weakref import WeakValueDictionary

from .adapter import Adapter

_instances: WeakValueDictionary[int, Adapter] = WeakValueDictionary()
_numbers = count(1)


def callbacks(instance: Adapter | None = None) -> Any:
    """Return the callbacks for a new instance of an FMU, its logger among them.

    Without an instance: what makes the process' logger the one in use again, after FMPy added another.
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

    return fmi2CallbackLoggerTYPE(_hand_over)


def _hand_over(environment: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    instance = _instances.get(environment or 0)
    if instance is not None:
        instance.note(status, message)
    elif environment is None:
        from fmpy.fmi1 import printLogMessage

        printLogMessage(environment, name, status, category, message)
