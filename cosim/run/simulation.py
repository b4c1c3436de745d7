"""A run that can be stopped and carried on, returned to an earlier point, and branched.

    with Simulation(system, step=0.01) as simulation:
        simulation.run(5.0)
        there = simulation.snapshot()
        one = simulation.run(10.0)
        simulation.restore(there)
        same = simulation.run(10.0)

Time is the integer k, t_k = start + k step; nothing is summed up. What happens at a
communication point is in program.py, and `Result.schedule` shows it for the run.
`simulate` (master.py) is one run from start to stop.
"""

from __future__ import annotations

import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np

from ..core.time_grid import steps_between
from ..core.variables import Array
from ..errors import RecordError, SimulationEndedWarning, SnapshotError, TimeError
from ..fmi.instance.instance import FMUInstance
from ..loop.loop import Loop
from ..loop.signals import EndOfRun, ctrl_c
from ..result import Interrupted, Result, SimulationError, Statistics
from ..system.system import System
from .plan import (
    Coupling,
    Solver,
    check_choices,
    check_stop,
    check_system,
    check_time,
    numbers,
    port_names,
    ports,
)
from .program import Program

#: recorded signals above this many bytes go to a temporary file
MEMORY_LIMIT = 200_000_000


@dataclass(frozen=True)
class Snapshot:
    """All that a simulation knows at a communication point.

    time
        of the point, in s
    portable
        False when an FMU cannot serialise its state: then the snapshot serves only the
        simulation that it was taken of, while that is open
    """

    time: float
    portable: bool
    #: k, and whether the outputs at k have been evaluated
    place: tuple[int, bool]
    parts: dict[str, Any]
    memory: list[Array]
    owner: object
    #: what a simulation has to share to return to it
    kind: tuple[Any, ...]


