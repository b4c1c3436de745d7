"""Ports of an FMU, made from its variables.

An array variable of FMI 3.0 is a port. Scalar variables that are the elements of one
array (`accel[1]`, `accel[2]`, ..., as FMI 2.0 has them) are joined to one port.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

from ..core.port import Port
from ..errors import FMUError
from ..units import BASE_UNITS, Definition

Shape: TypeAlias = tuple[int, ...]

#: values of all ports of an FMU: 80 MB of floats, exchanged at every step
MAX_ELEMENTS = 10_000_000


_NUMBERS = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class FMUPort:
    """A port of an FMU: the variables that are its elements, in order, or one array variable."""

    name: str
    shape: Shape
    unit: str | None
    type: str
    variables: tuple[Any, ...]

    @property
    def relative(self) -> bool:
        """Return whether it is a difference, whose unit has no offset."""
        v = self.variables[0]
        own = v.relativeQuantity
        return bool(own if own is not None or v.declaredType is None else v.declaredType.relativeQuantity)

    @property
    def size(self) -> int:
        """The number of values."""
        return math.prod(self.shape)

    def as_port(self, definitions: Mapping[str, Definition]) -> Port:
        """Return the port as a system sees it, with the definition of its unit."""
        return Port(
            "",
            self.name,
            self.shape,
            self.unit,
            kind="String" if self.type == "String" else "Binary" if self.type == "Binary" else "number",
            definition=definitions.get(self.unit or ""),
            relative=self.relative,
            count=self.size,
        )

    def start_values(self, start: Mapping[str, list[Any]]) -> list[float]:
        """Return the start values: those given by variable, else the model description's, else 0."""
        found: list[float] = []
        for v in self.variables:
            if v.name in start:
                found += map(float, start[v.name])
                continue
            given = [_NUMBERS.get(text, text) for text in (v.start or "0").split()]
            size = self.size // len(self.variables)
            found += [float(x) for x in (given if len(given) == size else given[:1] * size)]
        return found

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


def unit_definitions(description: Any) -> dict[str, Definition]:
    """Return the units that a model description defines by base units."""
    units = [unit for unit in description.unitDefinitions or () if unit.baseUnit is not None]
    return {str(unit.name): definition_of(unit.baseUnit) for unit in units}


def definition_of(base: Any) -> Definition:
    """Return the definition that FMPy read from a BaseUnit element."""
    exponents = tuple(int(getattr(base, name)) for name in BASE_UNITS)
    return Definition(exponents, float(base.factor), float(base.offset))


def display_unit_of(variable: Any) -> str | None:
    """Return the unit in which a variable is to be shown, its own or its declared type's."""
    declared = variable.declaredType
    unit = variable.displayUnit or (declared.displayUnit if declared is not None else None)
    return str(unit) if unit else None


def shape_of(variable: Any, start: Mapping[str, Any]) -> Shape:
    """Return the shape of a variable: fixed dimensions, or those of structural parameters."""
    sizes = []
    for d in variable.dimensions:
        size = d.start if d.start is not None else start.get(d.variable.name, d.variable.start)
        try:
            sizes.append(int(size))
        except (TypeError, ValueError):
            raise FMUError(
                f"{variable.name}: its dimension {d.variable.name} = {size!r} must be a whole number"
            ) from None
    return tuple(sizes)


def ports(variables: Iterable[Any], shape_of: Callable[[Any], Shape]) -> dict[str, FMUPort]:
    """Return the ports of variables by name."""
    groups: dict[tuple[str, int], list[tuple[Shape, Any]]] = {}
    found: dict[str, FMUPort] = {}
    for v in variables:
        shape = shape_of(v)
        match = re.fullmatch(r"(.*[^\]])\[(\d{1,9}(?:,\s*\d{1,9})*)\]", v.name, re.DOTALL)
        if match and shape == ():
            index = tuple(int(i) for i in match[2].split(","))
            groups.setdefault((match[1], len(index)), []).append((index, v))
        else:
            found[v.name] = single(v, shape)
    if (total := sum(port.size for port in found.values())) > MAX_ELEMENTS:
        raise FMUError(
            f"the arrays of {', '.join(list(found)[:3])[:80]} ... have {total:,} values together, more than "
            f"{MAX_ELEMENTS:,}; check their dimensions, or the structural parameters that give them"
        )
    ranks = Counter(base for base, _ in groups)
    for (base, rank), members in groups.items():
        members.sort(key=lambda member: member[0])
        shape = tuple(max(index[d] for index, _ in members) for d in range(rank))
        kinds = {(v.type, unit_of(v)) for _, v in members}
        whole = len({i for i, _ in members}) == len(members) == math.prod(shape)
        alone = base not in found and ranks[base] == 1
        if not alone or not whole or members[0][0] != (1,) * rank or len(kinds) != 1:
            found |= {v.name: single(v, ()) for _, v in members}
            continue
        type_, unit = kinds.pop()
        found[base] = FMUPort(base, shape, unit, type_, tuple(v for _, v in members))
    return found


def single(v: Any, shape: Shape) -> FMUPort:
    """Return the port of one variable."""
    if math.prod(shape) > MAX_ELEMENTS:
        raise FMUError(
            f"variable {v.name[:80]} of shape {shape} has more than {MAX_ELEMENTS:,} values; "
            "check its dimensions, or the structural parameters that give them"
        )
    return FMUPort(v.name, shape, unit_of(v), v.type, (v,))
