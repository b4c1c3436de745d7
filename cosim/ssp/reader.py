"""A system from an SSP (System Structure and Parameterization, 1.0 and 2.0).

    system = read_ssp("loop.ssp")
    system = read_ssp("loop.ssp", replace={"control": MyController()})

Components are FMUs with the start values that the package binds to them. Nested systems are
flattened: `plant.damper` becomes the participant `plant_damper`. Signal dictionaries,
connectors of systems, units and linear transformations are resolved to plain connections.
An element that is not supported is an error that names it: mapping transformations, other
packages as components, clocks. fmus/packaging/ssp.py writes SSPs; format.py lists the
annotations in which structcosim goes beyond the standard.
"""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from ..core.component import Component
from ..core.participant import Block, Participant
from ..errors import CosimError, WiringError, did_you_mean
from ..fmi.file.archive import Archive, Extraction
from ..fmi.file.model_description import read_description
from ..fmi.fmu import FMU
from ..fmi.interfaces import interface_of
from ..fmi.ports import unit_definitions, unit_of
from ..system.system import System
from ..units import conversion
from .format import (
    FMU_TYPE,
    NAMESPACES,
    ROOT,
    SSD,
    VERSIONS,
    SSPError,
    Unit,
    Units,
    element_name,
    flag,
    number,
    own_annotation,
    parse_xml,
    tag,
    whole_number,
)
from .parameters import Parameters, Value
from .structure import Element, Link, Node, Structure


@dataclass(frozen=True)
class Experiment:
    """The default experiment of a package, times in s; None where the package gives no value."""

    start: float | None = None
    stop: float | None = None
    step: float | None = None
    coupling: str | None = None
    solver: str | None = None


@dataclass(frozen=True)
class Package:
    """The contents of an SSP: the system, and its default experiment."""

    system: System
    experiment: Experiment


def read_ssp(
    path: str | PathLike[str], *, replace: Mapping[str, Component | type[Participant]] | None = None
) -> System:
    """Return the system of an SSP; `replace` gives participants that replace components, by name.

    A replacement needs ports with the names of the component's connectors; it does not take
    the values that the package binds to the component. A class is instantiated with its own
    start values, and acts with the period of the component.
    """
    return read_package(path, replace=replace).system


def read_package(
    path: str | PathLike[str], *, replace: Mapping[str, Component | type[Participant]] | None = None
) -> Package:
    """Return the system and the default experiment of an SSP."""
    with Archive(Path(path), "SSP") as archive:
        return _Reader(archive, dict(replace or {})).package()


