"""A running FMU with Model Exchange: integrated here, its events handled.

Under sampled coupling it is integrated over each communication step by ode4 in equal
substeps, its inputs held; under stage coupling by the method of all.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from .errors import FMUError, SimulationError
from .fmu import FMU
from .fmu_events import EventInstance
from .instances import Failures, buffer
from .opcodes import CALL, COMBINE, COPY, FMI_TIME, FMI_VECTOR, Op
from .tableaus import TABLEAUS


class ModelExchangeInstance(EventInstance):
    """One instance of an FMU in a run, with Model Exchange."""

    model_exchange: ClassVar[bool] = True

    def __init__(self, name: str, fmu: FMU, failures: Failures, used: set[str]) -> None:
        super().__init__(name, fmu, failures, used)
        try:
            self.n_states, self.n_indicators = self.fmi.counts()
        except FMUError:
            self.stop()
            raise
        self.states = buffer(self.n_states)
        self.state_address = int(self.states.ctypes.data)
        self.flags = np.zeros(2, dtype=self.fmi.FLAG)
        self._signs = buffer(self.n_indicators) > 0
        self.stages = buffer(5 * self.n_states)
        self.event_callback: Any = None

    def start(self, t0: float) -> None:
        """Take the FMU through initialization and the events of the start."""
        super().start(t0)
        self._discrete_states(t0)
        self._resume()

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [*super().arrays(), self.states, self.flags, self._signs]

    # ---------------------------------------------------------------------- operations

    def advance(self) -> list[Op]:
        """Integrate over the step, by Runge-Kutta over the model's derivatives with its input held."""
        nodes, rows, weights = TABLEAUS["ode4"]
        part = 1.0 / self.fmu.substeps
        base = self.stages.ctypes.data
        ops = [Op(f"{self.name}: ode4, {self.fmu.substeps} substeps (FMU)", COPY, participant=self.name)]
        for j in range(self.fmu.substeps):
            ops.append(Op("", COPY, a=self.state_address, b=base, n=self.n_states, weights=(1.0, 0.0)))
            for i, (node, row) in enumerate(zip(nodes, rows, strict=True)):
                c = (j + node) * part
                if i > 0:
                    ops += [self._combine(base, [part * w for w in row]), *self.set_states(c)]
                else:
                    ops += self.set_states(c)
                ops += self.derivatives(base + 8 * self.n_states * (1 + i), c)
            ops.append(self._combine(base, [part * w for w in weights]))
        return [*ops, *self.set_states(1.0), *self.complete()]

    def _combine(self, base: int, weights: list[float]) -> Op:
        slopes = base + 8 * self.n_states
        return Op(
            "", COMBINE, a=base, b=slopes, c=self.state_address, n=self.n_states, weights=tuple(weights)
        )

    def _vector(self, name: str, address: int) -> Op:
        n = self.n_states
        return Op("", FMI_VECTOR, self._function(name), self._component, address, n=n, participant=self.name)

    def set_states(self, fraction: float) -> list[Op]:
        """Set time and states."""
        time = self._function(f"{self.fmi.PREFIX}SetTime")
        ops = [Op("", FMI_TIME, time, self._component, fraction=fraction, participant=self.name)]
        states = f"{self.fmi.PREFIX}SetContinuousStates"
        return [*ops, self._vector(states, self.state_address)] if self.n_states else ops

    def derivatives(self, target: int, fraction: float) -> list[Op]:
        """Get the derivatives into `target`."""
        return [self._vector(self.fmi.DERIVATIVES, target)] if self.n_states else []

    def complete(self) -> list[Op]:
        """Tell the model that a step is completed; handle its events."""
        # always told, even where the model says that it need not be: FMPy reads that flag inverted
        function = self._function(f"{self.fmi.PREFIX}CompletedIntegratorStep")
        flags, event_time = int(self.flags.ctypes.data), int(self.event_time.ctypes.data)
        told = Op(
            "", self.fmi.COMPLETED, function, self._component, flags, self._events_address(), event_time
        )
        ops = [replace(told, fraction=1.0, participant=self.name)]
        if self.n_indicators:
            text = f"{self.name}: events (Python callback)"
            ops.append(Op(text, CALL, self._events_address(), fraction=1.0, participant=self.name))
        return ops

    def _events_address(self) -> int:
        if self.event_callback is None:
            self.event_callback = self.failures.guard(self.name, self._handle_events)
        return ctypes.cast(self.event_callback, ctypes.c_void_p).value or 0

    # -------------------------------------------------------------------------- events

    def _indicator_signs(self) -> Any:
        n = self.n_indicators
        z = buffer(n)
        if n:
            pointer = z.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            self.fmi.attempt("get its event indicators", lambda: self.api.getEventIndicators(pointer, n))
        return z > 0

    def _handle_events(self, t: float, h: float) -> None:
        if self.flags[1]:
            raise SimulationError(f"{self.name} asked to end the simulation at t = {t:g} s")
        signs = self._indicator_signs()
        state_event = bool((signs != self._signs).any())
        time_event = t + 1e-9 * h >= self.event_time[0]
        if state_event or time_event or self.flags[0]:
            self._event(t)
        else:
            self._signs[:] = signs

    def _resume(self) -> None:
        self.fmi.attempt("enter continuous-time mode", self.api.enterContinuousTimeMode)
        self._get_states()
        self._signs[:] = self._indicator_signs()

    def _get_states(self) -> None:
        if self.n_states:
            pointer = self.states.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            self.fmi.attempt("get its states", lambda: self.api.getContinuousStates(pointer, self.n_states))

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
