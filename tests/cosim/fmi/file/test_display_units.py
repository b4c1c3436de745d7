"""Start values with units, display units, relative quantities; results in other units."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import FMU, Block, FMUError, Input, Output, System, WiringError, simulate
from cosim.cli.inspection import inspection
from cosim.fmi.file.display_units import DisplayUnit, has_unit, without_units
from cosim.fmi.ports import FMUPort
from tests.cosim.fmi.probe import write_fmu

#: units with display units, of FMI 3.0; FMI 2.0 has no inverse ones
UNITS = """
<Unit name="rad"><DisplayUnit name="deg" factor="57.29577951308232"/></Unit>
<Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" factor="1" offset="-273.15"/></Unit>
<Unit name="s"><DisplayUnit name="rpm" factor="60" {inverse}/></Unit>
<Unit name="N/m"/><Unit name="gizmo"><DisplayUnit name="kilogizmo" factor="0.001"/></Unit>
"""
#: name, attributes, causality
VARIABLES = [
    ("angle", 'unit="rad" displayUnit="deg"', "parameter"),
    ("temperature", 'unit="K" displayUnit="degC"', "parameter"),
    ("difference", 'unit="K" relativeQuantity="true"', "parameter"),
    ("period", 'unit="s"', "parameter"),
    ("k", 'unit="N/m"', "parameter"),
    ("own", 'unit="gizmo"', "parameter"),
    ("typed", 'declaredType="Span"', "parameter"),
    ("plain", "", "parameter"),
    ("dT", 'unit="K" relativeQuantity="true"', "input"),
    ("T", 'unit="K"', "input"),
]


def fmu_with_units(path, version):
    """Value references of probe.h that keep their values."""
    rows = ""
    for i, (name, attributes, causality) in enumerate(VARIABLES):
        general = f'name="{name}" valueReference="{46 + i}" causality="{causality}" '
        general += f'variability="{"continuous" if causality == "input" else "fixed"}"'
        if version == "2.0":
            rows += f'<ScalarVariable {general}><Real {attributes} start="0"/></ScalarVariable>'
        else:
            rows += f'<Float64 {general} {attributes} start="0"/>'
    span = 'unit="K" displayUnit="degC" relativeQuantity="true"'
    if version == "2.0":
        head, inverse = 'fmiVersion="2.0" modelName="units" guid="units"', ""
        types = f'<SimpleType name="Span"><Real {span}/></SimpleType>'
    else:
        head, inverse = 'fmiVersion="3.0" modelName="units" instantiationToken="units"', 'inverse="true"'
        types = f'<Float64Type name="Span" {span}/>'
        rows += '<Float64 name="time" valueReference="0" causality="independent"/>'
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription {head}><CoSimulation modelIdentifier="units"/>
<UnitDefinitions>{UNITS.format(inverse=inverse)}</UnitDefinitions>
<TypeDefinitions>{types}</TypeDefinitions>
<ModelVariables>{rows}</ModelVariables><ModelStructure/></fmiModelDescription>"""
    sources = ["probe2.c"] if version == "2.0" else ["probe3.c", "rest3.c"]
    return write_fmu(path, text, "units", *sources)


@pytest.fixture(params=["2.0", "3.0"])
def path(tmp_path, request):
    return fmu_with_units(tmp_path / "units.fmu", request.param)


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("angle", "90 deg", math.pi / 2),  # the FMU's display unit
        ("angle", "-1.5e0rad", -1.5),
        ("angle", "0.25 turn", math.pi / 2),  # pint's
        ("temperature", "20 degC", 293.15),
        ("temperature", "68 degF", 293.15),
        ("difference", "20 degC", 20.0),  # no offset
        ("typed", "20 degC", 20.0),  # its type is relative
        ("k", "2 kN/m", 2000.0),
        ("k", " .5 N/mm ", 500.0),
        ("own", "3 kilogizmo", 3000.0),  # pint knows no gizmo
        ("own", "3 gizmo", 3.0),
        ("period", "20 ms", 0.02),
        ("plain", 4.0, 4.0),
    ],
)
def test_start_values_with_units(path, name, text, value):
    [found] = FMU(path, start={name: text}).start_values()[name]
    assert found == pytest.approx(value, rel=1e-14)  # the factor is that of the file, 16 digits


