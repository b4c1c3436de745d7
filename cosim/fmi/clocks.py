"""Clocks of FMI 3.0 under Co-Simulation: which an FMU has, and when those with an interval tick.

An output clock is a port that reads 1 at a communication point when it has ticked since
the last one, and 0 otherwise. A triggered input clock is a port that ticks at the
communication points at which its value is not 0. An input clock with an interval ticks by
itself, at t_start + shift + i interval: interval and shift are whole numbers of
communication steps. The interval is the model description's; that of a clock with fixed
or tunable interval may be given, as its start value, or is asked of the FMU.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..core.time_grid import steps_between
from ..errors import FMUError
from .instance.adapter import Adapter

_GIVEN = ("fixed", "tunable")  # intervals that the importer may set


@dataclass(frozen=True)
class Clock:
    """A clock; `interval` and `shift` in s as the model description has them, None where it has not."""

    name: str
    reference: int
    is_output: bool
    variability: str
    interval: float | None
    shift: float

    @property
    def is_port(self) -> bool:
        """Tell whether it ticks the system, or is ticked by it."""
        return self.is_output or self.variability == "triggered"


def clocks_of(where: str, variables: Iterable[Any], start: Mapping[str, Any]) -> dict[str, Clock]:
    """Return the clocks among FMPy's variables; refuse what is not supported."""
    found: dict[str, Clock] = {}
    for v in variables:
        if v.type != "Clock":
            continue
        clock = Clock(
            v.name, v.valueReference, v.causality != "input", v.intervalVariability, *interval_of(v)
        )
        name = f"{where}: clock {v.name}"
        if v.dimensions:
            raise FMUError(f"{name} is an array, and arrays of clocks are not supported")
        if clock.variability in ("changing", "countdown") and not clock.is_output:
            raise FMUError(
                f"{name} has a {clock.variability} interval, which is not supported: intervals are constant, "
                "fixed or tunable, or the clock is triggered"
            )
        if clock.variability == "constant" and clock.interval is None:
            raise FMUError(f"{name} has a constant interval, and none in the model description")
        if v.name in start and (clock.is_output or clock.variability not in _GIVEN):
            raise FMUError(
                f"{name} has no interval to give (it is {clock.variability}); take it out of start"
            )
        found[v.name] = clock
    return found


def interval_of(variable: Any) -> tuple[float | None, float]:
    """Return interval and shift of a clock, in s, as the model description has them."""
    v = variable
    interval = _seconds(v.intervalCounter, v.resolution, v.intervalDecimal)
    return interval, _seconds(v.shiftCounter, v.resolution, v.shiftDecimal) or 0.0


def _seconds(count: int | None, resolution: int | None, decimal: float | None) -> float | None:
    return decimal if count is None or not resolution else count / resolution


class Timers:
    """The input clocks of an instance that have an interval."""

    def __init__(self, fmi: Adapter, clocks: Iterable[Clock], h: float) -> None:
        self._fmi = fmi
        self._clocks = [c for c in clocks if not c.is_port]
        self._h = h
        self._start = 0.0
        #: of each clock its reference, and interval and shift in steps
        self._timers: list[tuple[int, int, int]] = []

    def __bool__(self) -> bool:
        return bool(self._clocks)

    def start(self, t0: float, given: Mapping[str, list[Any]]) -> None:
        """Settle the intervals, in initialization mode."""
        self._start = t0
        self._timers = []
        for clock in self._clocks:
            interval, shift = self._interval(clock, given.get(clock.name))
            where = f"{self._fmi.name}: clock {clock.name}:"
            steps = steps_between(interval, self._h, f"{where} its interval")
            first = steps_between(shift, self._h, f"{where} its shift") if shift else 0
            self._timers.append((clock.reference, steps, first))

    def due(self, t: float) -> list[int]:
        """Return the references of the clocks that tick at the communication point t."""
        k = round((t - self._start) / self._h)
        return [ref for ref, steps, first in self._timers if k >= first and (k - first) % steps == 0]

    def _interval(self, clock: Clock, given: list[Any] | None) -> tuple[float, float]:
        references = (ctypes.c_uint * 1)(clock.reference)
        api, interval = self._fmi.api, (ctypes.c_double * 1)()
        if given is not None:
            interval[0] = given[0]
            what = f"set the interval of its clock {clock.name} to {given[0]:g} s"
            self._fmi.attempt(what, lambda: api.setIntervalDecimal(references, interval))
            return float(given[0]), clock.shift
        if clock.interval is not None:
            return clock.interval, clock.shift
        shift, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        what = f"tell the interval of its clock {clock.name}"
        self._fmi.attempt(what, lambda: api.getIntervalDecimal(references, interval, qualifier))
        self._fmi.attempt(what, lambda: api.getShiftDecimal(references, shift))
        if not (qualifier[0] and interval[0] > 0.0):
            raise FMUError(
                f"{self._fmi.name}: clock {clock.name} has no interval, neither in the model description nor "
                f"at the start; give one: start={{'{clock.name}': 0.01}}"
            )
        return float(interval[0]), float(shift[0])
