"""Units of ports: whether two are compatible, and how one is converted to the other.

A unit has a name, and where an FMU or an SSP defines it, a definition by SI base units:

    value in base units = factor * value + offset

A definition takes precedence; pint defines all other names. The spellings of FMUs ("m/s2",
"N.m", "kg m s-2") are accepted as well as "m/s^2" and "N*m".
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from .errors import WiringError

#: the base units of FMI and SSP, in the order of `Definition.exponents`
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_PINT_NAMES = ("gram", "meter", "second", "ampere", "kelvin", "mole", "candela", "radian")
_RADIAN = BASE_UNITS.index("rad")
#: far above any real unit, such as "kcal*inch/(hour*foot^2*delta_degF)"
_MAX_LENGTH = 100
_PLAIN = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻·⋅", "0123456789-**")
#: one factor of a unit: a name or 1, with a power of at most two digits
_FACTOR = re.compile(
    r"(?P<name>1(?!\d)|%|°?[^\W\d_]+(?:_\w+)?|°)"
    r"(?:(?:\^|\*\*)(?P<open>\()?(?P<given>[-+]?\d{1,2}(?:\.\d{1,3})?)(?(open)\)|(?!\d))"
    r"|(?P<power>-?\d{1,2})(?!\d))?"
)
_CLOSING = re.compile(r"\)(?:(?:\^|\*\*)?(?P<power>-?\d)(?!\d))?")
_OPERATOR = re.compile(r"\s*[*./]\s*|\s+")


@dataclass(frozen=True)
class Definition:
    """A unit by its powers of the base units, and value in base units = factor * value + offset."""

    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0

    def __str__(self) -> str:
        powers = zip(BASE_UNITS, self.exponents, strict=True)
        return " ".join(f"{n}^{e}" if e != 1 else n for n, e in powers if e) or "1"


@lru_cache(maxsize=1)
def registry() -> Any:
    """Return the unit registry; imported late, because it takes a third of a second."""
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def parse(unit: str) -> Any:
    """Return pint's unit for a text such as "m/s^2", "m/s2", "N.m", "kN*s/m", "1" or "g_0"."""
    text = _expression(unit)
    try:
        if text is None:
            raise ValueError("this is not a product of powers of units")
        return registry().Unit(text)
    except Exception as error:  # pint raises many types that share no base class
        shown = unit if len(unit) <= _MAX_LENGTH else f"{unit[:_MAX_LENGTH]}..."
        raise WiringError(
            f"unit '{shown}' is not known; write it as pint or FMI do, for example m/s^2, kN*s/m, rad/s"
        ) from error


def _expression(unit: str) -> str | None:
    """Return a unit as an expression for pint, None for a text that is not a product of powers."""
    text = unit.strip().translate(_PLAIN)
    if text in ("", "1", "-"):
        return ""
    if len(text) > _MAX_LENGTH:
        return None
    parts: list[str] = []
    place = depth = 0
    while place < len(text):
        if text[place] == "(":
            parts.append("(")
            place, depth = place + 1, depth + 1
            continue
        factor = _FACTOR.match(text, place)
        if factor is None:
            return None
        power = factor["power"] or factor["given"]
        parts.append(factor["name"] + (f"**{power}" if power else ""))
        place = factor.end()
        while depth and (closing := _CLOSING.match(text, place)):
            parts.append(f")**{closing['power']}" if closing["power"] else ")")
            place, depth = closing.end(), depth - 1
        if place < len(text):
            operator = _OPERATOR.match(text, place)
            if operator is None or operator.end() == len(text):
                return None
            parts.append("/" if "/" in operator[0] else "*")
            place = operator.end()
    return None if depth or parts[-1] == "(" else "".join(parts)


@lru_cache(maxsize=1024)
def definition(unit: str) -> Definition:
    """Return the definition of a unit that pint knows."""
    factor, offset, powers = _to_roots(unit)
    exponents = dict.fromkeys(_PINT_NAMES, 0)
    for name, exponent in powers.items():
        if name not in exponents:
            raise WiringError(f"unit '{unit}' is made of '{name}', for which FMI has no base unit")
        if exponent != int(exponent):
            raise WiringError(f"unit '{unit}' has the power {exponent} of {name}; FMI has whole powers only")
        exponents[name] = int(exponent)
        if name == "gram":
            factor, offset = factor * 1e-3 ** int(exponent), offset * 1e-3 ** int(exponent)
    return Definition(tuple(exponents.values()), _rounded(factor), _rounded(offset))


