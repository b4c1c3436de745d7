"""An SSP as a scenario: `cosim run loop.ssp --replace control=mine.py:Controller`."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any, get_args

from ..errors import did_you_mean
from ..result import Result
from ..run.plan import Coupling, Solver
from ..run.simulation import simulate
from ..ssp.reader import Package, read_package
from ..system.system import System
from .scenario import Scenario, ScenarioError, find_part


def ssp_scenario(path: Path) -> Scenario:
    """Return the scenario of an SSP: what is not given is what its default experiment says."""

    def package(replace: tuple[str, ...]) -> Package:
        return read_package(path, replace=dict(_replacement(text) for text in replace))

    def build(*, replace: tuple[str, ...] = ()) -> System:
        return package(replace).system

    def run(
        *,
        stop: float | None = None,
        step: float | None = None,
        start_time: float | None = None,
        coupling: Coupling | None = None,
        solver: Solver | None = None,
        record: tuple[str, ...] = (),
        replace: tuple[str, ...] = (),
        progress: Any = None,
    ) -> Result:
        """Run a system.

        Parameters
        ----------
        stop
            time to stop at, in s [that of the file]
        step
            communication step, in s [that of the file]
        start_time
            time to start at, in s [that of the file, or 0]
        coupling
            sampled: inputs held over a step; continuous: integrated together [that of the file, or sampled]
        solver
            of continuous coupling [that of the file, or ode3]
        record
            port to record, such as plant.x; may be repeated [all outputs]
        replace
            NAME=FILE.py:CLASS puts a Python block in the place of a component; may be repeated.
            Also NAME=module:CLASS, NAME=scenario:participant; ports are matched by name
        """
        found = package(replace)
        own = found.experiment
        return simulate(
            found.system,
            step=_needed(path, "step", step, own.step),
            stop=_needed(path, "stop", stop, own.stop),
            start=start_time if start_time is not None else own.start or 0.0,
            coupling=coupling or _known(path, own.coupling, Coupling) or "sampled",
            solver=solver or _known(path, own.solver, Solver) or "ode3",
            record=record or None,
            progress=progress,
        )

    module = ModuleType(path.stem)
    module.__dict__.update(build=build, run=run)
    return Scenario(path.stem, module)


def _replacement(text: str) -> tuple[str, Any]:
    name, equals, part = text.partition("=")
    if not (name and equals and part):
        raise ScenarioError(f"--replace {text}: write NAME=FILE.py:CLASS, such as control=mine.py:Controller")
    return name, find_part(part)


def _needed(path: Path, name: str, given: float | None, own: float | None) -> float:
    if given is None and own is None:
        raise ScenarioError(f"{path} does not say its {name}; give it in seconds, --{name} 0.01")
    return given if given is not None else own  # type: ignore[return-value]


def _known(path: Path, value: str | None, choices: Any) -> Any:
    if value is not None and value not in get_args(choices):
        raise ScenarioError(f"{path}: '{value}' is not known" + did_you_mean(value, get_args(choices)))
    return value
