"""Operations of the loop, and how a row of its table is laid out."""

from __future__ import annotations

import math
from dataclasses import dataclass

COPY = 0  # n floats a -> b, times w0 plus w1
CALL = 1  # kernel `function` on record a at the row's time; then n floats at b must be finite
RECORD = 2  # append the floats whose n addresses are at a to buffer b
STATISTICS = 3  # update (min, max, sum, sum of squares) at b for the n addresses at a
COMBINE = 4  # c = a + h sum_i w_i b_i, vectors of n floats, b one row a stage; c must be finite
TO_FLOAT = 5  # n int32 at a -> floats at b
TO_INT = 6  # n floats at a -> int32 at b; a fraction is an error
GATHER = 7  # n floats, from the first to the second address of n pairs at a
FMI2_VALUES = 10  # get or set n values at c by value references b; with d > 0 they must be finite
FMI2_DO_STEP = 11
FMI2_TIME = 12
FMI2_VECTOR = 13  # get or set the vector b of n floats (states, derivatives)
FMI2_COMPLETED = 14  # b: int32 flags "enter event mode", "terminate"; one set, or time d due, calls c


@dataclass(frozen=True)
class Op:
    """One row of the table, and the line of the schedule that says what it does ("" shows none)."""

    text: str
    code: int
    function: int = 0
    a: int = 0
    b: int = 0
    c: int = 0
    d: int = 0
    n: int = 0
    every: int = 1
    weights: tuple[float, ...] = ()
    fraction: float = 0.0
    participant: str = ""

    def operands(self) -> tuple[int, int, int, int, int]:
        """Return the words of the row: what differs between runs of one shape."""
        return self.function, self.a, self.b, self.c, self.d

    def seconds(self, t0: float, k: int, h: float) -> float:
        """Return the time at which the row runs."""
        return t0 + (k + self.fraction) * h if math.isfinite(h) else t0
