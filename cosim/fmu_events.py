"""Event mode: what Model Exchange and Co-Simulation with event mode do alike.

Discrete inputs that changed are set in event mode; discrete states are updated until they
stay; then the FMU says when its next time event is due.
"""

from __future__ import annotations

import ctypes
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from .errors import FMUError, SimulationError
from .fmu import FMU
from .fmu_instance import Exchange, FMUInstance
from .instances import Failures
from .opcodes import CALL, Op

EVENT_ITERATIONS = 1000  # at one instant; more is a chain of events without end


class EventInstance(FMUInstance):
    """One instance of an FMU whose events are handled here."""

    #: whether there is an event mode, in which alone discrete inputs can be set
    event_mode: bool = True

    def __init__(self, name: str, fmu: FMU, failures: Failures, used: set[str]) -> None:
        super().__init__(name, fmu, failures, used)
        #: when the next time event is due
        self.event_time = np.array([np.inf])
        self.input_callbacks: list[Any] = []

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [*super().arrays(), self.event_time]

    @abstractmethod
    def _resume(self) -> None:
        """Leave event mode."""

    def _set_inputs(self, x: Exchange) -> list[Op]:
        if not (self.event_mode and x.discrete):
            return super()._set_inputs(x)
        if not self.used & x.addresses.keys():
            return []
        return [*self._from_floats(x), self._event_input(x)]

    def _event_input(self, x: Exchange) -> Op:
        """Set discrete inputs when they change, which is an event."""

        def tell(t: float, h: float) -> None:
            if not np.array_equal(x.raw, x.told):
                x.told[:] = x.raw
                values, references = x.raw.tolist(), x.references.tolist()
                setter = getattr(self.api, f"set{x.access}")
                self._event(t, False, lambda: setter(references, values))

        self.input_callbacks.append(self.failures.guard(self.name, tell))
        address = ctypes.cast(self.input_callbacks[-1], ctypes.c_void_p).value or 0
        return Op(f"{self.name}: discrete inputs (Python callback)", CALL, address, participant=self.name)

    def _event(self, t: float, at_end: bool, change: Callable[[], Any] = lambda: None) -> None:
        """Handle an event at t, inside a step or at its end; inputs may change."""
        self.fmi.attempt("enter event mode", self.api.enterEventMode)
        self.fmi.attempt("set its discrete inputs", change)
        ends = self._discrete_states(t)
        self._resume()
        if ends:
            self.failures.ask_to_end(self.name, t, at_end)

    def _start_events(self, t0: float) -> None:
        """Handle the events of the start."""
        if self._discrete_states(t0):
            raise SimulationError(f"{self.name} asked to end the simulation at its start, t = {t0:g} s")
        self._resume()

    def _discrete_states(self, t: float) -> bool:
        """Update the discrete states until they stay; return whether the FMU asks to end the run."""
        for _ in range(EVENT_ITERATIONS):
            again, end, _, _, timed, time = self.fmi.attempt(
                "update its discrete states", self.fmi.discrete_states
            )
            if end or not again:
                self.event_time[0] = time if timed else np.inf
                return bool(end)
        raise FMUError(f"{self.name}: the event at t = {t:g} s does not end in {EVENT_ITERATIONS} iterations")
