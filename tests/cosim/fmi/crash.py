"""The FMU of c/crash.c, which fails on demand."""

from __future__ import annotations

from pathlib import Path

from cosim import FMU
from tests.cosim.fmi.probe import write_fmu


def crash(folder: Path, fault: str = "none", interface: str = "CoSimulation") -> FMU:
    """Build the FMU; `fault` is "FUNCTION WAY TIME", as described in c/crash.c."""
    folder.mkdir(exist_ok=True)
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="crash" guid="{fault}">
<{interface} modelIdentifier="crash" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/><ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="1"/></ScalarVariable>
<ScalarVariable name="x" valueReference="1" causality="output" initial="exact"><Real start="0"/>
</ScalarVariable>
<ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="2"/><Unknown index="4"/></Outputs>
<Derivatives><Unknown index="3"/></Derivatives><InitialUnknowns><Unknown index="4"/></InitialUnknowns>
</ModelStructure></fmiModelDescription>"""
    return FMU(write_fmu(folder / "crash.fmu", text, "crash", "crash.c"), isolated=True)
