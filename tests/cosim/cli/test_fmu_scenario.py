"""A single FMU from the command line: times, start values, inputs from CSV files."""

from __future__ import annotations

import contextlib
import json
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim import (
    FMU,
    CosimError,
    DeclarationError,
    FMUError,
    Input,
    LinearContinuous,
    ModelExchange,
    Parameter,
    RecordError,
    Result,
    State,
    System,
    simulate,
)
from cosim.blocks import TableSource
from cosim.cli.app import main
from cosim.cli.fmu_scenario import fmu_study
from cosim.cli.input_table import connect_inputs
from fmus.export import DefaultExperiment, export
from tests.cosim.fmi.ball import ball
from tests.cosim.fmi.crash import crash
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Chain


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Chain (two forces, both interfaces, a default experiment), the ball, the probe."""
    place = tmp_path_factory.mktemp("run")
    export(Chain(), place / "chain.fmu", experiment=DefaultExperiment(stop=1.0, step=0.1))
    ball(place / "ball.fmu")
    probe(place / "probe.fmu", "3.0")
    return place


# ------------------------------------------------------------------------------- tables


def test_a_table_between_its_rows_at_its_rows_and_outside():
    """0.1 k is below 0.3 and 0.7 in floats at some k; a row there counts all the same."""
    t = [0.25, 0.3, 0.7, 0.7, 1.05]
    rows = np.array([[1.0, 5.0], [2.0, 4.0], [3.0, 3.0], [-1.0, 2.0], [0.4, 1.0]])
    parts = {"linear": TableSource(t, rows, unit="N"), "held": TableSource(t, rows, interpolation="hold")}
    result = simulate(System(parts), step=0.1, stop=1.3)
    k = np.arange(14)
    assert result.units["linear.y"] == "N"
    for i in range(2):
        before = np.interp(0.1 * k, t[:3], rows[:3, i])
        after = np.interp(0.1 * k, t[3:], rows[3:, i])
        assert result["linear.y"][:, i] == pytest.approx(np.where(k < 7, before, after), abs=1e-14)
        row = [0, 0, 0, 1, 1, 1, 1, 3, 3, 3, 3, 4, 4, 4]
        assert list(result["held.y"][:, i]) == list(rows[row, i])


@pytest.mark.parametrize(
    ("instants", "rows", "words"),
    [([0.0, 1.0], [1.0], "do not fit"), ([1.0, 0.0], [1.0, 2.0], "do not decrease"), ([], [], "at least 1")],
)
def test_invalid_tables_are_refused(instants, rows, words):
    with pytest.raises(DeclarationError, match=words):
        TableSource(instants, rows)
    with pytest.raises(DeclarationError, match="did you mean 'linear'"):
        TableSource([0.0], [1.0], interpolation="liner")


# -------------------------------------------------------------------------------- inputs


def test_inputs_from_a_file_are_those_of_a_source(folder, tmp_path):
    """An element and an array: the run of the same table as a block, bit for bit."""
    (tmp_path / "in.csv").write_text('time,"u[2]"\n0,0\n0.45,1.5\n0.45,-1\n\n0.9,0.5\n')
    options = {"stop": 1.0, "step": 0.05, "record": ("a", "u")}
    found = fmu_study(folder / "chain.fmu")(input=tmp_path / "in.csv", **options).run()
    source = TableSource([0.0, 0.45, 0.45, 0.9], [0.0, 1.5, -1.0, 0.5])
    system = System({"chain": FMU(folder / "chain.fmu"), "s": source}, [("s.y", "chain.u[2]")])
    wanted = simulate(system, step=0.05, stop=1.0, record=["chain.a", "chain.u"])
    for name in ("chain.a", "chain.u"):
        assert np.array_equal(found[name], wanted[name])
    assert np.ptp(found["chain.u"][:, 1]) > 2.0
    (tmp_path / "array.csv").write_text("time, u\n0, 0 0\n0.45, 0 1.5\n0.45, 0 -1\n0.9, 0 0.5\n")
    again = fmu_study(folder / "chain.fmu")(input=tmp_path / "array.csv", **options).run()
    assert np.array_equal(found["chain.a"], again["chain.a"])


def test_discrete_inputs_are_held(folder, tmp_path):
    """Booleans by word, enumerations by number, an alias by its other name."""
    text = "time,b_in,e_in,i_in,r_other\n0,true,1,-5,0\n0.5,FALSE,2,7,1\n"
    (tmp_path / "in.csv").write_text(text)
    study = fmu_study(folder / "probe.fmu")
    record = ("b_out", "e_out", "i_out", "r_out")
    result = study(input=tmp_path / "in.csv", stop=1.0, step=0.25, record=record).run()
    # row of the file that is latched at t_k-1, with which y_k is computed; at t_0 what it starts with
    late = [0, 0, 0, 1, 1]
    for name, values in (("b_out", (0, 1)), ("e_out", (1, 2)), ("i_out", (-4, 8))):
        assert list(result[f"probe.{name}"]) == [values[row] for row in late], name
    assert list(result["probe.r_out"]) == [0.0, 0.0, 1.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "give a header, time and names of inputs"),
        ("time,u\n", "and at least one row"),
        ("u,time\n0,1\n", "the first column is 'u'; it must be time"),
        ("time,w\n0,1\n", r"chain\.fmu has no input 'w'"),
        ("time,x\n0,1\n", r"chain\.fmu has no input 'x'"),
        ('time,"u[3]"\n0,1\n', r"outside shape \(2,\)"),
        ("time,u\n0,1 2\n1\n", r"in\.csv:3: 1 cells, and the header has 2"),
        ("time,u\n0,1 2\n1,1\n", r"in\.csv:3: u takes 2 numbers"),
        ("time,u\n0,1 x\n", r"in\.csv:2: u is 'x', which is not a finite number"),
        ("time,u\n0,1 nan\n", "which is not a finite number"),
        ("time,u\n1,1 1\n0,1 1\n", r"in\.csv:3: time 0 s comes after 1 s"),
        ("time,u,u\n0,1 1,1 1\n", "there are two columns u"),
        ('time,"u\n0,1 1\n', "is not a CSV file"),
        (
            "time,u\n0,0 9007199254740993\n",
            r"in\.csv:2: u is 9007199254740993, which a float above 2\^53 cannot represent",
        ),
    ],
)
def test_invalid_input_files_are_refused(folder, tmp_path, text, words):
    (tmp_path / "in.csv").write_text(text)
    with pytest.raises(Exception, match=words) as caught:
        connect_inputs(System({"chain": FMU(folder / "chain.fmu")}), "chain", tmp_path / "in.csv")
    assert type(caught.value).__module__ == "cosim.errors"


FLOATS = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.floats(0.0, 1e6), FLOATS, FLOATS), min_size=1, max_size=20))
def test_numbers_come_out_of_a_file_as_they_went_in(folder, tmp_path, rows):
    """repr and float are inverse to each other: the block's table equals the written one, bit for bit."""
    rows = sorted(rows, key=lambda row: row[0])
    lines = [f"{t!r}, {a!r}  {b!r}" for t, a, b in rows]
    (tmp_path / "in.csv").write_text("\r\n".join(["time,u", *lines]))
    system = System({"chain": FMU(folder / "chain.fmu")})
    connect_inputs(system, "chain", tmp_path / "in.csv")
    source = system.participants["input_1"]
    assert list(source.instants) == [t for t, _, _ in rows]
    assert source.rows.tolist() == [[a, b] for _, a, b in rows]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(alphabet='timeu[12],"\n\r\t .-+e5nax\0é', max_size=60))