def test_inverse_display_units(tmp_path):
    """shown = factor / value: 1200 rpm are a period of 60 / 1200 s."""
    path = fmu_with_units(tmp_path / "u.fmu", "3.0")
    assert validate_fmu(str(path)) == []
    assert FMU(path, start={"period": "1200 rpm"}).start_values()["period"] == [60.0 / 1200.0]
    with pytest.raises(FMUError, match="rpm is the inverse of s times 60, which no value can be"):
        FMU(path, start={"period": "0 rpm"})


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ({"angle": "3 m"}, r"'m' .* is not convertible to 'rad' .* \(display units of the FMU: deg\)"),
        ({"angle": "3 foo"}, "unit 'foo' is not known"),
        ({"angle": "thirty deg"}, "'thirty deg' must be a number with a unit"),
        ({"angle": "30"}, "give others as floats"),
        ({"plain": "3 m"}, "the variable has no unit; give the number alone"),
    ],
)
def test_texts_that_are_refused(path, start, words):
    with pytest.raises(FMUError, match=words):
        FMU(path, start=start)


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e12, 1e12), st.sampled_from(["deg", " deg ", "rad", "\tmrad"]))
def test_any_number_is_read(number, unit):
    """repr of a float is read back, with any unit after it; other texts are refused."""
    units = [
        SimpleNamespace(name="rad", baseUnit=None, displayUnits=[DisplayUnit("deg", factor=180.0 / math.pi)])
    ]
    port = FMUPort("", "x", (), "rad", type="Float64")
    factor = {"deg": math.pi / 180.0, "rad": 1.0, "mrad": 1e-3}[unit.strip()]
    read = without_units("f", port, units, f"{number!r}{unit}")
    assert read == pytest.approx(number * factor, rel=1e-14)
    assert has_unit(f"{number!r}{unit}")
    for text in (f"{number!r} {number!r}", f"{unit}{number!r}", f"{number!r}"):
        assert not has_unit(text)


class Warm(Block):
    """A temperature, and a length."""

    T = Output(unit="degC")
    x = Output(unit="m")

    def step(self, t, h):
        self.T = 20.0
        self.x = t


class Look(Block):
    """What comes in goes out."""

    T = Input(unit="K")
    y = Output(unit="K")

    def step(self, t, h):
        self.y = self.T


def test_a_relative_quantity_has_no_offset_on_a_connection(path):
    system = System({"w": Warm(), "f": FMU(path), "l": Look()})
    for target in ("f.dT", "f.T", "l.T"):
        system.connect("w.T", target)
    result = simulate(system, step=0.5, stop=1.0, record=["f.dT", "f.T", "l.y", "w.x"])
    assert result["f.dT"][-1] == 20.0
    assert result["f.T"][-1] == result["l.y"][-1] == pytest.approx(293.15, rel=1e-15)
    assert list(result.in_unit("w.x", "mm")) == [0.0, 500.0, 1000.0]
    assert np.allclose(result.in_unit("l.y", "degC"), 20.0, atol=1e-12)
    with pytest.raises(WiringError, match=r"w\.x in m: 'm' .* is not convertible to 's'"):
        result.in_unit("w.x", "s")


def test_inspection_shows_display_units(path):
    rows = {line.split()[0]: line.split() for line in inspection(path).splitlines() if line}
    assert rows["variable"][3:6] == ["unit", "start", "display"]
    assert rows["angle"][3:6] == ["rad", "0", "deg"]
    assert rows["typed"][3:6] == ["K", "0", "degC"]
    assert rows["k"][3:6] == ["N/m", "0", "-"]
