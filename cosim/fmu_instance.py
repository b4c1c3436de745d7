"""A running FMU: its buffers, and the operations that call its functions by address."""

from __future__ import annotations

import ctypes
from contextlib import chdir
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .errors import FMUError
from .fmu import FMU, FMUPort
from .instances import Failures, buffer
from .opcodes import (
    CALL,
    COMBINE,
    COPY,
    FMI2_COMPLETED,
    FMI2_DO_STEP,
    FMI2_TIME,
    FMI2_VALUES,
    FMI2_VECTOR,
    TO_FLOAT,
    TO_INT,
    Op,
)
from .tableaus import TABLEAUS

_STATUS = {2: "discard", 3: "error", 4: "fatal", 5: "pending"}
_ACCESS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}


class _Exchange:
    """The variables of one FMI type: value references, and a buffer of floats over all ports."""

    def __init__(self, type_: str, ports: list[FMUPort]) -> None:
        self.type = type_
        self.ports = ports
        self.variables = [v for p in ports for v in p.variables]
        self.references = np.array([v.valueReference for v in self.variables], dtype=np.uint32)
        self.values = buffer(len(self.variables))
        self.integers = np.zeros(max(len(self.variables), 1), dtype=np.int32)

    def address(self, port: str) -> int | None:
        """Return where the floats of a port are, if it is of this type."""
        offset = 0
        for p in self.ports:
            if p.name == port:
                return int(self.values.ctypes.data) + 8 * offset
            offset += len(p.variables)
        return None


