"""The choice of the driver for an FMU's version."""

from __future__ import annotations

from ...loop.signals import RunSignals
from ..fmu_file import FMUFile
from ..versions import FMI2
from .driver import Driver
from .fmi2 import Driver2
from .fmi3 import Driver3


def load(
    file: FMUFile,
    name: str,
    model_exchange: bool,
    signals: RunSignals,
    event_mode: bool = False,
    isolated: bool = False,
) -> Driver:
    """Load the library of an FMU, instantiate it under a name, and return its driver."""
    made = Driver2 if file.version is FMI2 else Driver3
    return made(file, name, model_exchange, signals, event_mode, isolated)
