"""The master: `simulate` runs a system over fixed communication steps.

Time is the integer k, t_k = start + k step; nothing is summed up. What happens at a
communication point is in program.py, and `Result.schedule` shows it for the run.
"""

from __future__ import annotations

import ctypes
import math
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np

from .compiler import load
from .errors import RecordError, SimulationError, TimeError, WiringError, did_you_mean
from .fmu import FMU
from .fmu_instance import FMUInstance
from .instances import Failures
from .opcodes import CALL, COMBINE, FMI2_VALUES, FMI3_VALUES, FROM_FLOAT, TO_FLOAT
from .program import Program, steps_between
from .result import Result, Statistics
from .system import Port, System, outputs_of
from .tableaus import TABLEAUS
from .variables import Array

Coupling = Literal["sampled", "continuous"]
Solver = Literal["ode1", "ode2", "ode3", "ode4"]

#: recorded signals above this many bytes go to a temporary file
MEMORY_LIMIT = 200_000_000
_REPORT = 5


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; `result` holds what was computed until then."""

    def __init__(self, result: Result) -> None:
        super().__init__(f"interrupted at t = {result.time[-1] if len(result.time) else 0.0:g} s")
        self.result = result


def _compiled(ir: str) -> Callable[..., int]:
    """Return the loop of a system as a function."""
    integer, real, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
    kinds = (pointer, integer, integer, integer, real, real, pointer)
    function: Callable[..., int] = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(load(ir)("run"))
    return function


def simulate(
    system: System,
    *,
    step: float,
    stop: float,
    start: float = 0.0,
    coupling: Coupling = "sampled",
    solver: Solver = "ode3",
    record: Iterable[str] | None = None,
    statistics: Iterable[str] | None = None,
    decimation: int = 1,
    jit: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Run a system from `start` to `stop` with the communication step `step`, in s.

    coupling
        "sampled": what a real controller does; inputs are held over a step.
        "continuous": stage coupling, everything with continuous state is integrated
        together by `solver` (ode1 to ode4), blocks run at every stage
    record
        ports to record, such as "plant.x"; None records every output and state
    statistics
        ports to keep statistics of; None takes the recorded ones
    decimation
        record every so many-th communication point
    jit
        False calls every kernel as Python: for a debugger
    progress
        called with (steps done, steps in all) some ten times a second

    Raises CosimError for what can be checked before the run, SimulationError (with
    `result`, what was computed) when a participant fails or gives a value that is not
    finite, Interrupted (with `result`) on Ctrl-C.
    """
    steps = _steps(step, start, stop)
    _choices(coupling, solver, decimation)
    step, start, decimation = float(step), float(start), int(decimation)
    recorded = _ports(system, record)
    watched = recorded if statistics is None else _ports(system, statistics)
    program = Program(system, step, coupling, solver, recorded, watched, decimation, jit)
    try:
        with _ctrl_c(program.failures):
            return _Run(program, steps, start, decimation).run(progress)
    finally:
        program.close()


def schedule(system: System, *, step: float, coupling: Coupling = "sampled", solver: Solver = "ode3") -> str:
    """Return what happens in one communication step, a line an operation."""
    _steps(step, 0.0, step)
    _choices(coupling, solver, 1)
    program = Program(system, float(step), coupling, solver, [], [], 1, True)
    program.close()
    return program.schedule()


def _steps(step: float, start: float, stop: float) -> int:
    for name, value in (("step", step), ("start", start), ("stop", stop)):
        if not isinstance(value, Real) or not math.isfinite(value):
            raise TimeError(f"{name}={value!r} is no finite number of seconds")
    if step <= 0.0:
        raise TimeError(f"step={step:g} s; a communication step is above zero")
    if stop <= start:
        raise TimeError(f"stop={stop:g} s is not after start={start:g} s")
    return steps_between(stop - start, step, "the time from start to stop")


def _choices(coupling: str, solver: str, decimation: int) -> None:
    if coupling not in ("sampled", "continuous"):
        raise TimeError(
            f"coupling '{coupling}' is not known" + did_you_mean(coupling, ["sampled", "continuous"])
        )
    if solver not in TABLEAUS:
        raise TimeError(f"solver '{solver}' is not known" + did_you_mean(solver, TABLEAUS))
    if not isinstance(decimation, Integral) or decimation < 1:
        raise TimeError(f"decimation={decimation!r} is no whole number of steps, 1 or more")


def _ports(system: System, names: Iterable[str] | None) -> list[Port]:
    if names is None:
        return [
            system.port(f"{name}.{port}", "output")
            for name, member in system.participants.items()
            for port in (member.declared_outputs if isinstance(member, FMU) else outputs_of(member))
        ]
    if isinstance(names, str):
        raise WiringError(f"'{names}' is one name; give a list of ports, [\"{names}\"]")
    return [_readable(system, name) for name in names]


def _readable(system: System, name: str) -> Port:
    """Find a port to record: an output, a state, or an input (the value that was used)."""
    from .system import inputs_of

    where, _, port = name.partition(".")
    if where in system.participants and port.partition("[")[0] in inputs_of(system.participants[where]):
        return system.port(name, "input")
    return system.port(name, "output")


