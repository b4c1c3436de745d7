"""Ports: the named values that a component of a system reads and provides."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ..units import Definition, conversion

#: "number": float64 in a run, an array where there is a shape; "String": str; "Binary": bytes
Kind = Literal["number", "String", "Binary"]
Direction = Literal["input", "output"]


@dataclass(frozen=True)
class Port:
    """A port of a component, or the part of it that a connection uses.

    participant
        the component's name in its system; "" outside a system
    shape
        of the whole port; strings and binary data are single values, with shape ()
    unit, definition
        the unit's name; its definition where the component brings one, as an FMU does
    relative
        a difference, such as one of temperatures: its unit is converted without an offset
    first, count, index
        the part: `count` values from number `first` on, in the order of the memory, and its
        notation, such as [2:4]
    """

    participant: str
    name: str
    shape: tuple[int, ...] = ()
    unit: str | None = None
    kind: Kind = "number"
    definition: Definition | None = None
    relative: bool = False
    first: int = 0
    count: int = 1
    index: str = ""

    @property
    def size(self) -> int:
        """The number of values of the whole port."""
        return math.prod(self.shape)

    def __str__(self) -> str:
        return f"{self.participant}.{self.name}{self.index}"

    def conversion_to(self, target: Port) -> tuple[float, float]:
        """Return (scale, offset): value in the target's unit = scale * value in this unit + offset."""
        scale, offset = conversion(self.unit, target.unit, self.definition, target.definition)
        return scale, 0.0 if self.relative or target.relative else offset
