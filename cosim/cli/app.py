"""The command line: cosim list, run, table, export, inspect, doctor.

This is the outermost layer: only the command line imports scenarios, controllers and fmus,
and it does so when a command needs them. The options of a scenario are the fields of its
study or the keyword arguments of its functions. A user's error ends with exit code 2 and
one screen of text, an interrupted run with exit code 130.
"""

from __future__ import annotations

import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from ..errors import CosimError, SimulationEndedWarning
from ..result import Interrupted, SimulationError
from ..system.system import System
from .json_text import json_text
from .load import find_participant, load_scenario
from .python_scenario import scenario_names, summary
from .run_directory import RunDirectory
from .scenario import Options, Scenario, ScenarioError, aligned

_SETTINGS: dict[str, Any] = {
    "result_action": "return_value",
    "suppress_keyboard_interrupt": False,
    "default_parameter": Parameter(negative_iterable=()),  # no --empty-... in the help
}
_app = App(name="cosim", help="Co-simulation of vibration-controlled structures.", **_SETTINGS)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its exit code."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _dispatch(tokens)
        sys.stdout.flush()
    except (CosimError, CycloptsError) as error:
        print(f"error: {error}", *_notes(error), sep="\n", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as interrupt:
        print("interrupted", *_notes(interrupt), sep="\n", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:  # the reader, such as head, has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


def _notes(error: BaseException) -> list[str]:
    return getattr(error, "__notes__", [])


def _dispatch(tokens: list[str]) -> None:
    """Call a command; `run` and `table` take their options from the scenario that they name."""
    if len(tokens) > 1 and tokens[0] in ("run", "table") and not tokens[1].startswith("-"):
        scenario = load_scenario(tokens[1])
        app = App(name=f"cosim {tokens[0]} {scenario.name}", **_SETTINGS)
        app.default(_run_command(scenario) if tokens[0] == "run" else _table_command(scenario))
        app(tokens[2:], exit_on_error=False, print_error=False)
    else:
        _app(tokens, exit_on_error=False, print_error=False)


def _command(options: Options, body: Callable[..., None], **own: Any) -> Callable[..., None]:
    """Return `body` as a command with the options of a study or table, and those in `own`."""
    keyword = inspect.Parameter.KEYWORD_ONLY
    added = [inspect.Parameter(n, keyword, default=d, annotation=a) for n, (a, d) in own.items()]

    def command(**given: Any) -> None:
        body(*options.make(**{n: v for n, v in given.items() if n not in own}),
             **{n: given.get(n, default) for n, (_, default) in own.items()})  # fmt: skip

    command.__doc__ = options.doc
    command.__signature__ = inspect.Signature([*options.parameters, *added])  # type: ignore[attr-defined]
    return command


# ---------------------------------------------------------------------------- commands


@_app.command(name="list")
def list_scenarios() -> None:
    """List the scenarios."""
    names = scenario_names()
    width = max(map(len, names), default=0)
    for name in names:
        print(f"{name:<{width}}  {summary(name)}")


@_app.command
def run(scenario: str) -> None:
    """Run a scenario, your own Python file, an FMU or an SSP; `cosim run NAME --help` lists its options."""


@_app.command
def table(scenario: str) -> None:
    """Print the table of a scenario; `cosim table NAME --help` lists its options."""


def _run_command(scenario: Scenario) -> Callable[..., None]:
    out_type = Annotated[Path | None, Parameter(help="folder for metrics, result and figures [out/NAME]")]
    figures_type = Annotated[bool, Parameter(help="draw the figures")]

    def body(study: Any, options: dict[str, Any], out: Path | None, figures: bool) -> None:
        folder = RunDirectory(out or Path("out") / scenario.name)
        try:
            with warnings.catch_warnings(), _progress(study.run) as more:
                warnings.simplefilter("ignore", SimulationEndedWarning)  # a line of the output says it
                result = scenario.run(study, **more)
        except (SimulationError, Interrupted) as error:
            if error.result is not None:
                *_, kept = folder.save(scenario, study, options, error.result)
                error.add_note(f"kept: {kept}")
            raise
        for line in folder.save(scenario, study, options, result, figures=figures):
            print(line)

    return _command(scenario.study(), body, out=(out_type, None), figures=(figures_type, True))


def _table_command(scenario: Scenario) -> Callable[..., None]:
    json_type = Annotated[bool, Parameter(help="print the rows as JSON")]

    def body(table: Any, _: dict[str, Any], json: bool) -> None:
        with _progress(table.rows) as more:
            rows = table.rows(**more)
        print(json_text(rows) if json else getattr(table, "text", aligned)(rows))

    return _command(scenario.table(), body, json=(json_type, False))


@contextmanager
def _progress(function: Callable[..., Any]) -> Iterator[dict[str, Any]]:
    """Show a progress bar for a function that reports its progress; yield the argument that it takes."""
    if "progress" not in inspect.signature(function).parameters:
        yield {}
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.completed}/{task.total}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    shown = Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
    )
    with shown as bar:
        task = bar.add_task("", total=None)
        yield {"progress": lambda k, n: bar.update(task, completed=k, total=n)}


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
        scenario:participant, such as chattering:plant or my_scenario.py:controller; the name of a
        scenario alone exports its whole system
    out
        file to write [PARTICIPANT.fmu, SCENARIO.ssp]; a system written to .fmu is a container of FMUs
    platform
        x86_64-linux, aarch64-linux, x86_64-windows, x86_64-darwin, aarch64-darwin; may be repeated
        [this machine]
    fmi_version
        version of the FMUs: 2.0, or 3.0, which has array variables [2.0]
    ssp_version
        1.0, or 2.0 for arrays and types of FMI 3.0 [1.0 where it can express the system]
    step, stop
        default experiment of a system, s [STEP and STOP of the scenario]
    """
    from fmus.export.fmu import export as export_fmu

    platforms = list(platform) or None
    if ":" in what:
        path = out or Path(f"{what.rpartition(':')[2]}.fmu")
        export_fmu(find_participant(what), path, platforms=platforms, fmi_version=fmi_version or "2.0")
    else:
        scenario = load_scenario(what)
        path = out or Path(f"{scenario.name}.ssp")
        system = scenario.default_study().build()
        step, stop = step or scenario.seconds("STEP"), stop or scenario.seconds("STOP")
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
            _export_container(system, path, platforms, fmi_version or "2.0", step, stop)
        else:
            raise ScenarioError(
                f"a system is exported as an .ssp or as one .fmu, not as {path}; change --out"
            )
    print(f"{path} ({path.stat().st_size / 1024:.0f} KB)")


def _export_container(
    system: System,
    path: Path,
    platforms: list[str] | None,
    fmi_version: str,
    step: float | None,
    stop: float | None,
) -> None:
    from fmus.packaging.container import export_container

    if step is None:
        raise ScenarioError("a container needs its communication step; give it in seconds, --step 0.01")
    if platforms:
        raise ScenarioError("a container is made for this machine only; leave out --platform")
    export_container(system, path, step=step, stop=stop, fmi_version=fmi_version)


@_app.command(name="inspect")
def inspect_fmu(fmu: Path) -> None:
    """Show capabilities, default experiment and variables of an FMU."""
    from .inspection import inspection

    print(inspection(fmu))


@_app.command
def doctor(
    fmu: Path, *, json: bool = False, probe: tuple[str, ...] = (), time_limit: float | None = None
) -> None:
    """Examine how an FMU behaves: validity, reset, state, leaks, feedthrough, step size, misuse.

    The exit code reflects the worst finding: 0 ok or notes, 1 warnings, 2 errors (or invalid options,
    without a report), 3 a crash or a hang.

    Parameters
    ----------
    fmu
        the .fmu file
    json
        print the report as JSON
    probe
        probe to run, such as reset; may be repeated [all]
    time_limit
        longest duration of a probe, s [60]
    """
    from ..doctor import examine
    from ..doctor.examination import TIME_LIMIT

    report = examine(fmu, only=probe or None, time_limit=time_limit or TIME_LIMIT)
    print(report.json() if json else report.text())
    sys.exit(report.exit_code)


if __name__ == "__main__":
    main()
