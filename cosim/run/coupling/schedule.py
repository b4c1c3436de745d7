"""The schedule: the operations of one communication step, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from ...arrays import Array
from ...loop.operations import Operation


@dataclass(frozen=True)
class Schedule:
    """The operations of a coupling.

    at_point
        evaluate the outputs and blocks at t_k; the recorder follows
    to_next
        carry the system to t_{k+1}
    memory
        arrays of the coupling itself, which live as long as it and belong to a snapshot
    start
        runs once at t_0, when the instances have been initialized
    """

    title: str
    at_point: list[Operation]
    to_next: list[Operation]
    memory: list[Array] = field(default_factory=list)
    start: Callable[[], None] = lambda: None

    def text(self, recording: Iterable[Operation]) -> str:
        """Return the schedule with the operations that record, one line per operation."""

        def lines(ops: Iterable[Operation]) -> list[str]:
            return [f"  {op.line()}" for op in ops if op.text]

        at_point = lines([*self.at_point, *recording])
        return "\n".join([self.title, "at t_k:", *at_point, "to t_k+1:", *lines(self.to_next)])
