"""The ports of an FMU, made from its variables.

An array variable of FMI 3.0 is one port. Scalar variables that are the elements of one
array (`accel[1]`, `accel[2]`, ..., as FMI 2.0 has them) are joined into one port.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product
from types import MappingProxyType
from typing import Any, TypeAlias

from ..core.port import Kind, Port
from ..errors import FMUError
from ..units import BASE_UNITS, Definition

Shape: TypeAlias = tuple[int, ...]

#: values of all ports of an FMU together: 80 MB of floats, exchanged at every step
MAX_ELEMENTS = 10_000_000

_NUMBERS = {"true": 1.0, "false": 0.0}
_TEXTS: dict[str, Kind] = {"String": "String", "Binary": "Binary"}


@dataclass(frozen=True)
class FMUPort(Port):
    """A port of an FMU.

    type
        the FMI type of its variables
    variables
        FMPy's variables: its elements in order, or its one array variable
    """

    type: str = ""
    variables: tuple[Any, ...] = field(default=(), repr=False, compare=False)

    def start_values(self, start: Mapping[str, list[Any]]) -> list[float]:
        """Return the start values: those in `start` by variable, else the model description's, else 0."""
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
        """Return the names of its values."""
        if len(self.variables) == self.size:
            return [str(v.name) for v in self.variables]
        indices = product(*(range(1, n + 1) for n in self.shape))
        return [f"{self.name}[{','.join(map(str, index))}]" for index in indices]


def unit_of(variable: Any) -> str | None:
    """Return the unit of one of FMPy's variables: its own, or that of its declared type."""
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
    """Return the display unit of a variable: its own, or that of its declared type."""
    declared = variable.declaredType
    unit = variable.displayUnit or (declared.displayUnit if declared is not None else None)
    return str(unit) if unit else None


def shape_of(variable: Any, start: Mapping[str, Any]) -> Shape:
    """Return the shape of a variable; `start` may have structural parameters, which give dimensions.

    Raises FMUError if such a parameter is not a whole number.
    """
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


def ports(
    variables: Iterable[Any],
    shape_of: Callable[[Any], Shape],
    definitions: Mapping[str, Definition] = MappingProxyType({}),
) -> dict[str, FMUPort]:
    """Return the ports of variables by name, with the definitions of their units.

    Raises FMUError if they have more than MAX_ELEMENTS values.
    """
    groups: dict[tuple[str, int], list[tuple[Shape, Any]]] = {}
    found: dict[str, FMUPort] = {}
    for v in variables:
        shape = shape_of(v)
        match = re.fullmatch(r"(.*[^\]])\[(\d{1,9}(?:,\s*\d{1,9})*)\]", v.name, re.DOTALL)
        if match and shape == ():
            index = tuple(int(i) for i in match[2].split(","))
            groups.setdefault((match[1], len(index)), []).append((index, v))
        else:
            found[v.name] = port_of(v.name, shape, (v,), definitions)
    if (total := sum(port.size for port in found.values())) > MAX_ELEMENTS:
        raise FMUError(
            f"the arrays of {', '.join(list(found)[:3])[:80]} ... have {total:,} values together, more than "
            f"{MAX_ELEMENTS:,}; check their dimensions, or the structural parameters that give them"
        )
    ranks = Counter(base for base, _ in groups)
    for (base, rank), elements in groups.items():
        elements.sort(key=lambda element: element[0])
        shape = tuple(max(index[d] for index, _ in elements) for d in range(rank))
        whole = len({i for i, _ in elements}) == len(elements) == math.prod(shape)
        alone = base not in found and ranks[base] == 1
        alike = len({(v.type, unit_of(v)) for _, v in elements}) == 1
        if alone and whole and alike and elements[0][0] == (1,) * rank:
            found[base] = port_of(base, shape, tuple(v for _, v in elements), definitions)
        else:
            found |= {v.name: port_of(v.name, (), (v,), definitions) for _, v in elements}
    return found


def port_of(
    name: str, shape: Shape, variables: tuple[Any, ...], definitions: Mapping[str, Definition]
) -> FMUPort:
    """Return the port of variables that have one type and one unit."""
    v, size = variables[0], math.prod(shape)
    if size > MAX_ELEMENTS:
        raise FMUError(
            f"variable {name[:80]} of shape {shape} has more than {MAX_ELEMENTS:,} values; "
            "check its dimensions, or the structural parameters that give them"
        )
    unit, relative = unit_of(v), v.relativeQuantity
    if relative is None and v.declaredType is not None:
        relative = v.declaredType.relativeQuantity
    return FMUPort(
        participant="",
        name=name,
        shape=shape,
        unit=unit,
        kind=_TEXTS.get(v.type, "number"),
        definition=definitions.get(unit or ""),
        relative=bool(relative),
        count=size,
        type=v.type,
        variables=variables,
    )
