"""Type checkers see the packages as a user's files do: outside the checkout, in a process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.readme import ROOT, code_blocks

FRAME = '''
from cosim import Block, Continuous, Input, Output, Parameter, Result, State, System, simulate
from cosim.blocks import Delay, LowPass, MeasurementNoise


class Frame(Continuous):
    """Two stories and a scalar state: der_x is known without a declaration."""

    k = Parameter(2e6, "stiffness", unit="N/m", min=0.0)
    m = Parameter(1e4, "mass", unit="kg", min=1.0)
    f = Input("forces", unit="N", shape=2)
    x = State(0.0, "displacements", unit="m", shape=2)
    v = State(0.0, "velocities", unit="m/s", shape=2)
    s = State(1.0, "a scalar")
    a = Output("accelerations", unit="m/s^2", shape=2)

    def derivatives(self, t: float) -> None:
        for i in range(2):
            self.der_x[i] = self.v[i]
            self.der_v[i] = (self.f[i] - self.k * self.x[i]) / self.m
        self.der_s = -self.s

    def outputs(self, t: float) -> None:
        for i in range(2):
            self.a[i] = self.der_v[i]


class Brake(Block):
    b = Parameter(1e4, "damping", unit="N*s/m")
    v = Input("velocities", unit="m/s", shape=2)
    u = Output("forces", unit="N", shape=2)

    def step(self, t: float, h: float) -> None:
        for i in range(2):
            self.u[i] = -self.b * self.v[i]


late = Delay(3, unit="N", n=2, every=2)
noise = MeasurementNoise(0.1, sample_period=0.01, unit="N")
system = System({"frame": Frame(k=1e6), "brake": Brake(), "filter": LowPass(0.1, n=2)})
system.connect("frame.v", "brake.v")
result: Result = simulate(system, step=0.01, stop=1.0)
peak = float(result.statistics["frame.x"].peak[0])
'''


def mypy(folder: Path, script: str, *options: str) -> str:
    """Return mypy's report of a script."""
    (folder / "script.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file=", f"--cache-dir={folder / 'cache'}", *options]
    done = subprocess.run(
        [*command, "script.py"],
        cwd=folder,
        env={**os.environ, "MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return done.stdout


def test_a_user_file_passes_strictly(tmp_path):
    assert mypy(tmp_path, FRAME, "--strict").startswith("Success")


def test_the_script_of_the_readme_passes(tmp_path):
    (script,) = code_blocks(ROOT / "README.md")
    assert mypy(tmp_path, script, "--check-untyped-defs").startswith("Success")


MISTAKES = {
    "late.steps_ = 3.0": 'has no attribute "steps_"',
    "Delay(3, unit=3)": 'Argument "unit" to "Delay" has incompatible type',
    "LowPass(0.1, evry=2)": 'Unexpected keyword argument "evry" for "LowPass"',
    "text: str = Brake().b": "Incompatible types in assignment",
    "simulate(system, step=0.1)": 'Missing named argument "stop" for "simulate"',
    'System({"a": 3.0})': "Dict entry 0 has incompatible type",
}


def test_every_mistake_is_reported(tmp_path):
    report = mypy(tmp_path, "\n".join([FRAME, *MISTAKES]), "--strict").splitlines()
    first = len(FRAME.splitlines()) + 2
    for line, words in enumerate(MISTAKES.values(), first):
        assert any(r.startswith(f"script.py:{line}:") and words in r for r in report), (words, report)


@pytest.mark.parametrize("package", ["cosim", "controllers", "fmus", "scenarios"])
def test_packages_are_typed(package):
    assert (ROOT / package / "py.typed").is_file()
