"""What a run is asked for: its options, checked, and the ports that are recorded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Literal, get_args

from ..core.port import Port
from ..core.tableaus import TABLEAUS
from ..errors import TimeError, WiringError, did_you_mean
from ..system.system import System

Coupling = Literal["sampled", "iterated", "continuous"]
Solver = Literal["ode1", "ode2", "ode3", "ode4"]


def check_system(system: object) -> None:
    """Refuse what is no system."""
    if not isinstance(system, System):
        raise WiringError(f"{system!r} is no System; give System({{'plant': ...}}, [...])")


def check_time(step: float, start: float) -> None:
    """Refuse what is no step or no start, in s."""
    _check_seconds("step", step)
    _check_seconds("start", start)
    if step <= 0.0:
        raise TimeError(f"step={step:g} s; a communication step is above zero")


def check_stop(stop: float, start: float) -> None:
    """Refuse what is no stop after a start, in s."""
    _check_seconds("stop", stop)
    if stop <= start:
        raise TimeError(f"stop={stop:g} s is not after start={start:g} s")


def _check_seconds(name: str, value: object) -> None:
    if not isinstance(value, Real) or not math.isfinite(value):
        raise TimeError(f"{name}={value!r} is no finite number of seconds")


def check_choices(coupling: str, solver: str, decimation: int, tolerance: float) -> None:
    """Refuse a coupling, a solver, a decimation or a tolerance that is none."""
    if coupling not in get_args(Coupling):
        raise TimeError(f"coupling '{coupling}' is not known" + did_you_mean(coupling, get_args(Coupling)))
    if solver not in tuple(TABLEAUS):
        raise TimeError(f"solver '{solver}' is not known" + did_you_mean(solver, TABLEAUS))
    if not isinstance(decimation, Integral) or decimation < 1:
        raise TimeError(f"decimation={decimation!r} is no whole number of steps, 1 or more")
    if not (isinstance(tolerance, Real) and 0.0 < float(tolerance) < 1.0):
        raise TimeError(f"tolerance={tolerance!r} is no relative tolerance; it lies between 0 and 1")


def port_names(names: Iterable[str]) -> list[str]:
    """Return names of ports as a list; refuse what is none."""
    if isinstance(names, str):
        raise WiringError(f"'{names}' is one name; give a list of ports, [\"{names}\"]")
    found = list(names) if isinstance(names, Iterable) else [None]
    if not all(isinstance(name, str) for name in found):
        raise WiringError(f'{names!r} is no list of ports, such as ["plant.x"]')
    return found


def ports(system: System, names: list[str] | None) -> list[Port]:
    """Return the ports with these names; None means every declared output and state."""
    if names is None:
        return [
            system.port(f"{name}.{port}", "output")
            for name, component in system.participants.items()
            for port in component.declared_outputs
        ]
    return [_readable(system, name) for name in names]


def numbers(ports: Iterable[Port]) -> list[Port]:
    """Return the ports; refuse strings and binary data."""
    found = list(ports)
    for port in found:
        if port.kind != "number":
            raise WiringError(f"{port} is a {port.kind}; statistics are of numbers, so leave it out")
    return found


def _readable(system: System, name: str) -> Port:
    """Find a port to record: an output, a state, or an input of numbers (the value that was used)."""
    where, _, port = name.partition(".")
    component = system.participants.get(where)
    found = component.ports("input").get(port.partition("[")[0]) if component is not None else None
    return system.port(name, "input" if found is not None and found.kind == "number" else "output")
