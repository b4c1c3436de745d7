"""Operations of the loop, and how a row of its table is laid out."""

from __future__ import annotations

import math
from dataclasses import dataclass

COPY = 0  # n floats a -> b, times w0 plus w1
CALL = 1  # kernel `function` on record a at the row's time; then n floats at b must be finite
RECORD = 2  # append the floats whose n addresses are at a to buffer b
STATISTICS = 3  # update (min, max, sum, sum of squares) at b for the n addresses at a
COMBINE = 4  # c = a + h sum_i w_i b_i, vectors of n floats, b one row a stage; c must be finite
TO_FLOAT = 5  # n values of type `number` at a -> floats at b; one that a float does not hold is an error
FROM_FLOAT = 6  # n floats at a -> values of type `number` at b; one that the type does not hold is an error
GATHER = 7  # n floats, from the first to the second address of n pairs at a
FMI2_VALUES = 10  # get or set `count` values at c by n references b; with d > 0 they must be finite
FMI3_VALUES = 11
FMI2_DO_STEP = 12  # a step that is discarded calls d
# b: three bools "event, terminate, early return"; c: last successful time, and when the next event is
# due; an event that is due before the end of the step, and each of the three, call d
FMI3_DO_STEP = 13
FMI_TIME = 14
FMI_VECTOR = 15  # get or set the vector b of n floats (states, derivatives)
FMI2_COMPLETED = 16  # b: flags "enter event mode", "terminate"; one set, or time d due, calls c
FMI3_COMPLETED = 17
UNLESS_EVENT = 18  # go on; but if a time event at d is due before t + h, call c and go on at END
END = 19

#: a time event within so many steps after a communication point is due there: room for the round-off of times
SLACK = 1e-9


@dataclass(frozen=True)
class Number:
    """A number type of FMI in memory: LLVM's and NumPy's name, and the whole numbers that it holds."""

    llvm: str
    dtype: str
    low: int = 0
    high: int = 0

    @property
    def name(self) -> str:
        """Return a name that carries all fields, fit for a symbol: "int32_m2147483648_2147483647"."""
        return f"{self.dtype}_{self.low}_{self.high}".replace("-", "m")

    @property
    def is_float(self) -> bool:
        """Tell whether it holds fractions."""
        return self.high == 0

    @property
    def values(self) -> str:
        """Return what it holds, for an error message."""
        return f"a whole number from {self.low} to {self.high}" if self.high else "in the range of Float32"


def _integer(bits: int, signed: bool = True) -> Number:
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return Number(f"i{bits}", f"{'' if signed else 'u'}int{bits}", low, high)


NUMBERS = {
    "Float64": Number("double", "float64"),
    "Float32": Number("float", "float32"),
    **{f"Int{bits}": _integer(bits) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": _integer(bits, signed=False) for bits in (8, 16, 32, 64)},
}


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
    count: int = 0
    number: Number = NUMBERS["Float64"]
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
