"""Conversions between float64, in which the loop computes, and the number types of FMI.

A value that the other type cannot hold exactly is reported, by status -1 - i for value i, and
never rounded: a fraction or a number outside the range of an integer type, an integer above
2^53 for a float64. A float64 is rounded to a Float32, as the type implies; infinity is
reported.
"""

from __future__ import annotations

from dataclasses import dataclass

from .numbers import Number
from .operations import NOT_FINITE, Address, Operation
from .writer import Writer, number

_LOOP = """
define internal i64 @{name}(ptr %x, ptr %y, i64 %n) {{
entry:
  br label %loop
loop:
  %i = phi i64 [ 0, %entry ], [ %next, %fits ]
  %go = icmp slt i64 %i, %n
  br i1 %go, label %body, label %end
body:
  %p = getelementptr {source}, ptr %x, i64 %i
  %q = getelementptr {target}, ptr %y, i64 %i
  %v = load {source}, ptr %p
{check}
  %next = add i64 %i, 1
  br i1 %fit, label %fits, label %bad
fits:
  %converted = {convert}
  store {target} %converted, ptr %q
  br label %loop
bad:
  %status = xor i64 %i, -1
  ret i64 %status
end:
  ret i64 0
}}
"""


@dataclass(frozen=True, kw_only=True)
class _Conversion(Operation):
    """Convert `count` numbers from source to target."""

    source: Address
    target: Address
    count: int
    number: Number

    def function(self) -> tuple[str, str]:
        """Return name and text of the function that converts an array."""
        raise NotImplementedError

    def emit(self, w: Writer) -> None:
        name, text = self.function()
        source, target = w.address("source"), w.address("target")
        w.check(w.call_library(name, text, f"ptr {source}, ptr {target}, i64 {self.count}"))


class ToFloat(_Conversion):
    """From values of type `number` to floats."""

    def function(self) -> tuple[str, str]:
        kind = self.number
        if kind.is_float:
            check = f"  %zero = fsub {kind.llvm} %v, %v\n  %fit = fcmp oeq {kind.llvm} %zero, 0.0"
            convert = f"fpext {kind.llvm} %v to double"
        else:
            check = "  %fit = icmp eq i64 0, 0"
            if kind.llvm == "i64":
                low = 2**53 if kind.low else 0  # added so that the smallest value that fits becomes 0
                check = f"  %shifted = add i64 %v, {low}\n  %fit = icmp ule i64 %shifted, {2**53 + low}"
            convert = f"{'sitofp' if kind.low else 'uitofp'} {kind.llvm} %v to double"
        name = f"{kind.name}_to_float"
        text = _LOOP.format(name=name, source=kind.llvm, target="double", check=check, convert=convert)
        return name, text

    def checked(self) -> Address:
        return self.target

    def fault(self) -> tuple[str, str]:
        """Return the fault of a value that a float cannot hold, and the remedy."""
        if self.number.is_float:
            return NOT_FINITE
        return "is above 2^53, which a float does not hold", "do not connect or record it"


class FromFloat(_Conversion):
    """From floats to values of type `number`."""

    def function(self) -> tuple[str, str]:
        kind = self.number
        if kind.is_float:
            lines = [
                f"%narrow = fptrunc double %v to {kind.llvm}",
                f"%zero = fsub {kind.llvm} %narrow, %narrow",
                f"%fit = fcmp oeq {kind.llvm} %zero, 0.0",
            ]
            convert = f"fptrunc double %v to {kind.llvm}"
        else:
            lines = [
                "%rounded = call double @llvm.rint.f64(double %v)",
                "%whole = fcmp oeq double %rounded, %v",
                f"%above = fcmp oge double %v, {number(float(kind.low))}",
                f"%below = fcmp olt double %v, {number(float(kind.high + 1))}",
                "%range = and i1 %above, %below",
                "%fit = and i1 %whole, %range",
            ]
            convert = f"{'fptosi' if kind.low else 'fptoui'} double %rounded to {kind.llvm}"
        name = f"float_to_{kind.name}"
        check = "\n".join(f"  {line}" for line in lines)
        text = _LOOP.format(name=name, source="double", target=kind.llvm, check=check, convert=convert)
        return name, text

    def checked(self) -> Address:
        return self.source

    def fault(self) -> tuple[str, str]:
        """Return the fault of a float that the type cannot hold, and the remedy."""
        return f"is not {self.number.values}", "round or limit its source in a block"
