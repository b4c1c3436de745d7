"""The number types of FMI in memory."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Number:
    """A number type: its names in LLVM and NumPy, and the range of whole numbers that it holds."""

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
        """Tell whether the type holds fractions."""
        return self.high == 0

    @property
    def values(self) -> str:
        """Return the values that the type holds, for an error message."""
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
