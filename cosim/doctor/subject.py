"""An FMU under examination: one instance that is driven call by call, without the loop."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self, TypeAlias

import numpy as np

from ..errors import FMUError
from ..fmi.fmu import FMU
from ..fmi.instance.continuous_time import ContinuousTime
from ..fmi.instance.drivers import load
from ..fmi.instance.event_steps import EventSteps, RungeKutta
from ..fmi.ports import FMUPort
from ..loop.signals import RunSignals

#: values of ports by name, in the FMU's units
Values: TypeAlias = dict[str, np.ndarray[Any, Any]]

STEPS = 20  # of a run that is repeated: two input changes and their effects
_EULER = 0.1  # step of Euler's method, for Model Exchange, as a part of the communication step
_MOST_PORTS = 500  # number of ports that are watched; more would not find more faults


def times_of(fmu: FMU) -> tuple[float, float]:
    """Return start time and step of the default experiment, in s: its step, a 500th of it, or 10 ms."""
    experiment = fmu.description.defaultExperiment
    start, stop, step = (
        float(getattr(experiment, name, None) or 0.0) for name in ("startTime", "stopTime", "stepSize")
    )
    if step <= 0.0:
        step = (stop - start) / 500 if stop > start else 0.01
    return start, step


class Subject:
    """An instance of an FMU; its methods raise a CosimError with the FMU's log."""

    def __init__(self, fmu: FMU, model_exchange: bool, name: str = "instance") -> None:
        self.fmu = fmu
        #: start time and communication step, in s
        self.t0, self.h = times_of(fmu)
        self.model_exchange = model_exchange
        self.driver = load(fmu, name, model_exchange, RunSignals(), fmu.event_mode)
        self.api = self.driver.api
        outputs = {n: fmu.output_ports[n] for n in fmu.declared_outputs} or fmu.output_ports
        self.outputs = dict(list(outputs.items())[:_MOST_PORTS])
        floats = {n: p for n, p in fmu.input_ports.items() if fmu.version.numbers[p.type][1].is_float}
        continuous = {n: p for n, p in floats.items() if p.variables[0].variability == "continuous"}
        self.inputs = dict(list(continuous.items())[:_MOST_PORTS])

    # ----------------------------------------------------------------------------- life

    def start(self) -> Self:
        """Initialize the instance with the start values of the description, and return it."""
        self.driver.initialize(self.t0, lambda: None)
        if self.driver.event_mode:
            self._discrete_states(self.t0)
        if self.model_exchange:
            self.model = ContinuousTime(self.driver, *self.driver.counts())
            self.model.t = self.t0
            self.steps = EventSteps(self.model, RungeKutta(self.model, "ode1", 1), self._completed, self)
        self.start_inputs = self.get(self.inputs)
        return self

    def stop(self) -> None:
        """Terminate and free the instance; its library stays loaded, so that `driver.make` can follow."""
        self.driver.attempt("terminate", self.api.terminate)
        getattr(self.api, f"{self.fmu.version.prefix}FreeInstance")(self.api.component)

    # --------------------------------------------------------------------------- values

    def get(self, ports: Mapping[str, FMUPort]) -> Values:
        """Get the values of ports, with one call per type."""
        groups: dict[str, list[tuple[str, FMUPort]]] = {}
        for name, port in ports.items():
            groups.setdefault(self.fmu.version.numbers[port.type][0], []).append((name, port))
        found: Values = {}
        for access, group in groups.items():
            references = [v.valueReference for _, p in group for v in p.variables]
            values = np.array(self.driver.get(access, references, sum(p.size for _, p in group)))
            for name, port in group:
                found[name], values = values[: port.size], values[port.size :]
        return found

    def read(self) -> Values:
        """Get the outputs."""
        return self.get(self.outputs)

    def set(self, values: Values) -> None:
        """Set inputs."""
        for name, given in values.items():
            port, done = self.inputs[name], 0
            for v in port.variables:
                each = port.size // len(port.variables)
                self.driver.set(v, given[done : done + each].tolist())
                done += each

    def excited(self, amount: float) -> Values:
        """Return the inputs, moved from their start values by a fraction of their size."""
        return {name: self.moved(name, amount) for name in self.inputs}

    def moved(self, name: str, amount: float) -> np.ndarray[Any, Any]:
        """Return an input moved by `amount` of its start or nominal value, within its bounds."""
        start, v = self.start_inputs[name], self.inputs[name].variables[0]
        nominal = abs(float(v.nominal)) if v.nominal else 0.0
        size = np.where(start != 0.0, np.abs(start), nominal or 1.0)
        moved = start + amount * size
        low, high = (float(b) if b else None for b in (v.min, v.max))
        inside = moved if low is None and high is None else np.clip(moved, low, high)
        return np.where(inside != start, inside, start - amount * size)

    # ----------------------------------------------------------------------------- time

    def run(self, n: int = STEPS, first: int = 0) -> list[Values]:
        """Do n steps from step `first` on; the inputs change at steps 0 and 10. Return the outputs."""
        found = []
        for k in range(first, first + n):
            if k in (0, STEPS // 2):
                self.set(self.excited(0.1 if k == 0 else -0.05))
            self.step(self.t0 + k * self.h, self.h)
            found.append(self.read())
        return found

    def step(self, t: float, h: float) -> None:
        """Do a step from t over h, in s; with Model Exchange, a short one by Euler's method and an event."""
        if self.model_exchange:  # from the model's own time, which lags behind t
            self.steps.carry(self.model.t, _EULER * h)
        else:
            self.driver.do_step(t, h)
            self.driver.finish_step(t, h, self)

    def _completed(self, t: float, at_end: bool) -> bool:
        self.driver.attempt("complete a step", self.api.completedIntegratorStep)
        return True

    def handle_event(self, t: float, at_end: bool) -> None:
        """Handle an event."""
        self.driver.enter_event_mode()
        self._discrete_states(t)

    def end_run(self, t: float, at_end: bool) -> None:
        """Refuse to end the run."""
        raise FMUError(f"it asks to end the simulation at t = {t:g} s")

    def _discrete_states(self, t: float) -> None:
        if self.driver.update_discrete_states(t):
            raise FMUError("it asks to end the simulation in an event")
        self.driver.leave_event_mode()

    # ---------------------------------------------------------------------------- state

    def save(self) -> tuple[Any, float]:
        """Get the FMU's state, and the time of Model Exchange, which the importer keeps."""
        time = self.model.t if self.model_exchange else 0.0
        return self.driver.attempt("get its state", self.api.getFMUState), time

    def restore(self, saved: tuple[Any, float]) -> None:
        """Set the FMU's state."""
        self.driver.attempt("set its state", self.api.setFMUState, saved[0])
        if self.model_exchange:
            self.model.set_time(saved[1])

    def forget(self, saved: tuple[Any, float]) -> None:
        """Free a state."""
        self.driver.attempt("free its state", self.api.freeFMUState, saved[0])


def same(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> bool:
    """Return whether two values are equal bit for bit, apart from the sign of zero and the kind of NaN."""
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def difference(runs: tuple[list[Values], list[Values]], first: int = 1) -> str:
    """Return as text where two runs first differ, or "" if they do not."""
    for k, (a, b) in enumerate(zip(*runs, strict=True)):
        for name in a:
            if not same(a[name], b[name]):
                with np.errstate(all="ignore"):
                    gap = np.abs(a[name].astype(float) - b[name].astype(float)).max()
                return f"{name} by {gap:.3g} after step {k + first}"
    return ""
