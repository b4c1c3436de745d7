"""The FMU of c/metronome.c: Co-Simulation of FMI 3.0 with event mode, clocks and text."""

from __future__ import annotations

from pathlib import Path

from tests.cosim.fmi.probe import write_fmu

_CONTINUOUS = [
    '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>',
    '<Float64 name="rate" valueReference="1" causality="input" variability="discrete" start="1"/>',
    '<Float64 name="u" valueReference="2" causality="input" start="0"/>',
    '<Float64 name="x" valueReference="3" causality="output" initial="exact" start="0"/>',
    '<Int32 name="wraps" valueReference="4" causality="output"/>',
    '<Int32 name="beats" valueReference="5" causality="output"/>',
    '<Float64 name="beat" valueReference="6" causality="parameter" variability="fixed" start="0.75"/>',
    '<Float64 name="stuck" valueReference="7" causality="parameter" variability="fixed" start="1e9"/>',
    '<Int32 name="entries" valueReference="8" causality="output"/>',
]
_CLOCKED = [
    '<Clock name="wrap" valueReference="20" causality="output" intervalVariability="triggered"/>',
    '<Clock name="sample" valueReference="21" causality="input" intervalVariability="constant" '
    'intervalDecimal="0.5" shiftDecimal="0.25"/>',
    '<Clock name="tick" valueReference="22" causality="input" intervalVariability="fixed" '
    'supportsFraction="true" resolution="8" intervalCounter="2"/>',
    '<Clock name="own" valueReference="23" causality="input" intervalVariability="fixed"/>',
    '<Clock name="kick" valueReference="24" causality="input" intervalVariability="triggered"/>',
    '<Float64 name="own_period" valueReference="25" causality="parameter" variability="fixed" start="1"/>',
    '<Float64 name="kick_by" valueReference="26" causality="input" variability="discrete" clocks="24" '
    'start="0"/>',
    '<Float64 name="sampled" valueReference="27" causality="output" variability="discrete" clocks="21"/>',
    '<Int32 name="ticks" valueReference="28" causality="output" clocks="22"/>',
    '<Int32 name="owns" valueReference="29" causality="output" clocks="23"/>',
    '<Float64 name="kicked" valueReference="30" causality="output" variability="discrete" clocks="24"/>',
    '<Float64 name="wrapped_at" valueReference="31" causality="output" variability="discrete" clocks="20"/>',
    '<Int32 name="samples" valueReference="32" causality="output" clocks="21"/>',
]
_TEXT = [
    '<String name="word" valueReference="40" causality="input"><Start value="a"/></String>',
    '<String name="echo" valueReference="41" causality="output"/>',
    '<Binary name="data" valueReference="42" causality="input"><Start value=""/></Binary>',
    '<Binary name="reversed" valueReference="43" causality="output"/>',
]


def metronome(
    path: Path,
    *,
    clocks: bool = False,
    clock: str = "",
    event_mode: bool = True,
    early_return: bool = True,
    tool: str = "",
) -> Path:
    """Write the FMU.

    clocks, clock
        whether it has the clocks and their variables; another clock, as XML
    event_mode, early_return
        whether the model description declares the capability
    tool
        a tool that the FMU needs, which is not installed
    """
    variables = [*_CONTINUOUS, *(_CLOCKED if clocks else []), clock, *_TEXT]
    outputs = [v.split('valueReference="')[1].split('"')[0] for v in variables if '"output"' in v]
    listed = "".join(f'<Output valueReference="{vr}"/>' for vr in outputs)
    unknown = "".join(
        f'<InitialUnknown valueReference="{vr}"/>'
        for vr, v in zip(outputs, (v for v in variables if '"output"' in v), strict=True)
        if "clocks=" not in v and 'initial="exact"' not in v
    )
    can = {
        "hasEventMode": event_mode,
        "mightReturnEarlyFromDoStep": early_return,
        "needsExecutionTool": bool(tool),
        "canHandleVariableCommunicationStepSize": True,
        "canGetAndSetFMUState": True,
    }
    says = " ".join(f'{name}="true"' for name, value in can.items() if value)
    token, made = ("toolless", f'generationTool="{tool}"') if tool else ("metronome", "")
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="metronome" instantiationToken="{token}" {made}>
<CoSimulation modelIdentifier="metronome" {says}/>
<ModelVariables>{"".join(variables)}</ModelVariables>
<ModelStructure>{listed}{unknown}</ModelStructure></fmiModelDescription>"""
    return write_fmu(path, text, "metronome", "metronome.c", "rest3.c")
