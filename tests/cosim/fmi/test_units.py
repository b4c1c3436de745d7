"""Units that an FMU defines: converted by their definitions, on connections and at the start."""

from __future__ import annotations

import pytest

from cosim import FMU, Block, Input, Output, Result, System, WiringError, simulate
from tests.cosim.fmi.probe import description2, description3, write_fmu

SOURCES = {"2.0": ("probe2.c",), "3.0": ("probe3.c", "rest3.c")}
VERSIONS = pytest.mark.parametrize("version", ["2.0", "3.0"])


def wire(unit: str) -> Block:
    """Return a block y = x whose ports have a unit."""

    class Wire(Block):
        x = Input(unit=unit, start=3.0)
        y = Output(unit=unit)

        def step(self, t, h):
            self.y = self.x

    return Wire()


def with_unit(path, version, name, base):
    """Write the probe, r_out = 2 r_in, with another unit in place of N."""
    text = (description2 if version == "2.0" else description3)(False)
    text = text.replace('<Unit name="N"><BaseUnit kg="1" m="1" s="-2"/>', f'<Unit name="{name}">{base}')
    return write_fmu(path, text.replace('unit="N"', f'unit="{name}"'), "probe", *SOURCES[version])


@VERSIONS
@pytest.mark.parametrize(
    ("name", "base", "unit", "scale"),
    [
        ("force_unit", '<BaseUnit kg="1" m="1" s="-2"/>', "N", 1.0),
        ("ton", '<BaseUnit kg="1" factor="1000"/>', "kg", 1000.0),  # by its name 907.18 kg
        ("mm", '<BaseUnit m="1"/>', "m", 1.0),  # by its name 0.001 m
    ],
)
def test_connections_are_converted_by_definition(tmp_path, version, name, base, unit, scale):
    fmu = FMU(with_unit(tmp_path / "p.fmu", version, name, base))
    system = System({"source": wire(unit), "p": fmu, "sink": wire(unit)})
    system.connect("source.y", "p.r_in")
    system.connect("p.r_out", "sink.x")
    result = simulate(system, step=0.5, stop=1.0, record=["p.r_out", "sink.y"])
    # the input is held from the first step on; at t_0 the FMU has its start value of 0.5
    assert result["p.r_out"].tolist() == [1.0, 6.0 / scale, 6.0 / scale]
    assert result["sink.y"].tolist() == [scale, 6.0, 6.0]


@VERSIONS
def test_two_fmus_may_mean_different_units_by_one_name(tmp_path, version):
    large = with_unit(tmp_path / "a.fmu", version, "ton", '<BaseUnit kg="1" factor="1000"/>')
    small = with_unit(tmp_path / "b.fmu", version, "ton", '<BaseUnit kg="1" factor="500"/>')
    system = System({"a": FMU(large), "b": FMU(small)}, [("a.r_out", "b.r_in")])
    assert (system.connections[0].scale, system.connections[0].offset) == (2.0, 0.0)


@VERSIONS
def test_a_unit_of_another_kind_is_refused(tmp_path, version):
    path = with_unit(tmp_path / "p.fmu", version, "force_unit", '<BaseUnit kg="1" m="1" s="-2"/>')
    with pytest.raises(WiringError, match=r"p\.r_out \[force_unit\] -> sink\.x \[m\]: .*kg m s\^-2"):
        System({"p": FMU(path), "sink": wire("m")}, [("p.r_out", "sink.x")])


@VERSIONS
def test_start_values_are_converted_by_definition(tmp_path, version):
    path = with_unit(tmp_path / "p.fmu", version, "ton", '<BaseUnit kg="1" factor="1000"/>')
    assert FMU(path, start={"r_in": "500 kg"}).start_values() == {"r_in": [0.5]}


@VERSIONS
def test_results_are_converted_by_definition(tmp_path, version):
    fmu = FMU(with_unit(tmp_path / "p.fmu", version, "ton", '<BaseUnit kg="1" factor="1000"/>'))
    result = simulate(System({"p": fmu}), step=0.5, stop=0.5, record=["p.r_out"])
    result.save(tmp_path / "r.npz")
    for each in (result, Result.load(tmp_path / "r.npz")):
        assert each.in_unit("p.r_out", "kg").tolist() == [1000.0, 1000.0]  # r_out = 2 r_in = 1 ton
