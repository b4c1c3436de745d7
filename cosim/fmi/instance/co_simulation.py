"""A running FMU with Co-Simulation: doStep, and the events that interrupt it.

A step of FMI 3.0 that returns early is continued; in event mode, events are handled at their
instants and discrete inputs that changed are set at t_k (driver.py). All of this is Python, which
the loop enters only if a step was interrupted.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from typing import Any

from ...loop.fmi_operations import FMI2DoStep, FMI3DoStep
from ...loop.operations import SLACK, Operation
from ...result import SimulationError
from .driver import DISCARD, Driver
from .events import EventInstance
from .timers import Timers


class CoSimulationInstance(EventInstance):
    """One instance of an FMU in a run, with Co-Simulation in steps of h, in s."""

    def __init__(self, driver: Driver, used: Set[str], h: float) -> None:
        super().__init__(driver, used)
        self._timers = Timers(driver, self.fmu.clocks.values(), h)

    def start(self, t0: float) -> None:
        """Take the FMU through initialization and, in event mode, the events of the start."""
        super().start(t0)
        if self.driver.event_mode:
            self._start_events(t0)

    def _settle(self, t0: float) -> None:
        self._timers.start(t0, self.intervals)

    def _due(self, t: float) -> list[int]:
        return self._timers.due(t)

    def step(self, fraction: float = 0.0) -> list[Operation]:
        """Act as a block: set the inputs, step from t_k, get the outputs, which are valid at t_k."""
        stepped = (replace(op, fraction=fraction) for op in self.advance())
        read = [*self.read(), *self.read_texts()]
        return [*self.latch(), *stepped, *(replace(op, text="") for op in read)]

    def advance(self) -> list[Operation]:
        """Do the step."""
        common: dict[str, Any] = {
            "text": f"{self.name}: step (FMU)",
            "participant": self.name,
            "function": self.driver.address("DoStep"),
            "component": self._component,
        }
        answer = self.driver.answer
        if answer is None:
            return [FMI2DoStep(discarded=self.signals.callback(self.name, self._discarded), **common)]
        flags, times = int(answer.flags.ctypes.data), int(answer.times.ctypes.data)
        finish = self.signals.callback(self.name, lambda t, h: self.driver.finish_step(t, h, self))
        return [FMI3DoStep(flags=flags, times=times, interrupted=finish, **common)]

    def _discarded(self, t: float, h: float) -> None:
        """Find out why FMI 2.0 discarded a step: to end the run, or because it failed."""
        last = self.driver.asks_to_end()
        if last is None:
            raise SimulationError(self.driver.logged(self.driver.failure(DISCARD, t)))
        self.end_run(last, last >= t + h - SLACK * h)
