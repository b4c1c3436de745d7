"""Clocks of FMI 3.0 under Co-Simulation.

An output clock is a port whose value at a communication point is 1 if the clock has ticked since
the last one, and 0 otherwise. A triggered input clock is a port that ticks at the
communication points at which its value is not 0. An input clock with an interval is not a port
(instance/timers.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import FMUError

_GIVEN = ("fixed", "tunable")  # intervals that the importer may set


@dataclass(frozen=True)
class Clock:
    """A clock; `interval` and `shift` in s are those of the model description, or None and 0."""

    name: str
    reference: int
    is_output: bool
    variability: str
    interval: float | None
    shift: float

    @property
    def is_port(self) -> bool:
        """Whether it is connected in a system: it ticks, or is ticked, at communication points."""
        return self.is_output or self.variability == "triggered"


def clocks_of(where: str, variables: Iterable[Any], start: Mapping[str, Any]) -> dict[str, Clock]:
    """Return the clocks among FMPy's variables, by name.

    Raises FMUError for a clock that is not supported, and for an interval in `start` that it does not take.
    """
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
                f"{name} has a {clock.variability} interval, which is not supported; intervals must be "
                "constant, fixed or tunable, or the clock triggered"
            )
        if clock.variability == "constant" and clock.interval is None:
            raise FMUError(f"{name} has a constant interval, which the model description must state")
        if v.name in start and (clock.is_output or clock.variability not in _GIVEN):
            raise FMUError(f"{name} takes no interval (it is {clock.variability}); remove it from start")
        found[v.name] = clock
    return found


def interval_of(variable: Any) -> tuple[float | None, float]:
    """Return the interval and the shift of a clock in s, from the model description."""
    v = variable
    interval = _seconds(v.intervalCounter, v.resolution, v.intervalDecimal)
    return interval, _seconds(v.shiftCounter, v.resolution, v.shiftDecimal) or 0.0


def _seconds(count: int | None, resolution: int | None, decimal: float | None) -> float | None:
    return decimal if count is None or not resolution else count / resolution
