"""Each operation of the loop by itself, on memory of its own."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.loop import conversions, fmi_operations, operations
from cosim.loop.conversions import FromFloat, ToFloat
from cosim.loop.loop import Loop, loop_ir
from cosim.loop.numbers import NUMBERS
from cosim.loop.operations import INLINE, Call, Combine, Copy, Gather, Operation, Record, Sample
from cosim.loop.signals import KERNEL
from cosim.loop.writer import Writer

H = 0.25
#: written out, and as a loop
COUNTS = [3, INLINE + 5]


def at(array: np.ndarray) -> int:
    return int(array.ctypes.data)


def run(*ops: Operation, points: int = 1, first: int = 0) -> tuple[bool, list[int]]:
    """Run operations at points from `first` on, t_0 = 1; return whether one failed, and the report."""
    loop = Loop(ops, [], [], np.zeros(1, dtype=np.int64))
    failed = loop.run(first, first + points, first + points, 1.0, H)
    return failed, loop.report.tolist()


@pytest.mark.parametrize("n", COUNTS)
@pytest.mark.parametrize("spread", [False, True])
@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (3.0, -0.5)])
def test_copy(n, spread, factor, offset):
    source, target = np.arange(1.0, n + 1.0), np.zeros(n + 1)
    assert run(
        Copy(source=at(source), target=at(target), count=n, factor=factor, offset=offset, spread=spread)
    ) == (False, [0, 1, 0])
    wanted = factor * (np.full(n, source[0]) if spread else source) + offset
    assert np.array_equal(target, [*wanted, 0.0])  # binary fractions: exact


@pytest.mark.parametrize("n", [3, operations.INLINE_PAIRS + 5])
def test_gather(n):
    source, target = np.arange(1.0, n + 1.0), np.zeros(n)
    order = np.random.default_rng(1).permutation(n)
    pairs = np.array([(at(source) + 8 * i, at(target) + 8 * j) for i, j in enumerate(order)])
    run(Gather(pairs=at(pairs), count=n))
    assert np.array_equal(target[order], source)


def test_neighbouring_copies_become_one_gather_only_where_they_run_together():
    x, y = np.arange(1.0, 7.0), np.zeros(6)
    ops = [Copy(source=at(x) + 8 * i, target=at(y) + 8 * i, count=2, every=1 + i // 4) for i in (0, 2, 4)]
    loop = Loop(ops, [], [], np.zeros(1, dtype=np.int64))
    assert [(type(op), op.every, op.count) for op in loop.operations] == [(Gather, 1, 4), (Gather, 2, 2)]
    loop.run(1, 2, 2, 0.0, H)
    assert y.tolist() == [1, 2, 3, 4, 0, 0]  # at k = 1 the copy at every second point is not due


def test_an_operation_runs_at_every_nth_point_at_its_own_time_with_its_own_step():
    storage, seen = np.zeros(1), []

    def kernel(address, t, h):
        seen.append((address, t, h))
        return 0

    callback = KERNEL(kernel)
    address = ctypes.cast(callback, ctypes.c_void_p).value
    run(Call(function=address, storage=at(storage), every=3, fraction=0.5), points=5, first=2)
    assert seen == [(at(storage), 1.0 + 3.5 * H, 3 * H), (at(storage), 1.0 + 6.5 * H, 3 * H)]


@pytest.mark.parametrize("n", COUNTS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_result_that_is_not_finite_is_reported_by_its_index(n, bad):
    callback = KERNEL(lambda address, t, h: 0)
    results = np.ones(n)
    op = Call(function=ctypes.cast(callback, ctypes.c_void_p).value, results=at(results), count=n)
    assert run(op) == (False, [0, 1, 0])
    results[n - 2 :] = bad
    assert run(op, first=4) == (True, [0, 4, -1 - (n - 2)])
    assert op.checked() == at(results)
    assert op.fault()[0] == "is not finite (NaN or infinite)"


def test_the_report_names_the_operation_that_failed_and_nothing_runs_after_it():
    fails, after = KERNEL(lambda address, t, h: 7), np.zeros(1)
    source = np.ones(1)
    copy = Copy(source=at(source), target=at(after), count=1)
    op = Call(function=ctypes.cast(fails, ctypes.c_void_p).value)
    assert run(copy, op, copy, first=3) == (True, [1, 3, 7])


@pytest.mark.parametrize("n", COUNTS)
def test_combine(n):
    start, slopes, result = np.arange(n * 1.0), np.arange(3.0 * n), np.zeros(n)
    op = Combine(start=at(start), slopes=at(slopes), result=at(result), count=n, weights=(0.5, 0.0, 2.0))
    run(op)
    assert np.array_equal(result, start + H * (0.5 * slopes[:n] + 2.0 * slopes[2 * n :]))
    slopes[n : 2 * n] = np.nan  # its weight is 0
    assert not run(op)[0]
    slopes[2 * n + 1] = np.nan
    assert run(op) == (True, [0, 0, -2])
    assert op.checked() == at(result)


@pytest.mark.parametrize("n", COUNTS)
def test_record_and_sample(n):
    x, rows = np.arange(1.0, n + 1.0), np.zeros((2, n))
    sources = np.array([at(x) + 8 * i for i in range(n)])
    place = np.array([at(rows), 0])
    kept, points = np.tile([np.inf, -np.inf, 0.0, 0.0], (n, 1)), np.zeros(1, dtype=np.int64)
    record = Record(sources=at(sources), place=at(place), count=n)
    sample = Sample(sources=at(sources), kept=at(kept), points=at(points), count=n)
    run(record, sample)
    x *= -2.0
    run(record, sample)
    assert np.array_equal(rows, [x / -2.0, x])
    assert place.tolist() == [at(rows), 2]
    assert points.tolist() == [2]
    assert np.array_equal(kept, np.column_stack([x, x / -2.0, x / 2.0, 1.25 * x * x]))


@pytest.mark.parametrize("name", NUMBERS.keys() - {"Float64"})
def test_conversions(name):
    number = NUMBERS[name]
    floats = np.array([1.0, 0.0, 100.0])
    values, back = np.zeros(3, number.dtype), np.zeros(3)
    out = FromFloat(source=at(floats), target=at(values), count=3, number=number)
    into = ToFloat(source=at(values), target=at(back), count=3, number=number)
    assert run(out, into) == (False, [0, 1, 0])
    assert values.tolist() == back.tolist() == [1.0, 0.0, 100.0]
    floats[1] = 1e300 if number.is_float else 0.5
    assert run(out) == (True, [0, 0, -2])
    assert out.checked() == at(floats)
    assert out.fault()[0] == f"is not {number.values}"


def test_an_integer_that_a_float_does_not_hold_is_reported():
    values, floats = np.array([2**53, 2**53 + 1]), np.zeros(2)
    op = ToFloat(source=at(values), target=at(floats), count=2, number=NUMBERS["Int64"])
    assert run(op) == (True, [0, 0, -2])
    assert op.checked() == at(floats)
    assert op.fault()[0] == "is above 2^53, which a float does not hold"


def test_two_functions_of_one_name_are_an_internal_error():
    """The last text under a name would serve all of its callers."""
    writer = Writer()
    writer.call_library("f", "text", "")
    with pytest.raises(AssertionError, match="two functions of the loop are named f"):
        writer.call_library("f", "another text", "")


def test_resuming_watches_the_first_point_without_evaluating_it():
    x, acted, watched = np.ones(1), np.zeros(1), np.zeros(2)
    add = Combine(start=at(acted), slopes=at(x), result=at(acted), count=1, weights=(1.0,))
    rows = np.array([at(watched), 0])
    sources = np.array([at(acted)])
    record = Record(sources=at(sources), place=at(rows), count=1)
    loop = Loop([add], [record], [], np.zeros(1, dtype=np.int64))
    acted[0] = 5.0
    loop.run(0, 2, 9, 0.0, 1.0, resume=True)
    assert watched.tolist() == [5.0, 6.0]


# ------------------------------------------------------------------------------ FMI


class Fake:
    """A function of an FMU: notes its arguments and returns a status."""

    def __init__(self, *kinds, status=0, effect=None):
        self.calls = []
        self.status = status

        def function(*arguments):
            self.calls.append(arguments)
            if effect:
                effect(*arguments)
            return self.status

        self.callback = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(function)
        self.address = ctypes.cast(self.callback, ctypes.c_void_p).value


P, D, I, N = ctypes.c_void_p, ctypes.c_double, ctypes.c_int32, ctypes.c_size_t
COMPONENT = 4096


@pytest.mark.parametrize("kind", [fmi_operations.FMI2Values, fmi_operations.FMI3Values])
def test_values(kind):
    counted = kind is fmi_operations.FMI3Values
    fake = Fake(P, P, N, P, *([N] if counted else []))
    references, values = np.zeros(2, np.uint32), np.array([1.0, np.nan, 3.0])
    fields = {"references": at(references), "values": at(values), "n_references": 2, "count": 3}
    op = kind(function=fake.address, component=COMPONENT, **fields)
    assert not run(op)[0]
    assert fake.calls == [(COMPONENT, at(references), 2, at(values), *([3] if counted else []))]
    finite = kind(function=fake.address, component=COMPONENT, finite=True, **fields)
    assert run(finite) == (True, [0, 0, -2])
    assert finite.checked() == at(values)


@pytest.mark.parametrize("status", [-1, 0, 1, 2, 3, -(2**31)])
def test_every_status_but_ok_and_warning_is_a_failure(status):
    """A negative one too: read as signed it would be below fmiWarning."""
    fake = Fake(P, D, status=status)
    failed, report = run(fmi_operations.SetTime(function=fake.address, component=COMPONENT))
    assert failed == (status not in (0, 1))
    if failed:
        assert report == [0, 0, status % 2**32]


def test_set_time_and_vector():
    time, vector = Fake(P, D), Fake(P, P, N)
    values = np.zeros(2)
    run(
        fmi_operations.SetTime(function=time.address, component=COMPONENT, fraction=0.5),
        fmi_operations.Vector(function=vector.address, component=COMPONENT, values=at(values), count=2),
        first=2,
    )
    assert time.calls == [(COMPONENT, 1.0 + 2.5 * H)]
    assert vector.calls == [(COMPONENT, at(values), 2)]


@pytest.mark.parametrize(("status", "calls"), [(0, 0), (2, 1)])
def test_a_step_of_fmi_2_that_is_discarded_calls_back(status, calls):
    step, discarded = Fake(P, D, D, I, status=status), Fake(P, D, D)
    op = fmi_operations.FMI2DoStep(
        function=step.address, component=COMPONENT, discarded=discarded.address, every=2
    )
    assert not run(op, first=4)[0]
    assert step.calls == [(COMPONENT, 1.0 + 4 * H, 2 * H, 0)]
    assert discarded.calls == [(None, 1.0 + 4 * H, 2 * H)] * calls
    step.status = 3
    assert run(op) == (True, [0, 0, 3])


def test_a_step_of_fmi_3_calls_back_for_flags_and_for_an_event_that_is_due():
    flags, times = np.zeros(3, np.uint8), np.array([0.0, np.inf])
    step, interrupted = Fake(P, D, D, I, P, P, P, P), Fake(P, D, D)
    op = fmi_operations.FMI3DoStep(
        function=step.address,
        component=COMPONENT,
        flags=at(flags),
        times=at(times),
        interrupted=interrupted.address,
    )
    run(op)
    assert step.calls == [(COMPONENT, 1.0, H, 0, at(flags), at(flags) + 1, at(flags) + 2, at(times))]
    assert interrupted.calls == []
    for flag in range(3):
        flags[:] = 0
        flags[flag] = 1
        run(op)
        assert len(interrupted.calls) == flag + 1
    flags[:] = 0
    times[1] = 1.0 + H / 2  # inside the step: it is not begun, and seems to have returned at once
    run(op)
    assert len(step.calls) == 4
    assert len(interrupted.calls) == 4
    assert flags.tolist() == [0, 0, 1]
    assert times[0] == 1.0


@pytest.mark.parametrize(("boolean", "dtype"), [("i32", np.int32), ("i8", np.uint8)])
def test_a_completed_step_calls_back_for_flags_and_for_an_event_that_is_due(boolean, dtype):
    flags, event_time = np.zeros(2, dtype), np.array([np.inf])
    completed, events = Fake(P, I, P, P), Fake(P, D, D)
    op = fmi_operations.CompletedStep(
        function=completed.address,
        component=COMPONENT,
        flags=at(flags),
        event_time=at(event_time),
        events=events.address,
        boolean=boolean,
        fraction=1.0,
    )
    run(op)
    assert completed.calls == [(COMPONENT, 0, at(flags), at(flags) + flags.itemsize)]
    assert events.calls == []
    for flag in range(2):
        flags[:] = 0
        flags[flag] = 1
        run(op)
        assert events.calls[flag:] == [(None, 1.0 + H, H)]
    flags[:] = 0
    event_time[0] = 1.0 + H
    run(op)
    assert len(events.calls) == 3


def test_unless_event_leaves_out_what_stands_before_its_end():
    event_time, source, target, after = np.array([np.inf]), np.ones(1), np.zeros(1), np.zeros(1)
    split = Fake(P, D, D)
    ops = [
        fmi_operations.UnlessEvent(event_time=at(event_time), split=split.address),
        Copy(source=at(source), target=at(target), count=1),
        fmi_operations.End(),
        Copy(source=at(source), target=at(after), count=1, factor=2.0),
    ]
    run(*ops)
    assert (target[0], after[0], split.calls) == (1.0, 2.0, [])
    target[:], after[:] = 0.0, 0.0
    event_time[0] = 1.0 + H / 2
    run(*ops)
    assert (target[0], after[0], split.calls) == (0.0, 2.0, [(None, 1.0, H)])
    event_time[0] = 1.0 + H  # at the end of the step: not inside it
    run(*ops)
    assert target[0] == 1.0


def test_repeat_runs_its_substeps_at_their_own_times():
    """Bit for bit the times (k + (j + c) / n) h of a loop that is written out."""
    time, x = Fake(P, D), np.ones(1)
    ops = [
        fmi_operations.Repeat(count=3),
        fmi_operations.SetTime(function=time.address, component=COMPONENT, fraction=0.5, substeps=3),
        Copy(source=at(x), target=at(x), count=1, factor=2.0),
        fmi_operations.End(),
        fmi_operations.SetTime(function=time.address, component=COMPONENT, fraction=1.0),
    ]
    run(*ops, points=2, first=4)
    wanted = [1.0 + (k + (j + 0.5) * (1.0 / 3)) * H for k in (4, 5) for j in range(3)]
    assert [t for _, t in time.calls] == [*wanted[:3], 1.0 + 5.0 * H, *wanted[3:], 1.0 + 6.0 * H]
    assert x[0] == 64.0
    time.status = 3
    assert run(*ops, first=4) == (True, [1, 4, 3])
    assert loop_ir(ops, [], []).count("\n") == loop_ir([replace(ops[0], count=9999), *ops[1:]], [], []).count(
        "\n"
    )


def test_every_operation_is_tested_here():
    text = Path(__file__).read_text()
    for module in (operations, conversions, fmi_operations):
        for name, kind in vars(module).items():
            if isinstance(kind, type) and issubclass(kind, Operation) and not name.startswith("_"):
                assert f"{name}(" in text or f"fmi_operations.{name}" in text or kind is Operation
