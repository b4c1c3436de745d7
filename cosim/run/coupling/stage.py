"""Stage coupling: everything with continuous state is integrated together.

A fixed-step Runge-Kutta method (core/tableaus.py) with nodes c_i, rows a_ij and weights b_i
takes the states x of all FMUs (Model Exchange) and Continuous participants over a step:

    x_i = x(t_k) + h sum_j a_ij f_j,   f_i = x' at t_k + c_i h,   x(t_{k+1}) = x(t_k) + h sum_i b_i f_i

    at t_k      stage 1: outputs and blocks, in the order of their dependence; record
    to t_{k+1}  derivatives of stage 1; for each further stage the states, outputs and blocks,
                derivatives; the states at t_{k+1}; events

Blocks run at every stage, those with a sample period at communication points only. An output
that depends directly on inputs is read after their sources (evaluation_order.py); a ring of
such outputs is an algebraic loop, which is refused.
"""

from __future__ import annotations

from ...core.tableaus import TABLEAUS
from ...loop.instance import Integrated, buffer
from ...loop.operations import Combine, Copy, Operation
from ...system.evaluation_order import evaluation_order
from ..binding import Binding
from ..recorder import Recorder
from .schedule import Schedule


def stage(binding: Binding, recorder: Recorder) -> Schedule:
    """Return the schedule of stage coupling."""
    solver = binding.plan.solver
    nodes, rows, weights = TABLEAUS[solver]
    states = {name: _States(binding, name, len(nodes)) for name in binding.moving}
    through = {name: s.instance.feedthrough() for name, s in states.items()}
    used = [*recorder.recorded, *recorder.watched]
    rounds = evaluation_order(binding.blocks, through, binding.system.connections, used)
    at_point: list[Operation] = []
    to_next = [op for s in states.values() for op in s.keep()]
    for i, (c, row) in enumerate(zip(nodes, rows, strict=True)):
        ops = at_point if i == 0 else to_next
        for s in states.values():
            ops += s.combine(row, f"states of stage {i + 1}") if i else []
            ops += s.instance.set_states(c)
        if i == 0:
            ops += [op for name in states for op in binding.instances[name].read_texts()]
        ops += _evaluation(binding, rounds, c, at_point=i == 0)
        for name, s in states.items():
            to_next += [*_inputs(binding, name), *s.instance.derivatives(s.slopes(i), c)]
    for s in states.values():
        to_next += [*s.combine(weights, "states at t + h"), *s.instance.set_states(1.0)]
        to_next += s.instance.complete()
    to_next += binding.pass_on
    return Schedule(f"stage coupling, {solver}", at_point, to_next, [s.work for s in states.values()])


class _States:
    """The states of one instance at t_k, and its slopes at the stages."""

    def __init__(self, binding: Binding, name: str, stages: int) -> None:
        instance = binding.instances[name]
        assert isinstance(instance, Integrated)  # any other instance has refused stage coupling
        self.name, self.instance, self.n = name, instance, instance.n_states
        self.work = buffer((1 + stages) * self.n)

    def slopes(self, stage: int) -> int:
        """Return the address of the slopes at a stage."""
        return int(self.work.ctypes.data) + 8 * self.n * (1 + stage)

    def keep(self) -> list[Operation]:
        """Keep the states at t_k."""
        op = Copy(source=self.instance.state_address, target=self.slopes(-1), count=self.n)
        return [op] if self.n else []

    def combine(self, weights: tuple[float, ...], text: str) -> list[Operation]:
        """Compute states from those at t_k and weighted slopes."""
        op = Combine(
            text=f"{self.name}: {text}",
            start=self.slopes(-1),
            slopes=self.slopes(0),
            result=self.instance.state_address,
            count=self.n,
            weights=weights,
            participant=self.name,
        )
        return [op] if self.n else []


def _inputs(binding: Binding, name: str) -> list[Operation]:
    return [*binding.copies(name), *binding.instances[name].latch()]


def _evaluation(binding: Binding, rounds: list[dict[str, bool]], c: float, at_point: bool) -> list[Operation]:
    """Return the evaluation of all outputs and blocks at a stage."""
    ops: list[Operation] = []
    for i, members in enumerate(rounds):
        for name, after_inputs in members.items():
            if name in binding.every:
                ops += binding.block(name, c) if at_point or binding.every[name] is None else []
            else:
                ops += _inputs(binding, name) if after_inputs else []
                final = not any(name in later for later in rounds[i + 1 :])
                ops += binding.instances[name].read(c, final)
    return ops
