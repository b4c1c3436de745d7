"""A running FMU with Model Exchange: its integration and its events.

Under sampled coupling it is integrated over each communication step with its inputs held:
by CVODE, from event to event (event_steps.py), or by a fixed-step method in equal
substeps. The latter runs in the compiled loop; a step that contains a time event is
split there, and a state event is handled at the end of the step. Under stage coupling the
solver of the run integrates it, in one step for all components; events are handled at its end.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Set
from typing import Any

import numpy as np

from ...core.tableaus import TABLEAUS
from ...errors import CosimError, LateEventWarning
from ...loop.fmi_operations import CompletedStep, End, Repeat, SetTime, UnlessEvent, Vector
from ...loop.instance import buffer
from ...loop.operations import SLACK, Call, Combine, Copy, Operation
from ..interfaces import DEFAULT_TOLERANCE, ModelExchange
from .continuous_time import ContinuousTime
from .driver import Driver
from .event_steps import EventSteps, RungeKutta
from .events import EventInstance


class ModelExchangeInstance(EventInstance):
    """One instance of an FMU in a run, with Model Exchange; `options` name a solver."""

    def __init__(self, driver: Driver, used: Set[str], options: ModelExchange) -> None:
        super().__init__(driver, used)
        try:
            self.n_states, self.n_indicators = driver.counts()
        except CosimError:
            self.stop()
            raise
        self.states = buffer(self.n_states)
        self.state_address = int(self.states.ctypes.data)
        self.flags = np.zeros(2, dtype=driver.VERSION.flag)
        self.signs = buffer(self.n_indicators) > 0.0
        self.stages = buffer(5 * self.n_states)
        self.event_address = 0
        self.model = ContinuousTime(driver, self.n_states, self.n_indicators)
        self.options = options
        #: the solver of sampled coupling
        self.solver = str(options.solver)
        self.tolerance = options.tolerance or DEFAULT_TOLERANCE
        self.steps: EventSteps | None = None
        self.is_late = False

    def start(self, t0: float) -> None:
        """Take the FMU through initialization and the events of the start."""
        super().start(t0)
        self._start_events(t0)

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [*super().arrays(), self.states, self.flags, self.signs]

    # ---------------------------------------------------------------------- operations

    def advance(self) -> list[Operation]:
        """Integrate over the step, with the inputs held."""
        if self.solver == "cvode":
            text = f"{self.name}: cvode, tolerance {self.tolerance:g}, from event to event"
            carry = self.signals.callback(self.name, self._carry_by_cvode)
            return [Call(text=f"{text} (FMU, Python callback)", function=carry, participant=self.name)]
        split = self.signals.callback(self.name, self._carry_by_fixed_steps)
        event_time = int(self.event_time.ctypes.data)
        text = f"{self.name}: {self.solver}, {self.options.substeps} substeps, split at time events (FMU)"
        unless = UnlessEvent(text=text, split=split, event_time=event_time, participant=self.name)
        return [unless, *self._fixed_steps(), End(participant=self.name)]

    def _fixed_steps(self) -> list[Operation]:
        """Integrate by Runge-Kutta over the model's derivatives."""
        nodes, rows, weights = TABLEAUS[self.solver]
        n, base = self.options.substeps, int(self.stages.ctypes.data)
        part = 1.0 / n
        ops: list[Operation] = [Copy(source=self.state_address, target=base, count=self.n_states)]
        for i, (node, row) in enumerate(zip(nodes, rows, strict=True)):
            if i > 0:
                ops.append(self._combine(base, [part * w for w in row]))
            ops += [*self.set_states(node, n), *self.derivatives(base + 8 * self.n_states * (1 + i), node)]
        ops.append(self._combine(base, [part * w for w in weights]))
        if n > 1:
            ops = [Repeat(count=n), *ops, End()]
        return [*ops, *self.set_states(1.0), *self.complete()]

    def _combine(self, base: int, weights: list[float]) -> Operation:
        return Combine(
            start=base,
            slopes=base + 8 * self.n_states,
            result=self.state_address,
            count=self.n_states,
            weights=tuple(weights),
            participant=self.name,
        )

    def _vector(self, name: str, address: int) -> Operation:
        return Vector(
            function=self.driver.address(name),
            component=self._component,
            values=address,
            count=self.n_states,
            participant=self.name,
        )

    def set_states(self, fraction: float, substeps: int = 1) -> list[Operation]:
        """Set time and states."""
        time = SetTime(
            function=self.driver.address("SetTime"),
            component=self._component,
            fraction=fraction,
            substeps=substeps,
            participant=self.name,
        )
        if not self.n_states:
            return [time]
        return [time, self._vector("SetContinuousStates", self.state_address)]

    def derivatives(self, target: int, fraction: float) -> list[Operation]:
        """Get the derivatives into `target`."""
        return [self._vector(self.fmu.version.get_derivatives, target)] if self.n_states else []

    def complete(self) -> list[Operation]:
        """Report a completed step to the model; handle its events."""
        self.event_address = self.event_address or self.signals.callback(self.name, self._handle_events)
        # always, even if the model states that it need not be told: FMPy reads that flag inverted
        completed = CompletedStep(
            function=self.driver.address("CompletedIntegratorStep"),
            component=self._component,
            flags=int(self.flags.ctypes.data),
            event_time=int(self.event_time.ctypes.data),
            events=self.event_address,
            boolean=f"i{8 * self.flags.itemsize}",
            fraction=1.0,
            participant=self.name,
        )
        text = f"{self.name}: events (Python callback)"
        call = Call(text=text, function=self.event_address, fraction=1.0, participant=self.name)
        return [completed, call] if self.n_indicators else [completed]

    # ------------------------------------------------------------------ steps in Python

    def _carry_by_cvode(self, t: float, h: float) -> None:
        if self.steps is None:
            from .cvode import Cvode

            self.steps = self._event_steps(Cvode(self.model, t, self.tolerance))
        self.model.set_time(t)
        signs = self._indicator_signs()
        if (signs != self.signs).any():  # the new inputs at t have caused an event
            self.handle_event(t, False)
        self.steps.carry(t, h)
        self.model.get_states(self.state_address)
        self.signs[:] = self._indicator_signs()

    def _carry_by_fixed_steps(self, t: float, h: float) -> None:
        if self.steps is None:
            self.steps = self._event_steps(RungeKutta(self.model, self.solver, self.options.substeps))
        self.model.set_time(t)
        self.steps.carry(t, h)
        self.model.get_states(self.state_address)

    def _event_steps(self, integrator: Any) -> EventSteps:
        return EventSteps(self.model, integrator, self._completed, self)

    def _completed(self, t: float, at_end: bool) -> bool:
        """Report a completed step to the model; return whether an event is to be handled."""
        event, end = self.driver.attempt("complete a step", self.api.completedIntegratorStep)
        if end:
            self.end_run(t, at_end)
        if event or self.solver == "cvode":  # cvode finds state events itself
            return bool(event)
        return bool((self._indicator_signs() != self.signs).any())

    # -------------------------------------------------------------------------- events

    def _indicator_signs(self) -> Any:
        z = buffer(self.n_indicators)
        self.model.get_indicators(z.ctypes.data)
        return z > 0.0

    def _handle_events(self, t: float, h: float) -> None:
        """Handle the events of a step of the compiled loop, which ends at t."""
        if self.flags[1]:
            self.end_run(t, True)
        signs = self._indicator_signs()
        due = float(self.event_time[0])
        timed = due <= t + SLACK * h
        if timed and due >= t - SLACK * h:
            self.model.set_time(due)  # exactly; t equals it to rounding only
        elif due < t - SLACK * h:
            self._warn_late(
                f"a time event at t = {due:g} s, inside the step to t = {t:g} s, which is handled at its "
                "end: stage coupling has one step for all components; choose a step that meets the event, "
                "or sampled coupling"
            )
        changed = bool((signs != self.signs).any())
        if changed and not timed:
            self._warn_late(
                f"a state event in the step to t = {t:g} s, which is handled at its end: steps are "
                'fixed; take smaller ones, or sampled coupling with ModelExchange(solver="cvode"), '
                "which locates it"
            )
        if timed or self.flags[0] or changed:
            self.handle_event(t, True)
        else:
            self.signs[:] = signs

    def _warn_late(self, what: str) -> None:
        """Warn once that an event is handled late."""
        if not self.is_late:
            self.is_late = True
            warnings.warn(f"{self.name} has {what}", LateEventWarning, stacklevel=3)

    def _resume(self) -> None:
        super()._resume()
        self.model.get_states(self.state_address)
        self.signs[:] = self._indicator_signs()

    def locate(self, address: int) -> str:
        """Return the name of the variable or state at an address, for an error message."""
        found = super().locate(address)
        state = (address - self.state_address) // 8
        for unknown in self.fmu.description.derivatives if found == "?" and state >= 0 else []:
            variable = unknown.variable.derivative
            n = math.prod(self.fmu.shape_of(variable))
            if state < n:
                return str(variable.name) if n == 1 else f"{variable.name}[{state + 1}]"
            state -= n
        return found
