"""Start values as text with a unit: start={"angle": "30 deg", "k": "2 kN/m"}.

A display unit of the variable's own unit is converted by its definition in the FMU,

    shown = factor value + offset,  or, if it is inverse (FMI 3.0),  shown = factor / value

and any other unit by pint. A relative quantity, such as a difference of temperatures, is converted
without an offset.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ...errors import FMUError, WiringError
from ...units import conversion
from ..ports import FMUPort, definition_of

_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


@dataclass(frozen=True)
class DisplayUnit:
    """A unit in which a tool displays values of another unit."""

    name: str
    factor: float = 1.0
    offset: float = 0.0
    inverse: bool = False

    def value(self, shown: float, relative: bool) -> float:
        """Return a value in the variable's own unit from its value in this one."""
        if self.inverse:
            return self.factor / shown
        return (shown - (0.0 if relative else self.offset)) / self.factor


def display_units(unit: Any) -> list[DisplayUnit]:
    """Return the display units of a Unit element of a model description."""
    return [
        DisplayUnit(
            str(element.get("name")),
            float(element.get("factor", "1")),
            float(element.get("offset", "0")),
            element.get("inverse") in ("true", "1"),
        )
        for element in unit.iterfind("DisplayUnit")
    ]


def has_unit(text: str) -> bool:
    """Return whether a text is a number with a unit."""
    match = _VALUE.fullmatch(text)
    return bool(match and re.match(r"[^\d\s.,+-]", match[2]))


def without_units(where: str, port: FMUPort, units: Iterable[Any], value: Any) -> Any:
    """Return a start value in which texts such as "30 deg" are converted to numbers in the port's unit.

    `units` are the unit definitions of the model description. Raises FMUError if a text must not
    have a unit, or cannot be converted.
    """
    if isinstance(value, str):
        return _number(where, port, units, value)
    if isinstance(value, (list, tuple)):
        return [without_units(where, port, units, each) for each in value]
    return value


def _number(where: str, port: FMUPort, units: Iterable[Any], text: str) -> float:
    what = f"{where}: start value {port.name} = {text!r}"
    match = _VALUE.fullmatch(text)
    if not match or not match[2]:
        raise FMUError(f'{what} must be a number with a unit, such as "30 deg"; give others as floats')
    shown, given = float(match[1]), match[2]
    unit = "s" if port.type == "Clock" else port.unit  # an interval
    if unit is None:
        raise FMUError(f"{what}: the variable has no unit; give the number alone")
    if given == unit:
        return shown
    declared = [d for u in units if u.name == unit for d in u.displayUnits]
    for display in declared:
        if display.name == given:
            try:
                return float(display.value(shown, port.relative))
            except ZeroDivisionError:
                inverse = "the inverse of " if display.inverse else ""
                raise FMUError(
                    f"{what}: {given} is {inverse}{unit} times {display.factor:g}, which no value can be"
                ) from None
    defined = {u.name: definition_of(u.baseUnit) for u in units if u.baseUnit is not None}
    try:
        scale, offset = conversion(given, unit, defined.get(given), defined.get(unit))
    except WiringError as error:
        known = f" (display units of the FMU: {', '.join(d.name for d in declared)})" if declared else ""
        raise FMUError(f"{what}: {error}{known}") from error
    return scale * shown + (0.0 if port.relative else offset)
