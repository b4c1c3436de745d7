"""The differences between FMI 2.0 and 3.0 as a table: names, types and operations of the loop.

The differences in the order of calls are in instance/fmi2.py and instance/fmi3.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..loop.fmi_operations import FMI2Values, FMI3Values
from ..loop.numbers import NUMBERS, Number


@dataclass(frozen=True)
class Version:
    """A version of FMI.

    prefix
        the beginning of the function names, which is also the name of FMPy's module
    numbers
        by numeric type: its part of the function names (fmi2GetReal, fmi3GetFloat64), and its
        representation in memory
    get_derivatives
        the name, without prefix, of the function that gets the derivatives of the states
    update_discrete_states
        FMPy's name of the function that updates the discrete states
    values
        the operation of the loop that gets and sets values
    flag
        NumPy's name of the type of flags that functions return
    """

    prefix: str
    numbers: Mapping[str, tuple[str, Number]]
    get_derivatives: str
    update_discrete_states: str
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
    get_derivatives="GetDerivatives",
    update_discrete_states="newDiscreteStates",
    values=FMI2Values,
    flag="int32",
)

FMI3 = Version(
    prefix="fmi3",
    numbers={
        **{name: (name, number) for name, number in NUMBERS.items()},
        "Enumeration": ("Int64", NUMBERS["Int64"]),
        "Boolean": ("Boolean", Number("i8", "uint8", 0, 1)),
        "Clock": ("Clock", NUMBERS["Float64"]),  # of its port; its start value is an interval
    },
    get_derivatives="GetContinuousStateDerivatives",
    update_discrete_states="updateDiscreteStates",
    values=FMI3Values,
    flag="uint8",
)


def version_of(description: object) -> Version:
    """Return the version of FMPy's model description."""
    return FMI2 if getattr(description, "fmiVersion", "").startswith("2") else FMI3
