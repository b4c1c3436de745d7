"""SSPs that others write: nested systems, signal dictionaries, units, mappings; and what is refused.

Expected values are worked out by hand beside each case. The participants are a gain u = K x
and an integrator x' = u, so that a lost factor, offset or step shows.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim import FMU, CosimError, ModelExchange, System, read_ssp, simulate
from cosim.ssp import read_package
from cosim.ssp.format import NAMESPACES
from fmus.export import export
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Gain, Integrator
from tests.fmus.packaging.ssp_parts import Damper, Watch, schema

SPACES = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
REAL = "<ssc:Real/>"


def component(name, source, connectors, more="", **attributes):
    """A component; connectors are "name kind [unit]"."""
    listed = ""
    for text in connectors:
        name_, kind, *unit = text.split()
        given = f' unit="{unit[0]}"' if unit else ""
        listed += f'<ssd:Connector name="{name_}" kind="{kind}"><ssc:Real{given}/></ssd:Connector>'
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return (
        f'<ssd:Component name="{name}" source="resources/{source}.fmu"{extra}>'
        f"<ssd:Connectors>{listed}</ssd:Connectors>{more}</ssd:Component>"
    )


def connection(start, end, inside="", **attributes):
    """A connection between "element.connector" or "connector", of the system itself."""
    text = ""
    for which, where in (("start", start), ("end", end)):
        element, _, name = where.rpartition(".")
        text += f' {which}Element="{element}"' if element else ""
        text += f' {which}Connector="{name}"'
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return f"<ssd:Connection{text}{extra}>{inside}</ssd:Connection>"


def system(elements, connections="", before="", after="", name="top"):
    joined = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    inside = f"{before}<ssd:Elements>{elements}</ssd:Elements>{joined}{after}"
    return f'<ssd:System name="{name}">{inside}</ssd:System>'


def parameters(**values):
    """A parameter set of reals, in place."""
    listed = "".join(
        f'<ssv:Parameter name="{n.replace("__", ".")}"><ssv:Real value="{v}"/></ssv:Parameter>'
        for n, v in values.items()
    )
    inside = f"<ssv:Parameters>{listed}</ssv:Parameters>"
    return f'<ssv:ParameterSet version="1.0" name="set" {SPACES}>{inside}</ssv:ParameterSet>'


def binding(inside="", **attributes):
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    values = f"<ssd:ParameterValues>{inside}</ssd:ParameterValues>" if "source" not in attributes else inside
    return f"<ssd:ParameterBinding{extra}>{values}</ssd:ParameterBinding>"


def bindings(*each):
    return f"<ssd:ParameterBindings>{''.join(each)}</ssd:ParameterBindings>"


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    made = {kind.__name__: export(kind(), folder / f"{kind.__name__}.fmu") for kind in (Gain, Integrator)}
    made |= {kind.__name__: export(kind(), folder / f"{kind.__name__}.fmu") for kind in (Damper, Watch)}
    made["probe"] = probe(folder / "probe.fmu", "3.0")
    return made


@pytest.fixture
def package(tmp_path, fmus):
    """Write an SSP: valid by the schema unless it is meant not to be."""

    def write(body, after="", files=None, version="1.0", valid=True):
        text = (
            f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="it">{body}{after}'
            "</ssd:SystemStructureDescription>"
        )
        if valid:
            from lxml import etree

            schema(version, "Description").assertValid(etree.fromstring(text))
        path = tmp_path / "it.ssp"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("SystemStructure.ssd", text)
            for name, data in (files or {}).items():
                archive.writestr(name, data)
            for name, fmu in fmus.items():
                archive.write(fmu, f"resources/{name}.fmu")
        return path

    return write


GAIN = ["x input", "u output"]
SUM = ["u input", "x output", "y output"]


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
    with pytest.raises(CosimError, match=r"it\.ssp: there: there is no signal dictionary 'bus'"):
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
        (
            {"suppressUnitConversion": "true"},
            '<ssc:LinearTransformation factor="2" offset="7"/>',
            13.0,
        ),
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


TWO = component("g", "Gain", GAIN) + component("h", "Gain", GAIN)
MAPPING = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    "</ssc:BooleanMappingTransformation>"
)
REFUSED = [
    (system(TWO, connection("g.u", "h.u")), r"connection g\.u - h\.u: both connectors give a value"),
    (system(TWO, connection("g.x", "h.x")), r"connection g\.x - h\.x: both connectors take one"),
    (system(TWO, connection("g.u", "k.x")), r"names the element 'k' \(available: g, h\)"),
    (system(TWO, connection("g.uu", "h.x")), r"it\.ssp: g has no connector 'uu'.*did you mean 'u'"),
    (
        system(TWO, connection("g.u", "h.x") + connection("h.u", "h.x")),
        r"h\.x is fed by g\.u and by h\.u; an input has one source",
    ),
    (system(TWO, connection("g.u", "h.x", MAPPING)), r"a BooleanMappingTransformation is not supported"),
    (system(TWO + component("g", "Gain", GAIN)), r"the root system has two elements 'g'"),
    (
        system(component("a.b", "Gain", GAIN) + component("a_b", "Gain", GAIN)),
        r"a\.b and a_b would both be 'a_b'; rename one",
    ),
    (
        system(component("s", "Gain", GAIN, type="application/x-ssp-package")),
        r"component s is of type application/x-ssp-package, which is not supported",
    ),
    (
        system('<ssd:Component name="s" source="../../etc/passwd"/>'),
        r"component s: '\.\./\.\./etc/passwd' is outside of the package",
    ),
    (
        system('<ssd:Component name="s" source="https://example.org/a.fmu"/>'),
        r"'https://example\.org/a\.fmu' is outside of the package",
    ),
    (
        system(
            component("g", "Gain", ["K parameter"]) + component("k", "Gain", GAIN), connection("k.u", "g.K")
        ),
        r"k\.u -> g\.K connects a parameter to another component",
    ),
    (
        system(component("g", "Gain", ["x input", "z output"]), connection("g.z", "g.x")),
        r"g\.z -> g\.x: g has no output 'z'",
    ),
    (
        system(component("g", "Gain", GAIN, bindings(binding("", source="resources/no.ssv")))),
        r"parameter binding of g: the package has no file 'resources/no\.ssv'",
    ),
    (
        system(component("g", "Gain", GAIN, bindings(binding("", source="K.ssv", sourceBase="component")))),
        r"sourceBase 'component' is not supported",
    ),
]


@pytest.mark.parametrize(("body", "message"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_not_supported_is_named(package, body, message):
    with pytest.raises(CosimError, match=message):
        read_ssp(package(body))


def test_files_that_are_no_ssp(package, tmp_path):
    with pytest.raises(CosimError, match=r"there is no file .*none\.ssp"):
        read_ssp(tmp_path / "none.ssp")
    (tmp_path / "text.ssp").write_text("text")
    with pytest.raises(CosimError, match="is not an SSP: it is not a ZIP archive"):
        read_ssp(tmp_path / "text.ssp")
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w") as archive:
        archive.writestr("a.txt", "")
    with pytest.raises(CosimError, match=r"is not an SSP: it has no SystemStructure\.ssd at its top"):
        read_ssp(tmp_path / "empty.ssp")
    with pytest.raises(CosimError, match=r"has SSP version 3\.0; 1\.0 and 2\.0 are supported"):
        read_ssp(package(system(TWO), version="3.0", valid=False))
    with pytest.raises(CosimError, match=r"SystemStructure\.ssd is broken XML"):
        read_ssp(package("<ssd:System", valid=False))


def test_an_archive_that_leads_outside_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "slip.ssp", "w") as archive:
        archive.writestr("../evil.fmu", "")
        archive.writestr("SystemStructure.ssd", "")
    with pytest.raises(CosimError, match=r"'\.\./evil\.fmu' in it leads out of the folder"):
        read_ssp(tmp_path / "slip.ssp")


def test_entities_are_not_expanded(tmp_path):
    bomb = '<!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
    text = f'{bomb}<ssd:SystemStructureDescription {SPACES} version="1.0" name="&b;"/>'
    with zipfile.ZipFile(tmp_path / "bomb.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
    with pytest.raises(CosimError, match="document type declaration"):
        read_ssp(tmp_path / "bomb.ssp")


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
