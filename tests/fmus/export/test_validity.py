"""Exported FMUs pass other projects' checkers; structure, units and reference result are right."""

from __future__ import annotations

import csv
import io
import subprocess
import sysconfig
import zipfile
from collections.abc import Callable
from hashlib import sha3_256
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from lxml import etree

from cosim import Block, Continuous, Input, Output, Parameter, State
from fmus.export import DefaultExperiment, ExportError, export
from fmus.export.description import unit_definition
from fmus.export.fmu import FMI_VERSIONS
from tests.fmus.export.host import PARTICIPANTS, Accumulator, building

EVERY_FMU = [(name, version) for name in PARTICIPANTS for version in FMI_VERSIONS]
REFERENCE = "extra/org.fmi-standard.fmi-ls-ref/"


@pytest.mark.parametrize(("name", "version"), EVERY_FMU)
def test_fmpy_and_fmutool_find_nothing(fmu_of: Callable[..., Path], name: str, version: str) -> None:
    path = fmu_of(name, version)
    assert validate_fmu(str(path)) == []
    fmutool = Path(sysconfig.get_path("scripts")) / "fmutool"
    done = subprocess.run([fmutool, "-input", path, "-check"], capture_output=True, text=True, check=True)
    said = done.stdout + done.stderr
    assert f"compliant with FMI-{version}" in said
    assert "No semantic error" in said
    assert "ERROR" not in said
    assert "WARNING" not in said


def _reference(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        names = [n for n in archive.namelist() if n.startswith(REFERENCE)]
        return {n.removeprefix(REFERENCE): archive.read(n) for n in names}


def _table(data: bytes) -> tuple[list[str], np.ndarray]:
    rows = list(csv.reader(io.StringIO(data.decode())))
    return rows[0], np.array(rows[1:], dtype=float)


@pytest.mark.parametrize("name", PARTICIPANTS)
def test_the_reference_result_is_what_fmpy_simulates(fmu_of: Callable[..., Path], name: str) -> None:
    path = fmu_of(name)
    files = _reference(path)
    experiment = etree.fromstring(files["experiments.xml"])[0].attrib
    header, reference = _table(files["reference.csv"])
    inputs, stimuli = _table(files["stimuli.csv"])
    again = simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        start_time=float(experiment["startTime"]),
        stop_time=float(experiment["stopTime"]),
        output_interval=float(experiment["stepSize"]),
        input=np.rec.fromarrays(stimuli.T, names=inputs),
        output=header[1:],
    )
    assert reference.shape == (101, len(header))
    for i, n in enumerate(header):
        assert np.array_equal(reference[:, i], again[n])  # repr and float are inverse: not a digit is lost
    assert np.ptp(reference[:, 1:], axis=0).max() > 0.0  # and something happens in it


@pytest.mark.parametrize(("name", "version"), EVERY_FMU)
def test_the_manifest_lists_every_file_with_its_checksum(
    fmu_of: Callable[..., Path], name: str, version: str
) -> None:
    files = _reference(fmu_of(name, version))
    listed = {e.get("source"): e for e in etree.fromstring(files.pop("fmi-ls-manifest.xml"))}
    assert set(listed) == set(files) == {"reference.csv", "stimuli.csv", "experiments.xml"}
    for source, element in listed.items():
        assert element.get("checksum") == sha3_256(files[source]).hexdigest()


@pytest.mark.parametrize("name", PARTICIPANTS)
def test_both_versions_of_fmi_compute_the_same_bits(fmu_of: Callable[..., Path], name: str) -> None:
    first, *others = (_reference(fmu_of(name, version))["reference.csv"] for version in FMI_VERSIONS)
    assert others
    assert all(other == first for other in others)


def _dependencies(path: Path) -> dict[str, set[str]]:
    description = read_model_description(str(path))
    return {
        u.variable.name: {d.name for d in u.dependencies}
        for u in [*description.outputs, *description.derivatives]
    }


def test_dependencies_are_exact_by_element(fmu_of: Callable[..., Path]) -> None:
    found = _dependencies(fmu_of("building"))
    floor_1 = {"x[1]", "x[2]", "v[1]", "v[2]", "v[3]", "force[1]"}
    full_damping = {"v[1]", "v[2]", "v[3]"}  # C of modal damping has no zeros
    assert found["relative_acceleration[1]"] == floor_1 | full_damping | {"ground_acceleration"}
    assert found["acceleration[1]"] == floor_1 | full_damping  # (y - a_g) + a_g does not depend on a_g
    assert found["drift[1]"] == {"x[1]"}
    assert found["drift[3]"] == {"x[2]", "x[3]"}
    assert found["base_shear"] == {"x[1]"}
    assert found["x[2]"] == {"x[2]"}
    assert found["der(x[2])"] == {"v[2]"}
    assert found["der(v[3])"] == {"x[2]", "x[3]", "force[3]", "ground_acceleration"} | full_damping


def test_parameters_count_when_initialisation_ends(fmu_of: Callable[..., Path]) -> None:
    description = read_model_description(str(fmu_of("building")))
    initial = {u.variable.name: {d.name for d in u.dependencies} for u in description.initialUnknowns}
    assert initial["drift[1]"] == {"x[1]"}
    assert initial["base_shear"] == {"x[1]", "k[1]"}
    assert initial["acceleration[3]"] >= {"m[3]", "k[3]", "x[2]", "x[3]"}
    assert not initial["acceleration[3]"] & {"m[1]", "m[2]", "k[1]", "k[2]"}


