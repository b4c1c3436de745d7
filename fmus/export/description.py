"""modelDescription.xml of an exported participant, FMI 2.0 and 3.0.

Both versions share variables and their roles (`role`), units (`unit_definition`) and
dependencies by element (dependencies.py). FMI 2.0 lists every element
of an array as a scalar variable, `K[2,3]`; FMI 3.0 lists the array. A value reference is
a slot in the storage; that of an array is its first slot.

States are outputs, since ports can be read, with exact start values; derivatives are
local. Locals, and parameters that are fixed at export, are not listed.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from lxml import etree

from cosim import Continuous, Participant, WiringError
from cosim.core.variables import Variable
from cosim.units import BASE_UNITS, definition, parse

from .dependencies import ModelStructure
from .link import ExportError, Model, fmi_name, is_listed


@dataclass(frozen=True)
class DefaultExperiment:
    """Times in s that a host uses by default, and those of the reference result."""

    start: float = 0.0
    stop: float = 10.0
    step: float = 0.01


@dataclass(frozen=True)
class Role:
    """Attributes of a variable in FMI."""

    causality: str
    variability: str
    initial: str | None
    has_start: bool


def role(v: Variable, participant: Participant) -> Role:
    """Return causality, variability and initial: outputs and derivatives are calculated, others exact."""
    changes = "continuous" if isinstance(participant, Continuous) else "discrete"
    return {
        "input": Role("input", "continuous", None, True),  # also of a block, which samples it
        "output": Role("output", changes, "calculated", False),
        "state": Role("output", changes, "exact", True),
        "derivative": Role("local", "continuous", "calculated", False),
        "parameter": Role("parameter", "fixed", "exact", True),
    }[v.kind]


@dataclass(frozen=True)
class Element:
    """One variable of FMI: a scalar, an element of an array (FMI 2.0), or an array (FMI 3.0)."""

    name: str
    variable: Variable
    slot: int
    size: int
    role: Role


def elements(participant: Participant, *, arrays: bool) -> list[Element]:
    """Return the listed variables in the order of the storage, by element or with whole arrays."""
    found = []
    for v in filter(is_listed, participant.variables.values()):
        name, r = fmi_name(v), role(v, participant)
        if arrays or not v.shape:
            found.append(Element(name, v, v.slot, v.size, r))
            continue
        for offset, index in enumerate(np.ndindex(*map(int, v.shape))):
            where = "[" + ",".join(str(i + 1) for i in index) + "]"
            indexed = f"{name[:-1]}{where})" if v.kind == "derivative" else name + where
            found.append(Element(indexed, v, v.slot + offset, 1, r))
    return found


# -------------------------------------------------------------------------- units


def unit_definition(unit: str) -> tuple[dict[str, int], float, float]:
    """Return exponents of the SI base units, factor and offset of a unit."""
    try:
        found = definition(unit)
    except WiringError as error:
        raise ExportError(str(error)) from error
    exponents = {n: e for n, e in zip(BASE_UNITS, found.exponents, strict=True) if e}
    return exponents, found.factor, found.offset


def unit_name(v: Variable) -> str | None:
    """Return the unit that the FMU states: the declared one, but "m/s^2" for a derivative in "(m/s)/s"."""
    if v.kind != "derivative" or v.unit is None:
        return v.unit
    return f"{parse(v.unit):~C}".replace("**", "^").replace("dimensionless", "1")


def _add_units(parent: etree._Element, names: Iterable[str | None]) -> None:
    listed = sorted({name for name in names if name is not None})
    definitions = etree.SubElement(parent, "UnitDefinitions") if listed else None
    for name in listed:
        exponents, factor, offset = unit_definition(name)
        attributes = {k: str(n) for k, n in exponents.items()}
        if factor != 1.0:
            attributes["factor"] = repr(factor)
        if offset != 0.0:
            attributes["offset"] = repr(offset)
        etree.SubElement(etree.SubElement(definitions, "Unit", name=name), "BaseUnit", attributes)


# ---------------------------------------------------------------------- documents


def _common(participant: Participant, model: Model, interfaces: Iterable[str], token: str) -> etree._Element:
    """Return the root with the elements of the interfaces, which both versions have."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        tool = f"structcosim {version('structcosim')}"
    except PackageNotFoundError:  # run from a clone
        tool = "structcosim"
    root = etree.Element(
        "fmiModelDescription",
        {"fmiVersion": model.fmi_version, "modelName": type(participant).__name__, token: model.token},
    )
    summary = inspect.cleandoc(type(participant).__doc__ or "").split("\n\n")[0]
    if summary:
        root.set("description", " ".join(summary.split()))
    root.set("generationTool", tool)
    root.set("variableNamingConvention", "structured")
    state = "FMUstate" if model.fmi_version == "2.0" else "FMUState"
    abilities = {f"canGetAndSet{state}": "true", f"canSerialize{state}": "true"}
    if isinstance(participant, Continuous):
        abilities[f"providesDirectionalDerivative{'' if model.fmi_version == '2.0' else 's'}"] = "true"
    for interface in ("ModelExchange", "CoSimulation"):
        if interface in interfaces:
            element = etree.SubElement(root, interface, {"modelIdentifier": model.identifier, **abilities})
            if interface == "CoSimulation":
                element.set("canHandleVariableCommunicationStepSize", "true")
    return root


def _log_and_experiment(root: etree._Element, experiment: DefaultExperiment) -> None:
    categories = etree.SubElement(root, "LogCategories")
    etree.SubElement(categories, "Category", name="logStatusError", description="refused calls and failures")
    etree.SubElement(categories, "Category", name="logEvents", description="life of the instance")
    etree.SubElement(
        root,
        "DefaultExperiment",
        startTime=repr(float(experiment.start)),
        stopTime=repr(float(experiment.stop)),
        stepSize=repr(float(experiment.step)),
    )


