"""The FMU of c/counter3.c: Model Exchange of FMI 3.0 without states, with time events."""

from __future__ import annotations

from pathlib import Path

from tests.cosim.fmi.probe import write_fmu

_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="counter" instantiationToken="counter3">
<ModelExchange modelIdentifier="counter"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Int32 name="count" valueReference="1" causality="output" initial="exact" start="0"/>
<Float64 name="period" valueReference="2" causality="parameter" variability="fixed" start="0.1"/>
<Int32 name="last" valueReference="3" causality="parameter" variability="fixed" start="1000"/>
</ModelVariables>
<ModelStructure><Output valueReference="1" dependencies=""/></ModelStructure></fmiModelDescription>"""


def counter(path: Path) -> Path:
    """Write the FMU."""
    return write_fmu(path, _DESCRIPTION, "counter", "counter3.c", "rest3.c")
