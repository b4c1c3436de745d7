"""The input clocks of an instance that tick at an interval.

Such a clock ticks at t_start + shift + i interval, i = 0, 1, ...; interval and shift must be whole
numbers of communication steps. A fixed or tunable interval may be given as the start value of the
clock; otherwise it comes from the model description or, where that states none, from the FMU.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any

from ...core.time_grid import steps_between
from ...errors import FMUError
from ..clocks import Clock
from .driver import Driver


class Timers:
    """The input clocks of an instance that have an interval."""

    def __init__(self, driver: Driver, clocks: Iterable[Clock], h: float) -> None:
        self._driver = driver
        self._clocks = [c for c in clocks if not c.is_port]
        self._h = h
        self._start = 0.0
        #: reference, and interval and shift in steps, of each clock
        self._timers: list[tuple[int, int, int]] = []

    def start(self, t0: float, given: Mapping[str, list[Any]]) -> None:
        """Determine the intervals, in initialization mode."""
        self._start = t0
        self._timers = []
        for clock in self._clocks:
            interval, shift = self._interval(clock, given.get(clock.name))
            where = f"{self._driver.name}: clock {clock.name}:"
            steps = steps_between(interval, self._h, f"{where} its interval")
            first = steps_between(shift, self._h, f"{where} its shift") if shift else 0
            self._timers.append((clock.reference, steps, first))

    def due(self, t: float) -> list[int]:
        """Return the references of the clocks that tick at the communication point t."""
        k = round((t - self._start) / self._h)
        return [ref for ref, steps, first in self._timers if k >= first and (k - first) % steps == 0]

    def _interval(self, clock: Clock, given: list[Any] | None) -> tuple[float, float]:
        references = (ctypes.c_uint * 1)(clock.reference)
        api, interval = self._driver.api, (ctypes.c_double * 1)()
        if given is not None:
            interval[0] = given[0]
            what = f"set the interval of its clock {clock.name} to {given[0]:g} s"
            self._driver.attempt(what, api.setIntervalDecimal, references, interval)
            return float(given[0]), clock.shift
        if clock.interval is not None:
            return clock.interval, clock.shift
        shift, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        what = f"tell the interval of its clock {clock.name}"
        self._driver.attempt(what, api.getIntervalDecimal, references, interval, qualifier)
        self._driver.attempt(what, api.getShiftDecimal, references, shift)
        if not (qualifier[0] and interval[0] > 0.0):
            raise FMUError(
                f"{self._driver.name}: its clock {clock.name} has an interval neither in the model "
                f"description nor in the FMU; give one: start={{'{clock.name}': 0.01}}"
            )
        return float(interval[0]), float(shift[0])
