"""From a system to the table of operations that the loop runs: the schedule.

Sampled coupling, one communication step (DESIGN: "Time"):
    at t_k      outputs of FMUs and Continuous participants; blocks that are due, in the
                order of their connections; record
    to t_{k+1}  latch all inputs; advance every FMU and Continuous by h

Stage coupling: all FMUs (Model Exchange) and Continuous participants are integrated
together by a fixed-step Runge-Kutta method; the blocks run at every stage, those with a
sample period at the communication points only.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np

from ..core.participant import Continuous
from ..core.port import Port
from ..core.tableaus import TABLEAUS
from ..core.time_grid import steps_between
from ..core.variables import Array
from ..errors import WiringError
from ..fmi.fmu import FMU
from ..fmi.instance.co_simulation import CoSimulationInstance
from ..fmi.instance.instance import FMUInstance
from ..fmi.instance.model_exchange import ModelExchangeInstance
from ..loop.loop import Loop
from ..loop.operations import CALL, COMBINE, COPY, GATHER, RECORD, STATISTICS, Op
from ..loop.signals import EndOfRun, Failures, operation_error
from ..result import SimulationError
from ..system.evaluation_order import evaluation_order
from ..system.system import Connection, System
from .coupling.iterated import IteratedCoupling
from .kernel_instance import KernelInstance, buffer

Table: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]
Instance: TypeAlias = KernelInstance | CoSimulationInstance | ModelExchangeInstance
#: what stage coupling integrates
Integrated: TypeAlias = KernelInstance | ModelExchangeInstance


class Program:
    """The table of operations of one run, and the instances that it works on."""

    def __init__(
        self,
        system: System,
        h: float,
        coupling: str,
        solver: str,
        record: list[Port],
        statistics: list[Port],
        decimation: int,
        jit: bool,
        tolerance: float = 1e-8,
        texts: Iterable[Port] = (),
    ) -> None:
        self.system = system
        self.h = h
        self.failures = Failures()
        self.instances: dict[str, Instance] = {}
        self.buffers: list[Array] = []
        self.callbacks: list[Any] = []
        self.iteration: IteratedCoupling | None = None
        self.first: list[Op] = []
        self.second: list[Op] = []
        self.recorded = record
        self.watched = statistics
        self.coupling = f"stage coupling, {solver}" if coupling == "continuous" else f"{coupling} coupling"
        stage = coupling == "continuous"
        #: strings and binary data to record, and what was, a list a port
        self.recorded_texts: dict[Port, list[str | bytes]] = {port: [] for port in texts}
        ends = [end for c in system.connections for end in (c.source, c.target)]
        heard = [c.source for c in system.text_connections]
        used = {(p.participant, p.name) for p in [*record, *statistics, *ends]}
        used |= {(p.participant, p.name) for p in [*self.recorded_texts, *heard]}
        try:
            for name, member in system.participants.items():
                ports = {port for participant, port in used if participant == name}
                self.instances[name] = self._instance(name, member, stage, jit, ports)
            self._connect_texts()
            self.order = system.block_order()
            self.rates = {name: self._rate(name) for name in self.order}
            #: memory of the connections that are one step late, by their index
            self.delays = self._delays()
            if stage:
                self._stage_coupling(solver, self.delays, decimation)
            else:
                self._sampled_coupling(self.delays, decimation, tolerance if coupling == "iterated" else None)
            self.memory = [*self.delays.values(), *(self.iteration.arrays() if self.iteration else [])]
        except BaseException:
            self.close()
            raise

    # -------------------------------------------------------------------- participants

    def _instance(self, name: str, member: object, stage: bool, jit: bool, used: set[str]) -> Instance:
        if not isinstance(member, FMU):
            if stage and isinstance(member, Continuous) and "derivatives" not in member.kernels:
                raise WiringError(
                    f"{name} ({type(member).__name__}) moves by its advance alone and has no derivatives, "
                    'which stage coupling integrates; use coupling="sampled"'
                )
            return KernelInstance(name, member, jit, self.failures)  # type: ignore[arg-type]
        step = self.h * ((self._rate(name) or 1) if member.as_block else 1)
        return member.instance(name, self.failures, used, step, stage)

    def _rate(self, name: str) -> int | None:
        """Return every how many steps a block acts; None when it follows the coupling."""
        block = self.system.participants[name]
        if block.sample_period is not None:
            return steps_between(block.sample_period, self.h, f"{name}: sample period")
        return block.every

    def close(self) -> list[str]:
        """Free the FMU instances; return what isolated ones crashed in that, and how."""
        return [crash for instance in self.instances.values() if (crash := instance.stop())]

    def _is_block(self, name: str) -> bool:
        return self.system.participants[name].as_block

    # --------------------------------------------------------------------- connections

    def address(self, port: Port) -> int:
        """Return the address of the floats of a port."""
        return self.instances[port.participant].address(port.name) + 8 * port.first

    def _delays(self) -> dict[int, Array]:
        """Return the memory of the connections that are one step late, by their index.

        Row 0 is the source at t_{k-1}, which all of the step uses; row 1 the source at t_k.
        """
        delays = {}
        for i, c in enumerate(self.system.connections):
            if c.initial is not None:
                delays[i] = np.tile(c.initial, (2, 1))
                self.buffers.append(delays[i])
        return delays

    def _copies(
        self, name: str, delays: dict[int, Array], every: int = 1, leave: list[Connection] | None = None
    ) -> list[Op]:
        """Return the operations that bring the inputs of a participant, some connections left out."""
        ops = []
        for i, c in enumerate(self.system.connections):
            if c.target.participant == name and c not in (leave or []):
                source = delays[i].ctypes.data if i in delays else self.address(c.source)
                ops += self._copy(c, source, every)
        return ops

    def _copy(self, c: Connection, source: int, every: int) -> list[Op]:
        target = self.address(c.target)
        weights = (c.scale, c.offset)
        op = Op(str(c), COPY, a=source, b=target, n=c.source.count, every=every, weights=weights)
        if c.source.count == c.target.count:
            return [op]
        rest = [replace(op, text="", b=target + 8 * j) for j in range(1, c.target.count)]
        return [op, *rest]

    def _remember(self, delays: dict[int, Array]) -> list[Op]:
        """Return the operations that keep the sources of delayed connections for the next step."""
        ops = []
        for i, memory in delays.items():
            source = self.system.connections[i].source
            text = f"keep {source} for the next step"
            kept = memory[1].ctypes.data
            ops.append(Op(text, COPY, a=self.address(source), b=kept, n=source.count, weights=(1.0, 0.0)))
        return ops

    def _release(self, delays: dict[int, Array]) -> list[Op]:
        """Return the operations that turn what was kept into the value of the next step."""
        return [
            Op("", COPY, a=m[1].ctypes.data, b=m[0].ctypes.data, n=m.shape[1], weights=(1.0, 0.0))
            for m in delays.values()
        ]

    def _block(self, name: str, delays: dict[int, Array], fraction: float = 0.0, every: int = 1) -> list[Op]:
        instance = self.instances[name]
        assert not isinstance(instance, ModelExchangeInstance)  # as_block needs Co-Simulation
        acting = instance.step(fraction)
        return [*self._copies(name, delays, every), *(replace(op, every=every) for op in acting)]

    def _connect_texts(self) -> None:
        for c in self.system.text_connections:
            source, target = self._fmu(c.source.participant), self._fmu(c.target.participant)
            target.text_sources[c.target.name] = source, c.source.name

    def _fmu(self, name: str) -> FMUInstance:
        instance = self.instances[name]
        assert isinstance(instance, FMUInstance)  # texts are ports of FMUs only
        return instance

    def _read_texts(self, name: str) -> list[Op]:
        instance = self.instances[name]
        return instance.read_texts() if isinstance(instance, FMUInstance) else []

    # ----------------------------------------------------------------- recorded signals

    def _addresses(self, ports: list[Port]) -> Table:
        """Return the addresses of the single floats of ports."""
        return np.array([self.address(p) + 8 * i for p in ports for i in range(p.count)], dtype=np.int64)

    def values(self, addresses: Table) -> Array:
        """Return the floats at addresses."""
        return np.array([ctypes.c_double.from_address(int(a)).value for a in addresses])

    def _sinks(self, decimation: int) -> list[Op]:
        """Return the operations that record and keep statistics; `record_to` sets the record buffer."""
        self.recorded_addresses = self._addresses(self.recorded)
        self.watched_addresses = self._addresses(self.watched)
        self.columns, m = len(self.recorded_addresses), len(self.watched_addresses)
        self.statistics = buffer(4 * m)[: 4 * m].reshape(m, 4)
        ops = []
        if self.recorded_texts:
            guarded = self.failures.guard("record", lambda t, h: self.keep_texts())
            self.callbacks.append(guarded)
            address = ctypes.cast(guarded, ctypes.c_void_p).value or 0
            names = ", ".join(map(str, self.recorded_texts))
            ops.append(Op(f"record {names} (Python callback)", CALL, address, every=decimation))
        if m:
            a, b = int(self.watched_addresses.ctypes.data), int(self.statistics.ctypes.data)
            ops.append(Op(f"statistics of {_names(self.watched)}", STATISTICS, a=a, b=b, n=m))
        if self.columns or self.recorded_texts:
            a = int(self.recorded_addresses.ctypes.data)
            text = f"record {_names(self.recorded)}" if self.columns else ""
            ops.append(Op(text, RECORD, a=a, n=self.columns, every=decimation))
        return ops

    def keep_texts(self) -> None:
        """Record the strings and binary data of the present point."""
        for port, rows in self.recorded_texts.items():
            rows.append(self._fmu(port.participant).texts[port.name])

    # ----------------------------------------------------------------- sampled coupling

    def _sampled_coupling(self, delays: dict[int, Array], decimation: int, tolerance: float | None) -> None:
        """Sampled coupling; with a tolerance, what moves and is coupled directly is iterated."""
        moving = [n for n in self.instances if not self._is_block(n)]
        coupled: list[Connection] = []
        if tolerance is not None:
            coupled = self._coupled(moving)
            self.iteration = self._iterated(coupled, tolerance)
        alone = [n for n in moving if self.iteration is None or n not in self.iteration.members]
        for name in moving:
            if self.instances[name].has_outputs:
                self.first += self.instances[name].read()
            self.first += self._read_texts(name)
        for name in self.order:
            self.first += self._block(name, delays, every=self.rates[name] or 1)
        self.first += self._sinks(decimation)
        self.first += self._remember(delays)
        for name in moving:
            self.second += self._copies(name, delays, leave=coupled)
            self.second += self.instances[name].latch() if name in alone else []
        for name in alone:
            self.second += self.instances[name].advance()
        self.second += [self.iteration.operation()] if self.iteration else []
        self.second += self._release(delays)

    def _iterated(self, coupled: list[Connection], tolerance: float) -> IteratedCoupling:
        """Return the coupling of the participants that are connected by `coupled`."""
        ends = {end.participant for c in coupled for end in (c.source, c.target)}
        members = {name: instance for name, instance in self.instances.items() if name in ends}
        ticking = [n for n in members if getattr(self.system.participants[n], "clocks", None)]
        if ticking:
            raise WiringError(
                f"{', '.join(ticking)} cannot be iterated: clocks would tick at every repetition of a step; "
                'use coupling="sampled"'
            )
        return IteratedCoupling(members, coupled, tolerance, self.address, self.run_once, self.failures)

    def _coupled(self, moving: list[str]) -> list[Connection]:
        """Return the connections that iterated coupling solves for."""
        found = [
            c
            for c in self.system.connections
            if c.source.participant in moving and c.target.participant in moving and c.initial is None
        ]
        if not found:
            raise WiringError(
                "nothing is there to iterate: no FMU or Continuous is connected to another one; "
                'use coupling="sampled"'
            )
        return found

    # ------------------------------------------------------------------- stage coupling

    def _stage_coupling(self, solver: str, delays: dict[int, Array], decimation: int) -> None:
        nodes, rows, weights = TABLEAUS[solver]
        moving = {n: i for n, i in self.instances.items() if not self._is_block(n)}
        integrated = {n: i for n, i in moving.items() if isinstance(i, Integrated)}
        assert moving == integrated  # _instance sees to it
        through = {name: instance.feedthrough() for name, instance in moving.items()}
        used = [*self.recorded, *self.watched]
        rounds = evaluation_order(self.order, through, self.system.connections, used)
        work = {n: buffer((1 + len(nodes)) * i.n_states) for n, i in integrated.items()}
        self.buffers += work.values()
        for stage, (c, row) in enumerate(zip(nodes, rows, strict=True)):
            ops: list[Op] = []
            for name, instance in integrated.items():
                if stage > 0:
                    ops += _state_of(instance, work[name], row, f"{name}: states of stage {stage + 1}")
                ops += instance.set_states(c)
            if stage == 0:
                ops += [op for name in moving for op in self._read_texts(name)]
            ops += self._evaluation(rounds, delays, c, stage)
            if stage == 0:
                self.first = [*ops, *self._sinks(decimation), *self._remember(delays)]
                for name, instance in integrated.items():
                    save = Op("", COPY, a=instance.state_address, n=instance.n_states, weights=(1.0, 0.0))
                    self.second.append(replace(save, b=int(work[name].ctypes.data)))
            else:
                self.second += ops
            for name, instance in integrated.items():
                slopes = int(work[name].ctypes.data) + 8 * instance.n_states * (1 + stage)
                self.second += self._with_inputs(name, delays)
                self.second += instance.derivatives(slopes, c)
        for name, instance in integrated.items():
            self.second += _state_of(instance, work[name], weights, f"{name}: states at t + h")
            self.second += [*instance.set_states(1.0), *instance.complete()]
        self.second += self._release(delays)

    def _with_inputs(self, name: str, delays: dict[int, Array]) -> list[Op]:
        return [*self._copies(name, delays), *self.instances[name].latch()]

    def _evaluation(
        self, rounds: list[dict[str, bool]], delays: dict[int, Array], c: float, stage: int
    ) -> list[Op]:
        """Return one evaluation of all outputs and blocks at a stage."""
        ops: list[Op] = []
        for i, members in enumerate(rounds):
            for name, feedthrough in members.items():
                if not self._is_block(name):
                    ops += self._with_inputs(name, delays) if feedthrough else []
                    final = not any(name in later for later in rounds[i + 1 :])
                    ops += self.instances[name].read(c, final)
                elif self.rates[name] is None or stage == 0:
                    ops += self._block(name, delays, c, self.rates[name] or 1)
        return ops

    # ------------------------------------------------------------------------- the loop

    def start(self, t0: float) -> None:
        """Initialize the participants."""
        for instance in self.instances.values():
            instance.start(t0)
            if isinstance(self.failures.exception, KeyboardInterrupt):
                raise self.failures.exception
            if self.failures.exception is not None:
                raise self.failures.error()
        if self.iteration is not None:
            self.iteration.start(t0)

    def loop(self) -> Loop:
        """Return the loop, compiled."""
        return Loop(self._merged(self.first), self._merged(self.second), self.failures.stop)

    def _merged(self, ops: list[Op]) -> list[Op]:
        """Join neighbouring copies of a few floats to one operation: less to look up for the loop."""
        merged: list[Op] = []
        for plain, group in groupby(ops, key=_copied_as_is):
            if plain == 0:
                merged += group
                continue
            pairs = [(op.a + 8 * i, op.b + 8 * i) for op in group for i in range(op.n)]
            table = np.array(pairs, dtype=np.int64)
            self.buffers.append(table)  # type: ignore[arg-type]
            merged.append(Op("", GATHER, a=int(table.ctypes.data), n=len(pairs), every=plain))
        return merged

    def run_once(self, loop: Loop, t0: float, k: int) -> None:
        """Run operations of a loop of their own once, at t_k = t0 + k h; raise what ends the run."""
        if loop.run(k, k + 1, k, t0, self.h):
            if isinstance(self.failures.exception, (EndOfRun, KeyboardInterrupt)):
                raise self.failures.exception
            row, _, status = (int(x) for x in loop.report[:3])
            raise self.error(loop.rows[row], t0, k, status)

    def error(self, op: Op, start: float, k: int, status: int) -> SimulationError:
        """Return what it means that an operation failed at point k with a status."""
        if self.failures.exception is not None:
            return self.failures.error()
        t = op.seconds(start, k, self.h)
        return operation_error(op, self.instances[op.participant], t, k, status)

    # ------------------------------------------------------------------------- as text

    def schedule(self) -> str:
        """Return the schedule of one communication step, a line an operation."""

        def lines(ops: list[Op]) -> list[str]:
            rated = ((op, f" (every {op.every})" if op.every > 1 else "") for op in ops if op.text)
            return [f"  {op.text}{rate}" for op, rate in rated]

        return "\n".join([self.coupling, "at t_k:", *lines(self.first), "to t_k+1:", *lines(self.second)])


def _copied_as_is(op: Op) -> int:
    """Return the rate of an operation that copies a few floats without a factor, 0 for another one."""
    return op.every if op.code == COPY and op.n <= 8 and op.weights == (1.0, 0.0) else 0


def _state_of(instance: Integrated, work: Array, weights: tuple[float, ...], text: str) -> list[Op]:
    n, a = instance.n_states, int(work.ctypes.data)
    b, c = a + 8 * n, instance.state_address
    op = Op(text, COMBINE, a=a, b=b, c=c, n=n, weights=weights, participant=instance.name)
    return [op] if n else []


def _names(ports: list[Port]) -> str:
    return ", ".join(map(str, ports))
