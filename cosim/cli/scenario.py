"""Scenarios: Python modules that define a study, and the form in which the command line takes them.

A scenario is a Python module that defines a study as a frozen dataclass. Its fields are
the options of the command line, and the docstring below a field is that option's help.

    @dataclass(frozen=True, kw_only=True)
    class Study:
        b: float = 1.5
        \"\"\"damping, N*s/m\"\"\"

        build() -> System
        run(progress=None) -> Result
        metrics(result) -> {name: (value, unit)}      optional
        figures(result) -> {name: matplotlib figure}  optional

    @dataclass(frozen=True, kw_only=True)
    class Table:                                      optional
        rows() -> [row, ...]                          rows are dicts with the same keys
        text(rows) -> str                             optional

    STEP, STOP                                        optional, s: the default experiment on export

The light form is a module of functions with keyword arguments: build(**options),
run(**options), metrics(result), figures(result), table(**options), table_text(rows).

A scenario with a folder of its own defines `Study` in study.py and `Table` in table.py.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Annotated, Any

from cyclopts import Parameter

from ..core.participant import Participant
from ..errors import CosimError, WiringError, did_you_mean
from ..result import Result


class ScenarioError(CosimError):
    """An error of a scenario: it does not exist, or it lacks a part that a command needs."""


class Options:
    """The options of a study or a table: a dataclass, or a function of the light form.

    `parameters` declares them to the command line; `make` returns the study or the table
    with the options that were given, and those options by name.
    """

    def __init__(self, declared: Callable[..., Any], make: Callable[..., Any]) -> None:
        self.doc = declared.__doc__
        self._make = make
        self._is_class = isinstance(declared, type)
        signature = inspect.signature(declared)
        if self._is_class:
            # cyclopts flattens the dataclass and reads the docstrings of its fields
            complete = all(p.default is not p.empty for p in signature.parameters.values())
            self.parameters = [
                inspect.Parameter(
                    "options",
                    inspect.Parameter.KEYWORD_ONLY,
                    default=declared() if complete else inspect.Parameter.empty,
                    annotation=Annotated[declared, Parameter(name="*")],
                )
            ]
        else:
            hints = typing.get_type_hints(declared, include_extras=True)
            self.parameters = [
                p.replace(annotation=hints.get(n, str), kind=inspect.Parameter.KEYWORD_ONLY)
                for n, p in signature.parameters.items()
                if n != "progress"
            ]

    def make(self, **given: Any) -> tuple[Any, dict[str, Any]]:
        """Return the study or the table, and its options by name."""
        options = {p.name: p.default for p in self.parameters if p.default is not p.empty} | given
        if self._is_class:
            made = options["options"]
            return made, {f.name: getattr(made, f.name) for f in dataclasses.fields(made)}
        return self._make(options), options


def study_of_file(kind: type[Any], path: Path) -> type[Any]:
    """Return the study of a file: a subclass of a study whose class variable `path` is its file."""
    return type("Study", (kind,), {"path": path, "__module__": kind.__module__, "__doc__": kind.__doc__})


class Scenario:
    """A scenario under its name, with clear errors for the parts that it lacks."""

    def __init__(self, name: str, *modules: ModuleType | SimpleNamespace) -> None:
        self.name = name
        self._parts = {n: part for module in modules for n, part in vars(module).items()}

    def _part(self, name: str) -> Any:
        part = self._parts.get(name)
        return part if callable(part) else None

    def _class(self, name: str) -> Any:
        declared = self._part(name)
        if declared is not None and not dataclasses.is_dataclass(declared):
            raise ScenarioError(
                f"scenario {self.name}: class {name} must be a dataclass; put "
                "@dataclass(frozen=True, kw_only=True) above it"
            )
        return declared

    def study(self) -> Options:
        """Return the options of the study."""
        if declared := self._class("Study"):
            return Options(declared, declared)
        run = self._part("run")
        if run is None:
            raise ScenarioError(
                f"scenario {self.name} defines neither a class Study nor a function run(); add one of the two"
            )

        def functions(options: dict[str, Any]) -> SimpleNamespace:
            return SimpleNamespace(**self._parts | {"run": partial(run, **options)})

        return Options(run, functions)

    def table(self) -> Options:
        """Return the options of the table."""
        if declared := self._class("Table"):
            return Options(declared, declared)
        table = self._part("table")
        if table is None:
            raise ScenarioError(
                f"scenario {self.name} has no table; define a class Table with rows(), or a function table()"
            )
        text = {"text": self._parts["table_text"]} if self._part("table_text") else {}
        return Options(table, lambda options: SimpleNamespace(rows=partial(table, **options), **text))

    def default_study(self) -> Any:
        """Return the study with its default options."""
        options = self.study() if self._part("Study") else None
        if options is None:  # of the light form only build() is needed
            study: Any = SimpleNamespace(**self._parts)
        elif any(p.default is p.empty for p in options.parameters):
            raise ScenarioError(f"scenario {self.name}: give every option of Study a default")
        else:
            study, _ = options.make()
        if not callable(getattr(study, "build", None)):
            raise ScenarioError(f"scenario {self.name} has no build(); define it to return the System")
        return study

    def participant(self, name: str) -> Participant:
        """Return the Python object behind a component of the default system."""
        system = self.default_study().build()
        if name not in system.participants:
            raise WiringError(
                f"scenario {self.name} has no participant '{name}'" + did_you_mean(name, system.participants)
            )
        component = system.participants[name]
        source = component if isinstance(component, Participant) else component.source
        if source is None:
            raise ScenarioError(f"{self.name}:{name} is already an FMU ({component.path}); copy that file")
        found: Participant = source
        return found

    def seconds(self, name: str) -> float | None:
        """Return STEP or STOP of the scenario, if it defines one."""
        found = self._parts.get(name)
        return float(found) if isinstance(found, (int, float)) else None

    def run(self, study: Any, **more: Any) -> Result:
        """Run the study; refuse a value that is not a Result."""
        result = study.run(**more)
        if not isinstance(result, Result):
            raise ScenarioError(
                f"scenario {self.name}: run() returned {_kind(result)}; return the Result of simulate()"
            )
        return result

    def metrics(self, study: Any, result: Result) -> dict[str, tuple[float, str]]:
        """Return named numbers with units: the study's own, or peak and RMS of every scalar port."""
        if callable(getattr(study, "metrics", None)):
            found = study.metrics(result)
            self._check_metrics(found)
            return {n: (float(value), unit) for n, (value, unit) in found.items()}
        scalars = {n: s for n, s in result.statistics.items() if isinstance(s.rms, float)}
        return {
            f"{kind} {n}": (float(getattr(s, kind)), result.units.get(n) or "")
            for kind in ("peak", "rms")
            for n, s in scalars.items()
        }

    def _check_metrics(self, found: Any) -> None:
        where = f"scenario {self.name}: metrics()"
        if not isinstance(found, dict):
            raise ScenarioError(f"{where} returned {_kind(found)}; it must return {{name: (value, unit)}}")
        for name, pair in found.items():
            try:
                value, unit = pair
                float(value)
            except (TypeError, ValueError):
                raise ScenarioError(
                    f"{where}: '{name}' is {pair!r}; give (value, unit), such as (0.012, 'm')"
                ) from None
            if not isinstance(unit, str):
                raise ScenarioError(f"{where}: '{name}' has the unit {unit!r}; give a text, '1' for a ratio")


def _kind(value: Any) -> str:
    return "nothing" if value is None else f"an object of type {type(value).__name__}"


def aligned(rows: list[dict[str, Any]]) -> str:
    """Return rows with the same keys as aligned columns."""
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
