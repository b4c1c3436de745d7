"""What a run leaves on disk: metrics.json, result.npz, figures as PNG and SVG."""

from __future__ import annotations

import inspect
import json
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..result import Result
from .scenario import Scenario

_TOOLS = ("structcosim", "fmpy", "numpy", "scipy", "numba", "llvmlite", "matplotlib")


def write_run(
    directory: Path, scenario: Scenario, options: dict[str, Any], result: Result, figures: bool = False
) -> list[str]:
    """Write a run to its folder; return lines that say what was found and where it is."""
    directory.mkdir(parents=True, exist_ok=True)
    metrics = scenario.metrics(result)
    options = defaults(scenario) | options
    record = {
        "scenario": scenario.name,
        "command": " ".join(["cosim", *sys.argv[1:]]),
        "options": {
            n: v if isinstance(v, (int, float, str, bool, type(None))) else str(v) for n, v in options.items()
        },
        "seed": options.get("seed"),
        "metrics": {n: {"value": float(v), "unit": unit} for n, (v, unit) in metrics.items()},
        "steps": result.steps,
        "step": {"value": result.step, "unit": "s"},
        "loop": {"value": result.seconds, "unit": "s"},
        "interrupted": result.interrupted,
        "ended": result.ended,
        "schedule": result.schedule.splitlines(),
        "versions": {name: version(name) for name in _TOOLS} | {"python": platform.python_version()},
    }
    (directory / "metrics.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    result.save(directory / "result.npz")
    names = _draw(directory / "figures", scenario, result) if figures else []
    width = max(map(len, metrics), default=0)
    lines = [f"{name:<{width}}  {value:12.6g}  {unit}".rstrip() for name, (value, unit) in metrics.items()]
    drawn = f", {len(names)} figures" if names else ""
    return [
        *lines,
        *([result.ended] if result.ended else []),
        f"{result.steps} steps in {result.seconds:.3g} s; {directory}: metrics.json, result.npz{drawn}",
    ]


def defaults(scenario: Scenario) -> dict[str, Any]:
    """Return the options of a scenario's run function and their defaults."""
    parameters = inspect.signature(scenario.run).parameters
    return {n: p.default for n, p in parameters.items() if p.default is not p.empty and n != "progress"}


def _draw(directory: Path, scenario: Scenario, result: Result) -> list[str]:
    import matplotlib

    matplotlib.use("Agg")
    drawn = scenario.figures(result)
    if drawn:
        directory.mkdir(exist_ok=True)
    for name, figure in drawn.items():
        for ending in ("png", "svg"):
            figure.savefig(directory / f"{name}.{ending}", dpi=130)
    return list(drawn)
