"""The doctor: a sound FMU gets nothing above a note, and every fault is found by its probe."""

from __future__ import annotations

import json
import re

import pytest

from cosim import FMU, CosimError
from cosim.cli.app import main
from cosim.doctor import examine
from cosim.doctor.examination import PROBES
from fmus.export import export
from tests.cosim.fmi.probe import changed, probe, write_fmu
from tests.fmus.export.host import PARTICIPANTS

CS, ME = "Co-Simulation", "Model Exchange"
VARIABLES = """
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous">
  <Real unit="N" start="0"/></ScalarVariable>
<ScalarVariable name="x" valueReference="2" causality="output" variability="continuous" initial="exact">
  <Real unit="m" start="0.5"/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="3" causality="local" variability="continuous">
  <Real derivative="2" unit="m/s"/></ScalarVariable>
<ScalarVariable name="v" valueReference="4" causality="output" variability="continuous">
  <Real unit="m"/></ScalarVariable>"""
STATE = 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"'
VARIABLE_STEP = 'canHandleVariableCommunicationStepSize="true"'


def description(fault: str) -> str:
    """modelDescription.xml of bad.c; its GUID is the fault."""
    units = "".join(
        f'<Unit name="{name}"><BaseUnit {base}/></Unit>'
        for name, base in (("N", 'kg="1" m="1" s="-2"'), ("m", 'm="1"'), ("m/s", 'm="1" s="-1"'))
    )
    varies = "" if fault == "steps of 0.25" else VARIABLE_STEP
    unknowns = '<Unknown index="{}" dependencies="{}"/>'
    initial = unknowns.format(3, "1 2") + unknowns.format(4, "1 2")
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="bad" guid="{fault}" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="bad" {STATE}/><CoSimulation modelIdentifier="bad" {STATE} {varies}/>
<UnitDefinitions>{units}</UnitDefinitions><DefaultExperiment startTime="0" stopTime="9" stepSize="0.25"/>
<ModelVariables>{VARIABLES}</ModelVariables>
<ModelStructure><Outputs>{unknowns.format(2, "2")}{unknowns.format(4, "1 2")}</Outputs>
<Derivatives>{unknowns.format(3, "1 2")}</Derivatives>
<InitialUnknowns>{initial}</InitialUnknowns></ModelStructure></fmiModelDescription>"""


@pytest.fixture(scope="module")
def bad(tmp_path_factory):
    """Write bad.fmu with a fault; the library is compiled once."""
    folder = tmp_path_factory.mktemp("bad")
    original = write_fmu(folder / "bad.fmu", description("good"), "bad", "bad.c", "rest2.c")

    def give(fault: str):
        path = folder / f"{fault}.fmu"
        text = description(fault).encode()
        return changed(path, original, lambda name, old: text if name == "modelDescription.xml" else old)

    return give


def probed(path, name: str, interface: str) -> tuple[str, str]:
    """Run a probe in this process; for faults that do not end it."""
    planned = next(p for p in PROBES if p.name == name)
    done: list[str] = []
    try:
        return planned.function(FMU(path), interface == ME, done.append)
    except CosimError as error:
        return "error", str(error)


# ------------------------------------------------------------------------------ good FMUs


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["oscillator", "building", "accumulator"])
def test_an_exported_fmu_has_nothing_above_a_note(tmp_path, name, version):
    path = export(PARTICIPANTS[name](), tmp_path / "exported.fmu", fmi_version=version)
    fmu = FMU(path)
    for p in PROBES:
        for interface in p.interfaces:
            if interface != ME or fmu.has_me:
                level, text = probed(path, p.name, interface)
                # a block acts at every step of any length, which the doctor reports
                acts = name == "accumulator" and p.name == "step size"
                assert level in (["warning"] if acts else ["ok", "note"]), (p.name, interface, text)


def test_the_model_without_a_fault_has_no_findings(bad):
    """The findings below come from the faults. The step is exact: h and h / 2 differ by rounding."""
    planned = [(p.name, i) for p in PROBES for i in p.interfaces]
    found = {(name, interface): probed(bad("good"), name, interface) for name, interface in planned}
    assert {level for level, _ in found.values()} == {"ok"}, found
    assert found["feedthrough", CS] == found["feedthrough", ME] == ("ok", "1 dependency seen")
    assert found["state", CS] == ("ok", "repeats 20 steps bit for bit, also from 64 bytes")


def test_the_report_is_that_of_the_probes(bad):
    """Probes in their own processes give the same texts, in the order of the probes."""
    names = ["description", "reset", "negative step"]
    report = examine(bad("good"), only=reversed(names))
    assert [(f.probe, f.interface) for f in report.findings] == [
        ("platforms", ""), ("description", ""), ("reset", CS), ("negative step", CS), ("reset", ME)
    ]  # fmt: skip
    for f in report.findings[1:]:
        assert (f.level, f.text) == probed(bad("good"), f.probe, f.interface)
    assert (report.worst, report.exit_code) == ("note", 0)
    assert report.summary() == "5 probes: 1 note, 4 ok"


# --------------------------------------------------------------------------------- faults


@pytest.mark.parametrize(
    ("fault", "name", "interfaces", "level", "words"),
    [
        ("no instance", "instance", [CS, ME], "error", "failed to instantiate"),
        ("no initialization", "instance", [CS, ME], "error", "failed to enter initialization"),
        ("endless event", "instance", [ME], "error", "the event at t = 0 s does not end"),
        ("not finite", "initial values", [CS, ME], "error", "not finite: x"),
        ("derivative not finite", "initial values", [ME], "error", "not finite: derivatives"),
        ("indicator not finite", "initial values", [ME], "error", "not finite: event indicators"),
        ("reset keeps x", "reset", [CS, ME], "error", "reset differs: x by .* step 0; a new instance rep"),
        ("reset keeps u", "reset", [CS, ME], "warning", "inputs keep their values: u; set again, the run"),
        ("differs at random", "reset", [CS], "error", "reset differs: x by .*; a new instance differs, too"),
        ("state without x", "state", [CS, ME], "error", "after the state was set differs: x by .* step"),
        ("bytes without x", "state", [CS, ME], "error", "after the state was read from bytes differs: x by"),
        ("shared", "several instances", [CS, ME], "error", "changes when another one runs: x by .* step"),
        ("undeclared", "feedthrough", [CS, ME], "error", "not declared: x on u"),
        ("not seen", "feedthrough", [CS, ME], "note", "declared and not seen here: v on u"),
        ("get counts", "feedthrough", [CS, ME], "error", "getting the outputs changes them: x"),
        ("euler", "step size", [CS], "note", r"h / 2 the run differs by 0\.0\d* of its range"),
        ("extra per step", "step size", [CS], "warning", r"differs by \S+ of its range \(\w, h = 0\.25 s"),
        ("steps of 0.25", "step size", [CS], "note", r"takes no step of 0\.125 s; a variable step is not"),
        ("silent", "step before initialization", [CS], "warning", "accepted without an error: do a step"),
        ("silent", "negative step", [CS], "warning", r"accepted without an error: do a step of -0\.25 s"),
        ("silent", "unknown value reference", [CS, ME], "warning", "accepted without an error: get value"),
    ],
)  # fmt: skip
def test_a_fault_is_found(bad, fault, name, interfaces, level, words):
    for interface in interfaces:
        got, text = probed(bad(fault), name, interface)
        assert got == level, text
        assert re.search(words, text), text


@pytest.mark.parametrize(
    ("fault", "interfaces", "level", "words"),
    [
        ("leak", [CS, ME], "warning", r"every instance leaves (19|20|21)\S* KiB of memory"),
        ("leak much", [CS], "error", r"every instance leaves (48|49)\S* KiB of memory"),
        ("leak handles", [CS], "error", "1000 instances leave 800 handles open"),
    ],
)
def test_a_leak_is_found(bad, fault, interfaces, level, words):
    """The probes need their own processes: here, a leak would first fill memory that earlier tests freed."""
    findings = [f for f in examine(bad(fault), only=["leak"]).findings if f.probe == "leak"]
    assert [f.interface for f in findings] == [CS, ME]
    for f in findings:
        if f.interface in interfaces:
            assert f.level == level, f.text
            assert re.search(words, f.text), f.text


@pytest.mark.parametrize(
    ("fault", "name", "interfaces", "words"),
    [
        ("crash at instantiate", "instance", [CS, ME], r"died of SIG\w+; .*: load the library and inst"),
        ("crash at free", "instance", [CS, ME], r"died of SIG\w+; .*: terminate and free the instance"),
        ("exit at step", "instance", [CS], "ended its process with exit code 0; it was to: do steps"),
        ("crash at reset", "reset", [CS, ME], r"died of SIG\w+; it was to: reset"),
        ("crash at state", "state", [CS, ME], r"died of SIG\w+; it was to: set the state"),
        ("crash at reference", "unknown value reference", [CS, ME], r"died of SIG\w+; .*: get value ref"),
        ("hang at step", "instance", [CS], "hangs: it did not end within 6 s; it was to: do steps"),
    ],
)
def test_a_fault_that_ends_or_stops_the_process_is_found(bad, fault, name, interfaces, words):
    """The limit of 6 s begins after the start of the process; a probe that does not hang takes 0.5 s."""
    report = examine(bad(fault), only=[name], time_limit=6.0 if "hang" in fault else 60.0)
    found = {f.interface: f for f in report.findings if f.probe == name}
    for interface in interfaces:
        assert found[interface].level == "crashed"
        assert re.search(words, found[interface].text), report.text()
    assert report.exit_code == 3


def test_a_description_that_is_not_valid_is_found(bad, tmp_path):
    """FMPy reads a description without initial unknowns, which its validation of the structure refuses."""
    text = re.sub("<InitialUnknowns>.*?</InitialUnknowns>", "", description("good"))
    path = changed(tmp_path / "x.fmu", bad("good"), lambda n, old: text.encode() if n[0] == "m" else old)
    level, words = probed(path, "description", "")
    assert level == "error"
    assert words.startswith("not valid: ModelStructure/InitialUnknowns does not contain the expected set")


def test_units_that_are_missing_or_not_known(bad, tmp_path):
    text = description("good").replace('<Real unit="N" start="0"/>', '<Real start="0"/>')
    text = text.replace('"m"', '"furlog"').replace('name="m" ', 'name="furlog" ')
    defined = '<Unit name="furlog"><BaseUnit m="1"/></Unit>'
    assert defined in text
    for given, more in ((defined, ""), ('<Unit name="furlog"/>', "; not known, so not converted: furlog")):
        new = text.replace(defined, given).encode()
        path = changed(tmp_path / "x.fmu", bad("good"), lambda n, old, new=new: new if n[0] == "m" else old)
        level, words = probed(path, "units", "")
        assert level == "note"
        assert words == f"1 of 3 inputs and outputs have none: u{more}"


def test_dependencies_that_are_not_listed_are_named(tmp_path):
    """i_out has no list; x_alias is another name of x, which has one; v_out is an array."""
    level, words = probed(probe(tmp_path / "probe.fmu", "3.0"), "feedthrough", CS)
    assert (level, words.partition("; ")[2]) == ("note", "no dependencies listed, which means all: i_out")


def test_an_fmu_with_one_instance_per_process_is_not_instantiated_twice(tmp_path):
    path = probe(tmp_path / "once.fmu", "3.0", once=True)
    for name in ("leak", "several instances", "step size"):
        assert probed(path, name, CS) == ("note", "not tried: only one instance in a process, as declared")
    assert probed(path, "state", CS)[1] == "not declared: it cannot be saved and returned to"


def test_python_files_of_the_current_folder_are_not_run(bad, tmp_path, monkeypatch):
    """A probe imports json, and an untrusted folder may contain another json.py."""
    (tmp_path / "json.py").write_text("open('executed', 'w').close()\n")
    monkeypatch.chdir(tmp_path)
    assert probed(bad("good"), "instance", CS)[0] == "ok"
    assert not (tmp_path / "executed").exists()


# --------------------------------------------------------------------------- command line


def run(capsys, *arguments: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as ended:
        main(["doctor", *arguments])
    captured = capsys.readouterr()
    return int(ended.value.code or 0), captured.out + captured.err


def test_the_command_line(bad, capsys, tmp_path):
    """The report as text and as JSON; the exit code is that of the worst finding."""
    code, text = run(capsys, str(bad("undeclared")), "--probe", "feedthrough", "--probe", "units")
    assert code == 2
    assert text.splitlines()[0] == "undeclared.fmu: FMI 2.0, Co-Simulation and Model Exchange"
    assert re.search(r"^error +feedthrough +not declared: x on u$", text, re.MULTILINE)
    assert text.splitlines()[-1] == "4 probes: 2 errors, 1 note, 1 ok"
    code, text = run(capsys, str(bad("crash at reset")), "--probe", "reset", "--json")
    data = json.loads(text)
    assert (code, data["worst"], data["exit_code"]) == (3, "crashed", 3)
    assert data["findings"][1]["probe"] == "reset"
    assert run(capsys, str(bad("silent")), "--probe", "negative step")[0] == 1
    assert run(capsys, str(bad("good")), "--probe", "reset")[0] == 0
    (tmp_path / "no.fmu").write_text("no")
    code, text = run(capsys, str(tmp_path / "no.fmu"))
    assert (code, "is not an FMU" in text) == (2, True)
    code, text = run(capsys, str(bad("good")), "--probe", "rest")
    assert (code, "did you mean 'reset'" in text) == (2, True)


def test_nothing_is_left_behind(bad, tmp_path, monkeypatch):
    """A process that dies cannot remove the FMU that it unpacked; its folder is removed nevertheless."""
    import tempfile

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    examine(bad("crash at reset"), only=["reset"])
    assert list(tmp_path.iterdir()) == []
