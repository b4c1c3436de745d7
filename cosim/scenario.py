"""Scenarios: modules with `build` and `run`, found by name or by file.

A scenario is a Python file with these functions; options are keyword arguments with
types and defaults.

    build(**options) -> System
    run(**options) -> Result
    metrics(result) -> {name: (value, unit)}                optional
    figures(result) -> {name: matplotlib figure}            optional
    table(**options) -> [row, ...]                          optional, rows are dicts
    table_text(rows) -> str                                 optional
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from .errors import CosimError, WiringError, did_you_mean
from .participant import Participant
from .result import Result


class ScenarioError(CosimError):
    """A scenario that is not there or that lacks a function."""


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the installation."""
    package = importlib.import_module("scenarios")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


def summary(name: str) -> str:
    """Return the first line of a scenario's docstring, without importing it."""
    spec = importlib.util.find_spec(f"scenarios.{name}")
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
    """Load a scenario by its name, or a user's Python file or FMU by its path."""
    if name.endswith(".fmu"):
        from .fmu_scenario import fmu_scenario

        return fmu_scenario(Path(name))
    if name.endswith(".py"):
        path = Path(name)
        if not path.is_file():
            raise ScenarioError(f"there is no file {path}; give the path of a scenario or one of its names")
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None:
            raise ScenarioError(f"{path} cannot be loaded as a Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module
        sys.path.insert(0, str(path.parent.resolve()))
        spec.loader.exec_module(module)
        return Scenario(path.stem, module)
    if name not in scenario_names():
        raise ScenarioError(f"there is no scenario '{name}'" + did_you_mean(name, scenario_names()))
    return Scenario(name, importlib.import_module(f"scenarios.{name}"))


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
