"""A communication step of a Model Exchange FMU from Python, from event to event.

    to the next time event, or to the end of the step:
        integrate: by one step of CVODE, or by a fixed-step method (tableaus.py) in equal substeps
        tell the model that the step is completed
        at a root, a time event or where the model asks for it: event

A time event is met exactly. What is written down of an event is what the model makes of
it: nothing is recorded there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...core.tableaus import TABLEAUS
from ...core.variables import Array
from ...loop.operations import SLACK
from ...result import SimulationError
from .continuous_time import ContinuousTime

#: so many internal steps and events that bring less than so much of a step bring nothing
_PATIENCE, _LITTLE = 1000, 1e-8


class Mover(Protocol):
    """What integrates a model."""

    def restart(self, t: float) -> None:
        """Start at t from the states of the model."""

    def step(self, t: float, until: float) -> tuple[float, bool]:
        """Go on from t, to `until` at the most; return how far, and whether a root was found there."""


class RungeKutta:
    """A fixed-step method, in so many substeps to the next event or the end of the step."""

    def __init__(self, model: ContinuousTime, solver: str, substeps: int) -> None:
        self.model = model
        self.tableau = TABLEAUS[solver]
        self.substeps = substeps
        self.x = np.zeros(max(model.n_states, 1))
        self.slopes = np.zeros((len(self.tableau[0]), self.x.size))

    def restart(self, t: float) -> None:
        """Start from the states of the model."""
        self.model.get_states(self.x.ctypes.data)

    def step(self, t: float, until: float) -> tuple[float, bool]:
        """Go from t to `until`."""
        h = (until - t) / self.substeps
        for j in range(self.substeps):
            self._substep(t + j * h, h)
        self.model.set_time(until)
        self.model.set_states(self.x.ctypes.data)
        return until, False

    def _substep(self, t: float, h: float) -> None:
        nodes, rows, weights = self.tableau
        for i, (node, row) in enumerate(zip(nodes, rows, strict=True)):
            x = self.x + h * _weighted(row, self.slopes)
            self.model.set_time(t + node * h)
            self.model.set_states(x.ctypes.data)
            if self.model.n_states and not self.model.get_derivatives(self.slopes[i].ctypes.data):
                raise SimulationError(
                    f"{self.model.fmi.name} has no derivatives at t = {t + node * h:g} s (fmi2Discard); "
                    'take a smaller step, or solver="cvode"'
                )
        self.x += h * _weighted(weights, self.slopes)


def _weighted(weights: tuple[float, ...], slopes: Array) -> Array:
    total: Array = np.asarray(weights) @ slopes[: len(weights)]
    return total


class EventSteps:
    """Carries a model over communication steps; `event` handles what happens at an instant.

    completed
        tells the model of a completed step at t; returns whether it asks for an event
    event
        handles an event at t; both know whether that is at the end of the communication step
    next_event
        (1,) time of the next time event, infinity if there is none
    """

    def __init__(
        self,
        model: ContinuousTime,
        mover: Mover,
        completed: Callable[[float, bool], bool],
        event: Callable[[float, bool], None],
        next_event: Array,
        interrupted: Callable[[], bool],
    ) -> None:
        self.model = model
        self.mover = mover
        self.completed = completed
        self.event = event
        self.next_event = next_event
        self.interrupted = interrupted

    def carry(self, t: float, h: float) -> None:
        """Carry the model from t to t + h with its inputs as they are."""
        end, steps, before = t + h, 0, t
        self.mover.restart(t)
        while True:
            timed = self.next_event[0] <= end + SLACK * h
            until = max(t, self.next_event[0]) if timed else end
            root = False
            if until - t > 100.0 * np.spacing(max(abs(t), abs(until))):
                t, root = self.mover.step(t, until)
            else:
                t = until
                self.model.set_time(t)
            at_end = t >= end - SLACK * h
            asked = self.completed(t, at_end)
            if root or asked or (timed and t >= until):
                self.event(t, at_end)
                if t < end:
                    self.mover.restart(t)
            if t >= end:
                return
            if self.interrupted():
                raise KeyboardInterrupt
            steps += 1
            if steps % _PATIENCE == 0:
                if t - before < _LITTLE * h:
                    raise SimulationError(
                        f"{self.model.fmi.name} does not come beyond t = {t:.15g} s in {_PATIENCE} internal "
                        "steps and events; do its events accumulate there, do its states grow "
                        "without bound, or is tolerance= too small?"
                    )
                before = t
