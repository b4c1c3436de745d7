"""Export of a system as an SSP: `export_ssp(system, "loop.ssp", step=0.01, stop=20.0)`.

    resources/NAME.fmu       every component: an FMU is copied, a participant is exported
    SystemStructure.ssd      connectors, connections, parameter values (embedded SSV), units

SSP 1.0 is written unless the system needs 2.0: arrays as connectors, or types of FMI 3.0.
A conversion of units is written as a linear transformation, so that a tool that ignores units
computes the same. SSP cannot express which components act as blocks and how often, which
connections are late, and the step: these are annotations (cosim/ssp/format.py), from which
`cosim.ssp.read_ssp` restores the system.

Other masters exchange all values at the communication points and then step all FMUs (Jacobi),
blocks included: with them, every block between two other FMUs delays their loop by one more
step than in this system.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from cosim import FMU, System
from cosim.core.component import Component
from cosim.core.port import Port
from cosim.fmi.interfaces import ModelExchange
from cosim.fmi.ports import FMUPort, unit_of
from cosim.ssp.format import (
    ANNOTATION,
    FMU_TYPE,
    NAMESPACES,
    OWN,
    ROOT,
    SSC,
    SSD,
    SSV,
    TYPES_1,
    VERSIONS,
    SSPError,
    Units,
    tag,
)
from cosim.system.system import Connection

from ..export.description import xml_text
from ..export.fmu import write_archive
from .parts import Part, fmu_parts

PARAMETER_SET = "parameters"  # one name for all sets, since tools apply sets by name
#: the annotation that ecos and libcosim read
_OSP = ("com.opensimulationplatform", "http://opensimulationplatform.com/SSP/OSPAnnotations")


def export_ssp(
    system: System,
    path: str | os.PathLike[str],
    *,
    step: float | None = None,
    stop: float | None = None,
    start: float = 0.0,
    coupling: str | None = None,
    solver: str | None = None,
    version: str | None = None,
    fmi_version: str | None = None,
    platforms: Iterable[str] | None = None,
) -> Path:
    """Write a system as an SSP; the start values of its components are their present values.

    step, stop, start
        default experiment, in s; without it, `cosim run` needs `--step` and `--stop`
    coupling, solver
        arguments of `simulate` for a coupling other than sampled; read by `read_ssp` only
    version
        "1.0" or "2.0"; by default 1.0 if it can express the system, otherwise 2.0
    fmi_version
        FMI version of exported participants: by default "2.0", in SSP 2.0 "3.0"
    platforms
        names in `cosim.codegen.c_compiler.PLATFORMS` for these FMUs; the default is this machine's
    """
    if version is not None and version not in VERSIONS:
        raise SSPError(f"SSP version '{version}' is not supported; choose from {', '.join(VERSIONS)}")
    if not system.participants:
        raise SSPError("the system has no participants; add some before it is exported")
    fmi_version = fmi_version or ("3.0" if version == "2.0" else "2.0")
    wanted = None if platforms is None else list(platforms)
    parts = fmu_parts(system, fmi_version, wanted)
    needs = _needs_2(system, parts)
    if version == "1.0" and needs:
        raise SSPError(f"SSP 1.0 cannot express that {needs}; write version 2.0, or FMUs of FMI 2.0")
    writer = _Writer(system, parts, version or ("2.0" if needs else "1.0"))
    target = Path(path)
    asked = {"step": None if step is None else repr(float(step)), "coupling": coupling, "solver": solver}
    facts = {name: value for name, value in asked.items() if value is not None}
    text = writer.document(target.stem, start, stop, facts)
    files = {f"resources/{part.source}": part.file for part in parts.values()}
    write_archive(target, {ROOT: text, **files}, first=ROOT)
    return target


def _connections(system: System) -> list[Connection]:
    """Return the connections of numbers, and those of strings and binary data."""
    return [*system.connections, *system.text_connections]


def _needs_2(system: System, parts: dict[str, Part]) -> str:
    """Return the first fact that SSP 1.0 cannot express, as the end of a sentence, or an empty text."""
    for c in _connections(system):
        for end in (c.source, c.target):
            port = parts[end.participant].ports[end.name]
            if len(port.variables) != port.size:
                return f"{end} is an array"
            if port.type not in TYPES_1:
                return f"{end} is a {port.type}"
            if port.variables[0].causality == "local":
                return f"{end} is a local variable"
    for part in parts.values():
        if isinstance(part.component, FMU):
            for name, values in part.component.start_values().items():
                variable = part.component.variables[name]
                if len(values) != 1 or variable.type not in TYPES_1:
                    return f"{part.name}.{name} = {values} is a start value of type {variable.type}"
    return ""


class _Writer:
    """Writes SystemStructure.ssd."""

    def __init__(self, system: System, parts: dict[str, Part], version: str) -> None:
        self.connections = _connections(system)
        self.parts = parts
        self.version = version
        self.definitions = Units()
        for part in parts.values():
            self.definitions.add_fmu(part.description)
        self.units: set[str] = set()
        self.enumerations: dict[str, list[tuple[str, int]]] = {}

    def document(self, name: str, start: float, stop: float | None, facts: dict[str, str]) -> bytes:
        """Return the text of the file."""
        root = etree.Element(
            tag(SSD, "SystemStructureDescription"),
            {"version": self.version, "name": name, "generationTool": "structcosim"},
            nsmap={
                **NAMESPACES,
                "osp": _OSP[1],
            },  # here: libcosim fails if it is declared lower
        )
        system = _add(root, SSD, "System", name=name)
        elements = _add(system, SSD, "Elements")
        for part in self.parts.values():
            self._component(elements, part)
        pairs = [pair for c in self.connections for pair in self._pairs(c)]
        connections = _add(system, SSD, "Connections") if pairs else None
        for c, source, target, late in pairs:
            self._connection(connections, c, source, target, late)
        self._add_enumerations(root, SSD)
        self._add_units(root, SSD, self.units)
        self._experiment(root, start, stop, facts)
        return xml_text(root)

    # ---------------------------------------------------------------------- components

    def _component(self, elements: etree._Element, part: Part) -> None:
        component = part.component
        source = f"resources/{part.source}"
        element = _add(elements, SSD, "Component", name=part.name, type=FMU_TYPE, source=source)
        if isinstance(component, FMU) and component.interface is not None:
            element.set("implementation", type(component.interface).__name__)
        connectors = self._connectors(part)
        section = _add(element, SSD, "Connectors") if connectors else None
        for name, (port, kind) in connectors.items():
            connector = _add(section, SSD, "Connector", name=name, kind=kind)
            self._type(connector, port)
        self._parameters(element, part)
        facts = _facts(component)
        if facts:
            notes = _add(element, SSD, "Annotations")
            _annotate(notes, "participant", facts)
            if "samplePeriod" in facts:
                _osp_note(notes, "StepSizeHint").set("value", facts["samplePeriod"])

    def _connectors(self, part: Part) -> dict[str, tuple[FMUPort, str]]:
        """Return all outputs, and the connected inputs and local variables."""
        used = {
            end.name for c in self.connections for end in (c.source, c.target) if end.participant == part.name
        }
        found: dict[str, tuple[FMUPort, str]] = {}
        for name, port in part.ports.items():
            kind = port.variables[0].causality
            if (kind == "output" or name in used) and (self.version == "2.0" or port.type in TYPES_1):
                for variable in port.variables:
                    if len(port.variables) == port.size or self.version == "2.0":
                        found[str(variable.name)] = (port, str(kind))
        return found

    def _type(self, connector: etree._Element, port: FMUPort) -> None:
        kind = port.type if self.version == "2.0" else TYPES_1[port.type]
        element = _add(connector, SSC, kind)
        self._set_unit(element, port.unit, self.units)
        if kind == "Enumeration":
            declared = port.variables[0].declaredType
            self.enumerations[declared.name] = [(i.name, int(i.value)) for i in declared.items]
            element.set("name", declared.name)
        if len(port.variables) != port.size:
            for n in port.shape:
                _add(connector, SSC, "Dimension", size=str(n))

    def _parameters(self, parent: etree._Element, part: Part) -> None:
        """Write the parameter set: parameters of a participant, start values of an FMU."""
        values = _values(part)
        if not values:
            return
        binding = _add(_add(parent, SSD, "ParameterBindings"), SSD, "ParameterBinding")
        inside = _add(binding, SSD, "ParameterValues")
        parameters = _add(inside, SSV, "ParameterSet", version=self.version, name=PARAMETER_SET)
        section = _add(parameters, SSV, "Parameters")
        units: set[str] = set()
        for variable, given in values:
            parameter = _add(section, SSV, "Parameter", name=variable.name)
            kind = variable.type if self.version == "2.0" else TYPES_1[variable.type]
            texts = [_text(v, variable) for v in given]
            if kind in ("String", "Binary", "Enumeration") and len(texts) > 1:
                element = _add(parameter, SSV, kind)
                for text in texts:
                    _add(element, SSV, "Value", value=text)
            else:
                element = _add(parameter, SSV, kind, value=" ".join(texts))
            self._set_unit(element, unit_of(variable), units)
            for n in part.shape(variable):
                _add(parameter, SSC, "Dimension", size=str(n))
        self._add_units(parameters, SSV, units)

    def _set_unit(self, element: etree._Element, unit: str | None, units: set[str]) -> None:
        """Name the unit of a real number, if the FMU defines it."""
        real = str(element.tag).rpartition("}")[2] in ("Real", "Float64", "Float32")
        if real and unit is not None and unit in self.definitions.definitions:
            units.add(unit)
            element.set("unit", unit)

    # --------------------------------------------------------------------- connections

    def _pairs(self, c: Connection) -> list[tuple[Connection, str, str, np.ndarray | None]]:
        """Return a connection as pairs of connectors: whole arrays, or element by element."""
        sources, targets = self._names(c.source), self._names(c.target)
        if len(sources) == len(targets) == 1:
            return [(c, sources[0], targets[0], c.initial)]
        sources, targets = self._names(c.source, each=True), self._names(c.target, each=True)
        if len(sources) == 1:
            sources = sources * len(targets)
        late = [None] * len(targets) if c.initial is None else np.broadcast_to(c.initial, len(targets))
        return [
            (c, a, b, None if x is None else np.array([x]))
            for a, b, x in zip(sources, targets, late, strict=True)
        ]

    def _names(self, end: Port, each: bool = False) -> list[str]:
        """Return the connectors of one end; an element of an array connector has its indices after a bar."""
        port = self.parts[end.participant].ports[end.name]
        if len(port.variables) == port.size:
            return port.elements()[end.first : end.first + end.count]
        if end.count == port.size and not each:
            return [port.name]
        indices = list(product(*(range(1, n + 1) for n in port.shape)))
        return [f"{port.name}|{' '.join(map(str, i))}" for i in indices[end.first : end.first + end.count]]

    def _connection(
        self, parent: etree._Element, c: Connection, source: str, target: str, late: np.ndarray | None
    ) -> None:
        element = _add(parent, SSD, "Connection")
        for which, end, text in (("start", c.source, source), ("end", c.target, target)):
            name, _, indices = text.partition("|")
            element.set(f"{which}Element", end.participant)
            element.set(f"{which}Connector", name)
            if indices:
                element.set(f"{which}Indices", indices)
        if (c.scale, c.offset) != (1.0, 0.0):
            element.set("suppressUnitConversion", "true")
            _add(element, SSC, "LinearTransformation", factor=repr(c.scale), offset=repr(c.offset))
        if late is not None:
            notes = _add(element, SSD, "Annotations")
            _annotate(notes, "delay", {"initial": " ".join(repr(float(x)) for x in late)})

    # ------------------------------------------------------------ units and experiment

    def _add_enumerations(self, root: etree._Element, prefix: str) -> None:
        section = _add(root, prefix, "Enumerations") if self.enumerations else None
        for name, items in self.enumerations.items():
            listed = _add(section, SSC, "Enumeration", name=name)
            for item, value in items:
                _add(listed, SSC, "Item", name=item, value=str(value))

    def _add_units(self, parent: etree._Element, prefix: str, units: set[str]) -> None:
        section = _add(parent, prefix, "Units") if units else None
        for name in sorted(units):
            unit = _add(section, SSC, "Unit", name=name)
            etree.SubElement(unit, tag(SSC, "BaseUnit"), self.definitions.attributes(name))

    def _experiment(
        self, root: etree._Element, start: float, stop: float | None, facts: dict[str, str]
    ) -> None:
        if stop is None and not facts:
            return
        experiment = _add(root, SSD, "DefaultExperiment", startTime=repr(float(start)))
        if stop is not None:
            experiment.set("stopTime", repr(float(stop)))
        if facts:
            notes = _add(experiment, SSD, "Annotations")
            _annotate(notes, "experiment", facts)
        if "step" in facts:
            algorithm = _osp_note(notes, "Algorithm")
            fixed = etree.SubElement(algorithm, f"{{{_OSP[1]}}}FixedStepAlgorithm")
            fixed.set("baseStepSize", facts["step"])


def _add(parent: etree._Element, prefix: str, element: str, /, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, tag(prefix, element), attributes)


def _osp_note(notes: Any, tag: str) -> Any:
    """Add an annotation of the Open Simulation Platform, which ecos and libcosim read."""
    return etree.SubElement(_add(notes, SSC, "Annotation", type=_OSP[0]), f"{{{_OSP[1]}}}{tag}")


def _annotate(notes: etree._Element, name: str, facts: dict[str, str]) -> None:
    note = _add(notes, SSC, "Annotation", type=ANNOTATION)
    _add(note, OWN, name, **facts)


def _facts(component: Component) -> dict[str, str]:
    """Return the attributes of a component's annotation: facts that the standard cannot express."""
    facts: dict[str, str] = {}
    if component.as_block:
        facts["kind"] = "block"
        if component.every is not None:
            facts["every"] = str(component.every)
        if component.sample_period is not None:
            facts["samplePeriod"] = repr(component.sample_period)
    if isinstance(component, FMU):
        if isinstance(options := component.interface, ModelExchange):
            facts |= {} if options.solver is None else {"solver": options.solver}
            facts |= {} if options.substeps == 1 else {"substeps": str(options.substeps)}
            facts |= {} if options.tolerance is None else {"tolerance": repr(options.tolerance)}
        facts |= {"eventMode": "true"} if component.event_mode else {}
        facts |= {"isolated": "true"} if component.isolated else {}
    return facts


def _values(part: Part) -> list[tuple[Any, list[Any]]]:
    """Return the variables of a parameter set with their values."""
    variables = {v.name: v for v in part.description.modelVariables}
    if isinstance(part.component, FMU):
        return [(variables[n], values) for n, values in part.component.start_values().items()]
    found = []
    for v in variables.values():
        given = [] if v.causality != "parameter" or v.start is None else [float(x) for x in v.start.split()]
        if given and np.isfinite(given).all():  # SSV cannot express infinity or NaN; the FMU has them
            found.append((v, given))
    return found


def _text(value: Any, variable: Any) -> str:
    """Return a value as the text of an SSV attribute."""
    if isinstance(value, bytes):
        return value.hex()
    if variable.type == "Enumeration":
        items = {int(i.value): str(i.name) for i in variable.declaredType.items}
        return items[int(value)]
    if variable.type == "Boolean":
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
