"""Scenarios: modules with `build` and `run`, found by name or by file.

A scenario is a Python file with these functions; options are keyword arguments with
types and defaults.

    build(**options) -> System
    run(**options) -> Result
    metrics(result) -> {name: (value, unit)}                optional
    figures(result) -> {name: matplotlib figure}            optional
    table(**options) -> [row, ...]                          optional, rows are dicts
    table_text(rows) -> str                                 optional
    STEP, STOP                                              optional, s: what an exported system is run with

An .fmu and an .ssp are scenarios too (fmu_scenario.py, ssp_scenario.py).
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from ..core.participant import Participant
from ..errors import CosimError, WiringError, did_you_mean
from ..fmi.fmu import FMU
from ..result import Result


class ScenarioError(CosimError):
    """A scenario that is not there or that lacks a function."""


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the installation."""
    package = importlib.import_module("scenarios")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


def _module_of(name: str) -> str:
    """Return the module of a scenario: a file, or the file study.py of a folder."""
    spec = importlib.util.find_spec(f"scenarios.{name}")
    is_folder = spec is not None and spec.submodule_search_locations is not None
    return f"scenarios.{name}.study" if is_folder else f"scenarios.{name}"


def summary(name: str) -> str:
    """Return the first line of a scenario's docstring, without importing it."""
    spec = importlib.util.find_spec(_module_of(name))
    if spec is None or spec.origin is None:
        return ""
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


class Scenario:
    """A scenario's module, with clear errors for what it lacks."""

    def __init__(self, name: str, module: ModuleType) -> None:
        self.name = name
        self.module = module

    def function(self, name: str) -> Callable[..., Any]:
        """Return a function of the scenario; it must be there."""
        found = getattr(self.module, name, None)
        if not callable(found):
            raise ScenarioError(
                f"scenario {self.name} has no function {name}(); a scenario defines build and run"
            )
        function: Callable[..., Any] = found
        return function

    def seconds(self, name: str) -> float | None:
        """Return STEP or STOP of the scenario, if it has one."""
        found = getattr(self.module, name, None)
        return float(found) if isinstance(found, (int, float)) else None

    @property
    def run(self) -> Callable[..., Result]:
        """The scenario's run function."""
        return self.function("run")

    def metrics(self, result: Result) -> dict[str, tuple[float, str]]:
        """Return named numbers with units: the scenario's own, or peak and RMS of every scalar port."""
        if hasattr(self.module, "metrics"):
            found: dict[str, tuple[float, str]] = self.function("metrics")(result)
            return found
        scalars = {n: s for n, s in result.statistics.items() if isinstance(s.rms, float)}
        unit = {n: result.units.get(n) or "" for n in scalars}
        return {f"peak {n}": (float(s.peak), unit[n]) for n, s in scalars.items()} | {
            f"rms {n}": (s.rms, unit[n]) for n, s in scalars.items()
        }

    def figures(self, result: Result) -> dict[str, Any]:
        """Return the figures of a result; none if the scenario draws none."""
        found: dict[str, Any] = self.function("figures")(result) if hasattr(self.module, "figures") else {}
        return found

    def table_text(self, rows: list[dict[str, Any]]) -> str:
        """Return the rows of a table as text: the scenario's own, or aligned columns."""
        if hasattr(self.module, "table_text"):
            return str(self.function("table_text")(rows))
        return aligned(rows)


def aligned(rows: list[dict[str, Any]]) -> str:
    """Return rows of one kind as aligned columns."""
    if not rows:
        return "(no rows)"
    names = list(rows[0])
    cells = [[_cell(row.get(n)) for n in names] for row in rows]
    widths = [max(len(n), *(len(row[i]) for row in cells)) for i, n in enumerate(names)]
    lines = [names, ["-" * w for w in widths], *cells]
    return "\n".join(
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines
    )


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def load_scenario(name: str) -> Scenario:
    """Load a scenario by its name, or a user's Python file, FMU or SSP by its path."""
    if name.endswith(".fmu"):
        from .fmu_scenario import fmu_scenario

        return fmu_scenario(Path(name))
    if name.endswith(".ssp"):
        from .ssp_scenario import ssp_scenario

        return ssp_scenario(Path(name))
    if name.endswith(".py"):
        path = Path(name)
        return Scenario(path.stem, load_file(path))
    if name not in scenario_names():
        raise ScenarioError(f"there is no scenario '{name}'" + did_you_mean(name, scenario_names()))
    return Scenario(name, importlib.import_module(_module_of(name)))


def load_file(path: Path) -> ModuleType:
    """Load a user's Python file; what it imports from its own folder is found."""
    if not path.is_file():
        raise ScenarioError(f"there is no file {path}; give the path of a scenario or one of its names")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ScenarioError(f"{path} cannot be loaded as a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    sys.path.insert(0, str(path.parent.resolve()))
    try:
        spec.loader.exec_module(module)
    except CosimError:
        raise
    except Exception as error:  # whatever the user's file does
        lines = [f.lineno for f in extract_tb(error.__traceback__) if f.filename == spec.origin]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        raise ScenarioError(f"{path}, line {line}: {type(error).__name__}: {error}") from error
    return module


def find_part(text: str) -> Participant | FMU | type[Participant]:
    """Find what `file.py:Class`, `module:Class`, `module:instance` or `scenario:participant` names."""
    where, colon, wanted = text.rpartition(":")
    if not colon:
        raise ScenarioError(f"'{text}': write FILE.py:CLASS, module:CLASS or scenario:participant")
    if where.endswith(".py"):
        module = load_file(Path(where))
    elif where in scenario_names():
        module = importlib.import_module(_module_of(where))
    else:
        try:
            module = importlib.import_module(where)
        except ModuleNotFoundError as error:
            raise ScenarioError(
                f"'{text}': there is no module '{error.name}'; a file is named FILE.py"
            ) from error
    found = getattr(module, wanted, None)
    if isinstance(found, (Participant, FMU)) or (isinstance(found, type) and issubclass(found, Participant)):
        return found
    if found is None and hasattr(module, "build"):
        return find_participant(text)
    classes = {n: v for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, Participant)}
    parts = [n for n, v in classes.items() if not v.__module__.startswith("cosim.")]
    raise ScenarioError(f"{where} has no block '{wanted}'" + did_you_mean(wanted, parts))


def find_participant(text: str) -> Participant:
    """Find the Python object behind `scenario:participant`, as the scenario builds it by default."""
    name, colon, wanted = text.rpartition(":")
    if not colon:
        raise ScenarioError(f"'{text}': write scenario:participant, such as chattering:plant")
    system = load_scenario(name).function("build")()
    if wanted not in system.participants:
        raise WiringError(
            f"scenario {name} has no participant '{wanted}'" + did_you_mean(wanted, system.participants)
        )
    member = system.participants[wanted]
    source = member if isinstance(member, Participant) else member.source
    if source is None:
        raise ScenarioError(f"{text} is an FMU already ({member.path}); copy that file")
    found: Participant = source
    return found