def _bounds(v: Variable) -> dict[str, str]:
    """Return unit, min and max of a variable as attributes."""
    attributes = {}
    if (unit := unit_name(v)) is not None:
        attributes["unit"] = unit
    if np.isfinite(v.min):
        attributes["min"] = repr(float(v.min))
    if np.isfinite(v.max):
        attributes["max"] = repr(float(v.max))
    return attributes


def _start(e: Element, memory: np.ndarray) -> str:
    return " ".join(_double(x) for x in memory[e.slot : e.slot + e.size])


def _double(x: float) -> str:
    """Return a number as XML Schema writes it: the shortest text that reads back as the same double."""
    if np.isinf(x):
        return "INF" if x > 0 else "-INF"
    return repr(float(x))


def xml_text(root: etree._Element) -> bytes:
    """Return an element as the text of a file."""
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def fmi2_description(
    participant: Participant,
    model: Model,
    structure: ModelStructure,
    interfaces: Iterable[str],
    experiment: DefaultExperiment,
) -> bytes:
    """Return modelDescription.xml of FMI 2.0."""
    root = _common(participant, model, interfaces, "guid")
    root.set("numberOfEventIndicators", "0")
    for element in root:
        element.set("canNotUseMemoryManagementFunctions", "true")
        if element.tag == "ModelExchange":
            element.set("completedIntegratorStepNotNeeded", "true")
    listed = elements(participant, arrays=False)
    _add_units(root, (unit_name(e.variable) for e in listed))
    _log_and_experiment(root, experiment)
    index = {e.slot: i + 1 for i, e in enumerate(listed)}
    to_state = {d: s for s, d in structure.derivative_of.items()}
    variables = etree.SubElement(root, "ModelVariables")
    for e in listed:
        v = etree.SubElement(variables, "ScalarVariable", name=e.name, valueReference=str(e.slot))
        _add_role(v, e)
        real = etree.SubElement(v, "Real", _bounds(e.variable))
        if e.role.has_start:
            real.set("start", _start(e, participant.memory))
        if e.slot in to_state:
            real.set("derivative", str(index[to_state[e.slot]]))
    tree = etree.SubElement(root, "ModelStructure")
    for tag, (unknowns, known) in zip(
        ("Outputs", "Derivatives", "InitialUnknowns"), _unknowns(listed, structure), strict=True
    ):
        section = etree.SubElement(tree, tag) if unknowns else None
        for e in unknowns:
            unknown = etree.SubElement(section, "Unknown", index=str(index[e.slot]))
            if (needed := known.get(e.slot)) is not None:  # a missing attribute means all
                unknown.set("dependencies", " ".join(str(index[s]) for s in needed))
    return xml_text(root)


def fmi3_description(
    participant: Participant,
    model: Model,
    structure: ModelStructure,
    interfaces: Iterable[str],
    experiment: DefaultExperiment,
) -> bytes:
    """Return modelDescription.xml of FMI 3.0; an array depends on whatever one of its elements depends on."""
    root = _common(participant, model, interfaces, "instantiationToken")
    listed = elements(participant, arrays=True)
    owner = {e.slot + i: e.slot for e in listed for i in range(e.size)}
    state_of = {structure.derivative_of[e.slot]: e.slot for e in listed if e.slot in structure.derivative_of}
    _add_units(root, ["s", *(unit_name(e.variable) for e in listed)])
    _log_and_experiment(root, experiment)
    variables = etree.SubElement(root, "ModelVariables")
    time = "time"
    while time in participant.variables:
        time += "_"
    etree.SubElement(
        variables, "Float64", name=time, valueReference=str(participant.memory.size),
        causality="independent", variability="continuous", unit="s",
    )  # fmt: skip
    for e in listed:
        v = etree.SubElement(variables, "Float64", name=e.name, valueReference=str(e.slot))
        _add_role(v, e)
        for key, value in _bounds(e.variable).items():
            v.set(key, value)
        if e.role.has_start:
            v.set("start", _start(e, participant.memory))
        if e.slot in state_of:
            v.set("derivative", str(state_of[e.slot]))
        for size in e.variable.shape:
            etree.SubElement(v, "Dimension", start=str(size))
    tree = etree.SubElement(root, "ModelStructure")
    for tag, (unknowns, known) in zip(
        ("Output", "ContinuousStateDerivative", "InitialUnknown"), _unknowns(listed, structure), strict=True
    ):
        for e in unknowns:
            unknown = etree.SubElement(tree, tag, valueReference=str(e.slot))
            needed = [known.get(slot) for slot in range(e.slot, e.slot + e.size)]
            if None not in needed:
                whole = sorted({owner[s] for slots in needed for s in slots or ()})
                unknown.set("dependencies", " ".join(map(str, whole)))
    return xml_text(root)


def _add_role(v: etree._Element, e: Element) -> None:
    if e.variable.meaning:
        v.set("description", e.variable.meaning)
    v.set("causality", e.role.causality)
    v.set("variability", e.role.variability)
    if e.role.initial is not None:
        v.set("initial", e.role.initial)


def _unknowns(
    listed: list[Element], structure: ModelStructure
) -> list[tuple[list[Element], Mapping[int, tuple[int, ...]]]]:
    """Return outputs, derivatives and initial unknowns, each with its dependencies by slot."""
    outputs = [e for e in listed if e.role.causality == "output"]
    derivatives = [e for e in listed if e.variable.kind == "derivative"]
    calculated = [e for e in listed if e.role.initial == "calculated"]
    return [(outputs, structure.running), (derivatives, structure.running), (calculated, structure.initial)]
