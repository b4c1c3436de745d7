"""Simulations: runs that can be paused, continued, returned to an earlier point, and branched.

    with Simulation(system, step=0.01) as simulation:
        simulation.run(5.0)
        before = simulation.snapshot()
        one = simulation.run(10.0)
        simulation.restore(before)
        same = simulation.run(10.0)

`simulate` is one run from start to stop. Time is the integer k, with t_k = start + k step; no
sum of steps is kept. A run is built in four steps, each in a separate file:

    plan.py      the options, checked
    binding.py   the components of the system as running instances, its connections as copies
    coupling/    the operations of a communication step, in their order: `Result.schedule`
    recorder.py  signals, texts and statistics, recorded at communication points

The compiled loop (cosim/loop) then carries it out.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from ..arrays import Array
from ..errors import SimulationEndedWarning, SnapshotError, TimeError, WiringError
from ..loop.loop import Loop
from ..loop.signals import EndOfRun, ctrl_c
from ..result import Interrupted, Result, SimulationError
from ..system.system import System
from .binding import Binding
from .coupling.iterated import iterated
from .coupling.sampled import sampled
from .coupling.schedule import Schedule
from .coupling.stage import stage
from .plan import Coupling, RunPlan, Solver
from .recorder import Recorder


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
    tolerance: float = 1e-8,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Run a system from `start` to `stop` with the communication step `step`, in s.

    coupling
        "sampled": as a real controller; inputs are held over a step.
        "continuous": stage coupling, everything with continuous state is integrated
        together by `solver` (ode1 to ode4), blocks run at every stage.
        "iterated": as sampled, but FMUs and Continuous participants that are connected
        directly agree at every communication point, by repeating steps
    record
        ports to record, such as "plant.x"; None records every output and state
    statistics
        ports to keep statistics of; None takes the recorded ones
    decimation
        record every n-th communication point
    jit
        False calls every kernel as Python: for a debugger
    tolerance
        of iterated coupling, relative to the size of each exchanged value
    progress
        called with (steps done, steps in all) about ten times a second

    Raises CosimError for anything that can be checked before the run, SimulationError (with
    `result`, computed until then) when a component fails or gives a value that is not
    finite, Interrupted (with `result`) on Ctrl-C. A component that asks to end the run is
    not an error: the result up to that point is returned, `result.ended` names the
    component and the time, and SimulationEndedWarning is issued.
    """
    plan = RunPlan(step, start, coupling, solver, record, statistics, decimation, jit, tolerance)
    plan.point(stop)  # before FMUs are loaded
    with Simulation._planned(system, plan) as simulation:
        return simulation.run(stop, progress)


def schedule(system: System, *, step: float, coupling: Coupling = "sampled", solver: Solver = "ode3") -> str:
    """Return the operations of one communication step, one line per operation."""
    with Simulation(system, step=step, coupling=coupling, solver=solver, record=[]) as simulation:
        return simulation.schedule


@dataclass(frozen=True)
class Snapshot:
    """The state of a simulation at a communication point.

    time
        of the point, in s
    portable
        False when an FMU cannot serialise its state: the snapshot can then be restored only
        in the simulation that it was taken from, while that one is open
    """

    time: float
    portable: bool
    #: k, and whether the outputs at k have been evaluated
    place: tuple[int, bool]
    parts: dict[str, Any]
    memory: list[Array]
    owner: object
    #: the properties that a simulation must share to return to it
    kind: tuple[Any, ...]


