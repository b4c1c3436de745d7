"""The command line: cosim list, run, table, export, inspect, doctor.

The outermost layer: it alone may import scenarios, controllers and fmus, and does so
when a command needs them. Options of a scenario are the keyword arguments of its
functions; nothing is declared twice. An error of the user's ends with exit code 2 and
a text of one screen, an interrupted run with 130.
"""

from __future__ import annotations

import inspect
import json
import math
import sys
import typing
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from ..errors import CosimError, SimulationEndedWarning
from ..result import Result
from ..system.system import System
from .scenario import Scenario, ScenarioError, load_scenario, scenario_names

_app = App(
    name="cosim", help="Co-simulation of vibration-controlled structures.", result_action="return_value"
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its exit code."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _dispatch(tokens)
    except (CosimError, CycloptsError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


def _dispatch(tokens: list[str]) -> None:
    """Call a command; `run` and `table` take their options from the scenario that they name."""
    if len(tokens) > 1 and tokens[0] in ("run", "table") and not tokens[1].startswith("-"):
        scenario = load_scenario(tokens[1])
        app = App(name=f"cosim {tokens[0]} {scenario.name}", result_action="return_value")
        app.default(_run_command(scenario) if tokens[0] == "run" else _table_command(scenario))
        app(tokens[2:], exit_on_error=False, print_error=False)
    else:
        _app(tokens, exit_on_error=False, print_error=False)


def _with_options(
    function: Callable[..., Any], body: Callable[..., None], **more: Any
) -> Callable[..., None]:
    """Return `body` with the signature of `function` (less `progress`) and the options `more`."""

    def command(**options: Any) -> None:
        body(**{n: default for n, (_, default) in more.items()} | options)

    hints = typing.get_type_hints(function, include_extras=True)
    own = [
        p.replace(annotation=hints.get(n, str), kind=inspect.Parameter.KEYWORD_ONLY)
        for n, p in inspect.signature(function).parameters.items()
        if n != "progress"
    ]
    added = [
        inspect.Parameter(n, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for n, (annotation, default) in more.items()
    ]
    command.__doc__ = function.__doc__
    command.__signature__ = inspect.Signature([*own, *added])  # type: ignore[attr-defined]
    return command


# ---------------------------------------------------------------------------- commands


@_app.command(name="list")
def list_scenarios() -> None:
    """List the scenarios."""
    from .scenario import summary

    names = scenario_names()
    width = max(map(len, names), default=0)
    for name in names:
        print(f"{name:<{width}}  {summary(name)}")


@_app.command
def run(scenario: str) -> None:
    """Run a scenario, a file of yours like one, or an FMU; `cosim run NAME --help` lists its options."""


@_app.command
def table(scenario: str) -> None:
    """Print the table of a scenario, printed beside computed; `cosim table NAME --help` for options."""


def _run_command(scenario: Scenario) -> Callable[..., None]:
    out_type = Annotated[Path | None, Parameter(help="folder for metrics, result and figures [out/NAME]")]
    figures_type = Annotated[bool, Parameter(help="draw the figures")]

    def body(out: Path | None, figures: bool, **options: Any) -> None:
        from .run_directory import write_run

        directory = out or Path("out") / scenario.name
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SimulationEndedWarning)  # it is among the lines
            result = _with_progress(
                scenario.run, options, lambda part: write_run(directory, scenario, options, part)
            )
        for line in write_run(directory, scenario, options, result, figures=figures):
            print(line)

    return _with_options(scenario.run, body, out=(out_type, None), figures=(figures_type, True))


def _table_command(scenario: Scenario) -> Callable[..., None]:
    json_type = Annotated[bool, Parameter(help="print the rows as JSON")]

    def body(json: bool, **options: Any) -> None:
        rows = _with_progress(scenario.function("table"), options, lambda part: None)
        print(_as_json(rows) if json else scenario.table_text(rows))

    return _with_options(scenario.function("table"), body, json=(json_type, False))


def _as_json(rows: list[dict[str, Any]]) -> str:
    """Return rows as JSON; JSON has no NaN and no infinity, so what is not finite is null."""

    def plain(value: Any) -> Any:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps([{n: plain(v) for n, v in row.items()} for row in rows], indent=1, default=float)


def _with_progress(
    function: Callable[..., Any], options: dict[str, Any], keep: Callable[[Result], Any]
) -> Any:
    """Call a function of a scenario, with a progress bar if it takes one; keep an unfinished result."""
    from ..result import Interrupted, SimulationError

    try:
        if "progress" not in inspect.signature(function).parameters:
            return function(**options)
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        columns = [TextColumn("{task.completed}/{task.total}"), BarColumn(), TimeElapsedColumn()]
        console = Console(stderr=True)
        shown = Progress(
            *columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
        )
        with shown as bar:
            task = bar.add_task("", total=None)
            return function(**options, progress=lambda k, n: bar.update(task, completed=k, total=n))
    except (SimulationError, Interrupted) as error:
        if error.result is not None:
            keep(error.result)
        raise


@_app.command
def export(
    what: str,
    *,
    out: Path | None = None,
    platform: tuple[str, ...] = (),
    fmi_version: str | None = None,
    ssp_version: str | None = None,
    step: float | None = None,
    stop: float | None = None,
) -> None:
    """Export a participant of a scenario as a native FMU, or the whole system as an SSP or one FMU.

    Parameters
    ----------
    what
        scenario:participant, such as chattering:plant or my_scenario.py:controller; a scenario
        alone is the system
    out
        the file to write [PARTICIPANT.fmu, SCENARIO.ssp]; a system as .fmu is a container of FMUs
    platform
        x86_64-linux, aarch64-linux, x86_64-windows, x86_64-darwin, aarch64-darwin; may be repeated
        [this machine]
    fmi_version
        of FMUs that are made: 2.0, or 3.0, in which arrays are arrays [2.0]
    ssp_version
        1.0, or 2.0 for arrays and types of FMI 3.0 [1.0 where it can say what the system is]
    step, stop
        what a system is to be run with, s [what the scenario says]
    """
    from fmus.export.fmu import export as export_fmu

    from .scenario import find_participant

    platforms = list(platform) or None
    if ":" in what:
        member = find_participant(what)
        path = out or Path(f"{what.rpartition(':')[2]}.fmu")
        export_fmu(member, path, platforms=platforms, fmi_version=fmi_version or "2.0")
    else:
        scenario = load_scenario(what)
        path = out or Path(f"{scenario.name}.ssp")
        experiment = {"step": step or scenario.seconds("STEP"), "stop": stop or scenario.seconds("STOP")}
        _export_system(scenario.function("build")(), path, platforms, fmi_version, ssp_version, **experiment)
    print(f"{path} ({path.stat().st_size / 1024:.0f} KB)")


def _export_system(
    system: System,
    path: Path,
    platforms: list[str] | None,
    fmi_version: str | None,
    ssp_version: str | None,
    step: float | None,
    stop: float | None,
) -> None:
    if path.suffix == ".ssp":
        from fmus.packaging.ssp import export_ssp

        export_ssp(
            system,
            path,
            step=step,
            stop=stop,
            version=ssp_version,
            fmi_version=fmi_version,
            platforms=platforms,
        )
    elif path.suffix == ".fmu":
        from fmus.packaging.container import export_container

        if step is None:
            raise ScenarioError("a container steps what is in it; give its step in seconds, --step 0.01")
        if platforms:
            raise ScenarioError("a container is for the machine that makes it, not for --platform")
        export_container(system, path, step=step, stop=stop, fmi_version=fmi_version or "2.0")
    else:
        raise ScenarioError(f"a system leaves as an .ssp, or as an .fmu that holds it all, not as {path}")


@_app.command(name="inspect")
def inspect_fmu(fmu: Path) -> None:
    """Show what an FMU is: capabilities, default experiment, variables with units and start values."""
    from .inspection import inspection

    print(inspection(fmu))


@_app.command
def doctor(
    fmu: Path, *, json: bool = False, probe: tuple[str, ...] = (), time_limit: float | None = None
) -> None:
    """Examine what an FMU really does: validity, reset, state, leaks, feedthrough, step size, misuse.

    The exit code is that of the worst finding: 0 ok or notes, 1 warnings, 2 errors (as of wrong
    options, which print no report), 3 a crash or a hang.

    Parameters
    ----------
    fmu
        the .fmu file
    json
        print the report as JSON
    probe
        a probe to run, such as reset; may be repeated [all]
    time_limit
        seconds that a probe may take [60]
    """
    from ..doctor import examine
    from ..doctor.examination import TIME_LIMIT

    report = examine(fmu, only=probe or None, time_limit=time_limit or TIME_LIMIT)
    print(report.json() if json else report.text())
    sys.exit(report.exit_code)


if __name__ == "__main__":
    main()
