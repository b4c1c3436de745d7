"""Iterated coupling: FMUs and Continuous participants that drive each other, without delay.

Under sampled coupling each of two coupled plants holds what the other one gave at t_k, an
error of first order in h that can destabilise. Here the values w that they exchange are
solved for at t_{k+1}: each step is taken with their mean held,

    hold (w_k + w_{k+1}) / 2 over [t_k, t_{k+1}],  w_{k+1} = outputs at t_{k+1} with w_{k+1} as inputs,

undone and repeated until w_{k+1} agrees with itself (quasi_newton.py). So the interface
conditions hold at every communication point, direct feedthrough in a ring included, and
the coupling is of second order. What blocks give is held over the step, as always.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from ...core.port import Port
from ...core.variables import Array
from ...errors import WiringError
from ...fmi.instance.co_simulation import CoSimulationInstance
from ...fmi.instance.model_exchange import ModelExchangeInstance
from ...loop.loop import Loop
from ...loop.operations import CALL, Op
from ...loop.signals import EndOfRun, Failures
from ...result import SimulationError
from ...system.system import Connection
from ..kernel_instance import KernelInstance
from .quasi_newton import NoConvergence, QuasiNewton

Coupled: TypeAlias = KernelInstance | CoSimulationInstance | ModelExchangeInstance


class IteratedCoupling:
    """The participants that drive each other, and the solver of what they exchange."""

    def __init__(
        self,
        members: Mapping[str, Coupled],
        connections: list[Connection],
        tolerance: float,
        address: Callable[[Port], int],
        run_once: Callable[[Loop, float, int], None],
        failures: Failures,
    ) -> None:
        """Take the members by name, the connections between them, and the program's services.

        address
            returns where the floats of a port lie
        run_once
            runs the operations of a loop at t_0 + k h; raises what ends the run
        """
        self._instances = members
        #: the participants, in the order of the system
        self.members = list(members)
        self._run_once = run_once
        self._failures = failures
        unable = [name for name, instance in self._instances.items() if not instance.can_save]
        if unable:
            raise WiringError(
                f"{', '.join(unable)} cannot get and set its state (canGetAndSetFMUState), which iterated "
                'coupling needs to repeat a step; use coupling="sampled", or export it with that capability'
            )
        self._sources = list(dict.fromkeys(c.source for c in connections))
        self._views = [_floats(address(p), p.count) for p in self._sources]
        n = 0
        where = {}
        for port in self._sources:
            where[port] = slice(n, n + port.count)
            n += port.count
        self._inputs = [
            (_floats(address(c.target), c.target.count), where[c.source], c.scale, c.offset)
            for c in connections
        ]
        self._solver = QuasiNewton(n, tolerance)
        #: what is exchanged at t_k and at t_{k-1}
        self._w, self._before = np.full((2, n), np.nan)
        self._t0 = 0.0
        self._loops: tuple[Loop, Loop] | None = None
        self._callback = failures.guard(self.members[0], self._step)

    def operation(self) -> Op:
        """Return the operation that moves the members from t_k to t_{k+1}."""
        address = ctypes.cast(self._callback, ctypes.c_void_p).value or 0
        text = (
            f"{', '.join(self.members)}: step, repeated until {', '.join(map(str, self._sources))} "
            f"agree at t_k+1 to {self._solver.tolerance:g} (Python callback)"
        )
        return Op(text, CALL, address, participant=self.members[0])

    def arrays(self) -> list[Array]:
        """Return the memory that belongs to the state of a simulation."""
        return [self._w, self._before, *self._solver.arrays()]

    def start(self, t0: float) -> None:
        """Let the outputs at t_0 agree with the inputs that they are."""
        self._t0 = t0
        every = list(self._instances.values())
        latch = [op for i in every for op in i.latch()]
        stop = self._failures.stop
        look = Loop([*latch, *(op for i in every for op in i.read(0.0))], [], stop)
        after = [op for i in every for op in i.read(1.0)]
        move = Loop([*latch, *(op for i in every for op in i.advance())], [], stop)
        self._loops = move, Loop([*latch, *after], [], stop)

        def g(w: Array) -> Array:
            self._hold(w)
            self._run_once(look, t0, 0)
            return self._outputs()

        solver = QuasiNewton(len(self._w), self._solver.tolerance)
        try:
            self._run_once(look, t0, 0)
            self._w[:] = self._before[:] = self._solved(solver, g, self._outputs(), t0)
        except EndOfRun as end:
            raise SimulationError(f"{end.text}, which is its start") from None

    def _step(self, t: float, h: float) -> None:
        """Take the step from t; the outputs are left as they are at t + h."""
        assert self._loops is not None
        move, look = self._loops
        k = round((t - self._t0) / h)
        saved = {name: instance.save(serialised=False) for name, instance in self._instances.items()}
        moved, asked = False, self._failures.end

        def g(w: Array) -> Array:
            nonlocal moved
            if moved:
                for name, instance in self._instances.items():
                    instance.restore(saved[name])
                self._failures.set_end(asked)
            moved = True
            self._hold(0.5 * (self._w + w))
            self._run_once(move, self._t0, k)
            self._hold(w)
            self._run_once(look, self._t0, k)
            return self._outputs()

        w = self._solved(self._solver, g, 2.0 * self._w - self._before, t + h)
        self._before[:], self._w[:] = self._w, w
        for name, instance in self._instances.items():
            instance.forget(saved[name])

    def _solved(self, solver: QuasiNewton, g: Callable[[Array], Array], guess: Array, t: float) -> Array:
        try:
            return solver.solve(g, guess)
        except NoConvergence as error:
            worst = int(np.argmax(error.residual))
            name = [f"{p.participant}.{p.name}" for p in self._sources for _ in range(p.count)][worst]
            raise SimulationError(
                f"the coupling of {', '.join(self.members)} did not converge at t = {t:g} s: {name} is off "
                f"by {error.residual[worst]:.3g} of its size, tolerance {solver.tolerance:g}; "
                "take a smaller step=, or a larger tolerance="
            ) from None

    def _hold(self, w: Array) -> None:
        for view, part, scale, offset in self._inputs:
            view[:] = scale * w[part] + offset

    def _outputs(self) -> Array:
        return np.concatenate(self._views)


def _floats(address: int, n: int) -> Array:
    """Return n floats at an address as an array."""
    array: Array = np.ctypeslib.as_array((ctypes.c_double * n).from_address(address))
    return array
