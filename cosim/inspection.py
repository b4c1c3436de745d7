"""`cosim inspect`: what an FMU is, as text."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from .fmu import FMU
from .scenario import aligned


def inspection(path: Path) -> str:
    """Return capabilities, default experiment and variables of an FMU."""
    from .fmu import read_description

    description = read_description(path)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    platforms = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") > 1})
    facts = [
        ("model", f"{description.modelName}, FMI {description.fmiVersion}"),
        ("made by", f"{description.generationTool or 'unknown'}, {description.generationDateAndTime or ''}"),
        ("about", (description.description or "").partition("\n")[0]),
        ("platforms", ", ".join(platforms) or "none (sources only)"),
        ("Co-Simulation", _capabilities(description.coSimulation)),
        ("Model Exchange", _capabilities(description.modelExchange)),
        ("default experiment", _experiment(description.defaultExperiment)),
        ("states", f"{description.numberOfContinuousStates}"),
        ("event indicators", f"{description.numberOfEventIndicators}"),
    ]
    lines = [f"{name:<20}{text}".rstrip() for name, text in facts]
    return "\n".join([*lines, "", aligned([_row(v) for v in description.modelVariables])])


def _capabilities(interface: Any) -> str:
    if interface is None:
        return "no"
    wanted = {
        "canHandleVariableCommunicationStepSize": "variable step",
        "canGetAndSetFMUstate": "state get and set",
        "canSerializeFMUstate": "state serialised",
        "providesDirectionalDerivative": "directional derivatives",
        "canBeInstantiatedOnlyOncePerProcess": "one instance per process",
        "needsExecutionTool": "needs its tool",
    }
    has = [text for name, text in wanted.items() if str(getattr(interface, name, "")).lower() == "true"]
    return "yes: " + (", ".join(has) or "nothing optional")


def _experiment(experiment: Any) -> str:
    if experiment is None:
        return "none"
    parts = {
        "startTime": "from {} s",
        "stopTime": "to {} s",
        "stepSize": "step {} s",
        "tolerance": "tolerance {}",
    }
    given = [text.format(getattr(experiment, n)) for n, text in parts.items() if getattr(experiment, n, None)]
    return ", ".join(given) or "none"


def _row(variable: Any) -> dict[str, Any]:
    return {
        "variable": variable.name,
        "type": variable.type,
        "causality": variable.causality or "local",
        "unit": FMU.unit_of(variable) or "-",
        "start": variable.start if variable.start is not None else "-",
        "meaning": variable.description or "",
    }