class FMUInstance:
    """One instance of an FMU in a run: Co-Simulation, or Model Exchange integrated by the master."""

    is_compiled = True

    def __init__(self, name: str, fmu: FMU, model_exchange: bool, failures: Failures, used: set[str]) -> None:
        from fmpy.fmi2 import FMU2Model, FMU2Slave

        self.name = name
        self.fmu = fmu
        self.messages: list[str] = []
        self.model_exchange = model_exchange
        interface = fmu.description.modelExchange if model_exchange else fmu.description.coSimulation
        make = FMU2Model if model_exchange else FMU2Slave
        try:
            with chdir(
                fmu.directory
            ):  # FMPy goes to the library's folder and stays there when it does not load
                self.api: Any = make(
                    guid=fmu.description.guid,
                    unzipDirectory=str(fmu.directory),
                    modelIdentifier=interface.modelIdentifier,
                    instanceName=name,
                )
        except Exception as error:  # FMPy raises bare Exception when a library does not load
            raise FMUError(f"{name}: the binary of {fmu.path} cannot be loaded: {error}") from error
        self.running = False
        #: what the call that ended the run returned; 3 is an error, 4 a fatal one
        self.status = 0
        #: the start values that were given, by scalar variable
        self.start_values = fmu.start_values()
        self._instantiate()
        self.inputs = [_Exchange(t, _of(fmu.input_ports, t)) for t in ("Real", "Integer", "Boolean")]
        readable = {n: p for n, p in fmu.output_ports.items() if n in used}
        self.outputs = [_Exchange(t, _of(readable, t)) for t in ("Real", "Integer", "Boolean")]
        self.n_states = int(fmu.description.numberOfContinuousStates) if model_exchange else 0
        self.states = buffer(self.n_states)
        self.slopes = buffer(self.n_states)
        self.state_address = int(self.states.ctypes.data)
        self.has_outputs = bool(readable)
        self.flags = np.zeros(2, dtype=np.int32)
        self.event_time = np.array([np.inf])
        self.stages = buffer(5 * self.n_states)
        self.failures = failures
        self.event_callback: Any = None

    # ------------------------------------------------------------- life of an instance

    def _instantiate(self) -> None:
        from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
        from fmpy.logging import addLoggerProxy

        def log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
            if status > 0 and len(self.messages) < 1000:
                self.messages.append(f"[{_STATUS.get(status, 'warning')}] {message.decode(errors='replace')}")

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(log)
        callbacks.allocateMemory = defaultCallbacks.allocateMemory
        callbacks.freeMemory = defaultCallbacks.freeMemory
        addLoggerProxy(ctypes.byref(callbacks))
        self._try("instantiate", lambda: self.api.instantiate(callbacks=callbacks, loggingOn=True))

    def _try(self, what: str, call: Any) -> Any:
        try:
            return call()
        except Exception as error:  # FMPy raises FMICallException and bare Exception alike
            log = "".join(f"\n  {line}" for line in self.messages[-8:])
            raise FMUError(f"{self.name} ({self.fmu.path.name}) failed to {what}: {error}{log}") from error

    def start(self, t0: float) -> None:
        """Take the FMU through initialization, with the start values that were given."""
        api = self.api
        self._try("set up the experiment", lambda: api.setupExperiment(startTime=t0))
        self._set_start()
        self._try("enter initialization", api.enterInitializationMode)
        self._try("exit initialization", api.exitInitializationMode)
        self.running = True
        for exchange in self.inputs:
            for i, v in enumerate(exchange.variables):
                exchange.values[i] = float(self.start_values.get(v.name, _start(v)))
        if self.model_exchange:
            self._discrete_states()
            api.enterContinuousTimeMode()
            self._get_states()
            self._signs = self._indicator_signs()

    def _set_start(self) -> None:
        api = self.api
        setters = {
            "Real": (api.setReal, float),
            "Integer": (api.setInteger, int),
            "Enumeration": (api.setInteger, int),
            "Boolean": (api.setBoolean, bool),
            "String": (api.setString, str),
        }
        for name, value in self.start_values.items():
            variable = self.fmu.variables[name]
            setter, kind = setters[variable.type]
            call = partial(setter, [variable.valueReference], [kind(value)])
            self._try(f"set {name} = {value}", call)

    def stop(self) -> None:
        """Terminate and free the instance; after a fatal error it must not be called any more."""
        if self.status == 4:
            return
        if self.running and self.status < 3:
            try:
                self.api.terminate()
            except Exception as error:  # the run is over; an FMU that cannot terminate is reported, not fatal
                self.messages.append(f"[warning] terminate failed: {error}")
        self.running = False
        self.api.freeInstance()

    # ---------------------------------------------------------------------- operations

    def _function(self, name: str) -> int:
        return ctypes.cast(getattr(self.api.dll, name), ctypes.c_void_p).value or 0

    @property
    def _component(self) -> int:
        component = self.api.component
        return int(component if isinstance(component, int) else component.value)

    def address(self, port: str) -> int:
        """Return the address of the floats of a port."""
        for exchange in [*self.inputs, *self.outputs]:
            found = exchange.address(port)
            if found is not None:
                return found
        raise KeyError(port)

    def read(self, fraction: float = 0.0, text: str = "outputs") -> list[Op]:
        """Get the outputs that are used."""
        ops = []
        for x in self.outputs:
            n = len(x.variables)
            if n == 0:
                continue
            function = self._function(f"fmi2Get{_ACCESS[x.type]}")
            real = x.type == "Real"
            target = x.values if real else x.integers
            ops.append(self._values(function, x, target.ctypes.data, int(real), f"{self.name}: {text} (FMU)"))
            if not real:
                ops.append(Op("", TO_FLOAT, a=x.integers.ctypes.data, b=x.values.ctypes.data, n=n))
        return ops

    def _values(self, function: int, x: _Exchange, values: int, check: int, text: str) -> Op:
        references = int(x.references.ctypes.data)
        n = len(x.variables)
        return Op(
            text, FMI2_VALUES, function, self._component, references, values, check, n, participant=self.name
        )

    def latch(self) -> list[Op]:
        """Set the inputs."""
        ops = []
        for x in self.inputs:
            n = len(x.variables)
            if n == 0:
                continue
            source = x.values.ctypes.data
            if x.type != "Real":
                ops.append(Op("", TO_INT, a=source, b=x.integers.ctypes.data, n=n, participant=self.name))
                source = x.integers.ctypes.data
            ops.append(self._values(self._function(f"fmi2Set{_ACCESS[x.type]}"), x, source, 0, ""))
        return ops

    def advance(self) -> list[Op]:
        """Do the step: fmi2DoStep, or Runge-Kutta over the model's derivatives with its input held."""
        if not self.model_exchange:
            step = self._function("fmi2DoStep")
            return [
                Op(f"{self.name}: step (FMU)", FMI2_DO_STEP, step, self._component, participant=self.name)
            ]
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
        return Op("", FMI2_VECTOR, self._function(name), self._component, address, n=n, participant=self.name)

    def set_states(self, fraction: float) -> list[Op]:
        """Set time and states."""
        time = self._function("fmi2SetTime")
        ops = [Op("", FMI2_TIME, time, self._component, fraction=fraction, participant=self.name)]
        return [*ops, self._vector("fmi2SetContinuousStates", self.state_address)] if self.n_states else ops

    def derivatives(self, target: int, fraction: float) -> list[Op]:
        """Get the derivatives into `target`."""
        return [self._vector("fmi2GetDerivatives", target)] if self.n_states else []

    def complete(self) -> list[Op]:
        """Tell the model that a step is completed; handle its events."""
        # always told, even where the model says that it need not be: FMPy reads that flag inverted
        function = self._function("fmi2CompletedIntegratorStep")
        flags, event_time = int(self.flags.ctypes.data), int(self.event_time.ctypes.data)
        told = Op("", FMI2_COMPLETED, function, self._component, flags, self._events_address(), event_time)
        ops = [replace(told, fraction=1.0, participant=self.name)]
        if int(self.fmu.description.numberOfEventIndicators or 0):
            text = f"{self.name}: events (Python callback)"
            ops.append(Op(text, CALL, self._events_address(), fraction=1.0, participant=self.name))
        return ops

    def _events_address(self) -> int:
        if self.event_callback is None:
            self.event_callback = self.failures.guard(self.name, self._handle_events)
        return ctypes.cast(self.event_callback, ctypes.c_void_p).value or 0

    # -------------------------------------------------------------------------- events

    def _indicator_signs(self) -> Any:
        n = int(self.fmu.description.numberOfEventIndicators or 0)
        z = buffer(n)
        if n:
            self.api.getEventIndicators(z.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), n)
        return z > 0

    def _handle_events(self, t: float, h: float) -> None:
        signs = self._indicator_signs()
        state_event = bool((signs != self._signs).any())
        time_event = t + 1e-9 * h >= self.event_time[0]
        if state_event or time_event or self.flags[0]:
            self.api.enterEventMode()
            self._discrete_states()
            self.api.enterContinuousTimeMode()
            self._get_states()
            signs = self._indicator_signs()
        self._signs = signs
        if self.flags[1]:
            raise FMUError(f"{self.name} asked to end the simulation at t = {t:g} s")

    def _discrete_states(self) -> None:
        while True:
            again, end, _, _, timed, time = self.api.newDiscreteStates()
            if end:
                raise FMUError(f"{self.name} asked to end the simulation during event iteration")
            if not again:
                break
        self.event_time[0] = time if timed else np.inf

    def _get_states(self) -> None:
        if self.n_states:
            pointer = self.states.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            self._try("get its states", lambda: self.api.getContinuousStates(pointer, self.n_states))

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""
        return self.fmu.feedthrough()

    def locate(self, address: int) -> str:
        """Return the name of the variable at an address, for an error message."""
        for exchange in [*self.inputs, *self.outputs]:
            index = (address - exchange.values.ctypes.data) // 8
            if 0 <= index < len(exchange.variables):
                return str(exchange.variables[index].name)
        state = (address - self.state_address) // 8
        if 0 <= state < self.n_states:
            return str(self.fmu.description.derivatives[state].variable.derivative.name)
        return "?"

    def log(self) -> list[str]:
        """Return what the FMU logged at warning level and above."""
        return self.messages


def _of(ports: dict[str, FMUPort], type_: str) -> list[FMUPort]:
    wanted = ("Integer", "Enumeration") if type_ == "Integer" else (type_,)
    return [p for p in ports.values() if p.type in wanted]


def _start(variable: Any) -> float:
    text = variable.start
    if text is None:
        return 0.0
    return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)
