"""The command line: its output, its files, and the errors that end with exit code 2."""

import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from cosim import Result
from tests.cosim.cli.command import call

SCENARIO = '''
"""A mass that is braked."""
from cosim import Block, Continuous, Input, Output, Parameter, Result, State, System, simulate

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

STUDY = '''
from dataclasses import dataclass

@dataclass(frozen=True, kw_only=True)
class Study:
    """Brake a mass."""
    b: float = 1.5
    """damping constant"""
    stop: float = 2.0
    """time at which the run stops, s"""

    def build(self) -> System:
        brake = Brake(b=self.b)
        return System({"mass": Mass(), "brake": brake}, [("mass.v", "brake.v"), ("brake.F", "mass.F")])

    def run(self, progress=None):
        return simulate(self.build(), step=0.01, stop=self.stop, progress=progress)

    def metrics(self, result):
        return {"final speed": (result["mass.v"][-1], "m/s")}

@dataclass(frozen=True, kw_only=True)
class Table:
    """One row."""
    scale: float = 2.0

    def rows(self):
        return [{"b": 1.0, "double": self.scale}]
'''


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "braking.py"
    path.write_text(SCENARIO)
    return str(path)


def refused(capsys, *arguments):
    """Run a command that must end with exit code 2 and one screen of text; return the text."""
    code = call(*arguments)
    text = capsys.readouterr().err
    assert code == 2, text
    assert text.startswith("error: ")
    assert "Traceback" not in text
    assert len(text.splitlines()) < 25
    return text


def test_a_run_of_a_users_file_writes_metrics_and_result_and_names_the_folder(scenario, tmp_path, capsys):
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


def test_a_study_class_gives_the_options_of_its_fields(tmp_path, capsys):
    """The class form of the same scenario: the same options, numbers and record on disk."""
    functions = SCENARIO[SCENARIO.index("def build") :]
    path = tmp_path / "studied.py"
    path.write_text(SCENARIO.replace(functions, STUDY))
    assert call("run", path, "--b", 3.0, "--out", tmp_path / "out") == 0
    assert "final speed" in capsys.readouterr().out
    kept = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert kept["options"] == {"b": 3.0, "stop": 2.0}
    # v_k = 2 (1 - h b / m)^k: the force is held over a step and the derivative is constant
    final = kept["metrics"]["final speed"]
    assert final["value"] == pytest.approx(2.0 * (1 - 0.01) ** 200, rel=1e-12)  # 200 roundings
    assert final["unit"] == "m/s"
    assert call("run", path, "--help") == 0
    text = capsys.readouterr().out
    assert "damping constant" in text
    assert "Brake a mass." in text
    assert call("table", path, "--json", "--scale", 3.0) == 0
    assert json.loads(capsys.readouterr().out) == [{"b": 1.0, "double": 3.0}]
    assert call("table", path) == 0
    assert "double" in capsys.readouterr().out
    assert call("export", f"{path}:mass", "--out", tmp_path / "mass.fmu") == 0


def test_a_study_that_is_not_a_dataclass_or_needs_an_option(tmp_path, capsys):
    """A plain class is refused with the line to add; a field without default is a required option."""
    functions = SCENARIO[SCENARIO.index("def build") :]
    plain, needing = tmp_path / "plain.py", tmp_path / "needing.py"
    plain.write_text(SCENARIO.replace(functions, STUDY.replace("@dataclass(frozen=True, kw_only=True)", "")))
    assert "class Study must be a dataclass; put @dataclass" in refused(capsys, "run", plain)
    needing.write_text(SCENARIO.replace(functions, STUDY.replace("b: float = 1.5", "b: float")))
    assert "--b" in refused(capsys, "run", needing, "--out", tmp_path / "out")
    assert call("run", needing, "--b", 3.0, "--out", tmp_path / "out") == 0
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["options"]["b"] == 3.0
    assert "give every option of Study a default" in refused(capsys, "export", f"{needing}:mass")


def test_list_names_the_scenarios(capsys):
    """Every study is listed, and no module that studies share."""
    assert call("list") == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert {"chattering", "tall_building", "highway_bridge", "external_plant"} <= set(names)
    assert not {"figures", "measurement"} & set(names)


def test_a_reader_that_stops_reading_ends_the_list_without_a_traceback():
    """`cosim list | true`: the pipe is closed before the command writes to it."""
    reader, writer = os.pipe()
    os.close(reader)
    code = "from cosim.cli.app import main; main(['list'])"
    with os.fdopen(writer, "w") as pipe:
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=pipe, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert done.stderr == ""


METRICS = "def metrics(result):\n    return {}\n\ndef run("
NOT_A_SCENARIO = [
    ("return simulate(", "simulate(", "run() returned nothing; return the Result of simulate()"),
    ("def run(", METRICS.format("{'v': 1.0}"), "'v' is 1.0; give (value, unit)"),
    ("def run(", METRICS.format("{'v': (1.0, None)}"), "'v' has the unit None; give a text"),
    ("def run(", METRICS.format("[1.0]"), "type list; it must return {name: (value, unit)}"),
    ("def run(", "def other(", "defines neither a class Study nor a function run()"),
]


@pytest.mark.parametrize(("old", "new", "words"), NOT_A_SCENARIO)
def test_a_scenario_that_returns_something_else_is_refused(tmp_path, capsys, old, new, words):
    path = tmp_path / "wrong.py"
    path.write_text(SCENARIO.replace(old, new))
    assert words in refused(capsys, "run", path, "--out", tmp_path / "out")


def test_metrics_that_fail_do_not_lose_the_run(tmp_path, capsys):
    """The result is on disk before the study's own code computes from it."""
    path = tmp_path / "wrong.py"
    path.write_text(SCENARIO.replace("def run(", METRICS.replace("{}", "{'v': result['plant.vv']}")))
    assert "has no signal 'plant.vv'" in refused(capsys, "run", path, "--out", tmp_path / "out")
    assert len(Result.load(tmp_path / "out" / "result.npz").time) > 1


@pytest.mark.parametrize("name", ["random", "json", "numpy"])
def test_a_file_named_like_a_module_does_not_replace_it(tmp_path, name):
    """The file imports the module that it is named after; later imports find the module, too."""
    path = tmp_path / f"{name}.py"
    path.write_text(
        SCENARIO.replace("from cosim", f"import {name}\nassert not hasattr({name}, 'Brake')\nfrom cosim")
    )
    code = (
        "import sys\nfrom cosim.cli.app import main\n"
        f"main(['run', {str(path)!r}, '--out', {str(tmp_path / 'out')!r}])\n"
        f"sys.modules.pop('colorsys', None); import {name}\nassert not hasattr({name}, 'Brake')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_an_output_folder_is_tried_before_the_run(scenario, tmp_path, capsys, monkeypatch):
    """--out names a file, or lies below one: refused, and the scenario has not run."""
    (tmp_path / "taken").write_text("")
    monkeypatch.setattr("cosim.cli.app.warnings.catch_warnings", None)  # entered only to run a study
    for out in (tmp_path / "taken", tmp_path / "taken" / "below", tmp_path / ("x" * 300)):
        assert "name a folder that can be written to" in refused(capsys, "run", scenario, "--out", out)


def test_files_of_a_run_replace_the_old_ones_whole(scenario, tmp_path, capsys, monkeypatch):
    """A run that fails while it writes result.npz leaves the file of the run before, and no other file."""
    assert call("run", scenario, "--out", tmp_path / "out") == 0
    before = (tmp_path / "out" / "result.npz").read_bytes()

    def full(self, path):
        path.write_bytes(before[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("cosim.result.Result.save", full)
    assert "No space left" in refused(capsys, "run", scenario, "--b", 3.0, "--out", tmp_path / "out")
    assert (tmp_path / "out" / "result.npz").read_bytes() == before
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["metrics.json", "result.npz"]


def test_metrics_have_null_where_a_number_is_not_finite(tmp_path):
    path = tmp_path / "endless.py"
    path.write_text(SCENARIO + "\ndef metrics(result):\n    return {'v': (float('inf'), 'm/s')}\n")
    assert call("run", path, "--out", tmp_path / "out") == 0
    text = (tmp_path / "out" / "metrics.json").read_text()
    assert "Infinity" not in text
    assert json.loads(text)["metrics"]["v"] == {"value": None, "unit": "m/s"}


def test_table_as_json_is_a_list_of_rows(capsys):
    assert call("table", "chattering", "--no-comparison", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 24
    assert {"case", "gain", "coupling", "norm_u", "mean_sgn"} <= rows[0].keys()


def test_a_table_as_json_has_null_where_a_number_is_not_finite(tmp_path, capsys):
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
    assert line.split()[:9] == ["v", "Real", "output", "m/s", "2.0", "-", "continuous", "-", "-"]


def test_inspection_shows_bounds_and_escapes_control_characters(scenario, tmp_path, capsys):
    """The brake's damping has min = 0; a description with an escape sequence is shown as text."""
    path = tmp_path / "brake.fmu"
    assert call("export", f"{scenario}:brake", "--out", path) == 0
    changed = tmp_path / "changed.fmu"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'description="damping"', 'description="dam\u202eping"'.encode())
            new.writestr(name, data)
    assert call("inspect", changed) == 0
    text = capsys.readouterr().out
    (line,) = (line for line in text.splitlines() if line.startswith("b "))
    columns = line.split()
    assert columns[6:9] == ["fixed", "0.0", "-"]
    assert "dam\\u202eping" in line


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("run", "chatering"), "did you mean 'chattering'"),
        (("run", "nowhere/mine.py"), "there is no file"),
        (("run", "chattering", "--cas", "2"), "Did you mean"),
        (("run", "chattering", "--case", "9"), "Choose from"),
        (("table", "nothing"), "there is no scenario 'nothing'"),
        (("export", "chattering", "--out", "chattering.zip"), "is exported as an .ssp"),
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
    first, kept = done.stderr.splitlines()[-2:]
    assert first == "interrupted"
    assert kept.startswith("kept: ")
    assert f"{tmp_path / 'out'}: metrics.json, result.npz" in kept
    with np.load(tmp_path / "out" / "result.npz") as data:
        assert 1 < len(data["time"]) < 400_000_000


WRONG = {
    # mistake: (text of the scenario, its replacement, words of the error)
    "unknown port": ('("mass.v", "brake.v")', '("mass.w", "brake.v")', "mass has no output 'w'"),
    "unknown participant": ('("mass.v", "brake.v")', '("mas.v", "brake.v")', "did you mean 'mass'"),
    "incompatible unit": ('v = Input(unit="m/s")', 'v = Input(unit="kg")', "'m/s'"),
    "rate that is not a whole number": (
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
