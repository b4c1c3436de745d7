"""A running FMU: its buffers, and the operations that call its functions by address."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from .errors import FMUError, SimulationError
from .fmu import FMU
from .fmu_ports import FMUPort
from .instances import Failures, buffer
from .opcodes import (
    CALL,
    COMBINE,
    COPY,
    FMI_TIME,
    FMI_VECTOR,
    FROM_FLOAT,
    TERMINATED,
    TO_FLOAT,
    Number,
    Op,
)
from .tableaus import TABLEAUS

_EVENT_ITERATIONS = 1000  # at one instant; more is a chain of events without end


class _Exchange:
    """The ports of one FMI type and variability: value references, and a buffer of floats."""

    def __init__(self, access: str, number: Number, discrete: bool, ports: list[FMUPort]) -> None:
        self.access = access
        #: can change at events only, where there are events
        self.discrete = discrete
        self.number = number
        self.references = np.array([v.valueReference for p in ports for v in p.variables], dtype=np.uint32)
        self.elements = [e for p in ports for e in p.elements()]
        self.values = buffer(len(self.elements))
        #: what the FMU reads and writes; the floats themselves if it does so in Float64
        self.raw = self.values if number.dtype == "float64" else np.zeros(len(self.elements), number.dtype)
        #: what the FMU was told last, of discrete inputs
        self.told = self.raw.copy()
        self.addresses: dict[str, int] = {}
        offset = int(self.values.ctypes.data)
        for p in ports:
            self.addresses[p.name] = offset
            offset += 8 * p.size


class FMUInstance:
    """One instance of an FMU in a run: Co-Simulation, or Model Exchange integrated by the master."""

    is_compiled = True

    def __init__(self, name: str, fmu: FMU, model_exchange: bool, failures: Failures, used: set[str]) -> None:
        self.name = name
        self.fmu = fmu
        self.model_exchange = model_exchange
        self.running = False
        #: what the call that ended the run returned; 3 is an error, 4 a fatal one
        self.status = 0
        self.used = used
        given = fmu.start_values()
        structural = {n for n in given if fmu.variables[n].causality == "structuralParameter"}
        #: the start values that were given, by variable
        self.start_values = {n: v for n, v in given.items() if n not in structural}
        self.fmi = fmu.adapter(fmu, name, model_exchange)
        self.api = self.fmi.api
        try:
            self.fmi.configure({n: given[n] for n in structural})
            self.n_states, self.n_indicators = self.fmi.counts() if model_exchange else (0, 0)
        except FMUError:
            self.stop()
            raise
        self.inputs = self._exchanges(fmu.input_ports)
        self.outputs = self._exchanges({n: p for n, p in fmu.output_ports.items() if n in used})
        self.has_outputs = bool(self.outputs)
        self.states = buffer(self.n_states)
        self.state_address = int(self.states.ctypes.data)
        self.flags = np.zeros(2, dtype=self.fmi.FLAG)
        self.event_time = np.array([np.inf])
        self.stages = buffer(5 * self.n_states)
        self.failures = failures
        self.event_callback: Any = None
        self.input_callbacks: list[Any] = []

    def _exchanges(self, ports: dict[str, FMUPort]) -> list[_Exchange]:
        groups: dict[tuple[str, Number, bool], list[FMUPort]] = {}
        for port in ports.values():
            discrete = any(v.variability != "continuous" for v in port.variables)
            access, number = self.fmi.NUMBERS[port.type]
            groups.setdefault((access, number, discrete), []).append(port)
        return [_Exchange(*kind, members) for kind, members in groups.items()]

    # ------------------------------------------------------------- life of an instance

    def start(self, t0: float) -> None:
        """Take the FMU through initialization, with the start values that were given."""
        self.fmi.initialize(t0, self._set_start)
        self.running = True
        for x in self.inputs:
            x.values[:] = self.fmi.get(x.access, x.references.tolist(), len(x.elements))
            x.told[:] = x.values
        if self.model_exchange:
            self._discrete_states(t0)
            self.fmi.attempt("enter continuous-time mode", self.api.enterContinuousTimeMode)
            self._get_states()
            self._signs = self._indicator_signs()

    def _set_start(self) -> None:
        for name, values in self.start_values.items():
            self.fmi.set(self.fmu.variables[name], values)

    def stop(self) -> None:
        """Terminate and free the instance; after a fatal error it must not be called any more."""
        if self.status == 4:
            return
        if self.running and self.status < 3:
            try:
                self.api.terminate()
            except Exception as error:  # the run is over; an FMU that cannot terminate is reported, not fatal
                self.fmi.messages.append(f"[warning] terminate failed: {error}")
        self.running = False
        self.api.freeInstance()

    def failure(self, op: Op, status: int, t: float, h: float) -> str:
        """Return what it means that an operation ended with a status, and remember it for the end."""
        self.status = status if status < TERMINATED else 0
        return self.fmi.failure(status, op.code == self.fmi.DO_STEP, t, h * op.every)

    # ---------------------------------------------------------------------- operations

    def _function(self, name: str) -> int:
        return ctypes.cast(getattr(self.api.dll, name), ctypes.c_void_p).value or 0

    @property
    def _component(self) -> int:
        component = self.api.component
        return int(component if isinstance(component, int) else component.value)

    def address(self, port: str) -> int:
        """Return the address of the floats of a port."""
        return next(x.addresses[port] for x in [*self.inputs, *self.outputs] if port in x.addresses)

    def read(self, fraction: float = 0.0, text: str = "outputs") -> list[Op]:
        """Get the outputs that are used."""
        ops = []
        for x in self.outputs:
            is_float64 = x.raw is x.values
            ops.append(replace(self._values("Get", x, int(is_float64)), text=f"{self.name}: {text} (FMU)"))
            if not is_float64:
                ops.append(self._convert(TO_FLOAT, x, x.raw, x.values))
        return ops

    def _values(self, what: str, x: _Exchange, check: int = 0) -> Op:
        return Op(
            "",
            self.fmi.VALUES,
            self._function(f"{self.fmi.PREFIX}{what}{x.access}"),
            self._component,
            int(x.references.ctypes.data),
            int(x.raw.ctypes.data),
            check,
            n=len(x.references),
            count=len(x.elements),
            participant=self.name,
        )

    def _convert(self, code: int, x: _Exchange, source: Any, target: Any) -> Op:
        a, b, n = int(source.ctypes.data), int(target.ctypes.data), len(x.elements)
        return Op("", code, a=a, b=b, n=n, number=x.number, participant=self.name)

    def latch(self) -> list[Op]:
        """Set the inputs."""
        ops = []
        for x in self.inputs:
            waits = self.model_exchange and x.discrete
            if waits and not self.used & x.addresses.keys():
                continue
            if x.raw is not x.values:
                ops.append(self._convert(FROM_FLOAT, x, x.values, x.raw))
            ops.append(self._event_input(x) if waits else self._values("Set", x))
        return ops

    def _event_input(self, x: _Exchange) -> Op:
        """Set discrete inputs of Model Exchange when they change, which is an event."""

        def tell(t: float, h: float) -> None:
            if not np.array_equal(x.raw, x.told):
                x.told[:] = x.raw
                values, references = x.raw.tolist(), x.references.tolist()
                setter = getattr(self.api, f"set{x.access}")
                self._event(t, lambda: setter(references, values))

        self.input_callbacks.append(self.failures.guard(self.name, tell))
        address = ctypes.cast(self.input_callbacks[-1], ctypes.c_void_p).value or 0
        return Op(f"{self.name}: discrete inputs (Python callback)", CALL, address, participant=self.name)

    def step(self, fraction: float = 0.0) -> list[Op]:
        """Act as a block: set the inputs, step from t_k, get the outputs, which count at t_k."""
        stepped = (replace(op, fraction=fraction) for op in self.advance())
        return [*self.latch(), *stepped, *(replace(op, text="") for op in self.read())]

    def advance(self) -> list[Op]:
        """Do the step: doStep, or Runge-Kutta over the model's derivatives with its input held."""
        if not self.model_exchange:
            return [self._do_step()]
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

    def _do_step(self) -> Op:
        function = self._function(f"{self.fmi.PREFIX}DoStep")
        op = Op(f"{self.name}: step (FMU)", self.fmi.DO_STEP, function, self._component)
        flags, last = self.fmi.step_answers()
        return replace(op, b=flags, c=last, participant=self.name)

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
            self._signs = signs

    def _event(self, t: float, change: Callable[[], Any] = lambda: None) -> None:
        self.fmi.attempt("enter event mode", self.api.enterEventMode)
        self.fmi.attempt("set its discrete inputs", change)
        self._discrete_states(t)
        self.fmi.attempt("enter continuous-time mode", self.api.enterContinuousTimeMode)
        self._get_states()
        self._signs = self._indicator_signs()

    def _discrete_states(self, t: float) -> None:
        for _ in range(_EVENT_ITERATIONS):
            again, end, _, _, timed, time = self.fmi.attempt(
                "update its discrete states", self.fmi.discrete_states
            )
            if end:
                raise SimulationError(f"{self.name} asked to end the simulation at t = {t:g} s, in an event")
            if not again:
                self.event_time[0] = time if timed else np.inf
                return
        raise FMUError(
            f"{self.name}: the event at t = {t:g} s does not end in {_EVENT_ITERATIONS} iterations"
        )

    def _get_states(self) -> None:
        if self.n_states:
            pointer = self.states.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            self.fmi.attempt("get its states", lambda: self.api.getContinuousStates(pointer, self.n_states))

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""
        return self.fmu.feedthrough()

    def locate(self, address: int) -> str:
        """Return the name of the variable at an address, for an error message."""
        for x in [*self.inputs, *self.outputs]:
            index = (address - int(x.values.ctypes.data)) // 8
            if 0 <= index < len(x.elements):
                return x.elements[index]
        state = (address - self.state_address) // 8
        for unknown in self.fmu.description.derivatives if state >= 0 else []:
            variable = unknown.variable.derivative
            n = math.prod(self.fmu.shape_of(variable))
            if state < n:
                return str(variable.name) if n == 1 else f"{variable.name}[{state + 1}]"
            state -= n
        return "?"

    def log(self) -> list[str]:
        """Return what the FMU logged at warning level and above."""
        return self.fmi.messages
