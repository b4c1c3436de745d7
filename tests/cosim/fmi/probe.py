"""The FMUs of c/probe.h, whose features the exporter does not have: model descriptions, compiler."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import fmpy

SOURCES = Path(__file__).parent / "c"
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
INTEGERS = {f"{sign}Int{bits}": 20 + 4 * i + 2 * j
            for i, bits in enumerate((8, 16, 32, 64)) for j, sign in enumerate(("", "U"))}  # fmt: skip

#: name, value reference, type in FMI 2.0 and 3.0, causality, attributes of the type, dependencies
COMMON = [
    ("r_in", 1, "Real", "Float64", "input", 'start="0.5" unit="N"', None),
    ("r_out", 2, "Real", "Float64", "output", 'declaredType="Force"', "r_in"),
    ("i_in", 3, "Integer", "Int32", "input", 'start="7"', None),
    ("i_out", 4, "Integer", "Int32", "output", "", None),
    ("b_in", 5, "Boolean", "Boolean", "input", 'start="true"', None),
    ("b_out", 6, "Boolean", "Boolean", "output", "", "b_in"),
    ("e_in", 7, "Enumeration", "Enumeration", "input", 'declaredType="Mode" start="1"', None),
    ("e_out", 8, "Enumeration", "Enumeration", "output", 'declaredType="Mode"', "e_in"),
    ("label", 9, "String", "String", "parameter", 'start=""', None),
    ("label_length", 10, "Integer", "Int32", "output", "", ""),
    ("x", 11, "Real", "Float64", "output", "", ""),
    ("der(x)", 12, "Real", "Float64", "local", "", ""),
    ("stair", 13, "Integer", "Int32", "output", "", ""),
    ("quarters", 14, "Integer", "Int32", "output", "", ""),
    ("end_at", 15, "Real", "Float64", "parameter", 'start="1e9"', None),
    ("early_at", 16, "Real", "Float64", "parameter", 'start="1e9"', None),
    ("text_in", 17, "String", "String", "input", 'start=""', None),
    ("text_out", 18, "String", "String", "output", "", "text_in"),
]


def description2(once: bool) -> str:
    """modelDescription.xml of probe2.c."""
    number = {v[0]: i + 1 for i, v in enumerate(COMMON)}
    variables, unknowns = [], {"output": "", "local": "", "initial": ""}
    for name, vr, kind, _, causality, attributes, needs in COMMON:
        changes = {"parameter": "fixed", "input": "continuous", "output": "continuous", "local": "continuous"}
        varies = changes[causality] if kind == "Real" or causality == "parameter" else "discrete"
        extra = ' derivative="11"' if name == "der(x)" else ""
        start = ' initial="exact"' if name == "x" else ""
        extra += ' start="0"' if name == "x" else ""
        variables.append(
            f'<ScalarVariable name="{name}" valueReference="{vr}" causality="{causality}" '
            f'variability="{varies}"{start}><{kind} {attributes}{extra}/></ScalarVariable>'
        )
        if causality in unknowns:
            listed = "" if needs is None else f' dependencies="{number.get(needs, "")}"'
            unknown = f'<Unknown index="{number[name]}"{listed}/>'
            unknowns[causality] += unknown
            unknowns["initial"] += unknown if name != "x" else ""
    limit = 'canBeInstantiatedOnlyOncePerProcess="true"' if once else ""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="probe" guid="probe2" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="probe" {limit}/><CoSimulation modelIdentifier="probe" {limit}
canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit></UnitDefinitions>
<TypeDefinitions><SimpleType name="Force"><Real unit="N"/></SimpleType>
<SimpleType name="Mode"><Enumeration><Item name="off" value="1"/><Item name="on" value="2"/></Enumeration>
</SimpleType></TypeDefinitions>
<ModelVariables>{"".join(variables)}</ModelVariables>
<ModelStructure><Outputs>{unknowns["output"]}</Outputs><Derivatives>{unknowns["local"]}</Derivatives>
<InitialUnknowns>{unknowns["initial"]}</InitialUnknowns></ModelStructure></fmiModelDescription>"""


