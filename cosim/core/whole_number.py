"""The check of every count that a user gives: a size, a rate, a number of substeps."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from ..errors import CosimError, DeclarationError


def whole_number(what: str, value: Any, least: int = 1, error: type[CosimError] = DeclarationError) -> int:
    """Return a whole number as an int; raise `error` for any other value and for one below `least`."""
    number = float(value) if isinstance(value, Real) else math.nan
    if not (number.is_integer() and least <= number <= 2.0**53):
        raise error(f"{what}={value!r} must be a whole number, {least} or more")
    return int(number)
