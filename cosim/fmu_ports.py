"""Ports of an FMU: what its variables are to a system.

An array variable of FMI 3.0 is a port. Scalar variables that are the elements of one
array (`accel[1]`, `accel[2]`, ...; all there is in FMI 2.0) are joined to one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

Shape: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class FMUPort:
    """A port of an FMU: the variables that are its elements, in order, or one array variable."""

    name: str
    shape: Shape
    unit: str | None
    type: str
    variables: tuple[Any, ...]

    @property
    def size(self) -> int:
        """The number of values."""
        return math.prod(self.shape)

    def elements(self) -> list[str]:
        """Return the name of every value."""
        if len(self.variables) == self.size:
            return [str(v.name) for v in self.variables]
        indices = product(*(range(1, n + 1) for n in self.shape))
        return [f"{self.name}[{','.join(map(str, index))}]" for index in indices]


def unit_of(variable: Any) -> str | None:
    """Return the unit of one of FMPy's variables, its own or its declared type's."""
    declared = variable.declaredType
    unit = variable.unit or (declared.unit if declared is not None else None)
    return str(unit) if unit else None


def ports(variables: Iterable[Any], shape_of: Callable[[Any], Shape]) -> dict[str, FMUPort]:
    """Return the ports of variables by name."""
    groups: dict[str, dict[Shape, Any]] = {}
    found: dict[str, FMUPort] = {}
    for v in variables:
        shape = shape_of(v)
        match = re.fullmatch(r"(.*[^\]])\[(\d+(?:,\s*\d+)*)\]", v.name)
        if match and shape == ():
            index = tuple(int(i) for i in match[2].split(","))
            groups.setdefault(match[1], {})[index] = v
        else:
            found[v.name] = _single(v, shape)
    for base, members in groups.items():
        shape = tuple(max(index[d] for index in members) for d in range(len(next(iter(members)))))
        kinds = {(v.type, unit_of(v)) for v in members.values()}
        ordered = sorted(members)
        whole = len(members) == math.prod(shape) and ordered[0] == (1,) * len(shape)
        if base in found or not whole or len(kinds) != 1:
            found |= {v.name: _single(v, ()) for v in members.values()}
            continue
        type_, unit = kinds.pop()
        found[base] = FMUPort(base, shape, unit, type_, tuple(members[i] for i in ordered))
    return found


def _single(v: Any, shape: Shape) -> FMUPort:
    return FMUPort(v.name, shape, unit_of(v), v.type, (v,))
