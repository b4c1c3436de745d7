"""The loop: one generic compiled program that runs every system.

A system is a table of operations (program.py). Each row has nine integers and five
floats:

    opcode, function, a, b, c, d, n, every, index | w0, w1, w2, w3, fraction

`function` and a to d are addresses, `every` is the rate, `fraction` places the
operation at t = t0 + (k + fraction) h. Rows [0, first) run at t_k, rows [first, rows)
carry the system from t_k to t_{k+1} and are left out at the last point.

This module needs Numba and is imported only when the loop has to be compiled.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .opcodes import (
    CALL,
    COMBINE,
    COPY,
    FMI2_COMPLETED,
    FMI2_DO_STEP,
    FMI2_TIME,
    FMI2_VALUES,
    FMI2_VECTOR,
    FMI3_DO_STEP,
    FMI3_VALUES,
    GATHER,
    INTEGERS,
    RECORD,
    STATISTICS,
    TO_FLOAT,
    TO_INT,
    WEIGHTS,
)

_NUMBA: dict[str, Any] = {"i4": types.int32, "i8": types.int64, "f8": types.float64}
_LLVM = {"i4": ir.IntType(32), "i8": ir.IntType(64), "f8": ir.DoubleType()}


def _caller(*kinds: str) -> Any:
    """Return a function that calls the C function `i32 f(kinds...)` at an address."""

    @intrinsic
    def call(typing_context: Any, address: Any, values: Any) -> Any:
        arguments = types.Tuple([_NUMBA[k] for k in kinds])  # type: ignore[no-untyped-call]
        signature = types.int32(types.int64, arguments)

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            function = ir.FunctionType(_LLVM["i4"], [_LLVM[k] for k in kinds])
            pointer = builder.inttoptr(values[0], function.as_pointer())
            return builder.call(pointer, [builder.extract_value(values[1], i) for i in range(len(kinds))])

        return signature, generate

    return call


def _loader(kind: str) -> Any:
    @intrinsic
    def load(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.load(builder.inttoptr(values[0], _LLVM[kind].as_pointer()))

        return _NUMBA[kind](types.int64), generate

    return load


def _storer(kind: str) -> Any:
    @intrinsic
    def store(typing_context: Any, address: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            builder.store(values[1], builder.inttoptr(values[0], _LLVM[kind].as_pointer()))
            return context.get_dummy_value()

        return types.void(types.int64, _NUMBA[kind]), generate

    return store


call_kernel = _caller("i8", "f8", "f8")  # status = kernel(record, t, h)
call_do_step = _caller("i8", "f8", "f8", "i4")  # fmi2DoStep(c, t, h, noSetFMUStatePriorToCurrentPoint)
call_values = _caller("i8", "i8", "i8", "i8")  # fmi2GetReal(c, vr, n, values) and the like
call_time = _caller("i8", "f8")  # fmi2SetTime(c, t), fmi3SetTime
call_vector = _caller("i8", "i8", "i8")  # fmi2SetContinuousStates(c, x, n) and the like
call_completed = _caller("i8", "i4", "i8", "i8")  # fmi2CompletedIntegratorStep(c, noSet, *enter, *terminate)
call_values3 = _caller("i8", "i8", "i8", "i8", "i8")  # fmi3GetFloat64(c, vr, n, values, nValues)
call_do_step3 = _caller("i8", "f8", "f8", "i4", "i8", "i8", "i8", "i8")  # fmi3DoStep
EXPONENT = 0x7FF0000000000000  # of a float64: all ones in NaN and infinity only
load_i4, load_i8, load_f8 = _loader("i4"), _loader("i8"), _loader("f8")
store_i4, store_i8, store_f8 = _storer("i4"), _storer("i8"), _storer("f8")


def nonfinite(address: int, n: int) -> int:
    """Return 1 + the index of the first NaN or infinity of n floats, or 0."""
    for i in range(n):
        if load_i8(address + 8 * i) & EXPONENT == EXPONENT:
            return i + 1
    return 0


def fmi_status(status: int) -> int:
    """Return 0 for OK and Warning, otherwise the status: 2 Discard, 3 Error, 4 Fatal."""
    return 0 if status <= 1 else status


def run(
    table: int,
    weights: int,
    first: int,
    rows: int,
    k0: int,
    k1: int,
    last: int,
    t0: float,
    h: float,
    report: int,
) -> int:
    """Run the points k0 <= k < k1 of a system whose last point is `last`.

    report (5,) int64: row and k where it stopped, status there, recorded rows, sampled
    points. Returns 0, or 1 when an operation failed (status: what the function
    returned, or -1 - i when value i is not finite).
    """
    for k in range(k0, k1):
        count = rows if k < last else first
        for row in range(count):
            op = table + 8 * INTEGERS * row
            every = load_i8(op + 56)
            if every != 1 and k % every != 0:
                continue
            code = load_i8(op)
            function, a, b, c = load_i8(op + 8), load_i8(op + 16), load_i8(op + 24), load_i8(op + 32)
            n = load_i8(op + 48)
            w = weights + 8 * WEIGHTS * row
            status = 0
            if code == GATHER:
                for i in range(n):
                    store_f8(load_i8(a + 16 * i + 8), load_f8(load_i8(a + 16 * i)))
            elif code == COPY:
                scale, offset = load_f8(w), load_f8(w + 8)
                if scale == 1.0 and offset == 0.0:
                    for i in range(n):
                        store_f8(b + 8 * i, load_f8(a + 8 * i))
                else:
                    for i in range(n):
                        store_f8(b + 8 * i, load_f8(a + 8 * i) * scale + offset)
            elif code == CALL:
                # a block that acts at every so many points has a step of its own
                status = call_kernel(function, (a, t0 + (k + load_f8(w + 32)) * h, h * every))
                if status == 0 and n > 0:
                    status = -nonfinite(b, n)
            elif code == FMI2_VALUES:
                status = fmi_status(call_values(function, (a, b, n, c)))
                d = load_i8(op + 40)
                if status == 0 and d > 0:
                    status = -nonfinite(c, n)
            elif code == FMI2_DO_STEP:
                status = fmi_status(call_do_step(function, (a, t0 + (k + load_f8(w + 32)) * h, h, 1)))
            elif code == RECORD:
                recorded = load_i8(report + 24)
                for i in range(n):
                    store_f8(b + 8 * (recorded * n + i), load_f8(load_i8(a + 8 * i)))
                store_i8(report + 24, recorded + 1)
            elif code == STATISTICS:
                for i in range(n):
                    x = load_f8(load_i8(a + 8 * i))
                    s = b + 32 * i
                    store_f8(s, min(load_f8(s), x))
                    store_f8(s + 8, max(load_f8(s + 8), x))
                    store_f8(s + 16, load_f8(s + 16) + x)
                    store_f8(s + 24, load_f8(s + 24) + x * x)
                store_i8(report + 32, load_i8(report + 32) + 1)
            elif code == COMBINE:
                w0, w1, w2, w3 = load_f8(w), load_f8(w + 8), load_f8(w + 16), load_f8(w + 24)
                for i in range(n):
                    slope = w0 * load_f8(b + 8 * i)
                    if w1 != 0.0:
                        slope += w1 * load_f8(b + 8 * (n + i))
                    if w2 != 0.0:
                        slope += w2 * load_f8(b + 8 * (2 * n + i))
                    if w3 != 0.0:
                        slope += w3 * load_f8(b + 8 * (3 * n + i))
                    store_f8(c + 8 * i, load_f8(a + 8 * i) + h * slope)
                status = -nonfinite(c, n)
            elif code == FMI2_TIME:
                status = fmi_status(call_time(function, (a, t0 + (k + load_f8(w + 32)) * h)))
            elif code == FMI2_VECTOR:
                status = fmi_status(call_vector(function, (a, b, n)))
            elif code == FMI2_COMPLETED:
                status = fmi_status(call_completed(function, (a, 1, b, b + 4)))
                t = t0 + (k + load_f8(w + 32)) * h
                due = t + 1e-9 * h >= load_f8(load_i8(op + 40))
                if status == 0 and (due or load_i4(b) + load_i4(b + 4) != 0):
                    status = call_kernel(c, (0, t, h))
            elif code == FMI3_VALUES:
                status = fmi_status(call_values3(function, (a, b, n, c, load_i8(op + 40))))
            elif code == FMI3_DO_STEP:
                t = t0 + (k + load_f8(w + 32)) * h
                status = fmi_status(call_do_step3(function, (a, t, h, 1, b, b + 4, b + 8, b + 16)))
            elif code == TO_FLOAT:
                for i in range(n):
                    store_f8(b + 8 * i, load_i4(a + 4 * i) * 1.0)
            elif code == TO_INT:
                for i in range(n):
                    value = load_f8(a + 8 * i)
                    rounded = round(value)
                    if rounded != value:
                        status = -1 - i
                    store_i4(b + 4 * i, types.int32(rounded))
            if status != 0:
                store_i8(report, row)
                store_i8(report + 8, k)
                store_i8(report + 16, status)
                return 1
    return 0