class Simulation:
    """A system at a communication point. Options as for `simulate`.

    Raises CosimError for anything that can be checked before the run. A simulation holds
    instances of FMUs: close it, or use it in a `with` statement.
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
        self._open(
            system, RunPlan(step, start, coupling, solver, record, statistics, decimation, jit, tolerance)
        )

    @classmethod
    def _planned(cls, system: System, plan: RunPlan) -> Self:
        """Return a simulation with the options of a plan."""
        simulation = cls.__new__(cls)
        simulation._open(system, plan)
        return simulation

    def _open(self, system: System, plan: RunPlan) -> None:
        if not isinstance(system, System):
            raise WiringError(f"{system!r} must be a System; give System({{'plant': ...}}, [...])")
        self.system, self.plan = system, plan
        recorded, watched = plan.recorded(system), plan.watched(system)
        self._binding = Binding(system, plan, [*recorded, *watched])
        self._signals = self._binding.signals
        try:
            self._recorder = Recorder(recorded, watched, self._binding)
            self._coupling = self._coupled()
        except BaseException:
            self._binding.close()
            raise
        self._recording = [*self._recorder.operations, *self._binding.keep]
        #: the arrays that belong to the state, besides those of the instances
        self._memory = [*self._binding.memory, *self._coupling.memory]
        self._loop: Loop | None = None
        #: the point that comes next, or, once its outputs have been evaluated, the present one
        self._k, self._acted = 0, False
        self._incomplete = self._closed = False
        #: the component that asked to end the run, and when
        self._ended = ""
        self._token = object()
        self._first = 0
        self._began = 0.0
        self._last: Result | None = None

    def _coupled(self) -> Schedule:
        if self.plan.coupling == "continuous":
            return stage(self._binding, self._recorder)
        return (iterated if self.plan.coupling == "iterated" else sampled)(self._binding)

    @property
    def schedule(self) -> str:
        """The operations of one communication step, one line per operation."""
        return self._coupling.text(self._recording)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        elif not self._closed:
            self._closed = True
            self._binding.close()

    def close(self) -> None:
        """Terminate and free the FMUs; results remain valid.

        Raises SimulationError when an isolated FMU crashes while it is freed, Interrupted on Ctrl-C
        while it hangs there, both with the last `result`.
        """
        if self._closed:
            return
        self._closed = True
        crashes = self._binding.close()
        if self._signals.interrupted:
            raise Interrupted(self._last) if self._last is not None else KeyboardInterrupt
        if crashes:
            error = SimulationError("; ".join(crashes) + ", after the run, which is complete")
            error.result = self._last
            raise error

    @property
    def time(self) -> float:
        """The present communication point, in s."""
        return self.plan.start + self._k * self.plan.step

    # ----------------------------------------------------------------------------- runs

    def run(self, until: float, progress: Callable[[int, int], None] | None = None) -> Result:
        """Run from the present communication point to `until`, in s; the result includes both.

        Raises SimulationError (with `result`, computed until then) when a component fails
        or gives a value that is not finite, Interrupted (with `result`) on Ctrl-C. When a
        component asks to end the run, the result until then is returned: `Result.ended`.
        """
        last = self.plan.point(until)
        if last < self._k or (last == self._k and self._acted):
            raise TimeError(f"run until {until:g} s: the simulation is already at {self.time:g} s")
        with ctrl_c(self._signals):
            self._check_usable("run")
            loop = self._begun()
            self._first = self._k
            self._recorder.open(self._k, last)
            self._last = self._run(loop, last, progress)
            return self._last

    def _begun(self) -> Loop:
        """Return the loop; the first time, compile it and initialize the instances."""
        if self._loop is None:
            self._incomplete = True
            self._began = time.perf_counter()
            self._loop = Loop(
                self._coupling.at_point, self._recording, self._coupling.to_next, self._signals.stop
            )
            try:
                self._binding.start(self.plan.start)
                self._coupling.start()
            except SimulationError as error:
                error.result = self._result(interrupted=True)
                raise
            except KeyboardInterrupt:
                self._signals.clear()
                raise Interrupted(self._result(interrupted=True)) from None
            self._incomplete = False
        return self._loop

    def _run(self, loop: Loop, last: int, progress: Callable[[int, int], None] | None) -> Result:
        signals, plan = self._signals, self.plan
        self._began = time.perf_counter()
        begin, chunk = self._k, 1  # grows: a slow callback must not hold up progress and Ctrl-C
        try:
            while self._k < last or not self._acted:
                until = min(self._k + chunk, last + 1)
                before = time.perf_counter()
                self._incomplete = True  # until the loop is back
                if loop.run(self._k, until, last, plan.start, plan.step, self._acted):
                    self._k = int(loop.report[1])
                    self._acted = False
                    if isinstance(signals.exception, KeyboardInterrupt):
                        raise signals.exception
                    if isinstance(signals.exception, EndOfRun):
                        return self._end(signals.exception.text)
                    raise self._binding.error(loop)
                self._k = int(loop.report[1])
                self._acted = self._k < until  # the last point, or where a component asked to end
                if signals.end and self._acted:
                    return self._end(signals.end)
                self._incomplete = False
                if signals.interrupted:
                    raise KeyboardInterrupt
                took = time.perf_counter() - before
                chunk = max(1, min(int(chunk * 0.1 / max(took, 1e-6)), 4 * chunk, 1_000_000))
                if progress is not None:
                    progress(self._k - begin, last - begin)
        except KeyboardInterrupt:
            signals.clear()
            raise Interrupted(self._result(interrupted=True)) from None
        except SimulationError as error:
            error.result = self._result(interrupted=True)
            raise
        return self._result()

    def _end(self, text: str) -> Result:
        """Return the result of a run that a component asked to end."""
        self._ended = text
        warnings.warn(f"{text}; the result ends there", SimulationEndedWarning, stacklevel=4)
        return self._result()

    # ------------------------------------------------------------------------ snapshots

    def snapshot(self) -> Snapshot:
        """Return the whole state of the simulation; `restore` returns to it, any number of times.

        Raises SnapshotError, naming the FMUs, when they cannot get and set their state.
        """
        self._check_usable("take a snapshot")
        self._begun()
        unable = self._unable("can_save")
        if unable:
            raise SnapshotError(
                f"{unable} cannot get and set its state (canGetAndSetFMUState), which a snapshot needs; "
                "export it with that capability, or run again from the start"
            )
        parts = {name: instance.save() for name, instance in self._binding.instances.items()}
        portable = all(instance.can_serialise for instance in self._binding.instances.values())
        memory = [array.copy() for array in self._memory]
        place = self._k, self._acted
        return Snapshot(self.time, portable, place, parts, memory, self._token, self._kind())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot; results that were returned since then keep their signals.

        A snapshot of another simulation is accepted if that one has the same components and
        options. Raises SnapshotError otherwise.
        """
        self._check_open("restore a snapshot")
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"{snapshot!r} must be a snapshot, as `snapshot` returns it")
        if snapshot.kind != self._kind():
            raise SnapshotError(
                f"the snapshot at t = {snapshot.time:g} s belongs to another simulation: components, "
                "connected and recorded ports, step, start, coupling, solver and jit must be the same"
            )
        if snapshot.owner is not self._token and not snapshot.portable:
            raise SnapshotError(
                f"the snapshot at t = {snapshot.time:g} s can be restored only in its own simulation: "
                f"{self._unable('can_serialise')} cannot serialise its state"
            )
        self._begun()
        for name, instance in self._binding.instances.items():
            instance.restore(snapshot.parts[name])
        for array, kept in zip(self._memory, snapshot.memory, strict=True):
            array[:] = kept
        self._k, self._acted = snapshot.place
        self._incomplete, self._ended = False, ""
        self._signals.clear()

    def branch(self) -> Simulation:
        """Return a second simulation at the same point, which runs independently of this one.

        Raises SnapshotError, naming the FMUs, when they cannot serialise their state, or crash when
        it is restored in another process.
        """
        snapshot = self.snapshot()
        if not snapshot.portable:
            raise SnapshotError(
                f"{self._unable('can_serialise')} cannot serialise its state (canSerializeFMUState), "
                "which a second simulation needs; within one simulation, use snapshot and restore"
            )
        other = Simulation._planned(self.system, self.plan)
        try:
            other.restore(snapshot)
        except SimulationError as error:
            crashed = ", ".join(n for n, i in other._binding.instances.items() if i.is_gone)
            other.close()
            if not crashed:
                raise
            raise SnapshotError(
                f"{error}\nthe serialised state of {crashed} cannot be restored in another process, perhaps "
                "because it contains addresses; for a branch, load the FMU without isolated=True; "
                "this simulation can go on"
            ) from error
        except BaseException:
            other.close()
            raise
        return other

    def _kind(self) -> tuple[Any, ...]:
        plan = self.plan
        parts = tuple((name, instance.kind()) for name, instance in self._binding.instances.items())
        shapes = tuple(array.shape for array in self._memory)
        return plan.step, plan.start, plan.coupling, plan.solver, parts, shapes

    def _unable(self, capability: str) -> str:
        found = [n for n, i in self._binding.instances.items() if not getattr(i, capability)]
        return ", ".join(found)

    def _check_open(self, what: str) -> None:
        if self._closed:
            raise SimulationError(f"this simulation cannot {what}: it is closed; make a new one")

    def _check_usable(self, what: str) -> None:
        self._check_open(what)
        if self._incomplete:
            why = self._ended or "it ended within a step"
            raise SimulationError(
                f"this simulation cannot {what}: {why}; restore a snapshot, or make a new simulation"
            )

    # ---------------------------------------------------------------------------- ends

    def _result(self, interrupted: bool = False) -> Result:
        return Result(
            **self._recorder.recording(self.plan.start, self.plan.step),
            step=self.plan.step,
            steps=self._k - self._first,
            seconds=time.perf_counter() - self._began,
            schedule=self.schedule,
            interrupted=interrupted,
            ended=self._ended,
        )
