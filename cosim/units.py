"""Units of ports: whether two are compatible, and how one is converted to the other.

pint knows the units; this module reads the spellings that FMUs use ("m/s2", "N.m").
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

from .errors import WiringError


@lru_cache(maxsize=1)
def registry() -> Any:
    """Return the unit registry; imported late, it takes a third of a second."""
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def parse(unit: str) -> Any:
    """Return pint's unit for a text such as "m/s^2", "m/s2", "N.m", "kN*s/m", "1" or "g_0"."""
    text = re.sub(r"(?<=[A-Za-z])(-?\d+)", r"**\1", unit.strip())
    text = re.sub(r"\*\*\*\*", "**", text.replace("^", "**"))
    text = re.sub(r"(?<=[\w)])\.(?=[A-Za-z(])", "*", text)
    ureg = registry()
    try:
        return ureg.Unit("" if text in ("", "1", "-") else text)
    except Exception as error:  # pint raises many types, none of them its own base class
        raise WiringError(
            f"unit '{unit}' is not known; write it as pint or FMI do, for example m/s^2, kN*s/m, rad/s"
        ) from error


@lru_cache(maxsize=1024)
def conversion(source: str | None, target: str | None) -> tuple[float, float]:
    """Return (scale, offset) with `value in target = scale * value in source + offset`.

    A unit that is not given (None) is not checked. Raises WiringError when the two
    measure different things.
    """
    if source is None or target is None or source == target:
        return 1.0, 0.0
    a, b = parse(source), parse(target)
    if not a.is_compatible_with(b):
        raise WiringError(
            f"'{source}' ({a.dimensionality}) is not convertible to '{target}' ({b.dimensionality})"
        )
    angles = [bool(re.search("radian|degree|turn|revolution", str(unit))) for unit in (a, b)]
    cycles = ["hertz" in str(unit) for unit in (a, b)]
    if (angles[0] and cycles[1]) or (cycles[0] and angles[1]):  # to pint both are 1/s, without the 2 pi
        raise WiringError(
            f"'{source}' to '{target}': Hz counts cycles, rad/s radians; convert by 2 pi yourself"
        )
    quantity = registry().Quantity
    offset = float(quantity(0.0, a).to(b).magnitude)
    return float(quantity(1.0, a).to(b).magnitude) - offset, offset