def description3(once: bool) -> str:
    """modelDescription.xml of probe3.c: those of probe2.c, numbers of all types, arrays, binary data."""
    more = [
        ("f32_in", 36, "", "Float32", "input", 'start="0.5"', None),
        ("f32_out", 37, "", "Float32", "output", "", "f32_in"),
    ]
    for kind, vr in INTEGERS.items():
        more.append((f"{kind}_in", vr, "", kind, "input", 'start="1"', None))
        more.append((f"{kind}_out", vr + 1, "", kind, "output", "", f"{kind}_in"))
    more += [
        ("n", 40, "", "UInt64", "structuralParameter", 'start="2"', None),
        ("v_in", 41, "", "Float64", "input", 'start="1.5 2.5"', None),
        ("v_out", 42, "", "Float64", "output", "", "v_in"),
        ("blob_sum", 44, "", "Int32", "output", "", ""),
    ]
    reference = {v[0]: v[1] for v in [*COMMON, *more]}
    variables, structure = [], {"output": "", "local": "", "initial": ""}
    for name, vr, _, kind, causality, attributes, needs in [*COMMON, *more]:
        inside = '<Dimension valueReference="40"/>' if name.startswith("v_") else ""
        inside += {"x": '<Alias name="x_alias"/>', "r_in": '<Alias name="r_other"/>'}.get(name, "")
        if kind == "String":
            attributes, inside = "", '<Start value=""/>' if attributes else ""
        extra = ' derivative="11"' if name == "der(x)" else ""
        extra += ' initial="exact" start="0"' if name == "x" else ""
        variables.append(
            f'<{kind} name="{name}" valueReference="{vr}" causality="{causality}" '
            f"{attributes}{extra}>{inside}</{kind}>"
        )
        if causality in structure:
            listed = "" if needs is None else f' dependencies="{reference.get(needs, "")}"'
            tag = "Output" if causality == "output" else "ContinuousStateDerivative"
            structure[causality] += f'<{tag} valueReference="{vr}"{listed}/>'
            structure["initial"] += f'<InitialUnknown valueReference="{vr}"{listed}/>' if name != "x" else ""
    limit = 'canBeInstantiatedOnlyOncePerProcess="true"' if once else ""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="probe" instantiationToken="probe3">
<ModelExchange modelIdentifier="probe" {limit}/><CoSimulation modelIdentifier="probe" {limit}
canHandleVariableCommunicationStepSize="true" mightReturnEarlyFromDoStep="true"/>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit></UnitDefinitions>
<TypeDefinitions><Float64Type name="Force" unit="N"/>
<EnumerationType name="Mode"><Item name="off" value="1"/><Item name="on" value="2"/></EnumerationType>
</TypeDefinitions>
<ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Binary name="blob" valueReference="43" causality="parameter" variability="fixed"><Start value="00"/></Binary>
<Float64 name="z" valueReference="45" causality="local"/>{"".join(variables)}</ModelVariables>
<ModelStructure>{structure["output"]}{structure["local"]}{structure["initial"]}
<EventIndicator valueReference="45"/></ModelStructure></fmiModelDescription>"""


@lru_cache(maxsize=4)
def library(*sources: str) -> bytes:
    """Compile sources of c/ to a library."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "library.so"
        compiler = [sys.executable, "-m", "ziglang", "cc"]
        options = ["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden", f"-I{FMI_HEADERS}", "-o", str(out)]
        subprocess.run([*compiler, *options, *(str(SOURCES / name) for name in sources)], check=True)
        return out.read_bytes()


def write_fmu(path: Path, description: str, name: str, *sources: str) -> Path:
    """Write an FMU of a model description and sources of c/ to `path`."""
    folder = fmpy.platform if 'fmiVersion="2.0"' in description else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{folder}/{name}{fmpy.sharedLibraryExtension}", library(*sources))
    return path


def changed(path: Path, source: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """Write an FMU with the files of another one, each changed by `change(name, content)`; None omits it."""
    with zipfile.ZipFile(source) as original, zipfile.ZipFile(path, "w") as written:
        for name in original.namelist():
            if (content := change(name, original.read(name))) is not None:
                written.writestr(name, content)
    return path


def probe(path: Path, version: str, *, once: bool = False) -> Path:
    """Write the FMU; with `once`, it can be instantiated only once per process."""
    if version == "2.0":
        return write_fmu(path, description2(once), "probe", "probe2.c")
    return write_fmu(path, description3(once), "probe", "probe3.c", "rest3.c")
