"""An FMU under examination: one instance, moved call by call, without the loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from ..errors import CosimError, FMUError
from ..fmi.fmu import FMU
from ..fmi.instance.continuous_time import ContinuousTime
from ..fmi.instance.events import EVENT_ITERATIONS
from ..fmi.ports import FMUPort
from ..loop.signals import RunSignals

#: values of ports by name, as the FMU gives them
Values: TypeAlias = dict[str, np.ndarray[Any, Any]]

STEPS = 20  # of a run that is repeated: two input changes and what follows from them
_EULER = 0.1  # of the communication step: a step of Euler's method, for Model Exchange
_MOST_PORTS = 500  # that are watched; more would not find more


@dataclass(frozen=True)
class Plan:
    """Start time and communication step, in s."""

    start: float
    step: float


def plan_of(fmu: FMU) -> Plan:
    """Return the default experiment: its step, or a 500th of its time, or 10 ms."""
    experiment = fmu.description.defaultExperiment
    start, stop, step = (
        float(getattr(experiment, name, None) or 0.0) for name in ("startTime", "stopTime", "stepSize")
    )
    if step <= 0.0:
        step = (stop - start) / 500 if stop > start else 0.01
    return Plan(start, step)


class Subject:
    """An instance of an FMU; its functions raise CosimErrors with the FMU's own words."""

    def __init__(self, fmu: FMU, model_exchange: bool, name: str = "instance") -> None:
        self.fmu = fmu
        self.plan = plan_of(fmu)
        self.model_exchange = model_exchange
        self.fmi = fmu.adapter(fmu, name, model_exchange, RunSignals())
        self.api = self.fmi.api
        outputs = {n: fmu.output_ports[n] for n in fmu.declared_outputs} or fmu.output_ports
        self.outputs = dict(list(outputs.items())[:_MOST_PORTS])
        floats = {n: p for n, p in fmu.input_ports.items() if self.fmi.NUMBERS[p.type][1].is_float}
        continuous = {n: p for n, p in floats.items() if p.variables[0].variability == "continuous"}
        self.inputs = dict(list(continuous.items())[:_MOST_PORTS])

    # ----------------------------------------------------------------------------- life

    def start(self) -> None:
        """Take the instance through initialization, with the start values of the description."""
        self.fmi.initialize(self.plan.start, lambda: None)
        if self.model_exchange:
            self.model = ContinuousTime(self.fmi, *self.fmi.counts())
            self.model.t = self.plan.start
            self.states = np.zeros(self.model.n_states)
        if self.model_exchange or self.fmu.event_mode:
            self._discrete_states()
            self._leave_event_mode()
        self.start_inputs = self.get(self.inputs)

    def reset(self) -> None:
        """Reset the instance, and initialize it again."""
        self.fmi.attempt("reset", self.api.reset)
        self.start()

    def again(self) -> None:
        """Make another instance in the place of one that was freed."""
        self.fmi.attempt("instantiate", self.fmi._instantiate)

    def stop(self) -> None:
        """Terminate and free the instance; the library stays."""
        self.fmi.attempt("terminate", self.api.terminate)
        self.free()

    def free(self) -> None:
        """Free the instance."""
        getattr(self.api, f"{self.fmi.PREFIX}FreeInstance")(self.api.component)

    # --------------------------------------------------------------------------- values

    def get(self, ports: Mapping[str, FMUPort]) -> Values:
        """Get the values of ports, a call for every type."""
        groups: dict[str, list[tuple[str, FMUPort]]] = {}
        for name, port in ports.items():
            groups.setdefault(self.fmi.NUMBERS[port.type][0], []).append((name, port))
        found: Values = {}
        for access, members in groups.items():
            references = [v.valueReference for _, p in members for v in p.variables]
            values = np.array(self.fmi.get(access, references, sum(p.size for _, p in members)))
            for name, port in members:
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
                self.fmi.set(v, given[done : done + each].tolist())
                done += each

    def excited(self, amount: float) -> Values:
        """Return the inputs, moved from their start values by a fraction of their size."""
        return {name: self.moved(name, amount) for name in self.inputs}

    def moved(self, name: str, amount: float) -> np.ndarray[Any, Any]:
        """Return an input moved by `amount` of its nominal value, or of what it is, within its bounds."""
        start, v = self.start_inputs[name], self.inputs[name].variables[0]
        nominal = abs(float(v.nominal)) if v.nominal else 0.0
        size = np.where(start != 0.0, np.abs(start), nominal or 1.0)
        moved = start + amount * size
        low, high = (float(b) if b else None for b in (v.min, v.max))
        inside = moved if low is None and high is None else np.clip(moved, low, high)
        return np.where(inside != start, inside, start - amount * size)

    # ----------------------------------------------------------------------------- time

    def run(self, n: int = STEPS, first: int = 0, step: float | None = None) -> list[Values]:
        """Do n steps from number `first`, with inputs that change at 0 and 10; return the outputs."""
        h = self.plan.step if step is None else step
        found = []
        for k in range(first, first + n):
            if k in (0, STEPS // 2):
                self.set(self.excited(0.1 if k == 0 else -0.05))
            self.step(self.plan.start + k * h, h)
            found.append(self.read())
        return found

    def step(self, t: float, h: float) -> None:
        """Do a step: doStep as often as the FMU comes back early, or a short one of Euler's method."""
        if self.model_exchange:
            self._euler(t, _EULER * h)
            return
        now, end = t, t + h
        for _ in range(EVENT_ITERATIONS):
            answer = self.fmi.attempt("do a step", partial(self.api.doStep, now, end - now, False))
            if self.fmi.answer is None:
                return
            event, terminate, early, last = answer
            if terminate:
                raise FMUError(f"it asks to end the simulation at t = {last:g} s")
            if event and self.fmu.event_mode:
                self.fmi.attempt("enter event mode", self.api.enterEventMode)
                self._discrete_states()
                self._leave_event_mode()
            if not early or last >= end - 1e-9 * h:
                return
            now = last
        raise FMUError(f"its step at t = {t:g} s returns early without end")

    def _euler(self, t: float, h: float) -> None:
        # times of the model's own: `run` counts whole communication steps
        model, slopes = self.model, np.zeros(max(self.model.n_states, 1))
        if model.n_states:
            model.get_derivatives(slopes.ctypes.data)
            self.states += h * slopes[: model.n_states]
        model.set_time(model.t + h)
        model.set_states(self.states.ctypes.data)
        self.fmi.attempt("complete a step", self.api.completedIntegratorStep)
        self.fmi.attempt("enter event mode", self.api.enterEventMode)
        self._discrete_states()
        self._leave_event_mode()

    def _discrete_states(self) -> None:
        for _ in range(EVENT_ITERATIONS):
            again, end, *_ = self.fmi.attempt("update its discrete states", self.fmi.discrete_states)
            if end:
                raise FMUError("it asks to end the simulation in an event")
            if not again:
                return
        raise FMUError(f"an event does not end in {EVENT_ITERATIONS} iterations")

    def _leave_event_mode(self) -> None:
        if self.model_exchange:
            self.fmi.attempt("enter continuous-time mode", self.api.enterContinuousTimeMode)
            self.model.get_states(self.states.ctypes.data)
        else:
            self.fmi.attempt("enter step mode", self.api.enterStepMode)

    # ---------------------------------------------------------------------------- state

    def save(self) -> tuple[Any, float]:
        """Get the FMU's state."""
        return self.fmi.attempt("get its state", self.api.getFMUState), self._time()

    def restore(self, saved: tuple[Any, float]) -> None:
        """Set the FMU's state."""
        self.fmi.attempt("set its state", lambda: self.api.setFMUState(saved[0]))
        if self.model_exchange:
            self.model.set_time(saved[1])  # time is the importer's
            self.model.get_states(self.states.ctypes.data)

    def forget(self, saved: tuple[Any, float]) -> None:
        """Free a state."""
        self.fmi.attempt("free its state", lambda: self.api.freeFMUState(saved[0]))

    def _time(self) -> float:
        return self.model.t if self.model_exchange else 0.0


def same(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> bool:
    """Tell whether two values are the same, bit for bit but for the kinds of NaN and of zero."""
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def difference(runs: tuple[list[Values], list[Values]], first: int = 1) -> str:
    """Return where two runs differ first: nothing, or words."""
    for k, (a, b) in enumerate(zip(*runs, strict=True)):
        for name in a:
            if not same(a[name], b[name]):
                with np.errstate(all="ignore"):
                    gap = np.abs(a[name].astype(float) - b[name].astype(float)).max()
                return f"{name} by {gap:.3g} after step {k + first}"
    return ""


__all__ = ["STEPS", "CosimError", "Plan", "Subject", "Values", "difference", "plan_of", "same"]