def _to_roots(unit: str) -> tuple[float, float, dict[str, Any]]:
    """Return factor, offset and powers of pint's root units."""
    parsed = parse(unit)
    quantity = registry().Quantity
    try:
        zero, one = (quantity(x, parsed).to_root_units() for x in (0.0, 1.0))
    except OverflowError as error:
        raise WiringError(f"unit '{unit}' is too large or too small for a number") from error
    return float(one.magnitude - zero.magnitude), float(zero.magnitude), dict(one._units)


def _rounded(x: float) -> float:
    """Drop the rounding of a chain of conversions: 0.9999999999999999 is 1."""
    return float(f"{x:.15g}")


@lru_cache(maxsize=1024)
def conversion(
    source: str | None,
    target: str | None,
    source_definition: Definition | None = None,
    target_definition: Definition | None = None,
) -> tuple[float, float]:
    """Return (scale, offset) with `value in target = scale * value in source + offset`.

    A unit that is not given (None) is not checked. The same name is the same unit, unless both
    ends define it and differ. Raises WiringError when the two measure different things.
    """
    if source is None or target is None:
        return 1.0, 0.0
    if source == target and (
        source_definition is None or target_definition is None or source_definition == target_definition
    ):
        return 1.0, 0.0
    if source_definition is None and target_definition is None:
        return _by_name(source, target)
    a, b = source_definition or definition(source), target_definition or definition(target)
    for name, unit in ((source, a), (target, b)):
        if not (math.isfinite(unit.factor) and math.isfinite(unit.offset) and unit.factor):
            raise WiringError(
                f"'{name}' is defined with the factor {unit.factor} and the offset {unit.offset}; "
                "both must be finite, and the factor must not be 0"
            )
    if _is_usual(source, a) and _is_usual(target, b):
        return _by_name(source, target)  # without the rounding of the definitions' digits
    if a.exponents != b.exponents:
        raise WiringError(f"'{source}' ({a}) is not convertible to '{target}' ({b})")
    _refuse_cycles(source, target)
    return a.factor / b.factor, (a.offset - b.offset) / b.factor


def _is_usual(name: str, given: Definition) -> bool:
    """Tell whether a definition agrees with pint's for the name; many FMUs omit the radian."""
    try:
        known = definition(name)
    except WiringError:
        return False
    return (
        given.exponents[:_RADIAN] == known.exponents[:_RADIAN]
        and given.exponents[_RADIAN] in (0, known.exponents[_RADIAN])
        and math.isclose(given.factor, known.factor, rel_tol=1e-14)
        and math.isclose(given.offset, known.offset, rel_tol=1e-14)
    )


def _by_name(source: str, target: str) -> tuple[float, float]:
    """Convert two units that pint knows."""
    a, b = parse(source), parse(target)
    if not a.is_compatible_with(b):
        raise WiringError(
            f"'{source}' ({a.dimensionality}) is not convertible to '{target}' ({b.dimensionality})"
        )
    _refuse_cycles(source, target)
    quantity = registry().Quantity
    try:
        offset = float(quantity(0.0, a).to(b).magnitude)
        return float(quantity(1.0, a).to(b).magnitude) - offset, offset
    except (OverflowError, ZeroDivisionError) as error:
        raise WiringError(f"'{source}' to '{target}': the factor is too large or too small") from error


def _refuse_cycles(source: str, target: str) -> None:
    """Refuse to convert cycles to radians: pint and many FMUs take both for 1/s, without the 2 pi."""
    try:
        names = [str(parse(unit)) for unit in (source, target)]
    except WiringError:
        return  # a name that only the FMU defines
    angles = [bool(re.search("radian|degree|turn|revolution", name)) for name in names]
    cycles = ["hertz" in name for name in names]
    if (angles[0] and cycles[1]) or (cycles[0] and angles[1]):
        raise WiringError(
            f"'{source}' to '{target}': Hz counts cycles, rad/s radians; convert by 2 pi yourself"
        )
