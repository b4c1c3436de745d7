"""Between float64, which the loop computes with, and the number types of FMI, as LLVM IR.

A value that the other side does not hold exactly is never rounded but reported, by -1 - i
for value i: a fraction or a number outside the range for an integer, an integer above
2^53 for a float64. To a Float32 a float64 is rounded, as the type says; infinity is reported.
"""

from __future__ import annotations

import struct

from .operations import Number

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


def number(x: float) -> str:
    """Return a float as LLVM reads it exactly."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', x))[0]:016X}"


def to_float(kind: Number) -> tuple[str, str]:
    """Return name and text of the function from `kind` to float64."""
    if kind.is_float:
        check = f"  %zero = fsub {kind.llvm} %v, %v\n  %fit = fcmp oeq {kind.llvm} %zero, 0.0"
        convert = f"fpext {kind.llvm} %v to double"
    else:
        check = "  %fit = icmp eq i64 0, 0"
        if kind.llvm == "i64":
            low = 2**53 if kind.low else 0  # what has to be added for the least one to be 0
            check = f"  %shifted = add i64 %v, {low}\n  %fit = icmp ule i64 %shifted, {2**53 + low}"
        convert = f"{'sitofp' if kind.low else 'uitofp'} {kind.llvm} %v to double"
    name = f"{kind.name}_to_float"
    return name, _LOOP.format(name=name, source=kind.llvm, target="double", check=check, convert=convert)


def from_float(kind: Number) -> tuple[str, str]:
    """Return name and text of the function from float64 to `kind`."""
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
    return name, _LOOP.format(name=name, source="double", target=kind.llvm, check=check, convert=convert)
