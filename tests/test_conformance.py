"""The conformance table is true: its tests exist and run, and tests/README.md has it."""

from __future__ import annotations

import ast
import json
import os
import re
import signal
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave

from cosim import FMU, Block, Input, ModelExchange, SimulationError, System, simulate
from cosim.blocks import function_source
from cosim.cli.app import main
from fmus.export import export
from fmus.plants.oscillator import Oscillator
from tests.conformance import FMUS, NONE, PASS, TABLE, Row, cited, markdown, rows
from tests.cosim.fmi.probe import probe
from tests.fmus.export.host import building
from tests.others import swing
from tests.processes import children

ROOT = Path(__file__).parents[1]


@cache
def functions(file: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse((ROOT / file).read_text())
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.feature)
def test_a_row_is_shown_by_tests_that_run(row: Row) -> None:
    assert {row.fmi2, row.fmi3} <= {PASS, NONE, "no"}
    if "no" in (row.fmi2, row.fmi3):
        assert row.note, "say why not"
    if PASS in (row.fmi2, row.fmi3):
        assert row.tests
        assert row.fmus
    for name in cited(row):
        file, _, test = name.partition("::")
        assert test.startswith("test_")
        assert test in functions(file), f"{file} has no test {test}"
        marks = [ast.unparse(d) for d in functions(file)[test].decorator_list]
        assert not [m for m in marks if "skip" in m or "xfail" in m], marks
        assert ("pytest.mark.long" in marks) == ("-m long" in row.note)
    assert {name.strip() for name in row.fmus.split(",") if name} <= FMUS.keys()


def test_every_kind_of_fmu_is_there_and_used() -> None:
    for place, _ in FMUS.values():
        assert (ROOT / place).is_file()
    used = {name.strip() for row in rows() for name in row.fmus.split(",") if name}
    assert used == FMUS.keys()


def test_features_are_named_once() -> None:
    names = [(group, row.feature) for group, listed in TABLE.items() for row in listed]
    assert len(set(names)) == len(names)


def test_the_readme_has_this_table() -> None:
    section = (ROOT / "tests" / "README.md").read_text().split("## Conformance\n")[1].split("\n## ")[0]
    assert markdown() in section, "update tests/README.md with what python -m tests.conformance prints"
    for row in rows():
        for name in cited(row):
            assert (ROOT / name.partition("::")[0]).is_file()


@pytest.mark.parametrize(
    "options", [{"solver": "ode1"}, {"solver": "ode4", "substeps": 3}, {"solver": "cvode", "tolerance": 1e-8}]
)
def test_model_exchange_of_both_versions(tmp_path: Path, options: dict[str, object]) -> None:
    """The same solver over the same kernels: FMI 2.0 and 3.0 agree bit for bit, and with the exact plant."""
    runs = []
    for version in ("2.0", "3.0"):
        path = export(Oscillator(c=0.3, k=4.0), tmp_path / f"{version}.fmu", fmi_version=version)
        plant = FMU(path, interface=ModelExchange(**options))  # type: ignore[arg-type]
        system = System({"plant": plant, "u": function_source(np.sin)}, [("u.y", "plant.u")])
        runs.append(simulate(system, step=0.01, stop=5.0, record=["plant.x", "plant.v", "plant.a"]))
    exact = System({"plant": Oscillator(c=0.3, k=4.0), "u": function_source(np.sin)}, [("u.y", "plant.u")])
    wanted = simulate(exact, step=0.01, stop=5.0, record=["plant.x"])["plant.x"]
    for port in ("plant.x", "plant.v", "plant.a"):
        assert np.array_equal(runs[0][port], runs[1][port])
    # Euler's error is of first order: omega^2 h t / 2 = 0.1 relative; the others' far below 1e-5
    bound = 0.2 if options["solver"] == "ode1" else 1e-5
    assert np.abs(runs[0]["plant.x"] - wanted).max() < bound * np.abs(wanted).max()


# properties that FMI 2.0's tests show, and that FMI 3.0 shares through one core, tested for 3.0 as well


@pytest.fixture(scope="module")
def buildings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("buildings")
    return {v: export(building(), folder / f"{v}.fmu", fmi_version=v) for v in ("2.0", "3.0")}


