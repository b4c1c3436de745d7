"""The C compiler: `python -m ziglang cc`, which links for every platform from any machine.

It compiles for the lowest CPU level of each platform and an old C library, so that the
libraries that it links run on any such machine. FMPy includes the FMI headers.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import os
import platform as host_platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import CompilationError
from .cache import cache_directory, cached


@dataclass(frozen=True)
class Platform:
    """A platform: its name here and in FMI 3.0, the linker's target, the folder of FMI 2.0, the suffix."""

    name: str
    target: str
    fmi2_folder: str
    suffix: str


#: FMI 2.0 has one folder per system: see `folders` in fmus/export for two architectures at once.
PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "x86_64-linux-gnu.2.17", "linux64", ".so"),
        Platform("aarch64-linux", "aarch64-linux-gnu.2.17", "linux64", ".so"),
        Platform("x86_64-windows", "x86_64-windows-gnu", "win64", ".dll"),
        Platform("x86_64-darwin", "x86_64-macos.11.0", "darwin64", ".dylib"),
        Platform("aarch64-darwin", "aarch64-macos.11.0", "darwin64", ".dylib"),
    )
}

#: for a shared library that shares no code or data with others
LIBRARY_FLAGS = (
    *("-std=c23", "-O2", "-Wall", "-Wextra", "-g0", "-s"),
    *("-shared", "-fPIC", "-fvisibility=hidden", "-fomit-frame-pointer", "-fno-sanitize=all"),
)


def host() -> str:
    """Return the name of this machine's platform."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(m := host_platform.machine().lower(), m)
    return f"{machine}-{host_platform.system().lower()}"


def cached_library(parts: Iterable[str], suffix: str, build: Callable[[], bytes]) -> Path:
    """Return the file of a shared library that depends on `parts` and the compiler; build a new one."""
    if importlib.util.find_spec("ziglang") is None:
        raise CompilationError("no C compiler: the package ziglang is not installed; pip install ziglang")
    key = hashlib.sha256("\0".join([*parts, importlib.metadata.version("ziglang")]).encode()).hexdigest()
    return cached(f"libraries/{key}{suffix}", build)


def zig_cc(arguments: Sequence[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the compiler in a folder."""
    zig = str(cache_directory() / "zig")
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": zig, "ZIG_LOCAL_CACHE_DIR": zig}
    return subprocess.run(
        [sys.executable, "-m", "ziglang", "cc", *map(str, arguments)],
        capture_output=True, text=True, env=environment, cwd=folder, check=False,
    )  # fmt: skip


def complaint(stderr: str) -> str:
    """Return the errors of the compiler as one line."""
    lines = [line.strip() for line in stderr.splitlines() if "error" in line or "undefined symbol" in line]
    return "; ".join(lines[:4]) or stderr.strip()[-400:] or "the compiler gave no reason"


def fmi_headers() -> Path:
    """Return the folder of the FMI headers, which FMPy includes."""
    spec = importlib.util.find_spec("fmpy")
    folder = Path(spec.origin).parent / "c-code" if spec and spec.origin else Path("c-code")
    if not (folder / "fmi2Functions.h").exists():
        raise CompilationError(
            "the FMI headers are missing: they come with the package fmpy; pip install fmpy"
        )
    return folder