class _Reader:
    """Reads one package."""

    def __init__(self, archive: Archive, replace: dict[str, Component | type[Participant]]) -> None:
        self.where = archive.path.name
        self.archive = archive
        self.replace = replace
        #: the replacements of components by name
        self.replaced: dict[str, Component] = {}
        self.extraction: Extraction | None = None
        self.root = parse_xml(self.read(ROOT, self.where), f"{self.where}/{ROOT}")
        version = self.root.get("version", "none")
        if self.root.tag != tag(SSD, "SystemStructureDescription") or version not in VERSIONS:
            raise SSPError(f"{self.where} has SSP version {version}; versions 1.0 and 2.0 are supported")
        self.structure = Structure(self.root, self.where)
        self.units = Units.of(self.root, SSD, self.where)
        self.parameters = Parameters(self.structure.root, self.read, self.where)

    def read(self, source: str, where: str) -> bytes:
        """Return an XML file of the package by the URI that names it."""
        return self.archive.read(source if source == ROOT else self._name(source, where))

    def _name(self, source: str, where: str) -> str:
        """Return the name in the archive for a URI."""
        uri = urlsplit(source)
        name = posixpath.normpath(unquote(uri.path))
        if uri.scheme or uri.netloc or uri.fragment or name.startswith(("/", "..")):
            raise SSPError(f"{where}: '{source}' is outside the package, which is not supported")
        if name not in self.archive.names:
            hint = did_you_mean(name, self.archive.names)
            raise SSPError(f"{where}: the package has no file '{name}'{hint}")
        return name

    def package(self) -> Package:
        """Build the system."""
        system = System()
        links = list(self.structure.links())
        names: dict[str, Element] = {}
        for path, element in self.structure.components.items():
            name = element_name(path)
            if name in names:
                other = ".".join(names[name].path)
                raise SSPError(
                    f"{self.where}: {other} and {'.'.join(path)} would both be '{name}'; rename one"
                )
            names[name] = element
        for name in self.replace:
            if name not in names:
                raise WiringError(f"{self.where} has no component '{name}'" + did_you_mean(name, names))
        for name, element in names.items():
            system.add(
                name, self._other(name, element) if name in self.replace else self._fmu(element, links)
            )
        for link in links:
            if link.origin.path in self.structure.components:
                self._connect(system, link)
        return Package(system, self._experiment())

    # ---------------------------------------------------------------------- components

    def _other(self, name: str, element: Element) -> Component:
        """Return the participant that replaces a component."""
        given = self.replace[name]
        if isinstance(given, type):
            where = f"{self.where}: {name} is replaced by a {given.__name__}"
            options = self._options(element, where) if issubclass(given, Block) else {}
            try:
                given = given(**{n: options[n] for n in ("every", "sample_period") if n in options})
            except CosimError as error:
                raise type(error)(f"{where}: {error}") from error
        self.replaced[name] = given
        return given

    def _fmu(self, element: Element, links: list[Link]) -> FMU:
        where = f"{self.where}: component {'.'.join(element.path)}"
        source = element.xml.get("source")
        if not source:
            raise SSPError(f"{where} has no FMU (no source attribute); give a replacement, replace=")
        kind = element.xml.get("type", FMU_TYPE)
        if kind != FMU_TYPE:
            raise SSPError(f"{where} is of type {kind}, which is not supported; use FMUs ({FMU_TYPE})")
        name = self._name(source, where)
        if self.extraction is None:
            self.extraction = self.archive.extraction()
        path = self.extraction.folder / name
        try:
            start = self._start_values(element, read_description(path), links)
            fmu = FMU(path, start=start, **self._options(element, where))
        except CosimError as error:
            raise type(error)(f"{where}: {error}") from error
        fmu.kept = self.extraction
        return fmu

    def _options(self, element: Element, where: str) -> dict[str, Any]:
        """Return the keywords of an FMU that the element and its annotation give."""
        own = own_annotation(element.xml, SSD, "participant")
        implementation = element.xml.get("implementation", "any")
        return {
            "interface": interface_of(
                str(element.xml.get("source")),
                None if implementation == "any" else implementation,
                solver=own.get("solver"),
                substeps=whole_number(own["substeps"], where) if "substeps" in own else None,
                tolerance=number(own["tolerance"], where) if "tolerance" in own else None,
                event_mode=flag(own["eventMode"]) if "eventMode" in own else None,
            ),
            "as_block": own.get("kind") == "block",
            "every": whole_number(own["every"], where) if "every" in own else None,
            "sample_period": number(own["samplePeriod"], where) if "samplePeriod" in own else None,
            "isolated": "isolated" in own and flag(own["isolated"]),
        }

    def _start_values(self, element: Element, description: Any, links: list[Link]) -> dict[str, Any]:
        self.units.add_fmu(description)
        variables = {v.name: v for v in description.modelVariables}
        found = self.parameters.of(element)
        defined = unit_definitions(description)

        def unit(variable: Any) -> Unit:
            name = unit_of(variable)
            return name, defined.get(name or "")

        start = {
            n: self._start(value, variables[n], unit(variables[n]))
            for n, value in found.items()
            if n in variables
        }
        for link in links:
            if link.target.path == element.path and link.target.name in variables:
                value = self.parameters.values.get(link.origin)
                if value is not None and link.origin.path not in self.structure.components:
                    start[link.target.text] = self._along(link, value, unit(variables[link.target.name]))
        return start

    def _start(self, value: Value, variable: Any, unit: Unit) -> Any:
        if value.kind != "Enumeration":
            return value.in_unit(unit, self.units)
        items = {i.name: int(i.value) for i in getattr(variable.declaredType, "items", None) or []}
        names = value.value if isinstance(value.value, list) else [value.value]
        for name in names:
            if name not in items:
                raise SSPError(f"{variable.name} has no item '{name}'" + did_you_mean(name, items))
        return [items[n] for n in names] if isinstance(value.value, list) else items[value.value]

    def _along(self, link: Link, value: Value, unit: Unit) -> Any:
        """Return the value of a system's connector as it arrives at a component's connector."""
        first = self.units.of_name(self.structure.units.get(link.origin) or value.unit)
        scale, offset = self._transformation(link, first, unit)
        plain = value.in_unit(first, self.units)
        return plain if (scale, offset) == (1.0, 0.0) else scale * plain + offset

    # --------------------------------------------------------------------- connections

    def _connect(self, system: System, link: Link) -> None:
        origin, target = link.origin, link.target
        kind = self.structure.components[target.path].kinds[target.name]
        if kind in ("parameter", "structuralParameter"):
            raise SSPError(
                f"{self.where}: {origin} -> {target} connects a parameter to another component, "
                "which is not supported; bind a value to it"
            )
        a, b = (f"{element_name(node.path)}.{node.text}" for node in (origin, target))
        text = " -> ".join(map(str, [origin, *(edge.target for edge in link.edges)]))
        initial = link.edges[0].initial
        late = None if initial is None else np.array(initial)
        if len(link.edges) > 1 and any(edge.initial is not None for edge in link.edges):
            raise SSPError(
                f"{self.where}: {text} is delayed on part of its path, which is not supported; "
                "delay a direct connection"
            )
        try:
            transformation = None
            source, sink = system.port(a, "output"), system.port(b, "input")
            if source.kind == sink.kind == "number":
                relative = source.relative or sink.relative
                ends = (source.unit, source.definition), (sink.unit, sink.definition)
                transformation = self._transformation(link, *ends, relative)
            elif any((edge.factor, edge.offset) != (1.0, 0.0) for edge in link.edges):
                transformation = (0.0, 0.0)  # `connect` refuses any for a string
            system.connect(a, b, initial=late, transformation=transformation)
        except WiringError as error:
            names = (element_name(node.path) for node in (origin, target))
            for name in (n for n in names if n in self.replaced):
                other = self.replaced[name]
                ports = ", ".join([*other.ports("input"), *other.ports("output")])
                text += f" ({name} is replaced by a {type(other).__name__}, ports: {ports})"
            raise WiringError(f"{self.where}: {text}: {error}") from error

    def _transformation(
        self, link: Link, first: Unit, last: Unit, relative: bool = False
    ) -> tuple[float, float]:
        """Return (factor, offset) from a port's unit through all connectors to another port's unit.

        Relative quantities are differences; their units are converted without an offset.
        """
        scale, offset, unit = 1.0, 0.0, first

        def apply(factor: float, shift: float) -> None:
            nonlocal scale, offset
            if (factor, shift) != (1.0, 0.0):
                scale, offset = factor * scale, factor * offset + shift

        def to(other: Unit) -> None:
            nonlocal unit
            factor, shift = conversion(unit[0], other[0], unit[1], other[1])
            apply(factor, 0.0 if relative else shift)
            unit = other if other[0] else unit

        to(self._unit_at(link.origin))
        for edge in link.edges:
            other = self._unit_at(edge.target)
            if edge is link.edges[-1] and not other[0]:
                other = last  # a linear transformation comes after the conversion
            if edge.keep_unit:
                unit = other
            else:
                to(other)
            apply(edge.factor, edge.offset)
        to(last)
        return scale, offset

    def _unit_at(self, node: Node) -> Unit:
        return self.units.of_name(self.structure.units.get(node.whole))

    def _experiment(self) -> Experiment:
        found = self.root.find(f"{SSD}:DefaultExperiment", NAMESPACES)
        if found is None:
            return Experiment()
        own = own_annotation(found, SSD, "experiment")
        where = f"{self.where}: default experiment"
        texts = {"start": found.get("startTime"), "stop": found.get("stopTime"), "step": own.get("step")}
        times = {name: number(text, where) for name, text in texts.items() if text}
        return Experiment(**times, coupling=own.get("coupling"), solver=own.get("solver"))
