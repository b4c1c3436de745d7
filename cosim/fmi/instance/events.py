"""Event mode: what Model Exchange and Co-Simulation with event mode do alike.

Discrete inputs that changed are set in event mode, and clocks that are due activated;
discrete states are updated until they stay; then the FMU says when its next time event is
due. Clocked variables are set and got while their clock is active.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import FMUError
from ...loop.operations import Call, Copy, Operation
from ...loop.signals import RunSignals
from ...result import SimulationError
from ..fmu import FMU
from .instance import Exchange, FMUInstance

EVENT_ITERATIONS = 1000  # at one instant; more is a chain of events without end


class EventInstance(FMUInstance):
    """One instance of an FMU whose events are handled here."""

    #: whether there is an event mode, in which alone discrete inputs can be set
    event_mode: bool = True

    def __init__(self, name: str, fmu: FMU, failures: RunSignals, used: set[str]) -> None:
        super().__init__(name, fmu, failures, used)
        #: when the next time event is due
        self.event_time = np.array([np.inf])
        self._output_clocks = [c.reference for c in fmu.clocks.values() if c.is_output]

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [*super().arrays(), self.event_time]

    @abstractmethod
    def _resume(self) -> None:
        """Leave event mode."""

    def _due(self, t: float) -> list[int]:
        """Return the references of the clocks that tick by themselves at a communication point."""
        return []

    # ---------------------------------------------------------------------- operations

    def latch(self) -> list[Operation]:
        """Set the inputs; in event mode those that can change at events only."""
        waiting = [x for x in self.inputs if self.event_mode and x.discrete]
        native = [op for x in self.inputs if x not in waiting for op in self._set_inputs(x)]
        forget = [self._scaled(x.told, x.told, 0.0) for x in self.outputs if x.is_clock]
        if not self.event_mode:
            return [*native, *self._latch_texts()]
        if not waiting and not self.fmu.clocks and not self.text_sources:
            return native
        tell = self.failures.callback(self.name, lambda t, h: self._tell(t, waiting))
        what = "discrete inputs and clocks" if self.fmu.clocks else "discrete inputs"
        told = Call(text=f"{self.name}: {what} (Python callback)", function=tell, participant=self.name)
        return [*native, *forget, *(op for x in waiting for op in self._from_floats(x)), told]

    def _get_outputs(self, x: Exchange, final: bool) -> list[Operation]:
        if x.is_clock:
            return [self._scaled(x.told, x.values, 1.0)]
        return [] if x.clocks else super()._get_outputs(x, final)

    def _scaled(self, source: Any, target: Any, factor: float) -> Operation:
        a, b = int(source.ctypes.data), int(target.ctypes.data)
        return Copy(source=a, target=b, count=len(source), factor=factor, participant=self.name)

    # -------------------------------------------------------------------------- events

    def _tell(self, t: float, waiting: list[Exchange]) -> None:
        """Make an event of discrete inputs that changed and of clocks that tick."""
        ticking = self._due(t)
        for x in waiting:
            if x.is_clock:
                ticking += x.references[x.values != 0.0].tolist()
        plain = (x for x in waiting if not (x.is_clock or x.clocks))
        changed = [x for x in plain if not np.array_equal(x.raw, x.told)]
        texts = self._new_texts()
        if ticking or changed or texts:
            self._event(t, False, ticking, changed, texts)

    def _event(
        self,
        t: float,
        at_end: bool,
        ticking: Sequence[int] = (),
        changed: Iterable[Exchange] = (),
        texts: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Handle an event at t, inside a step or at its end; clocks may tick and inputs change."""
        self.fmi.attempt("enter event mode", self.api.enterEventMode)
        if ticking:
            self.fmi.attempt("activate its clocks", lambda: self.api.setClock(ticking, [True] * len(ticking)))
        for x in changed:
            self._set_now(x)
        self._set_texts(texts)
        ends = self._discrete_states(t, set(ticking))
        self._resume()
        if ends:
            self.failures.ask_to_end(self.name, t, at_end)

    def _start_events(self, t0: float) -> None:
        """Handle the events of the start."""
        if self._discrete_states(t0):
            raise SimulationError(f"{self.name} asked to end the simulation at its start, t = {t0:g} s")
        self._resume()

    def _set_now(self, x: Exchange) -> None:
        x.told[:] = x.raw
        setter = getattr(self.api, f"set{x.access}")
        references, values = x.references.tolist(), x.raw.tolist()
        self.fmi.attempt("set its discrete inputs", lambda: setter(references, values))

    def _discrete_states(self, t: float, active: set[int] | None = None) -> bool:
        """Update the discrete states until they stay; return whether the FMU asks to end the run."""
        active = set(active or ())
        for _ in range(EVENT_ITERATIONS):
            if self.fmu.clocks:
                self._exchange_clocked(t, active)
            active = set()  # the update takes the ticks as done
            again, end, _, _, timed, time = self.fmi.attempt(
                "update its discrete states", self.fmi.discrete_states
            )
            if end or not again:
                self.event_time[0] = time if timed else np.inf
                return bool(end)
        raise FMUError(f"{self.name}: the event at t = {t:g} s does not end in {EVENT_ITERATIONS} iterations")

    # -------------------------------------------------------------------------- clocks

    def _exchange_clocked(self, t: float, active: set[int]) -> None:
        """Ask which output clocks tick; set and get what belongs to the clocks that are active."""
        references = self._output_clocks
        if references:
            ticks = self.fmi.attempt("read its clocks", lambda: self.api.getClock(references))
            ticked = [ref for ref, ticks_now in zip(references, ticks, strict=True) if ticks_now]
            active.update(ticked)
            for x in self.outputs:
                if x.is_clock and ticked:
                    x.told[np.isin(x.references, ticked)] = 1.0
        for x in self.inputs:
            if x.clocks & active:
                self._set_now(x)
        for x in self.outputs:
            if x.clocks & active:
                self._get_now(x, t)

    def _get_now(self, x: Exchange, t: float) -> None:
        values = self.fmi.get(x.access, x.references.tolist(), len(x.elements))
        for name, value in zip(x.elements, values, strict=True):
            if not (math.isfinite(value) if x.number.is_float else abs(value) <= 2**53):
                what = "is not finite" if x.number.is_float else "is above 2^53, which a float does not hold"
                raise SimulationError(f"{self.name}.{name} {what} at t = {t:g} s, at a tick of its clock")
        x.raw[:] = values
        x.values[:] = values
