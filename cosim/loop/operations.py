"""The operations of the loop, with their addresses and their LLVM IR.

An operation is a frozen dataclass. Its fields of type Address go into the loop's table and
differ from run to run; all others are written into the text of the loop, so that systems of
one shape share it. The operations that call FMUs are in fmi_operations.py, those between
number types in conversions.py.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cache
from typing import TypeAlias

from .writer import INLINE, Writer, number

#: an address in memory, or that of a function
Address: TypeAlias = int

INLINE_PAIRS = 64  # of copies between connected ports; the compiler takes a minute for 20,000 of them
#: a time event within this part of a step after a communication point is due there: room for round-off
SLACK = 1e-9
NOT_FINITE = (
    "is not finite (NaN or infinite)",
    "check the inputs that lead to it, and the step: a diverging plant ends this way",
)


@dataclass(frozen=True, kw_only=True)
class Operation(ABC):
    """One operation of the loop.

    text
        its line in the schedule; "" shows none
    participant
        the component that it belongs to
    every
        it runs at every n-th communication point
    fraction
        c in the time of the operation, t_0 + (k + c) h
    """

    text: str = ""
    participant: str = ""
    every: int = 1
    fraction: float = 0.0

    @classmethod
    @cache
    def addresses(cls) -> tuple[str, ...]:
        """Return the names of the fields that are addresses, in the order of the table."""
        return tuple(f.name for f in fields(cls) if f.type == "Address")

    def words(self) -> list[int]:
        """Return the addresses, in the order of the table."""
        return [getattr(self, name) for name in self.addresses()]

    @abstractmethod
    def emit(self, w: Writer) -> None:
        """Write the operation in LLVM IR."""

    def checked(self) -> Address:
        """Return the address of the checked floats, of which status -1 - i names number i; 0 for none."""
        return 0

    def fault(self) -> tuple[str, str]:
        """Return the fault of a value that did not pass the check, and the remedy."""
        return NOT_FINITE

    def seconds(self, t0: float, k: int, h: float) -> float:
        """Return the time at which the operation runs."""
        return t0 + (k + self.fraction) * h if math.isfinite(h) else t0

    def line(self) -> str:
        """Return the line of the schedule."""
        return f"{self.text} (every {self.every})" if self.every > 1 and self.text else self.text


@dataclass(frozen=True, kw_only=True)
class Copy(Operation):
    """target = factor * source + offset for `count` floats; with `spread` all from one float."""

    source: Address
    target: Address
    count: int
    factor: float = 1.0
    offset: float = 0.0
    spread: bool = False

    @property
    def is_plain(self) -> bool:
        """Tell whether floats are copied unchanged."""
        return (self.factor, self.offset) == (1.0, 0.0)

    def pairs(self) -> list[tuple[Address, Address]]:
        """Return source and target of every float."""
        return [(self.source + 8 * i * (not self.spread), self.target + 8 * i) for i in range(self.count)]

    def emit(self, w: Writer) -> None:
        source, target = w.address("source"), w.address("target")

        def one(i: int | str) -> None:
            x = w.load(source if self.spread else w.at(source, i))
            if not self.is_plain:
                x = w.add(w.multiply(x, number(self.factor)), number(self.offset))
            w.store(x, w.at(target, i))

        if self.count > INLINE and self.is_plain and not self.spread:
            size = 8 * self.count
            w.write(f"call void @llvm.memmove.p0.p0.i64(ptr {target}, ptr {source}, i64 {size}, i1 false)")
        else:
            w.each(self.count, one)


@dataclass(frozen=True, kw_only=True)
class Gather(Operation):
    """Copy `count` floats, each between the two addresses of a pair in a table."""

    pairs: Address
    count: int

    def emit(self, w: Writer) -> None:
        pairs = w.address("pairs")

        def one(i: int | str) -> None:
            source, target = (w.load(w.at(pairs, i, 2, j), "ptr") for j in (0, 1))
            w.store(w.load(source), target)

        w.each(self.count, one, inline=INLINE_PAIRS)


@dataclass(frozen=True, kw_only=True)
class Call(Operation):
    """Call a kernel or callback with storage, t and h; then `count` floats at `results` must be finite."""

    function: Address
    storage: Address = 0
    results: Address = 0
    count: int = 0

    def emit(self, w: Writer) -> None:
        t, h = w.time(self.fraction), w.step(self.every)
        w.check_status(w.call("ptr double double", w.address("storage"), t, h))
        if self.count:
            w.check_finite(w.address("results"), self.count)

    def checked(self) -> Address:
        return self.results


@dataclass(frozen=True, kw_only=True)
class Combine(Operation):
    """result = start + h sum_i w_i slope_i, a stage of a Runge-Kutta method; the result must be finite.

    The slopes are one vector of `count` floats a stage, one after the other.
    """

    start: Address
    slopes: Address
    result: Address
    count: int
    weights: tuple[float, ...]

    def emit(self, w: Writer) -> None:
        start, slopes, result = (w.address(name) for name in self.addresses())

        def one(i: int | str) -> None:
            slope = ""
            for stage, weight in enumerate(self.weights):
                if weight != 0.0:
                    term = w.multiply(w.load(w.at(slopes, i, offset=stage * self.count)), number(weight))
                    slope = w.add(slope, term) if slope else term
            x = w.load(w.at(start, i))
            w.store(w.add(x, w.multiply("%h", slope)) if slope else x, w.at(result, i))

        w.each(self.count, one)
        w.check_finite(result, self.count)

    def checked(self) -> Address:
        return self.result


@dataclass(frozen=True, kw_only=True)
class Record(Operation):
    """Append the floats at `count` addresses to rows.

    sources
        the addresses
    place
        two words: the address of the rows, and the number of rows so far
    """

    sources: Address
    place: Address
    count: int

    def emit(self, w: Writer) -> None:
        place = w.address("place")
        rows, before = w.load(place, "ptr"), w.count_up(w.at(place, 1))
        row = w.at(rows, w.value(f"mul i64 {before}, {self.count}"))
        sources = w.address("sources")
        w.each(self.count, lambda i: w.store(w.load(w.load(w.at(sources, i), "ptr")), w.at(row, i)))


@dataclass(frozen=True, kw_only=True)
class Sample(Operation):
    """Update minimum, maximum, sum and sum of squares of the floats at `count` addresses.

    sources
        the addresses
    kept
        four floats each
    points
        the number of points so far
    """

    sources: Address
    kept: Address
    points: Address
    count: int

    def emit(self, w: Writer) -> None:
        sources, kept = w.address("sources"), w.address("kept")

        def one(i: int | str) -> None:
            x = w.load(w.load(w.at(sources, i), "ptr"))
            for j, better in enumerate(("olt", "ogt")):
                place = w.at(kept, i, 4, j)
                old = w.load(place)
                beats = w.value(f"fcmp {better} double {x}, {old}")
                w.store(w.value(f"select i1 {beats}, double {x}, double {old}"), place)
            for j, term in ((2, x), (3, w.multiply(x, x))):
                place = w.at(kept, i, 4, j)
                w.store(w.add(w.load(place), term), place)

        w.each(self.count, one)
        w.count_up(w.address("points"))
