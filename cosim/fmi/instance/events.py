"""Event handling of a running FMU: with Model Exchange, and with Co-Simulation in event mode.

In event mode, discrete inputs that changed are set and clocks that are due are activated. The
discrete states are then updated until they no longer change, and the FMU gives the time of its
next time event. Clocked variables are set and got while their clock is active.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from types import MappingProxyType
from typing import Any

import numpy as np

from ...loop.operations import Call, Copy, Operation
from ...result import SimulationError
from .driver import Driver
from .instance import FMUInstance, VariableGroup


class EventInstance(FMUInstance):
    """One instance of an FMU, with the handling of its events."""

    def __init__(self, driver: Driver, used: Set[str]) -> None:
        super().__init__(driver, used)
        #: (1,) time of the next time event, in s
        self.event_time = driver.event_time
        self._output_clocks = [c.reference for c in self.fmu.clocks.values() if c.is_output]

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [*super().arrays(), self.event_time]

    def _due(self, t: float) -> list[int]:
        """Return the references of the clocks that tick at the communication point t by an interval."""
        return []

    # ---------------------------------------------------------------------- operations

    def latch(self) -> list[Operation]:
        """Set the inputs; discrete ones, where there is an event mode, in an event."""
        waiting = [x for x in self.inputs if self.driver.event_mode and x.discrete]
        native = [op for x in self.inputs if x not in waiting for op in self._set_inputs(x)]
        forget = [self._scaled(x.last, x.last, 0.0) for x in self.outputs if x.is_clock]
        if not self.driver.event_mode:
            return [*native, *self._latch_texts()]
        if not waiting and not self.fmu.clocks and not self.text_sources:
            return native
        send = self.signals.callback(self.name, lambda t, h: self._send(t, waiting))
        what = "discrete inputs and clocks" if self.fmu.clocks else "discrete inputs"
        sent = Call(text=f"{self.name}: {what} (Python callback)", function=send, participant=self.name)
        return [*native, *forget, *(op for x in waiting for op in self._from_floats(x)), sent]

    def _get_outputs(self, x: VariableGroup, final: bool) -> list[Operation]:
        if x.is_clock:
            return [self._scaled(x.last, x.values, 1.0)]
        return [] if x.clocks else super()._get_outputs(x, final)

    def _scaled(self, source: Any, target: Any, factor: float) -> Operation:
        a, b = int(source.ctypes.data), int(target.ctypes.data)
        return Copy(source=a, target=b, count=len(source), factor=factor, participant=self.name)

    # -------------------------------------------------------------------------- events

    def _send(self, t: float, waiting: list[VariableGroup]) -> None:
        """Handle an event if discrete inputs or texts changed, or clocks tick."""
        ticking = self._due(t)
        for x in waiting:
            if x.is_clock:
                ticking += x.references[x.values != 0.0].tolist()
        plain = (x for x in waiting if not (x.is_clock or x.clocks))
        changed = [x for x in plain if not np.array_equal(x.raw, x.last)]
        texts = self._new_texts()
        if ticking or changed or texts:
            self.handle_event(t, False, ticking, changed, texts)

    def handle_event(
        self,
        t: float,
        at_end: bool,
        ticking: Sequence[int] = (),
        changed: Iterable[VariableGroup] = (),
        texts: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Handle an event at t, inside a step or at its end; clocks may tick and inputs change."""
        self.driver.enter_event_mode()
        if ticking:
            self.driver.attempt("activate its clocks", self.api.setClock, ticking, [True] * len(ticking))
        for x in changed:
            self._set_now(x)
        self._set_texts(texts)
        ends = self._discrete_states(t, set(ticking))
        self._resume()
        if ends:
            self.end_run(t, at_end)

    def end_run(self, t: float, at_end: bool) -> None:
        """Note that the FMU asks at t to end the run."""
        self.signals.ask_to_end(self.name, t, at_end)

    def _start_events(self, t0: float) -> None:
        """Handle the events of the start."""
        if self._discrete_states(t0):
            raise SimulationError(f"{self.name} asked to end the simulation at its start, t = {t0:g} s")
        self._resume()

    def _resume(self) -> None:
        """Leave event mode."""
        self.driver.leave_event_mode()

    def _set_now(self, x: VariableGroup) -> None:
        x.last[:] = x.raw
        setter = getattr(self.api, f"set{x.access}")
        self.driver.attempt("set its discrete inputs", setter, x.references.tolist(), x.raw.tolist())

    def _discrete_states(self, t: float, ticking: Iterable[int] = ()) -> bool:
        """Update the discrete states until they no longer change; return whether the FMU ends the run."""
        active = set(ticking)

        def exchange() -> None:
            if self.fmu.clocks:
                self._exchange_clocked(t, active)
            active.clear()  # the update deactivates the clocks

        return self.driver.update_discrete_states(t, exchange)

    # -------------------------------------------------------------------------- clocks

    def _exchange_clocked(self, t: float, active: set[int]) -> None:
        """Read the output clocks; set and get the variables of the clocks that are active."""
        references = self._output_clocks
        if references:
            ticks = self.driver.attempt("read its clocks", self.api.getClock, references)
            ticked = [ref for ref, ticks_now in zip(references, ticks, strict=True) if ticks_now]
            active.update(ticked)
            for x in self.outputs:
                if x.is_clock and ticked:
                    x.last[np.isin(x.references, ticked)] = 1.0
        for x in self.inputs:
            if x.clocks & active:
                self._set_now(x)
        for x in self.outputs:
            if x.clocks & active:
                self._get_now(x, t)

    def _get_now(self, x: VariableGroup, t: float) -> None:
        values = self.driver.get(x.access, x.references.tolist(), len(x.elements))
        for name, value in zip(x.elements, values, strict=True):
            if not (math.isfinite(value) if x.number.is_float else abs(value) <= 2**53):
                fault = "is not finite" if x.number.is_float else "is above 2^53 and not exact as a float"
                raise SimulationError(f"{self.name}.{name} {fault} at t = {t:g} s, at a tick of its clock")
        x.raw[:] = values
        x.values[:] = values
