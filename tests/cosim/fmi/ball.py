"""The FMU of c/ball2.c: Model Exchange with state events, time events and failures on demand."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.cosim.fmi.probe import write_fmu

STATES = [("h", 'start="1"'), ("v", 'start="0"'), ("q", 'start="0"')]
PARAMETERS = {
    "g": 1.0,
    "e": 0.5,
    "first_at": 1e9,
    "period": 1e9,
    "end_at_bounce": 1e9,
    "hole": 1e9,
    "fails_at": 1e9,
}


def description() -> str:
    """modelDescription.xml of ball2.c."""
    rows = [(n, 'causality="output" initial="exact"', start) for n, start in STATES]
    rows += [(f"der({n})", 'causality="local"', f'derivative="{i + 1}"') for i, (n, _) in enumerate(STATES)]
    rows.append(("gust", 'causality="input"', 'start="0"'))
    rows += [(n, 'causality="parameter" variability="fixed"', f'start="{v}"') for n, v in PARAMETERS.items()]
    rows += [(n, 'causality="output" variability="discrete"', "") for n in ("bounces", "gusts", "level")]
    variables = "".join(
        f'<ScalarVariable name="{name}" valueReference="{vr}" {kind}><Real {more}/></ScalarVariable>'
        for vr, (name, kind, more) in enumerate(rows)
    )
    outputs = "".join(f'<Unknown index="{i}"/>' for i in (1, 2, 3, 15, 16, 17))
    slopes = "".join(f'<Unknown index="{i}"/>' for i in (4, 5, 6))
    initial = "".join(f'<Unknown index="{i}"/>' for i in (4, 5, 6, 15, 16, 17))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ball" guid="ball2" numberOfEventIndicators="2">
<ModelExchange modelIdentifier="ball" canGetAndSetFMUstate="true"/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs>{outputs}</Outputs><Derivatives>{slopes}</Derivatives>
<InitialUnknowns>{initial}</InitialUnknowns></ModelStructure></fmiModelDescription>"""


def ball(path: Path) -> Path:
    """Write the FMU."""
    return write_fmu(path, description(), "ball", "ball2.c")


def height(t: float, g: float = 1.0, e: float = 0.5) -> float:
    """Return h(t) of a ball that falls from 1, in closed form: parabola after parabola."""
    falls = np.sqrt(2.0 / g)
    if t < falls:
        return float(1.0 - 0.5 * g * t * t)
    t, v = t - falls, e * g * falls
    while v >= 0.02:
        if t < 2.0 * v / g:
            return float(v * t - 0.5 * g * t * t)
        t, v = t - 2.0 * v / g, e * v
    return 0.0
