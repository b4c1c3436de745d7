"""Any file named .fmu gives an FMU or an FMUError: nothing else is raised, nothing is written elsewhere.

Exported FMUs and those of c/probe.h are changed at random: as bytes, as archives, as XML. Their
binaries are a few bytes of text, because nothing is loaded here.
"""

from __future__ import annotations

import io
import tempfile
import zipfile
from copy import deepcopy
from functools import cache
from pathlib import Path

import fmpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from cosim import FMU, FMUError, Input, LinearContinuous, Output, State
from cosim.cli.inspection import inspection
from fmus.export import export
from tests.cosim.fmi.probe import description2, description3

EXAMPLES = 550  # of each of the four kinds: 2,200 in all


class Pair(LinearContinuous):
    """Arrays, units and a feedthrough, so that every element of a model description occurs."""

    u = Input("force", unit="N", shape=2)
    x = State([0.5, -0.2], "state", shape=2)
    y = Output("output", unit="N", shape=2)

    def derivatives(self, t):
        self.der_x[0] = self.u[0] - self.x[1]
        self.der_x[1] = self.u[1] - self.x[0]

    def outputs(self, t):
        self.y[0] = self.u[0]
        self.y[1] = self.x[1]


@cache
def originals() -> tuple[dict[str, bytes], ...]:
    """The files of four sound FMUs, by path."""
    found = []
    for version, folder in (("2.0", fmpy.platform), ("3.0", fmpy.platform_tuple)):
        library = f"binaries/{folder}/probe{fmpy.sharedLibraryExtension}"
        text = (description2 if version == "2.0" else description3)(False)
        found.append({"modelDescription.xml": text.encode(), library: b"no library"})
        with tempfile.TemporaryDirectory() as place:
            path = export(Pair(), Path(place) / "pair.fmu", fmi_version=version)
            with zipfile.ZipFile(path) as archive:
                files = {n: archive.read(n) for n in archive.namelist()}
        found.append({n: b"no library" if n.startswith("binaries/") else files[n][:9000] for n in files})
    return tuple(found)


def packed(entries: list[tuple[str, bytes]], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, content in entries:
            entry = zipfile.ZipInfo(name or "\0")
            entry.compress_type = compression
            archive.writestr(entry, content)
    return out.getvalue()


@pytest.fixture(scope="module")
def outer(tmp_path_factory):
    """A folder in whose innermost folder FMUs are unpacked; nothing else may appear in it."""
    folder = tmp_path_factory.mktemp("outer")
    (folder / "a" / "b").mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(folder / "a" / "b"))
        yield folder


def taken(outer: Path, content: bytes) -> bool:
    """Return whether a file is an FMU; otherwise an FMUError must give the reason."""
    path = outer / "fuzzed.fmu"
    path.write_bytes(content)
    message = ""
    try:
        fmu = FMU(path)
    except FMUError as error:
        message = str(error)
    if message:
        assert "fuzzed.fmu" in message or "variable" in message
        assert len(message) < 1500
    else:
        assert fmu.directory.parent == outer / "a" / "b"
        for needs in fmu.feedthrough().values():
            assert needs <= fmu.input_ports.keys()
        assert inspection(path).startswith("model")
        del fmu
    assert sorted(p.name for p in outer.iterdir()) == ["a", "fuzzed.fmu"]
    assert [p.name for p in (outer / "a").iterdir()] == ["b"]
    assert not list((outer / "a" / "b").iterdir())
    return not message


fuzzed = settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def test_the_originals_are_fmus(outer):
    assert [taken(outer, packed(list(o.items()))) for o in originals()] == [True] * 4


# ------------------------------------------------------------------------------- bytes


