"""The loop: a system's operations (opcodes.py) as one native function, written in LLVM IR.

The loop of a run is straight-line code, an operation after the other; what differs from
run to run, the addresses, comes from a table of five words a row (function, a, b, c, d).
So systems of one shape share one text, which is compiled once a process, in hundredths
of a second and without Numba.

    i32 run(ptr table, i64 k0, i64 k1, i64 last, double t0, double h, ptr report, i64 resume, ptr stop)

runs the points k0 <= k < k1 of a system whose last point is `last`: at every point the
first operations, at every point but the last the second ones as well, which carry the
system to the next. With `resume` the first ones have run at k0 already, as at the end of
the run that is resumed. When a callback has set `stop`, the point that comes next is the
last one. An operation with `fraction` c runs at t = t0 + (k + c) h.

report: five int64, row and k where it stopped, status there, recorded rows, sampled
points. It returns 0, or 1 when an operation failed; then the status is what the function
returned, or -1 - i when value i is not finite.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from ..codegen.kernels import load
from ..core.variables import Array
from . import conversions
from . import operations as opcodes
from .conversions import number
from .operations import SLACK, Op

_MAY_RETURN = "0"  # noSetFMUStatePriorToCurrentPoint: a simulation may return to a snapshot
INLINE_PAIRS = 64  # of copies between connected ports; the compiler takes a minute for 20,000 of them
INLINE = 8  # up to so many floats an operation is written out, above it is a loop

_LIBRARY = """
declare double @llvm.rint.f64(double)
declare void @llvm.memmove.p0.p0.i64(ptr, ptr, i64, i1)

