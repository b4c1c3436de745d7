"""The plan of a run: all of its options, checked once, and the ports that it records."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, get_args

from ..core.port import Port
from ..core.time_grid import steps_between
from ..core.whole_number import whole_number
from ..errors import OptionError, TimeError, WiringError, check_known
from ..system.system import System

Coupling = Literal["sampled", "iterated", "continuous"]
Solver = Literal["ode1", "ode2", "ode3", "ode4"]


@dataclass(frozen=True)
class RunPlan:
    """The options of a run, which `simulate` explains; making the plan checks them.

    The instances, the couplings and the recorder get the whole plan, and a branch of a simulation
    shares it. `record` and `statistics` become tuples of names.
    """

    step: float
    start: float = 0.0
    coupling: Coupling = "sampled"
    solver: Solver = "ode3"
    record: Iterable[str] | None = None
    statistics: Iterable[str] | None = None
    decimation: int = 1
    jit: bool = True
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        """Check the options; turn numbers and names into one type each."""
        step, start = _seconds("step", self.step), _seconds("start", self.start)
        if step <= 0.0:
            raise TimeError(f"step={step:g} s; a communication step must be above zero")
        check_known("coupling", self.coupling, get_args(Coupling))
        check_known("solver", self.solver, get_args(Solver))
        if not (isinstance(self.tolerance, Real) and 0.0 < float(self.tolerance) < 1.0):
            raise OptionError(
                f"tolerance={self.tolerance!r} must be a number between 0 and 1: it is relative to the size "
                "of each exchanged value"
            )
        decimation = whole_number("decimation", self.decimation, error=OptionError)
        checked: dict[str, Any] = {"step": step, "start": start, "decimation": decimation}
        checked |= {"record": _port_names(self.record), "statistics": _port_names(self.statistics)}
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def point(self, stop: float) -> int:
        """Return the k of a later time, in s; refuse one that is not a communication point."""
        stop = _seconds("stop", stop)
        if stop <= self.start:
            raise TimeError(f"stop={stop:g} s is not after start={self.start:g} s")
        return steps_between(stop - self.start, self.step, "the time from start to stop")

    def recorded(self, system: System) -> list[Port]:
        """Return the ports to record: numbers, strings and binary data."""
        if self.record is not None:
            return [_readable(system, name) for name in self.record]
        return [
            system.port(f"{name}.{port}", "output")
            for name, component in system.participants.items()
            for port in component.declared_outputs
        ]

    def watched(self, system: System) -> list[Port]:
        """Return the ports to keep statistics of; refuse strings and binary data among the given ones."""
        if self.statistics is None:
            return [port for port in self.recorded(system) if port.kind == "number"]
        ports = [_readable(system, name) for name in self.statistics]
        for port in ports:
            if port.kind != "number":
                raise WiringError(f"{port} is a {port.kind}; statistics need numbers, so leave it out")
        return ports


def _seconds(name: str, value: object) -> float:
    if not isinstance(value, Real) or not math.isfinite(value):
        raise TimeError(f"{name}={value!r} must be a finite number of seconds")
    return float(value)


def _port_names(names: Iterable[str] | None) -> tuple[str, ...] | None:
    if names is None:
        return None
    if isinstance(names, str):
        raise WiringError(f"'{names}' is one name; give a list of ports, [\"{names}\"]")
    found = tuple(names) if isinstance(names, Iterable) else (None,)
    if not all(isinstance(name, str) for name in found):
        raise WiringError(f'{names!r} must be a list of ports, such as ["plant.x"]')
    return found


def _readable(system: System, name: str) -> Port:
    """Find a port to record: an output, a state, or an input of numbers (the value that was used)."""
    where, _, port = name.partition(".")
    component = system.participants.get(where)
    found = component.ports("input").get(port.partition("[")[0]) if component is not None else None
    return system.port(name, "input" if found is not None and found.kind == "number" else "output")