@fuzzed
@given(st.data())
def test_changed_bytes(outer, data):
    """Bytes are cut off, flipped, overwritten, inserted; in stored archives, flips reach the XML."""
    original = data.draw(st.sampled_from(originals()))
    compression = data.draw(st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))
    content = bytearray(packed(list(original.items()), compression))
    where = st.integers(0, len(content) - 1) | st.integers(max(0, len(content) - 700), len(content) - 1)
    for _ in range(data.draw(st.integers(1, 6))):
        i, j = data.draw(where), data.draw(where)
        kind = data.draw(st.sampled_from(["flip", "flip", "cut", "copy", "insert", "zero"]))
        if kind == "flip":
            content[i % max(len(content), 1) : i + 1] = bytes([data.draw(st.integers(0, 255))])
        elif kind == "cut":
            del content[i : i + data.draw(st.sampled_from([1, 7, 4096, 10**9]))]
        elif kind == "copy":
            content[i : i + 40] = content[j : j + 40]
        elif kind == "insert":
            content[i:i] = data.draw(st.binary(max_size=30))
        else:
            content[i : i + 4] = data.draw(st.sampled_from([bytes(4), b"\xff" * 4, b"\0\0\0\x80"]))
    taken(outer, bytes(content))


# ----------------------------------------------------------------------------- archive

NAMES = st.sampled_from(
    ["../evil", "a/../../evil", "/evil", "//evil", "C:/evil", "C:evil", "..\\evil", "\\evil", "evil\0.txt",
     ".", "..", "", "/", "a//b", "./evil", "resources", "resources/", "modelDescription.xml",
     "modelDescription.xml/x", "binaries", "binaries/linux64", "b" * 300, "x/" * 2000 + "y", "é", "\ud7ff",
     "CON", "a?b*", "MODELDESCRIPTION.XML", "resources/x", "binaries/linux64/probe.so/x"]
) | st.text(max_size=12)  # fmt: skip


