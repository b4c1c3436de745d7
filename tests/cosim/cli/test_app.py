"""The command line: what it prints and writes, and the errors that end with exit code 2."""

import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from cosim.cli.app import main

SCENARIO = '''
"""A mass that is braked."""
from cosim import Block, Continuous, Input, Output, Parameter, State, System, simulate

class Mass(Continuous):
    F = Input("force", unit="N")
    v = State(2.0, "velocity", unit="m/s")
    def derivatives(self, t):
        self.der_v = self.F / 3.0

class Brake(Block):
    b = Parameter(1.5, "damping", unit="N*s/m", min=0.0)
    v = Input(unit="m/s")
    F = Output(unit="N")
    def step(self, t, h):
        self.F = -self.b * self.v

def build(*, b: float = 1.5) -> System:
    return System({"mass": Mass(), "brake": Brake(b=b)}, [("mass.v", "brake.v"), ("brake.F", "mass.F")])

def run(*, b: float = 1.5, stop: float = 2.0, progress=None):
    """Brake.

    Parameters
    ----------
    b
        damping constant
    """
    return simulate(build(b=b), step=0.01, stop=stop, progress=progress)
'''


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "braking.py"
    path.write_text(SCENARIO)
    return str(path)


def call(*arguments):
    """Run the command line in this process; return its exit code."""
    try:
        main([str(a) for a in arguments])
    except SystemExit as end:
        return end.code or 0
    return 0


def refused(capsys, *arguments):
    """Run a command that must end with exit code 2 and one screen of text; return the text."""
    code = call(*arguments)
    text = capsys.readouterr().err
    assert code == 2, text
    assert text.startswith("error: ")
    assert "Traceback" not in text
    assert len(text.splitlines()) < 25
    return text


def test_run_of_a_users_file_writes_numbers_result_and_says_where(scenario, tmp_path, capsys):
    assert call("run", scenario, "--b", 3.0, "--out", tmp_path / "out") == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["options"] == {"b": 3.0, "stop": 2.0}
    assert metrics["metrics"]["peak mass.v"] == {"value": 2.0, "unit": "m/s"}
    assert metrics["versions"]["numpy"] == np.__version__
    assert metrics["interrupted"] is False
    with np.load(tmp_path / "out" / "result.npz") as data:
        # v_k = 2 (1 - h b / m)^k: the force is held over a step and the derivative is constant
        assert data["mass.v"][-1] == pytest.approx(2.0 * (1 - 0.01) ** 200, rel=1e-12)  # 200 roundings
    assert "result.npz" in capsys.readouterr().out


def test_options_come_from_the_signature(scenario, capsys):
    assert call("run", scenario, "--help") == 0
    text = capsys.readouterr().out
    assert "damping constant" in text
    assert "--stop" in text
    assert "progress" not in text


def test_list_names_the_scenarios(capsys):
    assert call("list") == 0
    assert "chattering" in capsys.readouterr().out


def test_table_as_json_is_a_list_of_rows(capsys):
    assert call("table", "chattering", "--no-comparison", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 24
    assert {"case", "gain", "coupling", "norm_u", "mean_sgn"} <= rows[0].keys()


def test_json_has_null_where_a_number_is_not_finite(tmp_path, capsys):
    path = tmp_path / "tabled.py"
    rows = "[{'a': 1.5, 'b': float('nan'), 'c': 'x'}, {'a': float('inf'), 'b': 2, 'c': None}]"
    path.write_text(f"def table():\n    return {rows}\n")
    assert call("table", path, "--json") == 0
    text = capsys.readouterr().out
    assert "NaN" not in text
    assert json.loads(text) == [{"a": 1.5, "b": None, "c": "x"}, {"a": None, "b": 2, "c": None}]


def test_export_and_inspect(scenario, tmp_path, capsys):
    path = tmp_path / "mass.fmu"
    assert call("export", f"{scenario}:mass", "--out", path) == 0
    assert call("inspect", path) == 0
    text = capsys.readouterr().out
    assert "Co-Simulation" in text
    line = next(line for line in text.splitlines() if line.startswith("v "))
    assert line.split()[:5] == ["v", "Real", "output", "m/s", "2.0"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("run", "chatering"), "did you mean 'chattering'"),
        (("run", "nowhere/mine.py"), "there is no file"),
        (("run", "chattering", "--cas", "2"), "Did you mean"),
        (("run", "chattering", "--case", "9"), "Choose from"),
        (("table", "nothing"), "there is no scenario 'nothing'"),
        (("export", "chattering", "--out", "chattering.zip"), "leaves as an .ssp"),
        (("export", "chattering:plnt"), "did you mean 'plant'"),
        (("export", "chattering:plant", "--platform", "x86_64-linx"), "x86_64-linux"),
        (("export", "chattering:plant", "--fmi-version", "1.0"), "2.0"),
        (("inspect", "missing.fmu"), "there is no file"),
        (("frobnicate",), "Unknown command"),
    ],
)
def test_wrong_words_are_refused_with_a_remedy(capsys, arguments, expected):
    assert expected in refused(capsys, *arguments)