class Saturated(Continuous):
    """A comparison of numbers: the dependencies are those of the source, a superset"""

    u = Input(shape=2)
    x = State(shape=2)
    y = Output(shape=2)
    z = Output()

    def derivatives(self, t: float) -> None:
        for i in range(2):
            self.der_x[i] = self.u[i] - self.x[i]

    def outputs(self, t: float) -> None:
        for i in range(2):
            self.y[i] = min(max(self.x[i], -1.0), 1.0)
        self.z = 3.0


def test_branches_leave_the_answer_by_variable(tmp_path: Path) -> None:
    found = _dependencies(export(Saturated(), tmp_path / "s.fmu"))
    assert found["y[1]"] == {"x[1]", "x[2]"}
    assert found["z"] == set()


def test_outputs_of_a_block_are_held(fmu_of: Callable[..., Path]) -> None:
    """A block computes in a step; between steps no input changes an output."""
    assert set(map(frozenset, _dependencies(fmu_of("accumulator")).values())) == {frozenset()}


def test_variables_of_a_block(fmu_of: Callable[..., Path]) -> None:
    description = read_model_description(str(fmu_of("accumulator")))
    assert description.modelExchange is None
    names = [v.name for v in description.modelVariables]
    assert names[:3] == ["u[1]", "u[2]", "u[3]"]
    assert names[-1] == "K[2,3]"
    K = {v.name: v for v in description.modelVariables}["K[2,1]"]
    assert (K.unit, K.max, float(K.start), K.causality, K.variability) == (
        "N/m",
        "10.0",
        4.0,
        "parameter",
        "fixed",
    )


def test_fixed_parameters_and_locals_are_not_listed(fmu_of: Callable[..., Path]) -> None:
    names = {v.name.split("[")[0] for v in read_model_description(str(fmu_of("building"))).modelVariables}
    assert not names & {"C", "hold_A", "hold_B", "hold_step"}


def test_every_variable_with_a_unit_has_it_defined_in_base_units(fmu_of: Callable[..., Path]) -> None:
    description = read_model_description(str(fmu_of("oscillator")))
    units = {u.name: u.baseUnit for u in description.unitDefinitions}
    assert all(v.unit in units for v in description.modelVariables)
    derivative = next(v for v in description.modelVariables if v.name == "der(v)")
    assert derivative.unit == "m/s^2"
    assert (units["N*s/m"].kg, units["N*s/m"].m, units["N*s/m"].s) == (1, 0, -1)


@pytest.mark.parametrize(
    ("unit", "exponents", "factor", "offset"),
    [
        ("kN*s/m", {"kg": 1, "s": -1}, 1000.0, 0.0),
        ("rad/s", {"rad": 1, "s": -1}, 1.0, 0.0),
        ("degC", {"K": 1}, 1.0, 273.15),
        ("cm", {"m": 1}, 0.01, 0.0),
        ("1", {}, 1.0, 0.0),
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0, 0.0),
    ],
)
def test_units_in_base_units(unit: str, exponents: dict[str, int], factor: float, offset: float) -> None:
    assert unit_definition(unit) == (exponents, factor, offset)


@pytest.mark.parametrize(
    ("unit", "says"), [("fathomless", "not known"), ("m^0.5", "power 0.5"), ("bit", "'bit'")]
)
def test_units_that_fmi_cannot_say(unit: str, says: str) -> None:
    with pytest.raises(ExportError, match=says):
        unit_definition(unit)


class Interpreted(Block):
    """Runs as Python"""

    compiled = False
    y = Output()

    def step(self, t: float, h: float) -> None:
        self.y = float(str(t))


@pytest.mark.parametrize(
    ("participant", "options", "says"),
    [
        (
            building,
            {"platforms": ["sparc-solaris"]},
            "platform 'sparc-solaris' is not known; choose from x86_64-linux",
        ),
        (building, {"platforms": []}, "at least one"),
        (building, {"fmi_version": "1.0"}, "FMI version '1.0' is not supported"),
        (building, {"experiment": DefaultExperiment(0.0, 1.0, -0.1)}, "step must be above zero"),
        (building, {"interfaces": ["ScheduledExecution"]}, "no interface 'ScheduledExecution'"),
        (building, {"interfaces": []}, "interfaces is empty"),
        (lambda: Accumulator(m=2, n=3), {"interfaces": ["ModelExchange"]}, "choose from CoSimulation"),
        (Interpreted, {}, "compiled = False"),
    ],
)
def test_what_cannot_be_exported_says_why(
    tmp_path: Path, participant: Callable[[], Block], options: dict[str, object], says: str
) -> None:
    with pytest.raises(ExportError, match=says):
        export(participant(), tmp_path / "no.fmu", **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("version", FMI_VERSIONS)
def test_one_interface_only(tmp_path: Path, version: str) -> None:
    path = export(building(), tmp_path / "me.fmu", interfaces=["ModelExchange"], fmi_version=version)
    description = read_model_description(str(path))
    assert description.coSimulation is None
    assert description.modelExchange is not None
    assert validate_fmu(str(path)) == []
    assert len(_reference(path)["reference.csv"].splitlines()) == 102


class Tabulated(Continuous):
    """A baked table of 200,000 numbers"""

    table = Parameter(0.0, "large", shape="n", fixed=True)
    u = Input()
    x = State()
    y = Output()

    def derivatives(self, t: float) -> None:
        self.der_x = self.u

    def outputs(self, t: float) -> None:
        self.y = self.x + self.table[self.table.shape[0] - 1]


def test_a_large_record_is_baked_in(tmp_path: Path) -> None:
    path = export(Tabulated(table=np.arange(200_000.0)), tmp_path / "large.fmu")
    result = simulate_fmu(str(path), stop_time=0.1, output_interval=0.1, start_values={"x": 0.5})
    assert result["y"][-1] == 199_999.5
    assert len(read_model_description(str(path)).modelVariables) == 4  # u, y, x and der(x)