def test_the_structure_is_the_same_in_both_versions(buildings: dict[str, Path]) -> None:
    """An array of FMI 3.0 depends on what its elements do, has their unit, and a parameter their start."""
    found = []
    for path in buildings.values():
        description = fmpy.read_model_description(str(path))
        needs: dict[str, set[str]] = {}
        for unknowns in (description.outputs, description.derivatives, description.initialUnknowns):
            for u in unknowns:
                name = re.sub(r"\[\d+\]", "", u.variable.name)
                needs.setdefault(name, set()).update(re.sub(r"\[\d+\]", "", d.name) for d in u.dependencies)
        variables = [v for v in description.modelVariables if v.causality != "independent"]
        units = {re.sub(r"\[\d+\]", "", v.name): v.unit for v in variables}
        values = " ".join(str(v.start) for v in variables if v.causality == "parameter").split()
        found.append((needs, units, [float(x) for x in values]))
    assert found[0] == found[1]
    assert found[0][0]["base_shear"] == {"x", "k"}


def test_reset_and_many_instances(buildings: dict[str, Path], tmp_path: Path) -> None:
    """FMI 3.0: after a reset the run is the same bit for bit, and the same as in another instance."""
    description = fmpy.read_model_description(str(buildings["3.0"]))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmpy.extract(str(buildings["3.0"]), str(tmp_path))

    def instance() -> FMU3Slave:
        made = FMU3Slave(
            guid=description.guid, unzipDirectory=str(tmp_path), instanceName="b",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )  # fmt: skip
        made.instantiate()
        return made

    def run(fmu: FMU3Slave) -> list[float]:
        fmu.setFloat64([reference["k"]], [2000.0, 1500.0, 900.0])
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        rows: list[float] = []
        for k in range(50):
            fmu.setFloat64([reference["force"]], [1.0, 0.0, float(k)])
            fmu.doStep(currentCommunicationPoint=k * 0.01, communicationStepSize=0.01)
            rows += fmu.getFloat64([reference["x"]], nValues=3)
        return rows

    many = [instance() for _ in range(100)]
    runs = [run(fmu) for fmu in many]
    many[0].reset()
    runs.append(run(many[0]))
    for fmu in many:
        fmu.freeInstance()
    assert all(rows == runs[0] for rows in runs)
    assert len(set(runs[0])) == len(runs[0])


class Killer(Block):
    """Ends every process that this one has started, at 0.5 s."""

    compiled = False
    x = Input()

    def step(self, t: float, h: float) -> None:
        if t >= 0.5:
            for process in children(os.getpid()):
                os.kill(process, signal.SIGKILL)


def test_an_isolated_fmu_of_fmi_3_that_is_killed(tmp_path: Path) -> None:
    path = export(Oscillator(), tmp_path / "o.fmu", fmi_version="3.0")
    system = System({"plant": FMU(path, isolated=True), "killer": Killer()}, [("plant.x", "killer.x")])
    with pytest.raises(SimulationError, match=r"plant.*SIGKILL") as caught:
        simulate(system, step=0.01, stop=1.0)
    alone = simulate(System({"plant": FMU(path)}), step=0.01, stop=1.0)
    kept = caught.value.result["plant.x"]
    assert 50 <= len(kept) < 60
    assert np.array_equal(kept, alone["plant.x"][: len(kept)])


def test_isolated_instances_of_fmi_3_that_a_process_can_have_once_only(tmp_path: Path) -> None:
    path = probe(tmp_path / "once.fmu", "3.0", once=True)
    members = {n: FMU(path, isolated=True, start={"r_in": float(i)}) for i, n in enumerate("abc")}
    result = simulate(System(members), step=0.0625, stop=0.0625)
    assert [result[f"{n}.r_out"][0] for n in "abc"] == [0.0, 2.0, 4.0]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_plant_in_python_in_a_process_of_its_own(tmp_path: Path, version: str) -> None:
    """Two Pythons then: the master's, and the one that the tool's library loads there."""
    path = swing(tmp_path, version)
    runs = [
        simulate(System({"p": FMU(path, isolated=isolated)}), step=0.01, stop=2.0)
        for isolated in (True, False)
    ]
    assert np.array_equal(runs[0]["p.x"], runs[1]["p.x"])
    assert np.ptp(runs[0]["p.x"]) > 1.0


def test_the_doctor_on_fmus_of_fmi_3_that_are_not_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """probe.h keeps its time over a reset and reads any value reference; pythonfmu steps backwards."""

    def findings(path: Path, *probes: str) -> dict[str, str]:
        with pytest.raises(SystemExit):
            main(["doctor", str(path), "--json", *(word for name in probes for word in ("--probe", name))])
        listed = json.loads(capsys.readouterr().out)["findings"]
        return {f["probe"]: f["level"] for f in listed if f["probe"] in probes}

    theirs = probe(tmp_path / "probe.fmu", "3.0")
    assert findings(theirs, "reset", "unknown value reference") == {
        "reset": "error",
        "unknown value reference": "crashed",
    }
    python = swing(tmp_path, "3.0")
    assert findings(python, "reset", "negative step") == {"reset": "ok", "negative step": "warning"}
