"""The examination of an FMU by all probes, each in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from ..errors import CosimError, FMUError, did_you_mean
from ..fmi.fmu import FMU
from . import misuse, probes
from .report import Finding, Report

_INTERFACES = ("Co-Simulation", "Model Exchange")
TIME_LIMIT = 60.0  # s of one probe; 1,000 instances of an ordinary FMU take two
_START_LIMIT = 60.0  # s until Python and the package are loaded, on a busy machine as well
_FILE = ("",)


@dataclass(frozen=True)
class Planned:
    """A probe, and the interfaces to which it applies."""

    name: str
    function: probes.Probe
    interfaces: tuple[str, ...] = _INTERFACES


PROBES = (
    Planned("description", probes.validity, _FILE),
    Planned("units", probes.units, _FILE),
    Planned("instance", probes.instance),
    Planned("initial values", probes.initial_values),
    Planned("reset", probes.reset),
    Planned("state", probes.state),
    Planned("leak", probes.leak),
    Planned("several instances", probes.several),
    Planned("feedthrough", probes.feedthrough),
    Planned("step size", probes.step_size, _INTERFACES[:1]),
    Planned("step before initialization", misuse.step_before_initialization, _INTERFACES[:1]),
    Planned("negative step", misuse.negative_step, _INTERFACES[:1]),
    Planned("unknown value reference", misuse.unknown_reference),
)


def examine(
    path: str | PathLike[str], *, only: Iterable[str] | None = None, time_limit: float = TIME_LIMIT
) -> Report:
    """Examine an FMU and return the report; the faults of the FMU are findings, not exceptions.

    only
        the names of the probes to run; all by default
    time_limit
        the time that a probe may take, in s, without the start of its process

    Raises CosimError for an unknown name of a probe.
    """
    path = Path(path)
    wanted = [p.name for p in PROBES] if only is None else list(only)
    for name in wanted:
        if name not in [p.name for p in PROBES]:
            raise CosimError(f"probe '{name}' does not exist" + did_you_mean(name, [p.name for p in PROBES]))
    try:
        fmu = FMU(path)
    except FMUError as error:
        return Report(path.name, "not usable here", (Finding("file", "", "error", str(error)),))
    has = {"": True, "Co-Simulation": fmu.has_cs, "Model Exchange": fmu.has_me}
    jobs = [(p.name, i) for i in has for p in PROBES if has[i] and i in p.interfaces and p.name in wanted]
    with (
        tempfile.TemporaryDirectory(prefix="structcosim-doctor-", ignore_cleanup_errors=True) as folder,
        ThreadPoolExecutor(max_workers=max(os.cpu_count() or 1, 1)) as pool,
    ):
        found = [
            pool.submit(_probed, path, *job, Path(folder) / str(i), time_limit) for i, job in enumerate(jobs)
        ]
        findings = [_platforms(fmu), *(f.result() for f in found)]
    tool = fmu.description.generationTool
    kinds = " and ".join(i for i in _INTERFACES if has[i])
    about = f"FMI {fmu.description.fmiVersion}, {kinds}" + (f", made by {tool}" if tool else "")
    return Report(path.name, about, tuple(findings))


def _platforms(fmu: FMU) -> Finding:
    platforms = sorted(folder.name for folder in (fmu.directory / "binaries").iterdir() if folder.is_dir())
    text = f"binaries for {', '.join(platforms)}"
    return Finding("platforms", "", "note" if len(platforms) == 1 else "ok", text)


def _probed(path: Path, probe: str, interface: str, folder: Path, time_limit: float) -> Finding:
    """Run a probe in a process; a crash or a hang is a finding."""
    folder.mkdir()
    answer, words = folder / "answer", folder / "words"
    package = str(Path(__file__).parents[2])
    # a process that dies leaves its unpacked FMU in the folder, which is removed
    environment = os.environ | {
        "TMPDIR": str(folder),
        "PYTHONPATH": os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")])),
    }
    # without -P, Python would import a json.py of the current folder in place of its own
    command = [sys.executable, "-P", "-m", "cosim.doctor.child", str(path), probe, interface, str(answer)]
    with words.open("wb") as out:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, env=environment, start_new_session=True
        )
        try:
            code = _exit_code(process, answer, time_limit)
        finally:
            _end(process)
    lines = [json.loads(line) for line in _complete_lines(answer)]
    if lines and "level" in lines[-1] and code == 0:
        return Finding(probe, interface, lines[-1]["level"], lines[-1]["text"])
    doing = lines[-1].get("doing", "end") if lines else "start"
    if code is None:
        how = f"hangs: it did not end within {time_limit:g} s"
    elif code < 0:
        how = f"died of {signal.Signals(-code).name}"
    else:
        last = words.read_text(errors="replace").strip().splitlines()[-1:]
        how = f"ended its process with exit code {code}" + "".join(f" ({line[:200]})" for line in last)
    return Finding(probe, interface, "crashed", f"{how}; it was to: {doing}")


def _exit_code(process: subprocess.Popen[bytes], answer: Path, time_limit: float) -> int | None:
    """Return the exit code, or None if the probe does not end in time after its first line."""
    deadline, has_begun = time.monotonic() + _START_LIMIT, False
    while time.monotonic() < deadline:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(0.02)
        if not has_begun and _complete_lines(answer):
            deadline, has_begun = time.monotonic() + time_limit, True
    return None


def _complete_lines(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return [line for line in text.splitlines(keepends=True) if line.endswith("\n")]


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the process and its children if it is still running."""
    if process.poll() is None:
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)  # a process group of its own: start_new_session
        else:
            process.kill()
        process.wait()