class Simulation:
    """A system at a communication point. Options as for `simulate`.

    Raises CosimError for what can be checked before the run. To be closed, or used in
    a `with` statement: it holds instances of FMUs.
    """

    def __init__(
        self,
        system: System,
        *,
        step: float,
        start: float = 0.0,
        coupling: Coupling = "sampled",
        solver: Solver = "ode3",
        record: Iterable[str] | None = None,
        statistics: Iterable[str] | None = None,
        decimation: int = 1,
        jit: bool = True,
        tolerance: float = 1e-8,
    ) -> None:
        check_system(system)
        check_time(step, start)
        check_choices(coupling, solver, decimation, tolerance)
        self.system = system
        self.step, self.start, self.decimation = float(step), float(start), int(decimation)
        self._options: dict[str, Any] = {
            "coupling": coupling,
            "solver": solver,
            "record": None if record is None else port_names(record),
            "statistics": None if statistics is None else port_names(statistics),
            "jit": jit,
            "tolerance": tolerance,
        }
        asked = ports(system, self._options["record"])
        texts = [port for port in asked if port.kind != "number"]
        recorded = [port for port in asked if port.kind == "number"]
        watched = recorded if statistics is None else numbers(ports(system, self._options["statistics"]))
        self._program = Program(
            system, self.step, coupling, solver, recorded, watched, self.decimation, jit, tolerance, texts
        )
        self._loop: Loop | None = None
        #: the point that comes next, or, once its outputs have been evaluated, the present one
        self._k, self._acted = 0, False
        self._incomplete = self._closed = False
        #: who asked to end the run, and when
        self._ended = ""
        self._token = object()
        self._first = 0
        self._data: Array = np.empty((0, 0))
        self._began = 0.0
        self._last: Result | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        elif not self._closed:
            self._closed = True
            self._program.close()

    def close(self) -> None:
        """Terminate and free the FMUs; results stay.

        Raises SimulationError when an isolated FMU crashes in that, Interrupted on Ctrl-C while
        it hangs in that, both with the last `result`.
        """
        if self._closed:
            return
        self._closed = True
        crashes = self._program.close()
        if self._program.failures.interrupted:
            raise Interrupted(self._last) if self._last is not None else KeyboardInterrupt
        if crashes:
            error = SimulationError("; ".join(crashes) + ", after the run, which is complete")
            error.result = self._last
            raise error

    @property
    def time(self) -> float:
        """The communication point at which the simulation stands, in s."""
        return self.start + self._k * self.step

    # ----------------------------------------------------------------------------- runs

    def run(self, until: float, progress: Callable[[int, int], None] | None = None) -> Result:
        """Run from the present communication point to `until`, in s; both are in the result.

        Raises SimulationError (with `result`, what was computed) when a participant fails
        or gives a value that is not finite, Interrupted (with `result`) on Ctrl-C. When a
        participant asks to end the run, what was computed is returned: `Result.ended`.
        """
        check_stop(until, self.start)
        last = steps_between(until - self.start, self.step, "the time from start to stop")
        if last < self._k or (last == self._k and self._acted):
            raise TimeError(f"run until {until:g} s: the simulation is at {self.time:g} s already")
        with ctrl_c(self._program.failures):
            self._check_usable("run")
            loop = self._begun()
            self._open_records(loop, last)
            self._last = self._run(loop, last, progress)
            return self._last

    def _begun(self) -> Loop:
        """Return the loop; the first time, compile it and initialize the participants."""
        if self._loop is None:
            self._incomplete = True
            self._began = time.perf_counter()
            self._loop = self._program.loop()
            self._data = np.empty((0, self._program.columns))
            try:
                self._program.start(self.start)
            except SimulationError as error:
                error.result = self._result(interrupted=True)
                raise
            except KeyboardInterrupt:
                self._program.failures.clear()
                raise Interrupted(self._result(interrupted=True)) from None
            self._incomplete = False
        return self._loop

    def _open_records(self, loop: Loop, last: int) -> None:
        """Make room for what is recorded from here on; the present point is the first if it was computed."""
        program = self._program
        self._data = self._room(last)
        self._first = self._k
        loop.record_to(self._data)
        loop.report[:] = 0
        program.statistics[:] = np.inf, -np.inf, 0.0, 0.0
        for texts in program.recorded_texts.values():
            texts.clear()
        if self._acted:
            x = program.values(program.watched_addresses)
            if len(x):
                program.statistics[:] = np.column_stack([x, x, x, x * x])
            loop.report[4] = 1
            if self._k % self.decimation == 0 and (program.columns or program.recorded_texts):
                self._data[0] = program.values(program.recorded_addresses)
                program.keep_texts()
                loop.report[3] = 1

    def _room(self, last: int) -> Array:
        rows = last // self.decimation - -(-self._k // self.decimation) + 1
        columns = self._program.columns
        size = rows * columns * 8
        if size <= MEMORY_LIMIT:
            return np.empty((rows, columns))
        folder = tempfile.gettempdir()
        free = shutil.disk_usage(folder).free
        if size > free:
            raise RecordError(
                f"{columns} numbers at {rows} points take {size / 1e9:.3g} GB and {folder} has "
                f"{free / 1e9:.3g} GB free; record fewer ports (record=[...]), or with decimation="
            )
        file = tempfile.TemporaryFile(prefix="structcosim-")  # noqa: SIM115  lives as long as the arrays
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(rows, columns))

    def _run(self, loop: Loop, last: int, progress: Callable[[int, int], None] | None) -> Result:
        failures = self._program.failures
        self._began = time.perf_counter()
        begin, chunk = self._k, 1  # grows: a slow callback must not hold up progress and Ctrl-C
        try:
            while self._k < last or not self._acted:
                until = min(self._k + chunk, last + 1)
                before = time.perf_counter()
                self._incomplete = True  # until the loop is back
                if loop.run(self._k, until, last, self.start, self.step, self._acted):
                    row, self._k, status = (int(x) for x in loop.report[:3])
                    self._acted = False
                    if isinstance(failures.exception, KeyboardInterrupt):
                        raise failures.exception
                    if isinstance(failures.exception, EndOfRun):
                        return self._end(failures.exception.text)
                    raise self._program.error(loop.rows[row], self.start, self._k, status)
                self._k = int(loop.report[1])
                self._acted = self._k < until  # the last point, or where a participant asked to end
                if failures.end and self._acted:
                    return self._end(failures.end)
                self._incomplete = False
                if failures.interrupted:
                    raise KeyboardInterrupt
                took = time.perf_counter() - before
                chunk = max(1, min(int(chunk * 0.1 / max(took, 1e-6)), 4 * chunk, 1_000_000))
                if progress is not None:
                    progress(self._k - begin, last - begin)
        except KeyboardInterrupt:
            failures.clear()
            raise Interrupted(self._result(interrupted=True)) from None
        except SimulationError as error:
            error.result = self._result(interrupted=True)
            raise
        return self._result()

    def _end(self, text: str) -> Result:
        """Return the result of a run that a participant asked to end."""
        self._ended = text
        warnings.warn(f"{text}; the result ends there", SimulationEndedWarning, stacklevel=4)
        return self._result()

    # ------------------------------------------------------------------------ snapshots

    def snapshot(self) -> Snapshot:
        """Return all that the simulation knows now; `restore` returns to it, as often as you like.

        Raises SnapshotError, naming them, when FMUs cannot get and set their state.
        """
        self._check_usable("take a snapshot")
        self._begun()
        unable = self._unable("can_save")
        if unable:
            raise SnapshotError(
                f"{unable} cannot get and set its state (canGetAndSetFMUState), which a snapshot needs; "
                "export it with that capability, or run again from the start"
            )
        parts = {name: instance.save() for name, instance in self._program.instances.items()}
        portable = all(instance.can_serialise for instance in self._program.instances.values())
        memory = [array.copy() for array in self._program.memory]
        place = self._k, self._acted
        return Snapshot(self.time, portable, place, parts, memory, self._token, self._kind())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot; what was recorded since then stays in the results that were returned.

        One that was taken of another simulation serves if that has the same participants and
        options. Raises SnapshotError if it does not serve.
        """
        self._check_open("restore a snapshot")
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"{snapshot!r} is no snapshot; give what `snapshot` returned")
        if snapshot.kind != self._kind():
            raise SnapshotError(
                f"the snapshot at t = {snapshot.time:g} s is of another simulation: participants, connected "
                "and recorded ports, step, start, coupling, solver and jit have to be the same"
            )
        if snapshot.owner is not self._token and not snapshot.portable:
            raise SnapshotError(
                f"the snapshot at t = {snapshot.time:g} s serves only the simulation that it was taken of: "
                f"{self._unable('can_serialise')} cannot serialise its state"
            )
        self._begun()
        for name, instance in self._program.instances.items():
            instance.restore(snapshot.parts[name])
        for array, kept in zip(self._program.memory, snapshot.memory, strict=True):
            array[:] = kept
        self._k, self._acted = snapshot.place
        self._incomplete, self._ended = False, ""
        self._program.failures.clear()

    def branch(self) -> Simulation:
        """Return a second simulation that stands where this one does, and goes its own way.

        Raises SnapshotError, naming them, when FMUs cannot serialise their state, or do not bear it
        in another process.
        """
        snapshot = self.snapshot()
        if not snapshot.portable:
            raise SnapshotError(
                f"{self._unable('can_serialise')} cannot serialise its state (canSerializeFMUState), "
                "which a second simulation needs; snapshot and restore serve within one simulation"
            )
        other = Simulation(
            self.system, step=self.step, start=self.start, decimation=self.decimation, **self._options
        )
        try:
            other.restore(snapshot)
        except SimulationError as error:
            instances = other._program.instances
            crashed = ", ".join(n for n, i in instances.items() if isinstance(i, FMUInstance) and i.is_gone)
            other.close()
            if not crashed:
                raise
            raise SnapshotError(
                f"{error}\nthe bytes that {crashed} gives of its state do not serve in another process, "
                "perhaps because there are addresses among them; a branch needs it without isolated=True, "
                "and this simulation goes on"
            ) from error
        except BaseException:
            other.close()
            raise
        return other

    def _kind(self) -> tuple[Any, ...]:
        options = tuple(self._options[name] for name in ("coupling", "solver"))
        parts = tuple((name, instance.kind()) for name, instance in self._program.instances.items())
        return self.step, self.start, options, parts, tuple(array.shape for array in self._program.memory)

    def _unable(self, capability: str) -> str:
        found = [n for n, i in self._program.instances.items() if not getattr(i, capability)]
        return ", ".join(found)

    def _check_open(self, what: str) -> None:
        if self._closed:
            raise SimulationError(f"this simulation cannot {what}: it is closed; make a new one")

    def _check_usable(self, what: str) -> None:
        self._check_open(what)
        if self._incomplete:
            why = self._ended or "it ended within a step"
            raise SimulationError(f"this simulation cannot {what}: {why}; restore a snapshot, or start anew")

    # ---------------------------------------------------------------------------- ends

    def _result(self, interrupted: bool = False) -> Result:
        program = self._program
        assert self._loop is not None
        rows, sampled = (int(n) for n in self._loop.report[3:])
        signals: dict[str, Array] = {}
        column = 0
        for port in program.recorded:
            part = self._data[:rows, column : column + port.count]
            signals[str(port)] = part[:, 0] if port.shape == () or port.count == 1 else part
            column += port.count
        first = -(-self._first // self.decimation)
        k = (first + np.arange(rows, dtype=np.float64)) * self.decimation
        return Result(
            time=self.start + k * self.step,
            signals=signals,
            units={str(p): p.unit for p in [*program.recorded, *program.watched]},
            texts={str(port): texts[:rows] for port, texts in program.recorded_texts.items()},
            statistics=self._statistics(sampled),
            step=self.step,
            steps=self._k - self._first,
            seconds=time.perf_counter() - self._began,
            schedule=program.schedule(),
            interrupted=interrupted,
            ended=self._ended,
        )

    def _statistics(self, n: int) -> dict[str, Statistics]:
        found: dict[str, Statistics] = {}
        if n == 0:
            return found
        row = 0
        for port in self._program.watched:
            low, high, total, squares = self._program.statistics[row : row + port.count].T.copy()
            row += port.count
            values: list[Any] = [low, high, total / n, np.sqrt(squares / n), np.sqrt(squares)]
            if port.shape == () or port.count == 1:
                values = [float(v[0]) for v in values]
            found[str(port)] = Statistics(*values)
        return found
