"""Declarations of the inputs, outputs, states and parameters of a block or plant.

    class Gain(Block):
        K = Parameter(2.0, "gain", unit="N/m", min=0.0)
        x = Input("displacement", unit="m")
        u = Output("force", unit="N")

Sizes in `shape` are numbers or names ("n"); a name is resolved when an instance is
made, from the arrays given to it or from a keyword (`n=3`). Units may have names too,
with a dollar sign: `unit="$unit"` or `unit="($unit)/s"` is resolved from the
keyword `unit="N"`. A unit of None is not checked, "1" is dimensionless. Type checkers
see a scalar declaration as `float`, one with a shape as an array; on an instance it is
that value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array

Size: TypeAlias = int | str
Shape: TypeAlias = Size | tuple[Size, ...]
Kind = Literal["input", "output", "state", "derivative", "local", "parameter"]

#: the order of the zones in a storage
KINDS: tuple[Kind, ...] = ("input", "output", "state", "derivative", "local", "parameter")
_UNIT_NAME = re.compile(r"\$([A-Za-z_]\w*)")


@dataclass(frozen=True)
class Variable:
    """One declared variable; `shape` and `slot` are resolved in an instance."""

    kind: Kind
    start: Any = 0.0
    meaning: str = ""
    unit: str | None = None
    shape: tuple[Size, ...] = ()
    min: float = -np.inf
    max: float = np.inf
    fixed: bool = False
    whole: bool = False
    name: str = ""
    slot: int = -1

    @property
    def unit_names(self) -> set[str]:
        """The names in the unit that an instance resolves."""
        return set(_UNIT_NAME.findall(self.unit or ""))

    @property
    def size(self) -> int:
        """Number of float64 slots."""
        return math.prod(int(n) for n in self.shape)

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        return self if instance is None else instance._get(self.name)

    def __set__(self, instance: Any, value: Any) -> None:
        instance._set(self.name, value)

    def resolved(self, shape: tuple[int, ...], slot: int, units: Mapping[str, str | None]) -> Variable:
        """Return a copy with numbers for its shape, its first slot, and units for their names."""
        unit = self.unit
        if self.unit_names:
            known = {name: units.get(name) for name in self.unit_names}
            unit = None if None in known.values() else _UNIT_NAME.sub(lambda m: str(known[m[1]]), str(unit))
        return replace(self, shape=shape, slot=slot, unit=unit)


def _shape(shape: Shape) -> tuple[Size, ...]:
    return shape if isinstance(shape, tuple) else (shape,)


@overload
def Parameter(
    start: float = ...,
    meaning: str = ...,
    *,
    unit: str | None = ...,
    min: float = ...,
    max: float = ...,
    fixed: bool = ...,
    whole: bool = ...,
) -> float: ...
@overload
def Parameter(
    start: ArrayLike = ...,
    meaning: str = ...,
    *,
    shape: Shape,
    unit: str | None = ...,
    min: float = ...,
    max: float = ...,
    fixed: bool = ...,
    whole: bool = ...,
) -> Array: ...
def Parameter(
    start: ArrayLike = 0.0,
    meaning: str = "",
    *,
    shape: Shape = (),
    unit: str | None = None,
    min: float = -np.inf,
    max: float = np.inf,
    fixed: bool = False,
    whole: bool = False,
) -> Any:
    """Declare a parameter: set before the run, constant in it.

    `fixed=True` keeps it out of the interface of an exported FMU (a large matrix, a
    table): the FMU computes with the value at export. `whole=True` refuses fractions.
    """
    return Variable("parameter", start, meaning, unit, _shape(shape), min, max, fixed, whole)


@overload
def Input(meaning: str = ..., *, unit: str | None = ..., start: float = ...) -> float: ...
@overload
def Input(meaning: str = ..., *, shape: Shape, unit: str | None = ..., start: ArrayLike = ...) -> Array: ...
def Input(meaning: str = "", *, shape: Shape = (), unit: str | None = None, start: ArrayLike = 0.0) -> Any:
    """Declare an input; it has its start value until something is connected."""
    return Variable("input", start, meaning, unit, _shape(shape))


@overload
def Output(meaning: str = ..., *, unit: str | None = ..., start: float = ...) -> float: ...
@overload
def Output(meaning: str = ..., *, shape: Shape, unit: str | None = ..., start: ArrayLike = ...) -> Array: ...
def Output(meaning: str = "", *, shape: Shape = (), unit: str | None = None, start: ArrayLike = 0.0) -> Any:
    """Declare an output; `start` is its value until the kernel first writes it."""
    return Variable("output", start, meaning, unit, _shape(shape))


@overload
def State(start: float = ..., meaning: str = ..., *, unit: str | None = ...) -> float: ...
@overload
def State(start: ArrayLike = ..., meaning: str = ..., *, shape: Shape, unit: str | None = ...) -> Array: ...
def State(start: ArrayLike = 0.0, meaning: str = "", *, shape: Shape = (), unit: str | None = None) -> Any:
    """Declare a state `x`: in a Continuous with its derivative `der_x`, in a Block a memory between steps.

    A state is a port: it can be connected and recorded like an output.
    """
    return Variable("state", start, meaning, unit, _shape(shape))


@overload
def Local(start: float = ..., meaning: str = ..., *, unit: str | None = ...) -> float: ...
@overload
def Local(start: ArrayLike = ..., meaning: str = ..., *, shape: Shape, unit: str | None = ...) -> Array: ...
def Local(start: ArrayLike = 0.0, meaning: str = "", *, shape: Shape = (), unit: str | None = None) -> Any:
    """Declare working memory of the kernels: neither a port nor a parameter; saved with the state."""
    return Variable("local", start, meaning, unit, _shape(shape))
