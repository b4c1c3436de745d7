"""The binding of a system: its components as running instances, its connections as copies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from ..arrays import Array
from ..core.component import Component
from ..core.participant import Participant
from ..core.port import Port
from ..core.time_grid import steps_between
from ..errors import WiringError
from ..loop.instance import Instance, MakesInstance, Setting, Stepping
from ..loop.loop import Loop
from ..loop.operations import Copy, Operation
from ..loop.signals import EndOfRun, RunSignals, operation_error
from ..result import SimulationError
from ..system.system import Connection, System
from .kernel_instance import KernelInstance
from .plan import RunPlan


class Binding:
    """The running instances of a system, and the operations that carry values between them.

    blocks
        names of the instances that act at communication points, in the order of their connections
    moving
        names of the others
    every
        a block acts at every n-th communication point; None where it follows the coupling
    memory
        the values of delayed connections: a row for t_{k-1}, which the whole step uses, and one
        for t_k
    """

    def __init__(self, system: System, plan: RunPlan, used: Iterable[Port]) -> None:
        """Make the instances; `used` are the ports that are read in addition to the connected ones."""
        self.system, self.plan, self.signals = system, plan, RunSignals()
        self.instances: dict[str, Instance] = {}
        components = system.participants
        self.blocks = system.block_order()
        self.moving = [name for name, component in components.items() if not component.as_block]
        self.every = {name: self._every(name, components[name]) for name in self.blocks}
        ends = [end for c in system.connections for end in (c.source, c.target)]
        names: dict[str, set[str]] = defaultdict(set)
        for port in [*used, *ends, *(c.source for c in system.text_connections)]:
            names[port.participant].add(port.name)
        try:
            for name, component in components.items():
                every = self.every.get(name)
                setting = Setting(
                    step=plan.step * (every or 1),
                    every=every,
                    is_stage=plan.coupling == "continuous",
                    jit=plan.jit,
                    used=names[name],
                    signals=self.signals,
                )
                self.instances[name] = _instance(name, component, setting)
            for c in system.text_connections:
                target = self.instances[c.target.participant]
                target.text_sources[c.target.name] = self.instances[c.source.participant], c.source.name
        except BaseException:
            self.close()
            raise
        self.memory: list[Array] = []
        #: the operations that keep the sources of delayed connections at t_k, and pass them on to t_{k+1}
        self.keep: list[Operation] = []
        self.pass_on: list[Operation] = []
        self._copies: dict[str, list[tuple[Connection, Copy]]] = defaultdict(list)
        for c in system.connections:
            source = self.address(c.source) if c.initial is None else self._delayed(c, c.initial)
            self._copies[c.target.participant].append((c, self._copy(c, source)))

    def _every(self, name: str, block: Component) -> int | None:
        if block.sample_period is None:
            return block.every
        return steps_between(block.sample_period, self.plan.step, f"{name}: sample period")

    def close(self) -> list[str]:
        """Free the instances; return the crashes of isolated ones while they were freed."""
        return [crash for instance in self.instances.values() if (crash := instance.stop())]

    # --------------------------------------------------------------------- connections

    def address(self, port: Port) -> int:
        """Return the address of the floats of a port."""
        return self.instances[port.participant].address(port.name) + 8 * port.first

    def text(self, port: Port) -> str | bytes:
        """Return the string or binary data of a port."""
        text: str | bytes = self.instances[port.participant].texts[port.name]
        return text

    def _delayed(self, c: Connection, initial: Array) -> int:
        """Return the address of the source of a connection one step earlier."""
        memory = np.tile(initial, (2, 1))
        self.memory.append(memory)
        used, kept = (int(row.ctypes.data) for row in memory)
        n, text = c.source.count, f"keep {c.source} for the next step"
        self.keep.append(Copy(text=text, source=self.address(c.source), target=kept, count=n))
        self.pass_on.append(Copy(source=kept, target=used, count=n))
        return used

    def _copy(self, c: Connection, source: int) -> Copy:
        return Copy(
            text=str(c),
            source=source,
            target=self.address(c.target),
            count=c.target.count,
            factor=c.scale,
            offset=c.offset,
            spread=c.source.count != c.target.count,
        )

    def copies(self, name: str, every: int = 1, without: Collection[Connection] = ()) -> list[Operation]:
        """Return the operations that copy the inputs of an instance, without some connections."""
        left_out = {id(c) for c in without}
        return [replace(op, every=every) for c, op in self._copies[name] if id(c) not in left_out]

    def copy_from(self, c: Connection, source: int) -> Operation:
        """Return the operation of a connection, with another source address."""
        return replace(self._copy(c, source), text="")

    def block(self, name: str, fraction: float = 0.0) -> list[Operation]:
        """Return the operations that copy the inputs of a block and run it."""
        instance, every = self.instances[name], self.every[name] or 1
        assert isinstance(instance, Stepping)
        acting = (replace(op, every=every) for op in instance.step(fraction))
        return [*self.copies(name, every), *acting]

    # ----------------------------------------------------------------------------- run

    def start(self, t0: float) -> None:
        """Initialize the instances at t_0."""
        for instance in self.instances.values():
            instance.start(t0)
            if isinstance(self.signals.exception, KeyboardInterrupt):
                raise self.signals.exception
            if self.signals.exception is not None:
                raise self.signals.error()

    def run_once(self, loop: Loop, k: int) -> None:
        """Run a loop at t_k; raise the exception that ends the run."""
        if loop.run(k, k + 1, k, self.plan.start, self.plan.step):
            if isinstance(self.signals.exception, (EndOfRun, KeyboardInterrupt)):
                raise self.signals.exception
            raise self.error(loop)

    def error(self, loop: Loop) -> SimulationError:
        """Return the error of a loop that has stopped."""
        if self.signals.exception is not None:
            return self.signals.error()
        row, k, status = loop.report.tolist()
        op = loop.operations[row]
        t = op.seconds(self.plan.start, k, self.plan.step)
        return operation_error(op, self.instances[op.participant], t, k, status)


def _instance(name: str, component: Component, setting: Setting) -> Instance:
    if isinstance(component, MakesInstance):
        return component.instance(name, setting)
    if isinstance(component, Participant):
        return KernelInstance(name, component, setting)
    raise WiringError(
        f"{name}: {type(component).__name__} makes no running instance; derive it from Block or Continuous, "
        "or give it a method instance(name, setting)"
    )
