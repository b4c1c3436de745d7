"""Units of ports that pass any signal: an instance carries the unit that it is given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..core.participant import Participant
from ..errors import DeclarationError


def set_unit(participant: Participant, unit: str | None, *names: str) -> None:
    """Give the named variables of one instance a unit; None leaves it unchecked."""
    for name in names:
        participant.variables[name] = replace(participant.variables[name], unit=unit)
        derivative = participant.variables.get(f"der_{name}")
        if derivative is not None:
            rate = None if unit is None else f"({unit})/s"
            participant.variables[f"der_{name}"] = replace(derivative, unit=rate)


def whole(value: float, what: str, least: int, most: float = 2.0**53) -> int:
    """Return a whole number in [least, most]; anything else is refused."""
    if not (isinstance(value, (int, float)) and math.isfinite(value) and value == int(value)):
        raise DeclarationError(f"{what} = {value!r} is no whole number; give one from {least} on")
    if not least <= value <= most:
        raise DeclarationError(f"{what} = {value!r} is outside [{least}, {most:g}]")
    return int(value)


def length(where: str, n: int | None, *values: ArrayLike) -> int:
    """Return the number of elements: n, or as many as the given values have, otherwise 1."""
    sizes = {np.size(v) for v in values if np.ndim(v) == 1}
    if n is not None:
        sizes.add(whole(n, f"{where}: n", 1))
    if len(sizes) > 1:
        raise DeclarationError(
            f"{where}: sizes {sorted(sizes)} do not fit each other; give vectors of one length"
        )
    return sizes.pop() if sizes else 1
