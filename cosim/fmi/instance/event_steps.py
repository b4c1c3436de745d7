"""The integration of a Model Exchange FMU over a communication step in Python, from event to event.

    repeat, to the next time event or to the end of the step:
        integrate by one step of CVODE, or by a fixed-step method (tableaus.py) in equal substeps
        report the completed step to the model
        at a root, at a time event, or if the model asks for it: handle an event

Time events are met exactly. Nothing is recorded at an event.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...core.tableaus import TABLEAUS
from ...loop.operations import SLACK
from ...result import SimulationError
from .continuous_time import ContinuousTime
from .driver import Interrupts

#: a number of internal steps and events, and the part of a communication step that they must cover
_PATIENCE, _LITTLE = 1000, 1e-8


class Integrator(Protocol):
    """An integrator of a model; times in s."""

    def restart(self, t: float) -> None:
        """Start at t from the states of the model."""

    def step(self, t: float, until: float) -> tuple[float, bool]:
        """Integrate from t, at most to `until`; return the time reached, and whether it is a root."""


class RungeKutta:
    """A fixed-step method, in equal substeps to the next event or the end of the step.

    model_exchange.py makes the same steps of whole communication steps, for the compiled loop.
    """

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
        """Integrate from t to `until`."""
        h = (until - t) / self.substeps
        for j in range(self.substeps):
            self._substep(t + j * h, h)
        self.model.set_time(until)
        self.model.set_states(self.x.ctypes.data)
        return until, False

    def _substep(self, t: float, h: float) -> None:
        nodes, rows, weights = self.tableau
        for i, (node, row) in enumerate(zip(nodes, rows, strict=True)):
            x = self.x + h * (np.asarray(row) @ self.slopes[:i])
            self.model.set_time(t + node * h)
            self.model.set_states(x.ctypes.data)
            if self.model.n_states and not self.model.get_derivatives(self.slopes[i].ctypes.data):
                raise SimulationError(
                    f"{self.model.driver.name} has no derivatives at t = {t + node * h:g} s (it discards the "
                    'call); take a smaller step, or ModelExchange(solver="cvode")'
                )
        self.x += h * (np.asarray(weights) @ self.slopes)


class EventSteps:
    """The integration of a model over communication steps.

    completed
        reports a completed step at t to the model, and whether t is the end of the communication
        step; returns whether an event is to be handled
    owner
        handles the events
    """

    def __init__(
        self,
        model: ContinuousTime,
        integrator: Integrator,
        completed: Callable[[float, bool], bool],
        owner: Interrupts,
    ) -> None:
        self.model = model
        self.integrator = integrator
        self.completed = completed
        self.owner = owner
        self.next_event = model.driver.event_time

    def carry(self, t: float, h: float) -> None:
        """Carry the model from t to t + h with its inputs held."""
        end, steps, before = t + h, 0, t
        self.integrator.restart(t)
        while True:
            timed = self.next_event[0] <= end + SLACK * h
            until = max(t, self.next_event[0]) if timed else end
            root = False
            if until - t > 100.0 * np.spacing(max(abs(t), abs(until))):
                t, root = self.integrator.step(t, until)
            else:
                t = until
                self.model.set_time(t)
            at_end = t >= end - SLACK * h
            asked = self.completed(t, at_end)
            if root or asked or (timed and t >= until):
                self.owner.handle_event(t, at_end)
                if t < end:
                    self.integrator.restart(t)
            if t >= end:
                return
            if self.model.driver.signals.interrupted:
                raise KeyboardInterrupt
            steps += 1
            if steps % _PATIENCE == 0:
                if t - before < _LITTLE * h:
                    raise SimulationError(
                        f"{self.model.driver.name} does not get past t = {t:.15g} s in {_PATIENCE} internal "
                        "steps and events; check whether its events accumulate there, its states grow "
                        "without bound, or the tolerance is too small"
                    )
                before = t
