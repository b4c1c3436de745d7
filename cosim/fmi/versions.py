"""FMI 2.0 and 3.0 side by side: names, types and operations of the loop in which they differ.

The calls that they order differently are in instance/fmi2.py and instance/fmi3.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..loop.fmi_operations import FMI2Values, FMI3Values
from ..loop.numbers import NUMBERS, Number


@dataclass(frozen=True)
class Version:
    """A version of FMI.

    numbers
        of every numeric type the part of the function name (fmi2GetReal, fmi3GetFloat64), and its
        representation in memory
    values
        the operation of the loop that gets and sets values
    flag
        NumPy's name of the type of flags that functions return
    """

    prefix: str
    numbers: Mapping[str, tuple[str, Number]]
    get_derivatives: str
    values: type[FMI2Values]
    flag: str

    @property
    def platform(self) -> str:
        """The folder of this machine's binary."""
        import fmpy

        return str(fmpy.platform if self is FMI2 else fmpy.platform_tuple)


FMI2 = Version(
    prefix="fmi2",
    numbers={
        "Real": ("Real", NUMBERS["Float64"]),
        "Integer": ("Integer", NUMBERS["Int32"]),
        "Enumeration": ("Integer", NUMBERS["Int32"]),
        "Boolean": ("Boolean", Number("i32", "int32", 0, 1)),
    },
    get_derivatives="fmi2GetDerivatives",
    values=FMI2Values,
    flag="int32",
)

FMI3 = Version(
    prefix="fmi3",
    numbers={
        **{name: (name, number) for name, number in NUMBERS.items()},
        "Enumeration": ("Int64", NUMBERS["Int64"]),
        "Boolean": ("Boolean", Number("i8", "uint8", 0, 1)),
        "Clock": ("Clock", NUMBERS["Float64"]),  # as a port; its start value is an interval
    },
    get_derivatives="fmi3GetContinuousStateDerivatives",
    values=FMI3Values,
    flag="uint8",
)


def version_of(description: object) -> Version:
    """Return the version of FMPy's model description."""
    return FMI2 if getattr(description, "fmiVersion", "").startswith("2") else FMI3