@fuzzed
@given(st.data())
def test_changed_archives(outer, data):
    """Entries are omitted, added, duplicated, renamed to paths that lead elsewhere; headers are changed."""
    entries = list(data.draw(st.sampled_from(originals())).items())
    for _ in range(data.draw(st.integers(0, 3))):
        i = data.draw(st.integers(0, len(entries) - 1))
        kind = data.draw(st.sampled_from(["add", "rename", "drop", "twice", "absolute"]))
        if kind == "add":
            entries.insert(i, (data.draw(NAMES), data.draw(st.binary(max_size=9))))
        elif kind == "absolute":
            entries.insert(i, (f"{outer}/evil", b"x"))
        elif kind == "rename":
            entries[i] = (data.draw(NAMES), entries[i][1])
        elif kind == "drop" and len(entries) > 1:
            del entries[i]
        else:
            entries.append((entries[i][0], data.draw(st.sampled_from([entries[i][1], b"other"]))))
    content = bytearray(packed(entries))
    heads = [
        i for i in range(len(content)) if content[i : i + 4] in (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06")
    ]
    for _ in range(data.draw(st.integers(0, 3))):  # a field of a header: flags, method, sizes, mode, offset
        at = data.draw(st.sampled_from(heads)) + data.draw(st.integers(4, 45))
        value = data.draw(st.sampled_from([0, 1, 8, 12, 14, 0xA1, 0xFF]))
        content[at : at + 1] = bytes([value])
    taken(outer, bytes(content))


# --------------------------------------------------------------------------------- XML

WORDS = """0 -1 1 2 99 4294967295 4294967296 1e400 nan true x a[1] a[2] a[1,2] a[999999999] 0x10 ../../evil
    /bin/true é \U0001f600 input output local independent parameter structuralParameter calculatedParameter
    constant fixed tunable discrete continuous exact approx calculated 2.0 3.0 3.0-beta.2 3.99 1.0 N m %s%n"""
ODD = ["", "9" * 30, "9" * 5000, f"a[{'9' * 5000}]", "1 1", " 1  2 ", "1\t2", "x" * 100_000]
PRINTED = st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"])
VALUES = st.sampled_from(WORDS.split() + ODD) | st.text(PRINTED, max_size=8)
ATTRIBUTES = """name valueReference causality variability initial start unit displayUnit declaredType
    derivative dependencies dependenciesKind index fmiVersion guid modelIdentifier min max clocks stepSize
    numberOfEventIndicators""".split()
TAGS = """Real Float64 UInt64 Clock Binary String Dimension Alias Start Unknown Output CoSimulation
    ModelExchange ScheduledExecution Annotations Item ModelVariables ScalarVariable EventIndicator
    InitialUnknown UnitDefinitions Unit DisplayUnit""".split()


@fuzzed
@given(st.data())
def test_changed_elements(outer, data):
    """Attributes and elements are dropped, duplicated, enlarged, nested, renamed and moved."""
    original = dict(data.draw(st.sampled_from(originals())))
    root = etree.fromstring(original["modelDescription.xml"])
    for _ in range(data.draw(st.integers(1, 4))):
        elements = list(root.iter("*"))
        element = elements[data.draw(st.integers(0, len(elements) - 1))]
        kind = data.draw(
            st.sampled_from(["set", "set", "set", "drop", "remove", "copy", "nest", "tag", "new"])
        )
        if kind == "set":
            own = list(element.attrib) if data.draw(st.integers(0, 3)) else ATTRIBUTES
            element.set(data.draw(st.sampled_from(own or ATTRIBUTES)), data.draw(VALUES))
        elif kind == "drop" and element.attrib:
            del element.attrib[data.draw(st.sampled_from(sorted(element.attrib)))]
        elif kind == "remove" and element is not root:
            element.getparent().remove(element)
        elif kind == "copy" and element is not root:
            copies = data.draw(st.sampled_from([1, 1, 3, 50]))
            for _ in range(copies):
                element.addnext(deepcopy(element))
        elif kind == "nest":
            for _ in range(data.draw(st.sampled_from([1, 20, 3000]))):
                element = etree.SubElement(element, "Annotation")
        elif kind == "tag":
            element.tag = data.draw(st.sampled_from(TAGS))
        else:
            new = etree.SubElement(element, data.draw(st.sampled_from(TAGS)))
            new.set(data.draw(st.sampled_from(ATTRIBUTES)), data.draw(VALUES))
    original["modelDescription.xml"] = etree.tostring(root)
    taken(outer, packed(list(original.items())))


SECRET = "file:///etc/passwd"
PARTS = st.sampled_from(
    ["<!DOCTYPE x>", '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>', "&b;", "&#0;", "&#xD800;",
     f'<!DOCTYPE x SYSTEM "{SECRET}">', f'<!DOCTYPE x [<!ENTITY e SYSTEM "{SECRET}">]>', "&e;", "&lt;",
     '<?xml version="1.1"?>', '<?xml version="1.0" encoding="UTF-16"?>', '<?xml encoding="none"?>', "<?pi?>",
     "<!--", "-->", "<![CDATA[", "]]>", "<", ">", "/>", '"', "<a>" * 400, "</fmiModelDescription>", "\0",
     ' name="x"', ' xmlns="http://x"', ' xmlns:p="http://x"', "<p:x/>", f"<xi:include href='{SECRET}'/>",
     "\ufeff"]
)  # fmt: skip


@fuzzed
@given(st.data())
def test_changed_text(outer, data):
    """Text that XML writers do not produce: entities, declarations, cut elements, other encodings."""
    original = dict(data.draw(st.sampled_from(originals())))
    text = original["modelDescription.xml"].decode()
    places = [0, len(text), *(i for i, c in enumerate(text) if c in '<>" ')]
    for _ in range(data.draw(st.integers(0, 3))):
        i = min(data.draw(st.sampled_from(places)), len(text))
        cut = data.draw(st.sampled_from([0, 0, 0, 1, 5, 100, 10**6]))
        text = text[:i] + data.draw(PARTS) + text[i + cut :]
    encoding = data.draw(
        st.sampled_from(["utf-8", "utf-8", "utf-8", "utf-16", "utf-32", "utf-16-le", "utf-7", "cp500"])
    )
    original["modelDescription.xml"] = text.encode(encoding, errors="replace")
    taken(outer, packed(list(original.items())))