@contextmanager
def _ctrl_c(failures: Failures) -> Iterator[None]:
    """Let Ctrl-C end the run between chunks or after a callback.

    Raised at any moment it may strike while Python enters a callback from C, where the
    exception is printed and lost, and the run goes on. A second Ctrl-C does not wait.
    """
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def note(number: int, frame: object) -> None:
        if failures.interrupted:
            raise KeyboardInterrupt
        failures.interrupted = True

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class _Run:
    """One run of a program: chunks of the compiled loop, and what is served in between."""

    def __init__(self, program: Program, steps: int, start: float, decimation: int) -> None:
        self.program = program
        self.steps = steps
        self.start = start
        self.decimation = decimation
        self.report = np.zeros(_REPORT, dtype=np.int64)
        rows = steps // decimation + 1
        shape = (rows, program.columns)
        size = rows * program.columns * 8
        if size > MEMORY_LIMIT:
            folder = tempfile.gettempdir()
            free = shutil.disk_usage(folder).free
            if size > free:
                raise RecordError(
                    f"{program.columns} numbers at {rows} points take {size / 1e9:.3g} GB and {folder} has "
                    f"{free / 1e9:.3g} GB free; record fewer ports (record=[...]), or with decimation="
                )
            file = tempfile.TemporaryFile(prefix="structcosim-")  # noqa: SIM115  lives as long as the arrays
            self.data: Array = np.memmap(file, dtype=np.float64, mode="w+", shape=shape)
        else:
            self.data = np.empty(shape)
        self.began = time.perf_counter()

    def run(self, progress: Callable[[int, int], None] | None) -> Result:
        program = self.program
        ir, table = program.loop(self.data)
        loop = _compiled(ir)
        for instance in program.instances.values():
            instance.start(self.start)
            if program.failures.exception is not None:
                raise self._error(0, 0, 0)
        self.began = time.perf_counter()
        done, chunk = 0, 1  # grows: a slow callback must not hold up progress and Ctrl-C
        try:
            while done <= self.steps:
                until = min(done + chunk, self.steps + 1)
                before = time.perf_counter()
                failed = loop(
                    table.ctypes.data,
                    done,
                    until,
                    self.steps,
                    self.start,
                    program.h,
                    self.report.ctypes.data,
                )
                if failed:
                    if isinstance(program.failures.exception, KeyboardInterrupt):
                        raise program.failures.exception
                    raise self._error(*(int(x) for x in self.report[:3]))
                if program.failures.interrupted:
                    raise KeyboardInterrupt
                done = until
                took = time.perf_counter() - before
                chunk = max(1, min(int(chunk * 0.1 / max(took, 1e-6)), 4 * chunk, 1_000_000))
                if progress is not None:
                    progress(min(done, self.steps), self.steps)
        except KeyboardInterrupt:
            raise Interrupted(self._result(interrupted=True)) from None
        return self._result()

    # ---------------------------------------------------------------------------- ends

    def _result(self, interrupted: bool = False) -> Result:
        rows = int(self.report[3])
        signals: dict[str, Array] = {}
        column = 0
        for port in self.program.recorded:
            part = self.data[:rows, column : column + port.count]
            signals[str(port)] = part[:, 0] if port.shape == () or port.count == 1 else part
            column += port.count
        k = np.arange(rows, dtype=np.float64) * self.decimation
        return Result(
            time=self.start + k * self.program.h,
            signals=signals,
            units={str(p): p.unit for p in [*self.program.recorded, *self.program.watched]},
            statistics=self._statistics(),
            step=self.program.h,
            steps=self.steps,
            seconds=time.perf_counter() - self.began,
            schedule=self.program.schedule(),
            interrupted=interrupted,
        )

    def _statistics(self) -> dict[str, Statistics]:
        n = int(self.report[4])
        found: dict[str, Statistics] = {}
        if n == 0:
            return found
        row = 0
        for port in self.program.watched:
            low, high, total, squares = self.program.statistics[row : row + port.count].T.copy()
            row += port.count
            values: list[Any] = [low, high, total / n, np.sqrt(squares / n), np.sqrt(squares)]
            if port.shape == () or port.count == 1:
                values = [float(v[0]) for v in values]
            found[str(port)] = Statistics(*values)
        return found

    def _error(self, row: int, k: int, status: int) -> SimulationError:
        program = self.program
        failures = program.failures
        if failures.exception is not None:
            where, t = failures.participant, failures.time
            what = f"{type(failures.exception).__name__}: {failures.exception}"
            asked = isinstance(failures.exception, SimulationError)  # an FMU's: place and time are in it
            text = str(failures.exception) if asked else f"{where} failed at t = {t:g} s: {what}"
            error = SimulationError(text)
            error.__cause__ = failures.exception
            error.result = self._result(interrupted=True)
            return error
        op = program.rows[row]
        t = op.seconds(self.start, k, program.h)
        instance = program.instances[op.participant]
        values = {FMI2_VALUES: op.c, FMI3_VALUES: op.c, FROM_FLOAT: op.a, TO_FLOAT: op.b}
        checked = {CALL: op.b, COMBINE: op.c, **values}
        if status < 0 and op.code in checked:
            variable = instance.locate(checked[op.code] + 8 * (-status - 1))
            what = "is not finite (NaN or infinite)"
            remedy = "look at the inputs that lead to it, or at the step: a plant that diverges ends so"
            if op.code == FROM_FLOAT:
                what, remedy = f"is not {op.number.values}", "round or limit its source in a block"
            elif op.code == TO_FLOAT and not op.number.is_float:
                what, remedy = "is above 2^53, which a float does not hold", "do not connect or record it"
            text = f"{op.participant}.{variable} {what} at t = {t:g} s (step {k}); {remedy}"
        elif isinstance(instance, FMUInstance):
            text = instance.failure(op, status, t, program.h) + f" (step {k})"
        else:
            why = "an exception in its kernel; run with jit=False to see where"
            text = f"{op.participant} failed at t = {t:g} s (step {k}) with {why}"
        log = instance.log()[-8:]
        if log:
            text += "\n  log of the FMU:" + "".join(f"\n  {line}" for line in log)
        error = SimulationError(text)
        error.result = self._result(interrupted=True)
        return error
