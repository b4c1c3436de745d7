"""A single FMU as a scenario: `cosim run plant.fmu`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..errors import FMUError, TimeError, did_you_mean
from ..fmi.file.display_units import has_unit
from ..fmi.fmu import FMU
from ..fmi.interfaces import InterfaceName, Solver, interface_of
from ..result import Result
from ..run.simulation import simulate
from ..system.system import System
from .input_table import connect_inputs, start_from_inputs
from .scenario import Scenario

_TRUTH = {"true": 1, "false": 0}


def fmu_scenario(path: Path) -> Scenario:
    """Return the scenario of an FMU: it alone, inputs from a file, times from its default experiment."""
    name = path.stem if re.fullmatch(r"[A-Za-z_]\w*", path.stem) else "fmu"

    def build(
        *,
        interface: InterfaceName | None = None,
        solver: Solver | None = None,
        substeps: int | None = None,
        tolerance: float | None = None,
        event_mode: bool | None = None,
        isolated: bool = False,
        input: Path | None = None,
        start: tuple[str, ...] = (),
    ) -> System:
        values = start_values(FMU(path), start) if start else {}
        fmu = FMU(
            path,
            start=values,
            interface=interface_of(
                path.name,
                interface,
                solver=solver,
                substeps=substeps,
                tolerance=tolerance,
                event_mode=event_mode,
            ),
            isolated=isolated,
        )
        system = System({name: fmu})
        if input is not None:
            connect_inputs(system, name, input)
        return system

    def run(
        *,
        stop: float | None = None,
        step: float | None = None,
        start_time: float | None = None,
        interface: InterfaceName | None = None,
        solver: Solver | None = None,
        substeps: int | None = None,
        tolerance: float | None = None,
        event_mode: bool | None = None,
        isolated: bool = False,
        input: Path | None = None,
        start: tuple[str, ...] = (),
        record: tuple[str, ...] = (),
        progress: Callable[[int, int], None] | None = None,
    ) -> Result:
        """Run one FMU.

        Parameters
        ----------
        stop
            time to stop at, in s [the FMU's default]
        step
            communication step, in s [the FMU's default]
        start_time
            time to start at, in s [the FMU's default, or 0]
        interface
            CoSimulation or ModelExchange, where there are both [CoSimulation]
        solver
            of Model Exchange: ode1 to ode4, cvode [ode4; cvode if there are event indicators]
        substeps
            steps of ode1 to ode4 in a communication step [1]
        tolerance
            relative tolerance of cvode [1e-6]
        event_mode
            of Co-Simulation: handle events at their instants [where the FMU has clocks]
        isolated
            run the FMU in a process of its own: a crash of it is an error here
        input
            CSV file: time and inputs by name; linear for continuous inputs, held for others
        start
            name=value of a parameter or start value, with a unit ("30 deg") if it is another one than the
            variable's; arrays as "1 2 3"; may be repeated
        record
            variable to record; may be repeated [all outputs]
        """
        system = build(
            interface=interface,
            solver=solver,
            substeps=substeps,
            tolerance=tolerance,
            event_mode=event_mode,
            isolated=isolated,
            input=input,
            start=start,
        )
        fmu = system.participants[name]
        assert isinstance(fmu, FMU)
        begin, end, h = _times(fmu, start_time, stop, step)
        start_from_inputs(system, name, begin)
        wanted = list(record) or [*fmu.declared_outputs]
        recorded = [f"{name}.{variable}" for variable in wanted]
        return simulate(system, step=h, start=begin, stop=end, record=recorded, progress=progress)

    module = ModuleType(path.stem)
    module.__dict__.update(build=build, run=run, metrics=_metrics)
    return Scenario(path.stem, module)


def _metrics(result: Result) -> dict[str, tuple[float, str]]:
    """Return peak and RMS of everything that is recorded, arrays by element."""
    found: dict[str, tuple[float, str]] = {}
    for kind in ("peak", "rms"):
        for name, statistics in result.statistics.items():
            values = np.atleast_1d(getattr(statistics, kind))
            scalar = np.ndim(getattr(statistics, kind)) == 0
            for i, value in enumerate(values):
                element = name if scalar else f"{name}[{i + 1}]"
                found[f"{kind} {element}"] = (float(value), result.units.get(name) or "")
    return found


def _times(
    fmu: FMU, start: float | None, stop: float | None, step: float | None
) -> tuple[float, float, float]:
    """Return start, stop and step: what is given, else what the FMU gives."""
    experiment = fmu.description.defaultExperiment
    given = (
        {}
        if experiment is None
        else {n: getattr(experiment, n) for n in ("startTime", "stopTime", "stepSize")}
    )
    if given.get("stepSize") is None and not fmu.model_exchange:
        given["stepSize"] = getattr(fmu.description.coSimulation, "fixedInternalStepSize", None)
    begin = _time(fmu, start, given.get("startTime"), "startTime")
    end = _time(fmu, stop, given.get("stopTime"), "stopTime")
    h = _time(fmu, step, given.get("stepSize"), "stepSize")
    begin = 0.0 if begin is None else begin
    if end is None:
        raise TimeError(f"{fmu.path.name} has no default stop time; give --stop, in s")
    if h is None:
        example = (end - begin) / 1000
        raise TimeError(f"{fmu.path.name} has no default step; give --step, in s, such as {example:g}")
    return begin, end, h


def _time(fmu: FMU, asked: float | None, default: Any, name: str) -> float | None:
    if asked is not None or default is None:
        return asked
    try:
        value = float(default)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FMUError(f"{fmu.path.name}: {name}={default!r} of its default experiment is no number")
    return value


def start_values(fmu: FMU, pairs: tuple[str, ...]) -> dict[str, Any]:
    """Return start values from texts such as m=2.5, name=text, u=1 2 3."""
    found: dict[str, Any] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        name = name.strip()
        if not equals:
            raise FMUError(f"--start '{pair}': write name=value, such as m=2.5")
        kinds = {v.type for n, v in fmu.variables.items() if n == name or n.startswith(f"{name}[")}
        if not kinds:
            raise FMUError(f"{fmu.path.name} has no variable '{name}'" + did_you_mean(name, fmu.variables))
        found[name] = _value(name, kinds.pop(), text.strip())
    return found


def _value(name: str, kind: str, text: str) -> Any:
    try:
        if kind == "String":
            return text
        if kind == "Binary":
            return bytes.fromhex(text)
        number = float if kind in ("Real", "Float64", "Float32", "Clock") else int
        if number is float and has_unit(text):
            return text
        values = [
            _TRUTH[t.lower()] if t.lower() in _TRUTH else number(t) for t in text.replace(",", " ").split()
        ]
        return values[0] if len(values) == 1 else values
    except ValueError:
        raise FMUError(f"--start {name}={text}: '{text}' is no value of type {kind}") from None