def test_any_text_is_a_table_of_inputs_or_a_clear_error(folder, tmp_path, text):
    (tmp_path / "in.csv").write_text(text, encoding="utf-8", newline="")
    system = System({"chain": FMU(folder / "chain.fmu")})
    with contextlib.suppress(CosimError):
        connect_inputs(system, "chain", tmp_path / "in.csv")
        assert len(system.participants) > 1


def test_a_missing_or_binary_file_is_refused(folder, tmp_path):
    system = System({"p": FMU(folder / "probe.fmu")})
    with pytest.raises(RecordError, match="cannot be read"):
        connect_inputs(system, "p", tmp_path / "missing.csv")
    (tmp_path / "in.csv").write_bytes(bytes(range(128, 200)))
    with pytest.raises(RecordError, match="not text in UTF-8"):
        connect_inputs(system, "p", tmp_path / "in.csv")


# -------------------------------------------------------------------------- command line


def test_the_command_writes_what_it_finds(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--interface", "ModelExchange", "--solver", "ode2", "--start", "k=5"]
    main(["run", str(folder / "chain.fmu"), *options])
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith("10 steps in ")
    assert "peak chain.a[2]" in lines[1]
    kept = json.loads(Path("out/chain/metrics.json").read_text())
    fmu = FMU(folder / "chain.fmu", interface=ModelExchange("ode2"), start={"k": 5.0})
    wanted = simulate(System({"chain": fmu}), step=0.1, stop=1.0, record=["chain.a"])
    assert kept["metrics"]["peak chain.a[1]"]["value"] == np.abs(wanted["chain.a"][:, 0]).max()
    assert np.array_equal(Result.load("out/chain/result.npz")["chain.a"], wanted["chain.a"])


class Mixer(LinearContinuous):
    """x' = A u, A of shape (2, 3)"""

    A = Parameter(1.0, shape=(2, 3))
    u = Input(shape=3)
    x = State(0.0, shape=2)

    def derivatives(self, t):
        for i in range(2):
            self.der_x[i] = 0.0
            for j in range(3):
                self.der_x[i] += self.A[i, j] * self.u[j]


def test_a_matrix_is_given_row_by_row(tmp_path):
    path = export(Mixer(), tmp_path / "mixer.fmu", fmi_version="3.0")
    study = fmu_study(path)
    result = study(stop=1.0, step=0.5, start=("A=1 2 3, 4 5 6", "u=1 10 100"), record=("x",)).run()
    assert result["mixer.x"][-1] == pytest.approx([321.0, 654.0], rel=1e-15)
    with pytest.raises(FMUError, match=r"A = \[1\.0, 2\.0\] does not fit type Float64 of shape \(2, 3\)"):
        study(stop=1.0, step=0.5, start=("A=1 2",)).run()


def test_scheduled_execution_is_refused(tmp_path, capsys):
    """As of the Clocks of the FMI project: clocks of three kinds, variables that belong to them."""
    text = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Ticks" instantiationToken="t">
<ScheduledExecution modelIdentifier="Ticks"/><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Clock name="a" valueReference="1" causality="input" intervalVariability="constant" intervalDecimal="1.0"/>
<Clock name="b" valueReference="2" causality="input" intervalVariability="countdown"/>
<Clock name="c" valueReference="3" causality="output" intervalVariability="triggered"/>
<Int32 name="ticks" valueReference="4" causality="output" variability="discrete" clocks="1"/>
</ModelVariables><ModelStructure><Output valueReference="3"/><Output valueReference="4"/></ModelStructure>
</fmiModelDescription>"""
    with zipfile.ZipFile(tmp_path / "ticks.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{fmpy.platform_tuple}/Ticks{fmpy.sharedLibraryExtension}", b"")
    with pytest.raises(SystemExit):
        main(["run", str(tmp_path / "ticks.fmu")])
    words = "has neither Co-Simulation nor Model Exchange, and Scheduled Execution is not supported"
    assert words in capsys.readouterr().err


def test_an_end_at_the_request_of_the_fmu_is_reported(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ends = ["--start", "end_at_bounce=2", "--stop", "9", "--step", "0.5"]
    main(["run", str(folder / "ball.fmu"), *ends])
    out = capsys.readouterr()
    assert "ball asked to end the simulation at t = 2.82" in out.out
    assert out.err == ""
    assert json.loads(Path("out/ball/metrics.json").read_text())["ended"].startswith("ball asked")


def test_a_crash_of_an_isolated_fmu_keeps_what_was_computed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    crash(tmp_path, "DoStep null 0.5")
    with pytest.raises(SystemExit):
        main(["run", "crash.fmu", "--isolated", "--stop", "1", "--step", "0.125"])
    assert "SIGSEGV" in capsys.readouterr().err
    assert list(Result.load("out/crash/result.npz").time) == [0.0, 0.125, 0.25, 0.375, 0.5]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "ball.fmu has no default stop time; give --stop"),
        (["--stop", "2"], "ball.fmu has no default step; give --step, in s, such as 0.002"),
        (["--stop", "2", "--step", "0.1", "--start", "ee=1"], "no variable 'ee'; did you mean 'e'"),
        (["--stop", "2", "--step", "0.1", "--start", "e"], "write name=value"),
        (["--stop", "2", "--step", "0.1", "--start", "e=soft"], "'soft' is not a value of type Real"),
        (["--stop", "2", "--step", "0.1", "--record", "hh"], "did you mean 'h'"),
    ],
)
def test_wrong_options_are_refused_with_a_remedy(folder, tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(["run", str(folder / "ball.fmu"), *arguments])
    assert caught.value.code == 2
    assert words in capsys.readouterr().err
