"""The operations that call functions of an FMU by their address.

Each has `function`, the address of the function, and `component`, the instance of the FMU.
The status fmiOK or fmiWarning goes on, any other is a failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .operations import SLACK, Address, Operation
from .writer import Writer, number

_MAY_RETURN = "0"  # noSetFMUStatePriorToCurrentPoint: a simulation may return to a snapshot


@dataclass(frozen=True, kw_only=True)
class _FMIFunction(Operation):
    function: Address
    component: Address


@dataclass(frozen=True, kw_only=True)
class FMI2Values(_FMIFunction):
    """Get or set `count` values by their references; with `finite` they must be finite floats."""

    references: Address
    values: Address
    n_references: int
    count: int
    finite: bool = False

    #: whether the function takes the number of values
    counted: ClassVar[bool] = False

    def emit(self, w: Writer) -> None:
        values = w.address("values")
        kinds = "ptr ptr i64 ptr i64" if self.counted else "ptr ptr i64 ptr"
        last = [str(self.count)] if self.counted else []
        references = w.address("references")
        w.check_fmi(w.call(kinds, w.address("component"), references, str(self.n_references), values, *last))
        if self.finite:
            w.check_finite(values, self.count)

    def checked(self) -> Address:
        return self.values


@dataclass(frozen=True, kw_only=True)
class FMI3Values(FMI2Values):
    """As FMI2Values; a variable may have several values."""

    counted: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class FMI2DoStep(_FMIFunction):
    """Do a step; one that is discarded calls back."""

    discarded: Address

    def emit(self, w: Writer) -> None:
        t, h = w.time(self.fraction), w.step(self.every)
        status = w.call("ptr double double i32", w.address("component"), t, h, _MAY_RETURN)
        w.when(
            w.value(f"icmp eq i32 {status}, 2"),
            lambda: w.call_back("discarded", t, h),
            otherwise=lambda: w.check_fmi(status),
        )


@dataclass(frozen=True, kw_only=True)
class FMI3DoStep(_FMIFunction):
    """Do a step. A flag that is set, or a time event before the end of the step, calls back.

    flags
        three Booleans: event, terminate, early return
    times
        the last successful time, and the time of the next event
    """

    flags: Address
    times: Address
    interrupted: Address

    def emit(self, w: Writer) -> None:
        flags, times = w.address("flags"), w.address("times")
        event, terminate, early = (w.value(f"getelementptr i8, ptr {flags}, i64 {i}") for i in range(3))
        t, h = w.time(self.fraction), w.step(self.every)
        end = w.add(t, w.multiply(h, number(1.0 + SLACK)))
        due = w.value(f"fcmp ole double {w.load(w.at(times, 1))}, {end}")

        def return_at_once() -> None:
            w.store("0", event, "i8")
            w.store("1", early, "i8")
            w.store(t, times)

        def step() -> None:
            kinds = "ptr double double i32 ptr ptr ptr ptr"
            component = w.address("component")
            w.check_fmi(w.call(kinds, component, t, h, _MAY_RETURN, event, terminate, early, times))

        w.when(due, return_at_once, otherwise=step)
        either = w.value(f"or i8 {w.load(event, 'i8')}, {w.load(early, 'i8')}")
        any_flag = w.value(f"or i8 {either}, {w.load(terminate, 'i8')}")
        w.when(w.value(f"icmp ne i8 {any_flag}, 0"), lambda: w.call_back("interrupted", t, h))


@dataclass(frozen=True, kw_only=True)
class SetTime(_FMIFunction):
    """Set the time; inside a Repeat of `substeps` the fraction is one of a substep."""

    substeps: int = 1

    def emit(self, w: Writer) -> None:
        w.check_fmi(w.call("ptr double", w.address("component"), w.time(self.fraction, self.substeps)))


@dataclass(frozen=True, kw_only=True)
class Vector(_FMIFunction):
    """Get or set a vector of `count` floats: states or derivatives."""

    values: Address
    count: int

    def emit(self, w: Writer) -> None:
        w.check_fmi(w.call("ptr ptr i64", w.address("component"), w.address("values"), str(self.count)))


@dataclass(frozen=True, kw_only=True)
class CompletedStep(_FMIFunction):
    """Tell the FMU that a step is completed; a flag that is set, or an event that is due, calls back.

    flags
        two Booleans: enter event mode, terminate
    event_time
        the time of the next time event
    boolean
        LLVM's type of a Boolean: i32 in FMI 2.0, i8 in FMI 3.0
    """

    flags: Address
    event_time: Address
    events: Address
    boolean: str

    def emit(self, w: Writer) -> None:
        kind, enter = self.boolean, w.address("flags")
        terminate = w.value(f"getelementptr {kind}, ptr {enter}, i64 1")
        w.check_fmi(w.call("ptr i32 ptr ptr", w.address("component"), _MAY_RETURN, enter, terminate))
        t = w.time(self.fraction)
        almost = w.add(t, w.multiply("%h", number(SLACK)))
        due = w.value(f"fcmp oge double {almost}, {w.load(w.address('event_time'))}")
        either = w.value(f"or {kind} {w.load(enter, kind)}, {w.load(terminate, kind)}")
        asked = w.value(f"icmp ne {kind} {either}, 0")
        w.when(w.value(f"or i1 {due}, {asked}"), lambda: w.call_back("events", t, "%h"))


@dataclass(frozen=True, kw_only=True)
class UnlessEvent(Operation):
    """Go on with the next operation; if a time event is due inside the step, call back and go on at End."""

    event_time: Address
    split: Address

    def emit(self, w: Writer) -> None:
        before_end = w.value(f"fsub double {w.time(1.0)}, {w.multiply('%h', number(SLACK))}")
        due = w.value(f"fcmp olt double {w.load(w.address('event_time'))}, {before_end}")
        inside, split, on = w.label(), w.label(), w.label()
        w.branch(due, split, inside)
        w.start_block(split)
        w.call_back("split", w.time(0.0), "%h")
        w.go_to(on)
        w.start_block(inside)

        def close() -> None:
            w.go_to(on)
            w.start_block(on)

        w.ends.append(close)


@dataclass(frozen=True, kw_only=True)
class Repeat(Operation):
    """Run the operations up to End `count` times, once a substep."""

    count: int

    def emit(self, w: Writer) -> None:
        before, loop, again, on = w.block, w.label(), w.label(), w.label()
        j, following = f"%{loop}j", f"%{again}j"
        w.go_to(loop)
        w.start_block(loop)
        w.write(f"{j} = phi i64 [ 0, %{before} ], [ {following}, %{again} ]")
        w.substep = w.value(f"sitofp i64 {j} to double")

        def close() -> None:
            w.go_to(again)
            w.start_block(again)
            w.write(f"{following} = add i64 {j}, 1")
            w.branch(w.value(f"icmp slt i64 {following}, {self.count}"), loop, on)
            w.start_block(on)

        w.ends.append(close)


@dataclass(frozen=True, kw_only=True)
class End(Operation):
    """Close the last UnlessEvent or Repeat."""

    def emit(self, w: Writer) -> None:
        w.ends.pop()()
