"""A running FMU with Co-Simulation: doStep, and what interrupts it.

A step of FMI 3.0 that comes back early at t' is continued from there until t_{k+1}. In
event mode an event that ended it is handled at t', a time event that falls into the step
splits it, and discrete inputs that changed are set at t_k. All of this is Python, which
the loop enters only when there is something to do.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...errors import FMUError
from ...loop.fmi_operations import FMI2DoStep, FMI3DoStep
from ...loop.operations import SLACK, Operation
from ...loop.signals import RunSignals
from ...result import SimulationError
from ..clocks import Timers
from ..fmu import FMU
from .adapter import StepAnswer
from .events import EVENT_ITERATIONS, EventInstance

_DISCARD = 2


class CoSimulationInstance(EventInstance):
    """One instance of an FMU in a run, with Co-Simulation."""

    def __init__(self, name: str, fmu: FMU, failures: RunSignals, used: set[str], h: float) -> None:
        super().__init__(name, fmu, failures, used)
        self._timers = Timers(self.fmi, fmu.clocks.values(), h)
        self.event_mode = fmu.event_mode
        if self.fmi.answer is not None:
            self.event_time = self.fmi.answer.event_time

    def start(self, t0: float) -> None:
        """Take the FMU through initialization and, in event mode, the events of the start."""
        super().start(t0)
        if self.event_mode:
            self._start_events(t0)

    def _settle(self, t0: float) -> None:
        self._timers.start(t0, self.intervals)

    def _due(self, t: float) -> list[int]:
        return self._timers.due(t)

    def step(self, fraction: float = 0.0) -> list[Operation]:
        """Act as a block: set the inputs, step from t_k, get the outputs, which count at t_k."""
        stepped = (replace(op, fraction=fraction) for op in self.advance())
        read = [*self.read(), *self.read_texts()]
        return [*self.latch(), *stepped, *(replace(op, text="") for op in read)]

    def advance(self) -> list[Operation]:
        """Do the step."""
        name, function = self.name, self._function(f"{self.fmi.PREFIX}DoStep")
        common: dict[str, Any] = {"text": f"{name}: step (FMU)", "participant": name, "function": function}
        common["component"] = self._component
        answer = self.fmi.answer
        if answer is None:
            return [FMI2DoStep(discarded=self.failures.callback(name, self._discarded), **common)]
        flags, times = int(answer.flags.ctypes.data), int(answer.times.ctypes.data)
        finish = self.failures.callback(name, lambda t, h: self._finish_step(answer, t, h))
        return [FMI3DoStep(flags=flags, times=times, interrupted=finish, **common)]

    def _resume(self) -> None:
        self.fmi.attempt("enter step mode", self.api.enterStepMode)

    def _discarded(self, t: float, h: float) -> None:
        """Find out why a step of FMI 2.0 was discarded: to end the run, or because it failed."""
        last = self.fmi.asks_to_end()
        if last is None:
            raise SimulationError(self.fmi.logged(self.fmi.failure(_DISCARD, t)))
        self.failures.ask_to_end(self.name, last, last >= t + h - SLACK * h)

    def _finish_step(self, answer: StepAnswer, t: float, h: float) -> None:
        """Go on with the step over [t, t + h] from where it was interrupted, until its end."""
        end, near = t + h, SLACK * h
        now, stuck = answer.came_to(end), 0
        while True:
            if answer.terminate:
                self.failures.ask_to_end(self.name, now, now >= end - near)
            if self.event_mode and (answer.event or self.event_time[0] <= now):
                self._event(now, now >= end - near)
            if now >= end - near:
                answer.flags[:] = 0
                return
            if self.failures.interrupted:
                raise KeyboardInterrupt
            event = float(self.event_time[0])
            # a time event at the end, to rounding, is met at its own instant
            before, until = now, event if now < event <= end + near else end
            self._do_step(answer, before, until - before)
            now = answer.came_to(until)
            stuck = 0 if now > before else stuck + 1
            if stuck > (EVENT_ITERATIONS if self.event_mode and answer.event else 0):
                raise FMUError(
                    f"{self.name} returns early from its step at t = {before:g} s without getting on (the "
                    f"communication step is from {t:g} s to {end:g} s); look at its inputs and at its log"
                )

    def _do_step(self, answer: StepAnswer, t: float, h: float) -> None:
        answer.take(*self.fmi.attempt("do its step", lambda: self.api.doStep(t, h, False)))
