"""The loop: the operations of a system as one native function, written in LLVM IR.

The loop of a run is straight-line code, one operation after the other. The addresses, which
differ from run to run, come from a table. So systems of one shape share one text, which is
compiled once per process, in hundredths of a second and without Numba.

    i32 run(ptr table, i64 k0, i64 k1, i64 last, double t0, double h, ptr report, i64 resume, ptr stop)

runs the points k0 <= k < k1 of a system whose last point is `last`, in three parts:

    at_point    at every point: evaluate it
    recording   at every point: record it
    to_next     at every point but the last: move on to the next one

With `resume`, the run before has evaluated the point k0 already: it is recorded again, as the
first point of this run. When a callback has set `stop`, the next point is the last one.

report: three int64, the operation and k at which the run stopped, and the status there.
The function returns 0, or 1 when an operation failed; then the status is the one that the
called function returned, or -1 - i when value i did not pass the check.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ..codegen.kernels import load
from .operations import Copy, Gather, Operation
from .writer import INLINE, Writer

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
  br label %point
point:
  %k = phi i64 [ %k0, %entry ], [ %knext, %nextpoint ]
  %go = icmp slt i64 %k, %k1
  br i1 %go, label %begin, label %past
begin:
  %kf = sitofp i64 %k to double
  %start = icmp eq i64 %k, %k0
  %skip = and i1 %start, %resumes
  br i1 %skip, label %recording, label %at_point"""

_TAIL = """nextpoint:
  %knext = add i64 %k, 1
  br label %point
past:
  br label %done
done:
  store i64 %k, ptr %reached
  ret i32 0"""

_FAILED = """failed:
  %row = phi i64 {rows}
  %status = phi i64 {statuses}
  store i64 %row, ptr %report
  store i64 %k, ptr %reached
  %why = getelementptr i64, ptr %report, i64 2
  store i64 %status, ptr %why
  ret i32 1"""


class Loop:
    """The operations of a system, ready to run.

    report
        number of the operation and k at which it stopped, and the status there
    """

    def __init__(
        self,
        at_point: Sequence[Operation],
        recording: Sequence[Operation],
        to_next: Sequence[Operation],
        stop: np.ndarray[Any, np.dtype[np.int64]],
    ) -> None:
        """Take the operations of each part, and the (1,) `stop` that makes the next point the last."""
        self._pairs: list[Any] = []  # the tables of Gather
        parts = [self._gathered(part) for part in (at_point, recording, to_next)]
        self.operations = [op for part in parts for op in part]
        self.report = np.zeros(3, dtype=np.int64)
        self._stop = stop
        self._table = np.array([word for op in self.operations for word in op.words()], dtype=np.int64)
        integer, real, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
        kinds = (pointer, integer, integer, integer, real, real, pointer, integer, pointer)
        self._places = [int(array.ctypes.data) for array in (self._table, self.report, self._stop)]
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(load(loop_ir(*parts))("run"))

    def _gathered(self, operations: Sequence[Operation]) -> list[Operation]:
        """Join neighbouring plain copies of a few floats, so that the loop looks up fewer addresses."""
        joined: list[Operation] = []
        for every, group in groupby(operations, key=_gathered_every):
            if every == 0:
                joined += group
                continue
            pairs = [pair for op in group if isinstance(op, Copy) for pair in op.pairs()]
            self._pairs.append(np.array(pairs, dtype=np.int64))
            joined.append(Gather(pairs=int(self._pairs[-1].ctypes.data), count=len(pairs), every=every))
        return joined

    def run(self, k: int, until: int, last: int, t0: float, h: float, resume: bool = False) -> bool:
        """Run the points k to until - 1; tell whether an operation failed."""
        table, report, stop = self._places
        return bool(self._function(table, k, until, last, t0, h, report, resume, stop))


def _gathered_every(op: Operation) -> int:
    """Return `every` of an operation that Gather can replace, 0 for any other."""
    return op.every if isinstance(op, Copy) and op.is_plain and op.count <= INLINE else 0


def loop_ir(*parts: list[Operation]) -> str:
    """Return the loop of a system as LLVM IR; the text is the same for systems of one shape."""
    w = Writer()
    place = 0
    for name, part in zip(("at_point", "recording", "to_next"), parts, strict=True):
        if name == "recording":
            w.go_to("recording")
        elif name == "to_next":
            w.write("%stopped = load i64, ptr %stop\n  %runs = icmp eq i64 %stopped, 0")
            w.write("%before = icmp slt i64 %k, %last\n  %more = and i1 %before, %runs")
            w.branch("%more", "to_next", "done")
        w.start_block(name)
        for op in part:
            w.places = {name: place + i for i, name in enumerate(op.addresses())}
            place += len(w.places)
            _emit(w, op)
            w.row += 1
    w.go_to("nextpoint")
    w.lines.append(_TAIL)
    if w.exits:
        rows = ", ".join(f"[ {row}, %{block} ]" for block, row, _ in w.exits)
        statuses = ", ".join(f"[ {status}, %{block} ]" for block, _, status in w.exits)
        w.lines.append(_FAILED.format(rows=rows, statuses=statuses))
    return "\n".join([_LIBRARY, *w.library.values(), _HEAD, *w.lines, "}"]) + "\n"


def _emit(w: Writer, op: Operation) -> None:
    """Write one operation, skipped at the points at which it is not due."""
    if op.every == 1:
        op.emit(w)
    else:
        w.when(w.value(f"icmp eq i64 {w.value(f'srem i64 %k, {op.every}')}, 0"), lambda: op.emit(w))
