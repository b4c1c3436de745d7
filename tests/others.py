"""Other projects: tools for comparison, and plants exported by pythonfmu.

The libraries of pythonfmu (FMI 2.0) and pythonfmu3 (FMI 3.0) use the Python interpreter of the
process, so they work where CPython is the master.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from cosim import CosimError

_SWING = '''\
from {package} import Fmi{n}Causality as Causality, Fmi{n}Slave, Fmi{n}Variability as Variability, {Real}


class Swing{n}(Fmi{n}Slave):
    """m x'' = u - 8 x by the symplectic Euler method"""

    author = "somebody else"

    def __init__(self, **options):
        super().__init__(**options)
        self.time, self.m, self.u, self.x, self.v = 0.0, 2.0, 0.0, 1.0, 0.0
        {time}
        self.register_variable({Real}("m", causality=Causality.parameter, variability=Variability.fixed))
        self.register_variable({Real}("u", causality=Causality.input))
        self.register_variable({Real}("x", causality=Causality.output))
        self.register_variable({Real}("v", causality=Causality.output))

    def do_step(self, t, h):
        self.v += h * (self.u - 8.0 * self.x) / self.m
        self.x += h * self.v
        return True
'''


def tool(load: Callable[[], ModuleType]) -> ModuleType:
    """Import a tool of fmus.packaging.other_tools, or skip the test with the reason in one line."""
    try:
        return load()
    except CosimError as error:
        pytest.skip(str(error), allow_module_level=True)


def swing(folder: Path, version: str) -> Path:
    """Export the FMU with the tool of its version; return its path."""
    n = version[0]
    package, Real = {"2": ("pythonfmu", "Real"), "3": ("pythonfmu3", "Float64")}[n]
    time = 'self.register_variable(Float64("time", causality=Causality.independent))' if n == "3" else ""
    source = folder / f"swing{n}.py"
    source.write_text(_SWING.format(package=package, n=n, Real=Real, time=time))
    subprocess.run(
        [sys.executable, "-m", package, "build", "-f", source.name, "-d", "."], cwd=folder, check=True,
        capture_output=True,
    )  # fmt: skip
    return folder / f"Swing{n}.fmu"
