"""`cosim inspect`: capabilities and variables of an FMU as text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..fmi.clocks import interval_of
from ..fmi.file.archive import Archive
from ..fmi.file.model_description import description_of, parse
from ..fmi.ports import display_unit_of, unit_of
from .scenario import aligned

_LONGEST_START = 40


def inspection(path: Path) -> str:
    """Return capabilities, default experiment and variables of an FMU."""
    with Archive(path) as archive:
        description, root, platforms = description_of(archive), parse(archive), archive.platforms()
    tool = description.generationTool or "unknown"
    facts = [
        ("model", f"{description.modelName}, FMI {description.fmiVersion}"),
        ("made by", ", ".join(filter(None, (tool, description.generationDateAndTime)))),
        ("description", (description.description or "").partition("\n")[0]),
        ("platforms", ", ".join(platforms) or "none (sources only)"),
        ("Co-Simulation", _capabilities(root, "CoSimulation")),
        ("Model Exchange", _capabilities(root, "ModelExchange")),
        ("default experiment", _experiment(description.defaultExperiment)),
        ("states", f"{description.numberOfContinuousStates}"),
        ("event indicators", f"{description.numberOfEventIndicators}"),
    ]
    lines = [f"{name:<20}{text}".rstrip() for name, text in facts]
    return _printable("\n".join([*lines, "", aligned([_row(v) for v in description.modelVariables])]))


def _printable(text: str) -> str:
    """Escape the characters of an FMU's names and texts that would control the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def _capabilities(root: Any, interface: str) -> str:
    element = root.find(interface)
    if element is None:
        return "no"
    wanted = {
        "canHandleVariableCommunicationStepSize": "variable step",
        "hasEventMode": "event mode",
        "mightReturnEarlyFromDoStep": "early return",
        "canGetAndSetFMUstate": "state get and set",
        "canSerializeFMUstate": "state serialised",
        "providesDirectionalDerivative": "directional derivatives",
        "canBeInstantiatedOnlyOncePerProcess": "one instance per process",
        "needsExecutionTool": "needs its tool",
    }
    renamed = {
        "canGetAndSetFMUState": "canGetAndSetFMUstate",
        "canSerializeFMUState": "canSerializeFMUstate",
        "providesDirectionalDerivatives": "providesDirectionalDerivative",
    }  # in FMI 3.0
    true = {renamed.get(name, name) for name, value in element.attrib.items() if value in ("true", "1")}
    return "yes: " + (", ".join(text for name, text in wanted.items() if name in true) or "nothing optional")


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
        "type": variable.type + (f"[{','.join(map(str, variable.shape))}]" if variable.shape else ""),
        "causality": variable.causality or "local",
        "unit": unit_of(variable) or "-",
        "start": _start(variable),
        "display": display_unit_of(variable) or "-",
        "variability": variable.variability or "-",
        "min": _bound(variable, "min"),
        "max": _bound(variable, "max"),
        "meaning": variable.description or "",
    }


def _bound(variable: Any, name: str) -> str:
    """Return min or max of a variable, or of its declared type."""
    declared = getattr(variable, "declaredType", None)
    value = getattr(variable, name, None) or getattr(declared, name, None)
    return "-" if value is None else str(value)


def _start(variable: Any) -> str:
    """Return the start value, shortened for long arrays; of a clock the times of its ticks."""
    if variable.type != "Clock":
        text = str(variable.start) if variable.start is not None else "-"
        return text if len(text) <= _LONGEST_START else text[: _LONGEST_START - 3].rstrip() + "..."
    interval, shift = interval_of(variable)
    every = "" if interval is None else f", every {interval:g} s" + (f" from {shift:g} s" if shift else "")
    return f"{variable.intervalVariability}{every}"
