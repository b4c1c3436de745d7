"""Every error that an SSP file can cause in the reader: it says where, what, and the remedy."""

from __future__ import annotations

import zipfile

import pytest

from cosim import Block, CosimError, Input, read_ssp
from tests.cosim.parts import Gain
from tests.cosim.ssp.packages import GAIN, SPACES, TWO, binding, bindings, component, connection, system

MAPPING = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    "</ssc:BooleanMappingTransformation>"
)
REFUSED = [
    (system(TWO, connection("g.u", "h.u")), r"connection g\.u - h\.u: both connectors are outputs"),
    (system(TWO, connection("g.x", "h.x")), r"connection g\.x - h\.x: both connectors are inputs"),
    (system(TWO, connection("g.u", "k.x")), r"names the unknown element 'k' \(available: g, h\)"),
    (system(TWO, connection("g.uu", "h.x")), r"it\.ssp: g has no connector 'uu'.*did you mean 'u'"),
    (
        system(TWO, connection("g.u", "h.x") + connection("h.u", "h.x")),
        r"h\.x is fed by g\.u and by h\.u; an input has one source",
    ),
    (system(TWO, connection("g.u", "h.x", MAPPING)), r"a BooleanMappingTransformation is not supported"),
    (
        system(TWO + component("g", "Gain", GAIN)),
        r"the root system: the element name 'g' is empty or used twice",
    ),
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
        r"component s: '\.\./\.\./etc/passwd' is outside the package",
    ),
    (
        system('<ssd:Component name="s" source="https://example.org/a.fmu"/>'),
        r"'https://example\.org/a\.fmu' is outside the package",
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


def one(parameter, **more):
    """A gain, or another FMU, with one parameter."""
    values = f'<ssv:ParameterSet version="1.0" name="set">{inside(parameter)}</ssv:ParameterSet>'
    return system(component("g", more.get("fmu", "Gain"), GAIN, bindings(binding(values))))


def inside(parameter):
    return f"<ssv:Parameters>{parameter}</ssv:Parameters>"


def mapped(entry):
    """A gain whose parameter K comes through a mapping from the number or text of `set.ssv`."""
    mapping = f'<ssm:ParameterMapping version="1.0" {SPACES}>{entry}</ssm:ParameterMapping>'
    inner = f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping>"
    return system(component("g", "Gain", GAIN, bindings(binding(inner, source="set.ssv"))))


TEXT = '<ssv:Parameter name="K"><ssv:String value="a"/></ssv:Parameter>'
LINEAR = '<ssc:LinearTransformation factor="{}" offset="1"/>'
NOTE = '<ssd:Annotations><ssc:Annotation type="structcosim">{}</ssc:Annotation></ssd:Annotations>'
DELAY = '<structcosim:delay initial="1"/>'
EVERY = '<structcosim:participant kind="block" every="2.5"/>'


def connectors(*kinds):
    listed = "".join(f'<ssd:Connector name="{n}" kind="{k}"/>' for n, k in (k.split() for k in kinds))
    return f"<ssd:Connectors>{listed}</ssd:Connectors>"


def nested(wiring, outer="", kinds=("in input", "out output")):
    """A gain g, and a system sub with a gain in it."""
    sub = system(component("k", "Gain", GAIN), wiring, before=connectors(*kinds), name="sub")
    return system(component("g", "Gain", GAIN) + sub, outer)


#: possible in SSP, and not supported or not fitting
UNSUITABLE = [
    (
        system('<ssd:Component name="s" source=""/>'),
        r"component s has no FMU \(no source attribute\); give a replacement",
    ),
    (
        system(component("g", "Gain", GAIN, bindings("<ssd:ParameterBinding/>"))),
        r"parameter binding of g has neither a source nor values",
    ),
    (
        system(component("g", "Gain", GAIN, bindings(binding("", source="set.ssv", type="text/csv")))),
        r"parameter binding of g: type 'text/csv' is not supported; use SSV and SSM",
    ),
    (
        system(component("g", "Gain", GAIN, bindings(binding("", source="map.ssm")))),
        r"parameter binding of g: the root element of map\.ssm must be a ParameterSet",
    ),
    (
        mapped(f'<ssm:MappingEntry source="text" target="K">{LINEAR.format(2)}</ssm:MappingEntry>'),
        r"mapping of 'text': a LinearTransformation needs real numbers, and the value is of type String",
    ),
    (
        mapped(f'<ssm:MappingEntry source="text" target="K">{MAPPING}</ssm:MappingEntry>'),
        r"mapping of 'text': a BooleanMappingTransformation is not supported; use a LinearTransformation",
    ),
    (
        one('<ssv:Parameter name="e_in"><ssv:Enumeration value="onn"/></ssv:Parameter>', fmu="probe"),
        r"component g: e_in has no item 'onn'; did you mean 'on'",
    ),
    (
        nested(connection("in", "k.x", NOTE.format(DELAY)), connection("g.u", "sub.in")),
        r"g\.u -> sub\.in -> sub\.k\.x is delayed on a part of its way, .*; delay a direct connection",
    ),
    (system(component("g", "Gain", GAIN, NOTE.format(EVERY))), r"component g: '2\.5' must be a whole number"),
    (
        system(component("g", "Gain", GAIN, NOTE.format(EVERY.replace("2.5", "")))),
        r"component g: '' must be one whole number",
    ),
    (
        nested(connection("a", "b"), kinds=("a inout", "b inout")),
        r"connection sub\.a - sub\.b: both connectors are of kind inout",
    ),
    (
        nested(connection("in", "out"), connection("sub.out", "sub.in") + connection("sub.out", "g.x")),
        r"sub\.out feeds itself through connectors of systems",
    ),
    (system(component("g", "Gain", ["x input", "x output"])), r"it\.ssp: g has two connectors 'x'"),
]


@pytest.mark.parametrize(("body", "message"), UNSUITABLE, ids=range(len(UNSUITABLE)))
def test_what_does_not_fit_is_named(package, body, message):
    mapping = f'<ssm:ParameterMapping version="1.0" {SPACES}/>'
    texts = TEXT.replace('"K"', '"text"')
    text_set = f'<ssv:ParameterSet version="1.0" name="set" {SPACES}>{inside(texts)}</ssv:ParameterSet>'
    with pytest.raises(CosimError, match=message):
        read_ssp(package(body, files={"set.ssv": text_set, "map.ssm": mapping}, valid=False))


def test_a_unit_that_is_not_one_is_named(package):
    unit = '<ssd:Units><ssc:Unit name="nil"><ssc:BaseUnit factor="0"/></ssc:Unit></ssd:Units>'
    with pytest.raises(CosimError, match=r"unit 'nil': exponents, factor 0\.0 and offset 0\.0 must be"):
        read_ssp(package(system(TWO), unit))


#: broken in a way that the schemas refuse too
BROKEN = [
    ("", r"it\.ssp has no System element"),
    (system(TWO, connection("g.u", "h.x", LINEAR.format("two"))), r"g\.u - h\.x: 'two' must be numbers"),
    (system(TWO, connection("g.u", "h.x", LINEAR.format("1 2"))), r"g\.u - h\.x: '1 2' must be one number"),
    (one('<ssv:Parameter name="K"/>'), r"parameter 'K' has no value; give an element"),
    (one(TEXT.replace("String", "Integer")), r"parameter 'K': 'a' must be a whole number"),
    (one(TEXT.replace("String", "Binary")), r"parameter 'K': 'a' must be hexadecimal digits"),
    (one(TEXT.replace("String", "Complex")), r"parameter 'K': type Complex is not supported"),
    (
        one(TEXT.replace("</ssv:P", '<ssc:Dimension size="two"/></ssv:P')),
        r"parameter 'K': dimensions \['two'\] must be whole numbers",
    ),
    (
        one(TEXT.replace("</ssv:P", '<ssc:Dimension size="3"/></ssv:P')),
        r"parameter 'K' has 1 values for dimensions \[3\]",
    ),
    (
        system(TWO, connection("g.u", "h.x", startIndices="0 1")),
        r"g\.u: indices \['0', '1'\] must be whole numbers from 1",
    ),
    (system(component("g", "Gain", ["x sideways"])), r"g, connector 'x': kind 'sideways' is not known"),
    (system(TWO + '<ssd:Wire name="w"/>'), r"it\.ssp: w: <.*Wire> is not an element of SSP"),
    (
        nested(
            connection("in", "k.x"),
            connection("g.u", "sub.in", endIndices="1") + connection("g.u", "sub.in", endIndices="2"),
        ),
        r"sub\.in is fed element by element and read as a whole",
    ),
]


@pytest.mark.parametrize(("body", "message"), BROKEN, ids=range(len(BROKEN)))
def test_what_is_broken_is_named(package, body, message):
    with pytest.raises(CosimError, match=message):
        read_ssp(package(body, valid=False))


class Sized(Block):
    """A block that cannot be made without a size."""

    u = Input(shape="n")

    def step(self, t, h):
        pass


def test_replacements_that_do_not_fit_are_named(package):
    path = package(system(TWO, connection("g.u", "h.x")))
    with pytest.raises(CosimError, match=r"it\.ssp has no component 'k' \(available: g, h\)"):
        read_ssp(path, replace={"k": Gain()})
    with pytest.raises(CosimError, match=r"it\.ssp: g is replaced by a Sized: Sized: size n is not known"):
        read_ssp(path, replace={"g": Sized})
    words = r"g\.u -> h\.x \(g is replaced by a Sized, ports: u\): g\.u is an input, not an output"
    with pytest.raises(CosimError, match=words):
        read_ssp(path, replace={"g": Sized(n=2)})


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
    with pytest.raises(CosimError, match=r"has SSP version 3\.0; versions 1\.0 and 2\.0 are supported"):
        read_ssp(package(system(TWO), version="3.0", valid=False))
    with pytest.raises(CosimError, match=r"SystemStructure\.ssd is not valid XML"):
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
