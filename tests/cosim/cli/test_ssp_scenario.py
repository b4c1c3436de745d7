"""`cosim export SCENARIO --out loop.ssp` and `cosim run loop.ssp --replace NAME=FILE.py:CLASS`."""

import json

import numpy as np
import pytest

from cosim import Result
from tests.cosim.cli.command import call

SCENARIO = '''
"""A mass that is braked at every second point."""
from cosim import Block, Continuous, Input, Output, Parameter, State, System, simulate

STEP, STOP = 0.01, 1.0

class Mass(Continuous):
    """v' = F / 3"""
    F = Input("force", unit="N")
    v = State(2.0, "velocity", unit="m/s")
    def derivatives(self, t):
        self.der_v = self.F / 3.0

class Brake(Block):
    """F = -b v"""
    b = Parameter(1.5, "damping", unit="N*s/m", min=0.0)
    v = Input(unit="m/s")
    F = Output(unit="N")
    def step(self, t, h):
        self.F = -self.b * self.v

class Harder(Brake):
    """the same, by another law"""
    def step(self, t, h):
        self.F = -2.0 * self.b * self.v * abs(self.v)

class Other(Block):
    """no ports of a brake"""
    x = Input()
    y = Output()
    def step(self, t, h):
        self.y = self.x

class Sized(Block):
    """needs a size"""
    v = Input(shape="n")
    F = Output(shape="n")
    def step(self, t, h):
        self.F[0] = self.v[0]

def build(law=Brake):
    parts = {"mass": Mass(), "brake": law(sample_period=0.02)}
    return System(parts, [("mass.v", "brake.v"), ("brake.F", "mass.F")])

def run(*, harder: bool = False):
    return simulate(build(Harder if harder else Brake), step=STEP, stop=STOP)
'''


@pytest.fixture
def folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "braking.py").write_text(SCENARIO)
    (tmp_path / "broken.py").write_text("a = 1\nb = a / 0\n")
    assert call("export", "braking.py", "--out", "loop.ssp") == 0
    assert capsys.readouterr().out.startswith("loop.ssp (")
    return tmp_path


def velocity(folder):
    return Result.load(folder / "out" / "loop" / "result.npz")["mass.v"]


def reference(folder, *options):
    assert call("run", "braking.py", "--out", "ref", *options) == 0
    return Result.load(folder / "ref" / "result.npz")["mass.v"]


def test_a_file_runs_as_its_scenario_does(folder):
    """Step and end are in the file; every option overrides it."""
    assert call("run", "loop.ssp") == 0
    assert np.array_equal(velocity(folder), reference(folder))
    record = json.loads((folder / "out" / "loop" / "metrics.json").read_text())
    assert (record["scenario"], record["step"]["value"], record["steps"]) == ("loop", 0.01, 100)
    assert call("run", "loop.ssp", "--step", 0.005, "--stop", 0.1, "--record", "mass.v") == 0
    found = Result.load(folder / "out" / "loop" / "result.npz")
    assert (len(found.time), list(found.signals)) == (21, ["mass.v"])


@pytest.mark.parametrize("part", ["braking.py:Harder", "braking:Harder"])
def test_a_controller_from_the_command_line(folder, part, monkeypatch):
    """A class acts with the period of the component that it replaces."""
    monkeypatch.syspath_prepend(str(folder))
    assert call("run", "loop.ssp", "--replace", f"brake={part}") == 0
    assert np.array_equal(velocity(folder), reference(folder, "--harder"))


def test_a_controller_of_a_scenario(folder):
    assert call("run", "loop.ssp", "--replace", "brake=braking.py:brake") == 0
    assert np.array_equal(velocity(folder), reference(folder))


ERRORS = [
    (["--replace", "barke=braking.py:Brake"], "has no component 'barke'; did you mean 'brake'?"),
    (["--replace", "brake=braking.py:Break"], "braking.py has no participant 'Break'; did you mean 'brake'?"),
    (["--replace", "brake=absent.py:Brake"], "there is no file absent.py"),
    (["--replace", "brake=absent:Brake"], "there is no module 'absent'"),
    (["--replace", "brake=broken.py:Brake"], "broken.py, line 2: ZeroDivisionError"),
    (["--replace", "brake"], "write NAME=FILE.py:CLASS"),
    (["--replace", "brake=braking.py"], "write FILE.py:CLASS"),
    (["--replace", "brake=braking.py:Other"], "(brake is replaced by a Other, ports: x, y): brake has"),
    (["--replace", "brake=braking.py:Sized"], "brake is replaced by a Sized: Sized: size n is not known"),
    (["--step", "0.025"], "sample period of 0.02 s is"),
    (["--record", "mass.w"], "mass has no output 'w'"),
]


@pytest.mark.parametrize(("options", "message"), ERRORS, ids=range(len(ERRORS)))
def test_errors_end_with_code_2_and_one_text(folder, capsys, options, message):
    assert call("run", "loop.ssp", *options) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error


def test_a_file_without_a_default_experiment(folder, capsys):
    text = SCENARIO.replace("STEP, STOP = 0.01, 1.0", "")
    (folder / "bare.py").write_text(text.replace("step=STEP, stop=STOP", "step=1.0, stop=1.0"))
    assert call("export", "bare.py") == 0
    assert call("run", "bare.ssp", "--step", 0.01) == 2
    assert "bare.ssp states no stop; give it in seconds, --stop" in capsys.readouterr().err
    assert call("export", "bare.py", "--step", 0.01, "--stop", 0.5) == 0
    assert call("run", "bare.ssp") == 0


def test_a_system_as_one_fmu(folder, capsys):
    """At t_k the container gives the velocity that the scenario has at t_k."""
    text = SCENARIO.replace("sample_period=0.02", "sample_period=0.01")
    (folder / "even.py").write_text(text)
    assert call("export", "even.py", "--out", "even.fmu", "--fmi-version", "3.0") == 0
    assert call("run", "even.fmu", "--out", "whole") == 0
    assert call("run", "even.py", "--out", "ref") == 0
    whole, expected = (Result.load(folder / n / "result.npz") for n in ("whole", "ref"))
    assert np.array_equal(whole["even.mass.v"], expected["mass.v"])
    assert call("export", "braking.py", "--out", "loop.fmu") == 2
    assert "brake acts every 0.02 s and the container steps all FMUs every 0.01 s" in capsys.readouterr().err


def test_an_export_to_something_else_is_refused(folder, capsys):
    assert call("export", "braking.py", "--out", "loop.zip") == 2
    assert "a system is exported as an .ssp" in capsys.readouterr().err
