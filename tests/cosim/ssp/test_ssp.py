"""SSPs of other tools: nested systems, signal dictionaries, units, mappings.

Expected values are worked out by hand beside each case. The participants are a gain u = K x
and an integrator x' = u, so that a lost factor, offset or step shows.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import FMU, CosimError, ModelExchange, System, read_ssp, simulate
from cosim.ssp import read_package
from tests.cosim.parts import Gain
from tests.cosim.ssp.packages import (
    GAIN,
    REAL,
    SPACES,
    SUM,
    TWO,
    binding,
    bindings,
    component,
    connection,
    parameters,
    system,
)


def value(path, port, **options):
    """The value of a port at t = 2 s, with steps of 1 s."""
    result = simulate(read_ssp(path, **options), step=1.0, stop=2.0)
    return float(result[port][-1])


def test_nested_systems_are_flattened(package):
    """Outer gain (2) -> system's input, doubled -> inner gain (-3) -> system's output -> integrator."""
    twice = '<ssc:LinearTransformation factor="2" offset="0.5"/>'
    inner = system(
        component("g.1", "Gain", GAIN, bindings(binding(parameters(K=-3.0)))),
        connection("y", "g.1.u") + connection("in", "g.1.x", twice),  # an end may be the start
        before='<ssd:Connectors><ssd:Connector name="in" kind="input"/>'
        '<ssd:Connector name="y" kind="output"/></ssd:Connectors>',
        name="sub",
    )
    outer = component("g", "Gain", GAIN) + inner + component("sum", "Integrator", SUM)
    wiring = connection("g.u", "sub.in") + connection("sub.y", "sum.u") + connection("sum.y", "g.x")
    sets = bindings(binding(parameters(g__K=2.0, sum__x=1.0, none__such=3.0)))
    path = package(system(outer, wiring, before=sets))
    built = read_ssp(path)
    assert list(built.participants) == ["g", "sub_g_1", "sum"]
    assert [str(c) for c in built.connections] == [
        "sub_g_1.x <- g.u [* 2 + 0.5]",
        "sum.u <- sub_g_1.u",
        "g.x <- sum.y",
    ]
    # FMUs as FMUs, not as blocks: at t = 0 all outputs are those of initialization
    assert built.participants["g"].start_values() == {"K": [2.0]}
    assert built.participants["sub_g_1"].start_values() == {"K": [-3.0]}
    assert built.participants["sum"].start_values() == {"x": [1.0]}


def test_signal_dictionaries_join_what_refers_to_them(package):
    dictionary = (
        '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus">'
        f'<ssb:SignalDictionary version="1.0"><ssb:DictionaryEntry name="force">{REAL}'
        "</ssb:DictionaryEntry></ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"
    )

    def refer(name):
        inside = '<ssd:Connectors><ssd:Connector name="force" kind="inout"/></ssd:Connectors>'
        kind = "ssd:SignalDictionaryReference"
        return f'<{kind} name="{name}" dictionary="bus">{inside}</{kind}>'

    inner = system(
        component("sum", "Integrator", SUM) + refer("here"), connection("here.force", "sum.u"), name="sub"
    )
    elements = component("g", "Gain", GAIN) + inner + refer("there")
    path = package(system(elements, connection("g.u", "there.force"), after=dictionary))
    assert [str(c) for c in read_ssp(path).connections] == ["sub_sum.u <- g.u"]
    lost = package(system(component("g", "Gain", GAIN) + refer("there")))
    with pytest.raises(CosimError, match=r"it\.ssp: there: unknown signal dictionary 'bus'"):
        read_ssp(lost)


UNITS = (
    '<ssd:Units><ssc:Unit name="shove"><ssc:BaseUnit kg="1" m="1" s="-2" factor="250"/></ssc:Unit>'
    '<ssc:Unit name="nudge"><ssc:BaseUnit kg="1" m="1" s="-2" factor="0.5" offset="10"/></ssc:Unit>'
    '<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit></ssd:Units>'
)


@pytest.mark.parametrize(
    ("attributes", "inside", "expected"),
    [
        # 3 shove = 750 N = (750 - 10) / 0.5 nudge = 1480 nudge; then factor 2, offset 7
        ({}, "", 1480.0),
        ({}, '<ssc:LinearTransformation factor="2" offset="7"/>', 2967.0),
        ({"suppressUnitConversion": "true"}, '<ssc:LinearTransformation factor="2" offset="7"/>', 13.0),
        ({"suppressUnitConversion": "true"}, "", 3.0),
    ],
)
def test_units_are_those_that_the_file_defines(package, attributes, inside, expected):
    """Converted first, transformed then (SSP 1.0, 4.5.2); names that no library knows."""
    elements = component("g", "Gain", ["u output shove", "x input"]) + component(
        "h", "Gain", ["x input nudge", "u output"]
    )
    path = package(system(elements, connection("g.u", "h.x", inside, **attributes)), UNITS)
    connected = read_ssp(path).connections[0]
    assert connected.scale * 3.0 + connected.offset == pytest.approx(expected, rel=1e-15)


def test_units_that_differ_in_kind_are_refused(package):
    elements = component("g", "Gain", ["u output shove"]) + component("h", "Gain", ["x input m"])
    path = package(system(elements, connection("g.u", "h.x")), UNITS)
    with pytest.raises(CosimError, match=r"g\.u -> h\.x: 'shove' \(kg m s\^-2\) is not convertible to 'm'"):
        read_ssp(path)


def test_values_come_from_files_through_mappings_and_prefixes(package):
    """K of the file is in 1/10, as the mapping has it; a later binding wins, and one of the system."""
    ssm = (
        f'<ssm:ParameterMapping version="1.0" {SPACES}><ssm:MappingEntry source="h.gain" target="h.K">'
        '<ssc:LinearTransformation factor="0.1" offset="1"/></ssm:MappingEntry></ssm:ParameterMapping>'
    )
    files = {"resources/all.ssv": parameters(gain=30.0, K=8.0), "resources/my map.ssm": ssm}
    mapped = binding(
        '<ssd:ParameterMapping source="resources/my%20map.ssm"/>', source="resources/all.ssv", prefix="h."
    )
    elements = component("g", "Gain", GAIN, bindings(binding(parameters(K=5.0)), binding(parameters(K=6.0))))
    elements += component("h", "Gain", GAIN, bindings(binding(parameters(K=7.0))))
    path = package(system(elements, before=bindings(mapped)), files=files)
    found = {n: m.start_values() for n, m in read_ssp(path).participants.items()}
    assert found == {"g": {"K": [6.0]}, "h": {"K": [4.0]}}


def test_a_value_of_the_systems_input_arrives_at_what_it_feeds(package):
    """1500 N at the root, 1.5 kN at the block (offset 0.25 on the way); nothing else feeds it."""
    front = '<ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real unit="N"/></ssd:Connector>'
    front += "</ssd:Connectors>" + bindings(binding(parameters(**{"in": 1500.0})))
    units = '<ssd:Units><ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit></ssd:Units>'
    shifted = '<ssc:LinearTransformation factor="1" offset="0.25"/>'
    body = system(component("w", "Watch", ["p input"]), connection("in", "w.p", shifted), before=front)
    built = read_ssp(package(body, units))
    assert built.participants["w"].start_values() == {"p": [1.75]}
    assert built.connections == []


def test_values_of_all_types(package):
    given = (
        '<ssv:Parameter name="i_in"><ssv:Int32 value="-4"/></ssv:Parameter>'
        '<ssv:Parameter name="b_in"><ssv:Boolean value="false"/></ssv:Parameter>'
        '<ssv:Parameter name="e_in"><ssv:Enumeration value="on"/></ssv:Parameter>'
        '<ssv:Parameter name="label"><ssv:String value="a b"/></ssv:Parameter>'
        '<ssv:Parameter name="blob"><ssv:Binary value="00ff"/></ssv:Parameter>'
        '<ssv:Parameter name="n"><ssv:UInt64 value="3"/></ssv:Parameter>'
        '<ssv:Parameter name="v_in"><ssv:Float64 value="1 2 4"/><ssc:Dimension size="3"/></ssv:Parameter>'
    )
    inside = f"<ssv:Parameters>{given}</ssv:Parameters>"
    values = f'<ssv:ParameterSet version="2.0" name="s">{inside}</ssv:ParameterSet>'
    more = bindings(binding(values))
    path = package(system(component("p", "probe", ["r_in input"], more)), version="2.0")
    result = simulate(read_ssp(path), step=0.5, stop=1.0)
    last = {n: result[f"p.{n}"][-1] for n in ("i_out", "b_out", "e_out", "label_length", "blob_sum")}
    assert last == {"i_out": -3.0, "b_out": 1.0, "e_out": 2.0, "label_length": 3.0, "blob_sum": 255.0}
    assert result["p.v_out"].shape[1] == 3


def test_the_experiment_and_the_interface(package):
    chosen = component("s", "Integrator", SUM, implementation="ModelExchange")
    ends = '<ssd:DefaultExperiment startTime="1" stopTime="3"/>'
    found = read_package(package(system(chosen), ends))
    assert (found.experiment.start, found.experiment.stop, found.experiment.step) == (1.0, 3.0, None)
    assert found.system.participants["s"].interface == ModelExchange()
    with pytest.raises(CosimError, match=r"component g: Gain\.fmu: interface=ModelExchange is not avail"):
        read_ssp(package(system(component("g", "Gain", GAIN, implementation="ModelExchange"))))


def test_a_component_without_a_usable_fmu_can_be_replaced(package):
    """Its FMU is not even looked at."""
    gone = component("g", "gone", GAIN) + component("s", "Integrator", SUM)
    path = package(system(gone, connection("g.u", "s.u") + connection("s.y", "g.x")))
    with pytest.raises(CosimError, match=r"component g: the package has no file 'resources/gone\.fmu'"):
        read_ssp(path)
    # x' = -2 * 10 x held over 1 s: 1, -19, 361
    system_ = read_ssp(path, replace={"g": Gain()})
    system_.participants["s"] = FMU(system_.participants["s"].path, start={"x": 1.0})
    assert simulate(system_, step=1.0, stop=2.0)["s.x"].tolist() == [1.0, -19.0, 361.0]


def test_the_files_live_as_long_as_the_participants(package):
    import gc

    built = read_ssp(package(system(TWO)))
    path: Path = built.participants["g"].path
    other = System({"g": built.participants["g"]})
    del built
    gc.collect()
    assert path.is_file()
    assert np.isfinite(simulate(other, step=1.0, stop=1.0)["g.u"]).all()
    del other
    gc.collect()
    assert not path.exists()
