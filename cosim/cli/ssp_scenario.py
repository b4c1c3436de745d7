"""An SSP as a scenario: `cosim run loop.ssp --replace control=mine.py:Controller`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, get_args

from ..errors import did_you_mean
from ..result import Result
from ..run.plan import Coupling, Solver
from ..run.simulation import simulate
from ..ssp.reader import Package, read_package
from ..system.system import System
from .python_scenario import find_part
from .scenario import ScenarioError


@dataclass(frozen=True, kw_only=True)
class SSPStudy:
    """Run the system of an SSP file."""

    path: ClassVar[Path]  # a subclass for each file sets it

    stop: float | None = None
    """time at which the run stops, s [that of the file]"""
    step: float | None = None
    """communication step, s [that of the file]"""
    start_time: float | None = None
    """time at which the run starts, s [that of the file, or 0]"""
    coupling: Coupling | None = None
    """sampled: inputs are held over a step; continuous: stage coupling, which integrates all states
    together; iterated: plants that drive each other agree at every communication point [that of the
    file, or sampled]"""
    solver: Solver | None = None
    """solver of stage coupling [that of the file, or ode3]"""
    record: tuple[str, ...] = ()
    """port to record, such as plant.x; may be repeated [all outputs]"""
    replace: tuple[str, ...] = ()
    """NAME=FILE.py:CLASS replaces a component by a Python block; also NAME=module:CLASS and
    NAME=scenario:participant; ports are matched by name; may be repeated"""

    def _package(self) -> Package:
        return read_package(self.path, replace=dict(_replacement(text) for text in self.replace))

    def build(self) -> System:
        """Return the system of the file."""
        return self._package().system

    def run(self, progress: Callable[[int, int], None] | None = None) -> Result:
        """Run the system; options that are not given are those of the file's default experiment."""
        package = self._package()
        own = package.experiment
        return simulate(
            package.system,
            step=self._seconds("step", self.step, own.step),
            stop=self._seconds("stop", self.stop, own.stop),
            start=self.start_time if self.start_time is not None else own.start or 0.0,
            coupling=self.coupling or self._known(own.coupling, Coupling) or "sampled",
            solver=self.solver or self._known(own.solver, Solver) or "ode3",
            record=self.record or None,
            progress=progress,
        )

    def _seconds(self, name: str, given: float | None, own: float | None) -> float:
        value = own if given is None else given
        if value is None:
            raise ScenarioError(f"{self.path} states no {name}; give it in seconds, --{name} 0.01")
        return value

    def _known(self, value: str | None, choices: Any) -> Any:
        if value is not None and value not in get_args(choices):
            raise ScenarioError(
                f"{self.path}: '{value}' is not known" + did_you_mean(value, get_args(choices))
            )
        return value


def _replacement(text: str) -> tuple[str, Any]:
    name, equals, part = text.partition("=")
    if not (name and equals and part):
        raise ScenarioError(f"--replace {text}: write NAME=FILE.py:CLASS, such as control=mine.py:Controller")
    return name, find_part(part)