def test_broken_fmus_are_refused(tmp_path, capsys):
    torn = tmp_path / "torn.fmu"
    torn.write_bytes(b"PK\x03\x04 cut off")
    assert "not a ZIP archive" in refused(capsys, "inspect", torn)
    empty = tmp_path / "empty.fmu"
    with zipfile.ZipFile(empty, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    assert "modelDescription.xml" in refused(capsys, "inspect", empty)
    old = tmp_path / "old.fmu"
    with zipfile.ZipFile(old, "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="1.0"/>')
    assert "FMI version 1.0" in refused(capsys, "inspect", old)


def test_step_that_does_not_divide_the_time_is_refused(scenario, capsys):
    assert "whole number" in refused(capsys, "run", scenario, "--stop", "0.015", "--out", "unused")


def test_failing_run_keeps_what_was_computed(tmp_path, capsys):
    path = tmp_path / "failing.py"
    path.write_text(SCENARIO.replace("-self.b * self.v", "-self.b * self.v / (1.0 if t < 0.5 else 0.0)"))
    text = refused(capsys, "run", path, "--out", tmp_path / "out")
    assert "brake.F is not finite" in text
    assert "t = 0.5 s" in text
    with np.load(tmp_path / "out" / "result.npz") as data:
        assert data["time"][-1] == pytest.approx(0.49)
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["interrupted"] is True


def test_ctrl_c_keeps_what_was_computed(tmp_path):
    path = tmp_path / "long.py"
    longer = SCENARIO.replace("stop: float = 2.0", "stop: float = 4.0e5")
    path.write_text(longer.replace("step=0.01", "step=1e-3"))
    code = (  # SIGINT is ignored where tests run in the background
        "import os, signal, sys, threading, cosim.cli.app, cosim.run.recorder\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "cosim.run.recorder.MEMORY_LIMIT = 0\n"
        "threading.Timer(6.0, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        f"cosim.cli.app.main(['run', {str(path)!r}, '--out', {str(tmp_path / 'out')!r}])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=os.environ, check=False
    )
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    with np.load(tmp_path / "out" / "result.npz") as data:
        assert 1 < len(data["time"]) < 400_000_000


WRONG = {
    # what is wrong: (text of the scenario, what stands there instead, what the error says)
    "unknown port": ('("mass.v", "brake.v")', '("mass.w", "brake.v")', "mass has no output 'w'"),
    "unknown participant": ('("mass.v", "brake.v")', '("mas.v", "brake.v")', "did you mean 'mass'"),
    "incompatible unit": ('v = Input(unit="m/s")', 'v = Input(unit="kg")', "'m/s'"),
    "rate that is no whole number": (
        "Brake(b=b)",
        "Brake(b=b, sample_period=0.025)",
        "2.5 communication steps",
    ),
    "step of zero": ("step=0.01", "step=0.0", "above zero"),
    "negative step": ("step=0.01", "step=-0.01", "above zero"),
    "parameter out of bounds": ("Brake(b=b)", "Brake(b=-1.0)", "outside its bounds"),
    "unknown parameter": ("Brake(b=b)", "Brake(bb=1.0)", "did you mean 'b'"),
    "NaN from a block": ("-self.b * self.v", "self.v * float('nan')", "brake.F is not finite"),
    "missing FMU": ("Mass()", "__import__('cosim').FMU('none.fmu')", "there is no file none.fmu"),
    "missing record": ("Mass()", "__import__('cosim').read_at2('none.AT2')", "none.AT2"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_scenario_is_one_screen_and_exit_code_2(what, tmp_path, capsys):
    right, wrong, expected = WRONG[what]
    text = SCENARIO.replace(right, wrong)
    assert text != SCENARIO
    path = tmp_path / "wrong.py"
    path.write_text(text)
    message = refused(capsys, "run", path, "--out", tmp_path / "out")
    assert expected in message


def test_an_algebraic_cycle_is_printed_as_a_path(tmp_path, capsys):
    path = tmp_path / "wrong.py"
    text = SCENARIO.replace('Input(unit="m/s")', "Input()").replace(
        '[("mass.v", "brake.v")', '[("b.F", "brake.v")'
    )
    path.write_text(
        text.replace("Brake(b=b)}, ", 'Brake(b=b), "b": Brake()}, ').replace('"mass.F")]', '"b.v")]')
    )
    message = refused(capsys, "run", path, "--out", tmp_path / "out")
    assert "algebraic cycle: " in message
    assert "brake.F -> b.v" in message
    assert "initial=" in message


def test_unreadable_record_says_file_and_reason(tmp_path, capsys):
    record = tmp_path / "broken.AT2"
    record.write_text("PEER\nEl Centro\nacceleration\nNPTS= three, DT= often\n1 2 3\n")
    path = tmp_path / "wrong.py"
    path.write_text(
        "from cosim import read_at2\n"
        f"def build():\n    return read_at2({str(record)!r})\n"
        "def run():\n    return build()\n"
    )
    assert "broken.AT2" in refused(capsys, "run", path, "--out", tmp_path / "out")


def test_fmu_that_gives_nan_is_named_with_time(tmp_path, capsys):
    path = tmp_path / "wrong.py"
    root = SCENARIO.replace("self.F / 3.0", "(self.F / 3.0) ** 0.5")  # the braking force is negative: NaN
    path.write_text(root.replace("Mass()", "__import__('fmus.export').export.as_fmu(Mass())"))
    message = refused(capsys, "run", path, "--out", tmp_path / "out")
    assert "mass" in message
    assert "t = " in message
