"""Iterated coupling: FMUs and Continuous participants that drive each other, without delay.

Under sampled coupling each of two coupled plants holds the other one's value at t_k, which
is an error of first order in h and can make the loop unstable. Here the exchanged values w
are solved for at t_{k+1}: each step is taken with their mean held,

    hold (w_k + w_{k+1}) / 2 over [t_k, t_{k+1}],  w_{k+1} = outputs at t_{k+1} with w_{k+1} as inputs,

and is undone and repeated until w_{k+1} agrees with itself (quasi_newton.py). So the interface
conditions hold at every communication point, direct feedthrough in a ring included, and
the coupling is of second order. The outputs of blocks are held over the step, as under
sampled coupling, whose schedule at t_k is used.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Array
from ...core.port import Port
from ...errors import WiringError
from ...loop.instance import buffer
from ...loop.loop import Loop
from ...loop.operations import Call, Copy, Operation
from ...loop.signals import EndOfRun
from ...result import SimulationError
from ...system.system import Connection
from ..binding import Binding
from .quasi_newton import NoConvergence, QuasiNewton
from .sampled import at_point
from .schedule import Schedule


def iterated(binding: Binding) -> Schedule:
    """Return the schedule of iterated coupling."""
    moving, connections = set(binding.moving), binding.system.connections
    coupled = [
        c for c in connections if {c.source.participant, c.target.participant} <= moving and c.initial is None
    ]
    if not coupled:
        raise WiringError(
            "iterated coupling has nothing to iterate: no FMU or Continuous is connected to another one; "
            'use coupling="sampled"'
        )
    iteration = Iteration(binding, coupled)
    alone = [name for name in binding.moving if name not in iteration.members]
    to_next: list[Operation] = []
    for name in binding.moving:
        to_next += binding.copies(name, without=coupled)
        to_next += binding.instances[name].latch() if name in alone else []
    to_next += [op for name in alone for op in binding.instances[name].advance()]
    to_next += [iteration.operation(), *binding.pass_on]
    return Schedule(
        "iterated coupling", at_point(binding), to_next, memory=iteration.memory, start=iteration.start
    )


class Iteration:
    """The components that drive each other, and the solver for the values that they exchange."""

    def __init__(self, binding: Binding, coupled: list[Connection]) -> None:
        self._binding = binding
        ends = {end.participant for c in coupled for end in (c.source, c.target)}
        #: the components, in the order of the system
        self.members = {name: i for name, i in binding.instances.items() if name in ends}
        reasons = {name: i.unrepeatable for name, i in self.members.items() if i.unrepeatable}
        for reason in reasons.values():
            names = ", ".join(name for name, its in reasons.items() if its == reason)
            raise WiringError(f'{names} cannot be iterated: {reason}; use coupling="sampled"')
        self._sources = list(dict.fromkeys(c.source for c in coupled))
        n = sum(port.count for port in self._sources)
        #: the values that are written to the inputs, and those that the outputs return
        self._held, self._outputs = buffer(n), buffer(n)
        held, outputs = int(self._held.ctypes.data), int(self._outputs.ctypes.data)
        places: dict[Port, int] = {}
        for port in self._sources:
            places[port] = sum(8 * p.count for p in places)
        #: the operations that write the inputs and collect the outputs
        self._give = [binding.copy_from(c, held + places[c.source]) for c in coupled]
        self._collect = [
            Copy(source=binding.address(p), target=outputs + place, count=p.count)
            for p, place in places.items()
        ]
        self._solver = QuasiNewton(n, binding.plan.tolerance)
        #: the exchanged values at t_k and at t_{k-1}
        self._w, self._before = np.full((2, n), np.nan)
        self.memory: list[Array] = [self._w, self._before, *self._solver.arrays()]
        self._loops: tuple[Loop, Loop] | None = None
        self._callback = binding.signals.callback(next(iter(self.members)), self._step)

    def operation(self) -> Operation:
        """Return the operation that takes the members from t_k to t_{k+1}."""
        text = (
            f"{', '.join(self.members)}: step, repeated until {', '.join(map(str, self._sources))} "
            f"agree at t_k+1 to {self._solver.tolerance:g} (Python callback)"
        )
        return Call(text=text, function=self._callback, participant=next(iter(self.members)))

    def start(self) -> None:
        """Make the outputs at t_0 agree with the inputs that follow from them."""
        instances = list(self.members.values())
        latch = [op for i in instances for op in i.latch()]
        move = [op for i in instances for op in i.advance()]
        before, after = ([op for i in instances for op in i.read(c)] for c in (0.0, 1.0))
        look = self._loop([*latch, *before, *self._collect])
        again = self._loop([*self._give, *latch, *before, *self._collect])
        self._loops = (
            self._loop([*self._give, *latch, *move]),
            self._loop([*self._give, *latch, *after, *self._collect]),
        )

        def g(w: Array) -> Array:
            return self._exchange(again, 0, w)

        solver = QuasiNewton(len(self._w), self._solver.tolerance)
        try:
            self._binding.run_once(look, 0)
            self._w[:] = self._before[:] = self._solved(
                solver, g, self._outputs.copy(), self._binding.plan.start
            )
        except EndOfRun as end:
            raise SimulationError(f"{end.text}, at the start of the run") from None

    def _loop(self, ops: list[Operation]) -> Loop:
        return Loop(ops, [], [], self._binding.signals.stop)

    def _exchange(self, loop: Loop, k: int, w: Array) -> Array:
        """Write values to the inputs, run a loop, and return the values of the outputs."""
        self._held[:] = w
        self._binding.run_once(loop, k)
        return self._outputs.copy()

    def _step(self, t: float, h: float) -> None:
        """Take the step from t; the outputs are left as they are at t + h."""
        assert self._loops is not None
        move, look = self._loops
        k = round((t - self._binding.plan.start) / h)
        saved = {name: instance.save(serialised=False) for name, instance in self.members.items()}
        moved, signals = False, self._binding.signals
        asked = signals.end

        def g(w: Array) -> Array:
            nonlocal moved
            if moved:
                for name, instance in self.members.items():
                    instance.restore(saved[name])
                signals.set_end(asked)
            moved = True
            self._exchange(move, k, 0.5 * (self._w + w))
            return self._exchange(look, k, w)

        w = self._solved(self._solver, g, 2.0 * self._w - self._before, t + h)
        self._before[:], self._w[:] = self._w, w
        for name, instance in self.members.items():
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
