"""The folder of a run: metrics.json, result.npz, figures as PNG and SVG.

Every file is written under a temporary name and then renamed, so that a reader, or a run
that is killed, never leaves half a file under its final name.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..result import Result
from .json_text import json_text
from .scenario import Scenario, ScenarioError

_TOOLS = ("structcosim", "fmpy", "numpy", "scipy", "numba", "llvmlite", "matplotlib")


class RunDirectory:
    """The folder that a run writes to; it is made, and tried, before the run."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unwritable(error) from error
        self._write("metrics.json", lambda _: None, keep=False)

    def _unwritable(self, error: OSError) -> ScenarioError:
        return ScenarioError(
            f"--out {self.path}: {error.strerror or error}; name a folder that can be written to"
        )

    def _write(self, name: str, write: Callable[[Path], Any], *, keep: bool = True) -> None:
        """Write a file under a temporary name and rename it."""
        path = self.path / name
        temporary = path.with_name(f".{os.getpid()}-{path.name}")
        try:
            temporary.touch()
            write(temporary)
            if keep:
                temporary.replace(path)
        except OSError as error:
            raise self._unwritable(error) from error
        finally:
            temporary.unlink(missing_ok=True)

    def save(
        self,
        scenario: Scenario,
        study: Any,
        options: dict[str, Any],
        result: Result,
        *,
        figures: bool = False,
    ) -> list[str]:
        """Write a run; return its metrics as lines of text, and a last line with the files."""
        self._write("result.npz", result.save)  # first: the study's metrics and figures may fail
        metrics = scenario.metrics(study, result)
        record = {
            "scenario": scenario.name,
            "command": " ".join(["cosim", *sys.argv[1:]]),
            "options": {
                n: v if isinstance(v, (int, float, str, bool, type(None))) else str(v)
                for n, v in options.items()
            },
            "seed": options.get("seed"),
            "metrics": {n: {"value": v, "unit": unit} for n, (v, unit) in metrics.items()},
            "steps": result.steps,
            "step": {"value": result.step, "unit": "s"},
            "loop": {"value": result.seconds, "unit": "s"},
            "interrupted": result.interrupted,
            "ended": result.ended,
            "schedule": result.schedule.splitlines(),
            "versions": {name: version(name) for name in _TOOLS} | {"python": platform.python_version()},
        }
        text = json_text(record) + "\n"
        self._write("metrics.json", lambda path: path.write_text(text, encoding="utf-8"))
        names = self._draw(study, result) if figures else []
        width = max(map(len, metrics), default=0)
        lines = [f"{n:<{width}}  {v:12.6g}  {unit}".rstrip() for n, (v, unit) in metrics.items()]
        drawn = f", {len(names)} figures" if names else ""
        return [
            *lines,
            *([result.ended] if result.ended else []),
            f"{result.steps} steps in {result.seconds:.3g} s; {self.path}: metrics.json, result.npz{drawn}",
        ]

    def _draw(self, study: Any, result: Result) -> list[str]:
        if not callable(getattr(study, "figures", None)):
            return []
        import matplotlib  # takes longer than many a run

        matplotlib.use("Agg")
        drawn = study.figures(result)
        if drawn:
            (self.path / "figures").mkdir(exist_ok=True)
        for name, figure in drawn.items():
            for ending in ("png", "svg"):
                self._write(f"figures/{name}.{ending}", partial(figure.savefig, dpi=130))
        return list(drawn)
