"""A single FMU as a scenario: `cosim run plant.fmu`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..errors import FMUError, TimeError, did_you_mean
from ..fmi.file.display_units import has_unit
from ..fmi.fmu import FMU
from ..fmi.interfaces import InterfaceName, Solver, interface_of
from ..result import Result
from ..run.simulation import simulate
from ..system.system import System
from .input_table import connect_inputs, start_from_inputs

_TRUTH = {"true": 1, "false": 0}


@dataclass(frozen=True, kw_only=True)
class FMUStudy:
    """Run one FMU."""

    path: ClassVar[Path]  # a subclass for each file sets it

    stop: float | None = None
    """time at which the run stops, s [the FMU's default]"""
    step: float | None = None
    """communication step, s [the FMU's default]"""
    start_time: float | None = None
    """time at which the run starts, s [the FMU's default, or 0]"""
    interface: InterfaceName | None = None
    """CoSimulation or ModelExchange, for an FMU that offers both [CoSimulation]"""
    solver: Solver | None = None
    """solver of Model Exchange: ode1 to ode4, cvode [ode4; cvode for an FMU with event indicators]"""
    substeps: int | None = None
    """steps of ode1 to ode4 in a communication step [1]"""
    tolerance: float | None = None
    """relative tolerance of cvode [1e-6]"""
    event_mode: bool | None = None
    """handle events of Co-Simulation at their instants [for an FMU with clocks]"""
    isolated: bool = False
    """run the FMU in a process of its own, so that a crash of the FMU becomes an error"""
    input: Path | None = None
    """CSV file with time and inputs by name; continuous inputs are interpolated, others are held"""
    start: tuple[str, ...] = ()
    """name=value of a parameter or start value; a value may have a unit ("30 deg"), an array is
    written "1 2 3"; may be repeated"""
    record: tuple[str, ...] = ()
    """variable to record; may be repeated [all outputs]"""

    @property
    def name(self) -> str:
        """The FMU's name in the system: the stem of its file if that is a Python name, else fmu."""
        stem = self.path.stem
        return stem if re.fullmatch(r"[A-Za-z_]\w*", stem) else "fmu"

    def build(self) -> System:
        """Return a system of the FMU and its inputs."""
        values = start_values(FMU(self.path), self.start) if self.start else {}
        fmu = FMU(
            self.path,
            start=values,
            interface=interface_of(
                self.path.name,
                self.interface,
                solver=self.solver,
                substeps=self.substeps,
                tolerance=self.tolerance,
                event_mode=self.event_mode,
            ),
            isolated=self.isolated,
        )
        system = System({self.name: fmu})
        if self.input is not None:
            connect_inputs(system, self.name, self.input)
        return system

    def run(self, progress: Callable[[int, int], None] | None = None) -> Result:
        """Run the FMU; times that are not given are those of its default experiment."""
        system = self.build()
        fmu = system.participants[self.name]
        assert isinstance(fmu, FMU)
        begin, end, h = _times(fmu, self.start_time, self.stop, self.step)
        start_from_inputs(system, self.name, begin)
        recorded = [f"{self.name}.{variable}" for variable in self.record or fmu.declared_outputs]
        return simulate(system, step=h, start=begin, stop=end, record=recorded, progress=progress)

    def metrics(self, result: Result) -> dict[str, tuple[float, str]]:
        """Return peak and RMS of all recorded variables, arrays by element."""
        found: dict[str, tuple[float, str]] = {}
        for kind in ("peak", "rms"):
            for name, statistics in result.statistics.items():
                for index, value in np.ndenumerate(getattr(statistics, kind)):
                    element = f"{name}[{index[0] + 1}]" if index else name
                    found[f"{kind} {element}"] = (float(value), result.units.get(name) or "")
        return found


def _times(
    fmu: FMU, start: float | None, stop: float | None, step: float | None
) -> tuple[float, float, float]:
    """Return start, stop and step: the given values, or else those of the FMU's default experiment."""
    experiment = fmu.description.defaultExperiment
    default_step = getattr(experiment, "stepSize", None)
    if default_step is None and not fmu.model_exchange:
        default_step = getattr(fmu.description.coSimulation, "fixedInternalStepSize", None)
    begin = _time(fmu, start, getattr(experiment, "startTime", None), "startTime") or 0.0
    end = _time(fmu, stop, getattr(experiment, "stopTime", None), "stopTime")
    h = _time(fmu, step, default_step, "stepSize")
    if end is None:
        raise TimeError(f"{fmu.path.name} has no default stop time; give --stop, in s")
    if h is None:
        example = (end - begin) / 1000
        raise TimeError(f"{fmu.path.name} has no default step; give --step, in s, such as {example:g}")
    return begin, end, h


def _time(fmu: FMU, given: float | None, default: Any, name: str) -> float | None:
    if given is not None or default is None:
        return given
    try:
        value = float(default)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FMUError(
            f"{fmu.path.name}: {name}={default!r} of its default experiment must be a finite number"
        )
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
        raise FMUError(f"--start {name}={text}: '{text}' is not a value of type {kind}") from None