; 1 + the index of the first NaN or infinity of n floats at x, or 0
define internal i64 @nonfinite(ptr %x, i64 %n) {
entry:
  br label %loop
loop:
  %i = phi i64 [ 0, %entry ], [ %next, %more ]
  %go = icmp slt i64 %i, %n
  br i1 %go, label %look, label %fine
look:
  %p = getelementptr i64, ptr %x, i64 %i
  %bits = load i64, ptr %p
  %exponent = and i64 %bits, 9218868437227405312
  %bad = icmp eq i64 %exponent, 9218868437227405312
  %next = add i64 %i, 1
  br i1 %bad, label %found, label %more
more:
  br label %loop
found:
  ret i64 %next
fine:
  ret i64 0
}
"""

_HEAD = """
define i32 @run(ptr %table, i64 %k0, i64 %k1, i64 %last, double %t0, double %h,
                 ptr %report, i64 %resume, ptr %stop) {
entry:
  %resumes = icmp ne i64 %resume, 0
  %reached = getelementptr i64, ptr %report, i64 1
  %recorded = getelementptr i64, ptr %report, i64 3
  %sampled = getelementptr i64, ptr %report, i64 4
  br label %point
point:
  %k = phi i64 [ %k0, %entry ], [ %knext, %nextpoint ]
  %go = icmp slt i64 %k, %k1
  br i1 %go, label %begin, label %past
begin:
  %kf = sitofp i64 %k to double
  %start = icmp eq i64 %k, %k0
  %skip = and i1 %start, %resumes
  br i1 %skip, label %carry, label %act
act:
"""


class _Writer:
    """Writes the operations of one system; `failures` are the ways into the block that reports."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.count = 0
        self.row = 0
        self.block = "act"
        self.failures: list[tuple[str, int, str]] = []
        self.library: dict[str, str] = {}
        #: where what stands between UNLESS_EVENT and END goes on
        self.ends: list[str] = []

    def value(self, expression: str) -> str:
        """Write `%n = expression` and return %n."""
        self.count += 1
        self.lines.append(f"  %v{self.count} = {expression}")
        return f"%v{self.count}"

    def start_block(self, name: str) -> None:
        """Begin a block; the one before must have ended with a branch."""
        self.lines.append(f"{name}:")
        self.block = name

    def label(self) -> str:
        """Return a new block name."""
        self.count += 1
        return f"b{self.count}"

    def word(self, index: int) -> str:
        """Load an operand of the current row: 0 function, 1 a, 2 b, 3 c, 4 d; as a pointer."""
        place = self.value(f"getelementptr i64, ptr %table, i64 {5 * self.row + index}")
        return self.value(f"load ptr, ptr {place}")

    def at(self, base: str, i: int | str, stride: int = 1, offset: int = 0) -> str:
        """Return the address of float `stride i + offset` at a pointer; i is a number or a value."""
        if isinstance(i, int):
            index = str(stride * i + offset)
        else:
            index = i if stride == 1 else self.value(f"mul i64 {i}, {stride}")
            index = index if offset == 0 else self.value(f"add i64 {index}, {offset}")
        return base if index == "0" else self.value(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, address: str, kind: str = "double") -> str:
        """Load a float, or a value of another kind."""
        return self.value(f"load {kind}, ptr {address}")

    def store(self, value: str, address: str) -> None:
        """Store a float."""
        self.lines.append(f"  store double {value}, ptr {address}")

    def each(self, n: int, body: Callable[[int | str], None], inline: int = INLINE) -> None:
        """Write body(i) for i = 0 .. n - 1: one after the other, or as a loop when they are many."""
        if n <= inline:
            for element in range(n):
                body(element)
            return
        before, loop, inside, end = self.block, self.label(), self.label(), self.label()
        self.count += 1
        i, following = f"%i{self.count}", f"%j{self.count}"
        self.lines.append(f"  br label %{loop}")
        self.start_block(loop)
        self.lines.append(f"  {i} = phi i64 [ 0, %{before} ], [ {following}, %{inside} ]")
        go = self.value(f"icmp slt i64 {i}, {n}")
        self.lines.append(f"  br i1 {go}, label %{inside}, label %{end}")
        self.start_block(inside)
        body(i)
        self.lines.append(f"  {following} = add i64 {i}, 1\n  br label %{loop}")
        self.start_block(end)

    def count_up(self, place: str) -> str:
        """Add 1 to a counter; return what it was."""
        before = self.load(place, "i64")
        self.lines.append(f"  store i64 {self.value(f'add i64 {before}, 1')}, ptr {place}")
        return before

    def time(self, fraction: float) -> str:
        """Return t0 + (k + fraction) h."""
        k = "%kf" if fraction == 0.0 else self.value(f"fadd double %kf, {number(fraction)}")
        return self.value(f"fadd double %t0, {self.value(f'fmul double {k}, %h')}")

    def step(self, op: Op) -> str:
        """Return the step: a block that acts at every so many points has one of its own."""
        return "%h" if op.every == 1 else self.value(f"fmul double %h, {number(float(op.every))}")

    def convert(self, function: tuple[str, str], op: Op) -> None:
        """Call a conversion from a to b, of which the name and the text are given."""
        name, text = function
        if self.library.setdefault(name, text) != text:
            raise AssertionError(f"internal error: two functions of the loop are named {name}")
        self.check(self.value(f"call i64 @{name}(ptr {self.word(1)}, ptr {self.word(2)}, i64 {op.n})"))

    def check(self, status: str) -> None:
        """Go on if the i64 status is 0, report it otherwise."""
        good, on = self.value(f"icmp eq i64 {status}, 0"), self.label()
        self.lines.append(f"  br i1 {good}, label %{on}, label %failed")
        self.failures.append((self.block, self.row, status))
        self.start_block(on)

    def check_fmi(self, status: str) -> None:
        """Go on after OK and Warning."""
        bad = self.value(f"icmp sgt i32 {status}, 1")
        self.check(self.value(f"sext i32 {self.value(f'select i1 {bad}, i32 {status}, i32 0')} to i64"))

    def check_finite(self, address: str, n: int) -> None:
        """Report the first of n floats that is not finite; look closer only if there is one."""
        if n == 0:
            return
        on, slow = self.label(), self.label()
        if n <= INLINE:
            any_bad = ""
            for i in range(n):
                bits = self.value(f"load i64, ptr {self.at(address, i)}")
                exponent = self.value(f"and i64 {bits}, {0x7FF0000000000000}")
                bad = self.value(f"icmp eq i64 {exponent}, {0x7FF0000000000000}")
                any_bad = self.value(f"or i1 {any_bad}, {bad}") if any_bad else bad
            self.lines.append(f"  br i1 {any_bad}, label %{slow}, label %{on}")
            self.start_block(slow)
        found = self.value(f"call i64 @nonfinite(ptr {address}, i64 {n})")
        self.check(self.value(f"sub i64 0, {found}"))
        if n <= INLINE:
            self.lines.append(f"  br label %{on}")
            self.start_block(on)

    def call(self, kinds: str, *arguments: str) -> str:
        """Call the row's function with typed arguments; return its i32 status."""
        function = self.word(0)
        typed = ", ".join(f"{kind} {a}" for kind, a in zip(kinds.split(), arguments, strict=True))
        return self.value(f"call i32 {function}({typed})")

    def call_back(self, word: int, t: str, h: str) -> None:
        """Call the callback in an operand of the row, with t and h; go on if it did not fail."""
        self.check_status(self.value(f"call i32 {self.word(word)}(ptr null, double {t}, double {h})"))

    def check_status(self, status: str) -> None:
        """Go on if the i32 status of a kernel or callback is 0."""
        self.check(self.value(f"sext i32 {status} to i64"))


# ------------------------------------------------------------------------------ operations


def _copy(w: _Writer, op: Op) -> None:
    scale, offset = op.weights or (1.0, 0.0)
    a, b = w.word(1), w.word(2)

    def one(i: int | str) -> None:
        x = w.load(w.at(a, i))
        if (scale, offset) != (1.0, 0.0):
            x = w.value(f"fadd double {w.value(f'fmul double {x}, {number(scale)}')}, {number(offset)}")
        w.store(x, w.at(b, i))

    if op.n > INLINE and (scale, offset) == (1.0, 0.0):
        w.lines.append(f"  call void @llvm.memmove.p0.p0.i64(ptr {b}, ptr {a}, i64 {8 * op.n}, i1 false)")
    else:
        w.each(op.n, one)


def _call(w: _Writer, op: Op) -> None:
    status = w.call("ptr double double", w.word(1), w.time(op.fraction), w.step(op))
    w.check_status(status)
    w.check_finite(w.word(2), op.n)


def _record(w: _Writer, op: Op) -> None:
    offset = w.value(f"mul i64 {w.count_up('%recorded')}, {op.n}")
    addresses, row = w.word(1), w.value(f"getelementptr double, ptr {w.word(2)}, i64 {offset}")
    w.each(op.n, lambda i: w.store(w.load(w.load(w.at(addresses, i), "ptr")), w.at(row, i)))


def _statistics(w: _Writer, op: Op) -> None:
    addresses, kept = w.word(1), w.word(2)

    def one(i: int | str) -> None:
        x = w.load(w.load(w.at(addresses, i), "ptr"))
        for j, better in enumerate(("olt", "ogt")):
            place = w.at(kept, i, 4, j)
            old = w.load(place)
            beats = w.value(f"fcmp {better} double {x}, {old}")
            w.store(w.value(f"select i1 {beats}, double {x}, double {old}"), place)
        for j, term in ((2, x), (3, w.value(f"fmul double {x}, {x}"))):
            place = w.at(kept, i, 4, j)
            w.store(w.value(f"fadd double {w.load(place)}, {term}"), place)

    w.each(op.n, one)
    w.count_up("%sampled")


def _combine(w: _Writer, op: Op) -> None:
    """c = a + h sum_i w_i b_i; weights of 0 are left out."""
    a, b, c = w.word(1), w.word(2), w.word(3)

    def one(i: int | str) -> None:
        slope = ""
        for stage, weight in enumerate(op.weights):
            if weight != 0.0:
                term = w.value(f"fmul double {w.load(w.at(b, i, offset=stage * op.n))}, {number(weight)}")
                slope = w.value(f"fadd double {slope}, {term}") if slope else term
        start = w.load(w.at(a, i))
        step = w.value(f"fmul double %h, {slope}") if slope else ""
        w.store(w.value(f"fadd double {start}, {step}") if slope else start, w.at(c, i))

    w.each(op.n, one)
    w.check_finite(c, op.n)


def _to_float(w: _Writer, op: Op) -> None:
    w.convert(conversions.to_float(op.number), op)


def _from_float(w: _Writer, op: Op) -> None:
    w.convert(conversions.from_float(op.number), op)


def _gather(w: _Writer, op: Op) -> None:
    pairs = w.word(1)

    def one(i: int | str) -> None:
        source, target = (w.load(w.at(pairs, i, 2, j), "ptr") for j in (0, 1))
        w.store(w.load(source), target)

    w.each(op.n, one, inline=INLINE_PAIRS)


def _fmi_values(w: _Writer, op: Op) -> None:
    values = w.word(3)
    if op.code == opcodes.FMI2_VALUES:
        status = w.call("ptr ptr i64 ptr", w.word(1), w.word(2), str(op.n), values)
    else:
        status = w.call("ptr ptr i64 ptr i64", w.word(1), w.word(2), str(op.n), values, str(op.count))
    w.check_fmi(status)
    w.check_finite(values, op.count if op.d else 0)


def _fmi2_do_step(w: _Writer, op: Op) -> None:
    t, h = w.time(op.fraction), w.step(op)
    status = w.call("ptr double double i32", w.word(1), t, h, _MAY_RETURN)
    discarded, judged, on = (w.label() for _ in range(3))
    w.lines.append(f"  br i1 {w.value(f'icmp eq i32 {status}, 2')}, label %{discarded}, label %{judged}")
    w.start_block(discarded)
    w.call_back(4, t, h)
    w.lines.append(f"  br label %{on}")
    w.start_block(judged)
    w.check_fmi(status)
    w.lines.append(f"  br label %{on}")
    w.start_block(on)


def _fmi3_do_step(w: _Writer, op: Op) -> None:
    flags, times = w.word(2), w.word(3)
    event, terminate, early = (w.value(f"getelementptr i8, ptr {flags}, i64 {i}") for i in range(3))
    t, h = w.time(op.fraction), w.step(op)
    end = w.value(f"fadd double {t}, {w.value(f'fmul double {h}, {number(1.0 + SLACK)}')}")
    due = w.value(f"fcmp ole double {w.load(w.at(times, 1))}, {end}")
    split, whole, interrupted, on = (w.label() for _ in range(4))
    w.lines.append(f"  br i1 {due}, label %{split}, label %{whole}")
    w.start_block(split)  # as if the step had come back at once
    w.lines.append(f"  store i8 0, ptr {event}\n  store i8 1, ptr {early}")
    w.store(t, times)
    w.lines.append(f"  br label %{interrupted}")
    w.start_block(whole)
    kinds = "ptr double double i32 ptr ptr ptr ptr"
    w.check_fmi(w.call(kinds, w.word(1), t, h, _MAY_RETURN, event, terminate, early, times))
    either = w.value(f"or i8 {w.load(event, 'i8')}, {w.load(early, 'i8')}")
    any_flag = w.value(f"or i8 {either}, {w.load(terminate, 'i8')}")
    asked = w.value(f"icmp ne i8 {any_flag}, 0")
    w.lines.append(f"  br i1 {asked}, label %{interrupted}, label %{on}")
    w.start_block(interrupted)
    w.call_back(4, t, h)
    w.lines.append(f"  br label %{on}")
    w.start_block(on)


def _fmi_time(w: _Writer, op: Op) -> None:
    w.check_fmi(w.call("ptr double", w.word(1), w.time(op.fraction)))


def _fmi_vector(w: _Writer, op: Op) -> None:
    w.check_fmi(w.call("ptr ptr i64", w.word(1), w.word(2), str(op.n)))


def _fmi_completed(w: _Writer, op: Op) -> None:
    boolean = "i32" if op.code == opcodes.FMI2_COMPLETED else "i8"
    flags = w.word(2)
    second = w.value(f"getelementptr {boolean}, ptr {flags}, i64 1")
    w.check_fmi(w.call("ptr i32 ptr ptr", w.word(1), _MAY_RETURN, flags, second))
    t = w.time(op.fraction)
    almost = w.value(f"fadd double {t}, {w.value(f'fmul double %h, {number(SLACK)}')}")
    due = w.value(f"fcmp oge double {almost}, {w.value(f'load double, ptr {w.word(4)}')}")
    either = w.value(
        f"or {boolean} {w.value(f'load {boolean}, ptr {flags}')}, {w.value(f'load {boolean}, ptr {second}')}"
    )
    asked = w.value(f"icmp ne {boolean} {either}, 0")
    handle, on = w.label(), w.label()
    w.lines.append(f"  br i1 {w.value(f'or i1 {due}, {asked}')}, label %{handle}, label %{on}")
    w.start_block(handle)
    w.call_back(3, t, "%h")
    w.lines.append(f"  br label %{on}")
    w.start_block(on)


def _unless_event(w: _Writer, op: Op) -> None:
    end = w.value(f"fsub double {w.time(1.0)}, {w.value(f'fmul double %h, {number(SLACK)}')}")
    due = w.value(f"fcmp olt double {w.value(f'load double, ptr {w.word(4)}')}, {end}")
    inside, split, on = w.label(), w.label(), w.label()
    w.lines.append(f"  br i1 {due}, label %{split}, label %{inside}")
    w.start_block(split)
    w.call_back(3, w.time(0.0), "%h")
    w.lines.append(f"  br label %{on}")
    w.start_block(inside)
    w.ends.append(on)


def _end(w: _Writer, op: Op) -> None:
    on = w.ends.pop()
    w.lines.append(f"  br label %{on}")
    w.start_block(on)


_WRITE: dict[int, Callable[[_Writer, Op], None]] = {
    opcodes.COPY: _copy,
    opcodes.CALL: _call,
    opcodes.RECORD: _record,
    opcodes.STATISTICS: _statistics,
    opcodes.COMBINE: _combine,
    opcodes.TO_FLOAT: _to_float,
    opcodes.FROM_FLOAT: _from_float,
    opcodes.GATHER: _gather,
    opcodes.FMI2_VALUES: _fmi_values,
    opcodes.FMI3_VALUES: _fmi_values,
    opcodes.FMI2_DO_STEP: _fmi2_do_step,
    opcodes.FMI3_DO_STEP: _fmi3_do_step,
    opcodes.FMI_TIME: _fmi_time,
    opcodes.FMI_VECTOR: _fmi_vector,
    opcodes.FMI2_COMPLETED: _fmi_completed,
    opcodes.FMI3_COMPLETED: _fmi_completed,
    opcodes.UNLESS_EVENT: _unless_event,
    opcodes.END: _end,
}


class Loop:
    """The operations of a system, ready to run.

    report
        row and k where it stopped, status there, recorded rows, sampled points
    stop
        (1,) set by a callback when the next point is to be the last
    """

    def __init__(self, first: list[Op], second: list[Op], stop: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        self.rows = [*first, *second]
        self.report = np.zeros(5, dtype=np.int64)
        self.stop = stop
        self._table = np.array([op.operands() for op in self.rows], dtype=np.int64)
        integer, real, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
        kinds = (pointer, integer, integer, integer, real, real, pointer, integer, pointer)
        self._places = [int(array.ctypes.data) for array in (self._table, self.report, self.stop)]
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(load(loop_ir(first, second))("run"))

    def record_to(self, data: Array) -> None:
        """Set where recorded rows go."""
        for row, op in enumerate(self.rows):
            if op.code == opcodes.RECORD:
                self._table[row, 2] = data.ctypes.data

    def run(self, k: int, until: int, last: int, t0: float, h: float, resume: bool = False) -> bool:
        """Run the points k to until - 1; tell whether an operation failed."""
        table, report, stop = self._places
        return bool(self._function(table, k, until, last, t0, h, report, resume, stop))


def loop_ir(first: list[Op], second: list[Op]) -> str:
    """Return the loop of a system as LLVM IR; the text is the same for systems of one shape."""
    w = _Writer()
    for op in first:
        _operation(w, op)
    w.lines.append("  %stopped = load i64, ptr %stop\n  %runs = icmp eq i64 %stopped, 0")
    w.lines.append("  %before = icmp slt i64 %k, %last\n  %more = and i1 %before, %runs")
    w.lines.append("  br i1 %more, label %carry, label %done")
    w.start_block("carry")
    for op in second:
        _operation(w, op)
    w.lines.append("  br label %nextpoint\nnextpoint:\n  %knext = add i64 %k, 1\n  br label %point")
    w.lines.append("past:\n  br label %done")
    w.lines.append("done:\n  store i64 %k, ptr %reached\n  ret i32 0")
    if w.failures:
        rows = ", ".join(f"[ {row}, %{block} ]" for block, row, _ in w.failures)
        statuses = ", ".join(f"[ {status}, %{block} ]" for block, _, status in w.failures)
        w.lines += ["failed:", f"  %row = phi i64 {rows}", f"  %status = phi i64 {statuses}"]
        w.lines.append("  store i64 %row, ptr %report")
        for place, name in ((1, "%k"), (2, "%status")):
            w.lines.append(
                f"  store i64 {name}, ptr {w.value(f'getelementptr i64, ptr %report, i64 {place}')}"
            )
        w.lines.append("  ret i32 1")
    return "\n".join([_LIBRARY, *w.library.values(), _HEAD, *w.lines, "}"]) + "\n"


def _operation(w: _Writer, op: Op) -> None:
    """Write one operation, skipped at the points at which it is not due."""
    on = w.label()
    if op.every > 1:
        due = w.value(f"icmp eq i64 {w.value(f'srem i64 %k, {op.every}')}, 0")
        act = w.label()
        w.lines.append(f"  br i1 {due}, label %{act}, label %{on}")
        w.start_block(act)
    _WRITE[op.code](w, op)
    if op.every > 1:
        w.lines.append(f"  br label %{on}")
        w.start_block(on)
    w.row += 1
