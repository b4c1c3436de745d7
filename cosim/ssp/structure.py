"""The structure in an SSD: nested systems and signal dictionaries, flattened to links between components.

A connector of a component, a system or a signal dictionary is a node of a graph; a
connection is an edge. The kinds of the two connectors give the direction of the value,
not "start" and "end" (SSP 2.0, 5.3.2.1). The source of a component's input is found by
walking the edges back to the output of another component.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

from lxml import etree

from ..errors import did_you_mean
from .format import NAMESPACES, SSB, SSC, SSD, SSPError, factor_and_offset, flag, numbers, own_annotation, tag

Path: TypeAlias = tuple[str, ...]
#: kinds of connectors that give a value to the outside of their element
_GIVING = {"output", "calculatedParameter", "constant", "local"}
_TAKING = {"input", "parameter", "structuralParameter"}
_EITHER = {"inout", "unspecified"}
_MAPPINGS = [f"{SSC}:{kind}MappingTransformation" for kind in ("Boolean", "Integer", "Enumeration")]


@dataclass(frozen=True)
class Node:
    """A connector: the path of its element, its name, and in an array of SSP 2.0 the index of one element."""

    path: Path
    name: str
    index: tuple[int, ...] = ()

    @property
    def text(self) -> str:
        """The name with the index, written as in a port's name."""
        return self.name + (f"[{','.join(map(str, self.index))}]" if self.index else "")

    @property
    def whole(self) -> Node:
        """The connector without the index."""
        return Node(self.path, self.name)

    def __str__(self) -> str:
        return ".".join([*self.path, self.text])


@dataclass(frozen=True)
class Edge:
    """target = factor * (source, in the target's unit) + offset; with `initial`, one step late."""

    source: Node
    target: Node
    factor: float
    offset: float
    keep_unit: bool
    initial: tuple[float, ...] | None

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


@dataclass(frozen=True)
class Link:
    """The path of a value to a component's connector; `origin` may be an unconnected input of a system."""

    origin: Node
    edges: tuple[Edge, ...]

    @property
    def target(self) -> Node:
        """The connector at its end."""
        return self.edges[-1].target


@dataclass
class Element:
    """A component, a system or a reference to a signal dictionary."""

    path: Path
    xml: etree._Element
    kinds: dict[str, str] = field(default_factory=dict)
    children: dict[str, Element] = field(default_factory=dict)
    #: of a reference: the path under which the dictionary's signals are nodes
    dictionary: Path | None = None

    @property
    def is_component(self) -> bool:
        """Tell whether this is a component, not a system or a reference."""
        return bool(self.xml.tag == tag(SSD, "Component"))


class Structure:
    """The elements and connections of an SSD."""

    def __init__(self, root: etree._Element, where: str) -> None:
        self.where = where
        self.components: dict[Path, Element] = {}
        self.units: dict[Node, str] = {}
        self.feeds: dict[Node, Edge] = {}
        system = root.find(f"{SSD}:System", NAMESPACES)
        if system is None:
            raise SSPError(f"{where} has no System element")
        self.root = self._element(system, (), [])

    # ------------------------------------------------------------------------ elements

    def _element(self, xml: etree._Element, path: Path, dictionaries: list[dict[str, Path]]) -> Element:
        element = Element(path, xml)
        for c in xml.iterfind(f"{SSD}:Connectors/{SSD}:Connector", NAMESPACES):
            name, kind = c.get("name", ""), c.get("kind", "")
            if name in element.kinds:
                raise SSPError(f"{self._at(path)} has two connectors '{name}'")
            element.kinds[name] = kind
            if kind not in _GIVING | _TAKING | _EITHER:
                raise SSPError(f"{self._at(path)}, connector '{name}': kind '{kind}' is not known")
            unit = next((str(t.get("unit")) for t in c if t.get("unit") and t.tag.startswith("{")), None)
            if unit is not None:
                self.units[Node(path, name)] = unit
        if element.is_component:
            self.components[path] = element
        elif xml.tag == tag(SSD, "SignalDictionaryReference"):
            self._refer(element, dictionaries)
        else:
            self._contents(element, dictionaries)
        return element

    def _contents(self, system: Element, dictionaries: list[dict[str, Path]]) -> None:
        own: dict[str, Path] = {}
        for d in system.xml.iterfind(f"{SSD}:SignalDictionaries/{SSD}:SignalDictionary", NAMESPACES):
            own[d.get("name", "")] = (*system.path, f"dictionary {d.get('name')}")
            for entry in d.iterfind(f"{SSB}:SignalDictionary/{SSB}:DictionaryEntry", NAMESPACES):
                for kind in entry:
                    if kind.get("unit"):
                        self.units[Node(own[d.get("name", "")], entry.get("name", ""))] = kind.get("unit", "")
        for child in system.xml.iterfind(f"{SSD}:Elements/*", NAMESPACES):
            name = child.get("name", "")
            if not name or name in system.children:
                raise SSPError(f"{self._at(system.path)}: the element name '{name}' is empty or used twice")
            known = {tag(SSD, kind) for kind in ("Component", "System", "SignalDictionaryReference")}
            if child.tag not in known:
                raise SSPError(f"{self._at((*system.path, name))}: <{child.tag}> is not an element of SSP")
            system.children[name] = self._element(child, (*system.path, name), [own, *dictionaries])
        for c in system.xml.iterfind(f"{SSD}:Connections/{SSD}:Connection", NAMESPACES):
            edge = self._edge(system, c)
            other = self.feeds.setdefault(edge.target, edge)
            if other is not edge:
                raise SSPError(
                    f"{self.where}: {edge.target} is fed by {other.source} and by {edge.source}; "
                    "an input has one source"
                )

    def _refer(self, reference: Element, dictionaries: list[dict[str, Path]]) -> None:
        name = reference.xml.get("dictionary", "")
        found = next((d[name] for d in dictionaries if name in d), None)
        if found is None:
            known = [n for d in dictionaries for n in d]
            hint = did_you_mean(name, known)
            raise SSPError(f"{self._at(reference.path)}: unknown signal dictionary '{name}'{hint}")
        reference.dictionary = found

    def _at(self, path: Path) -> str:
        return f"{self.where}: {'.'.join(path) or 'the root system'}"

    # --------------------------------------------------------------------- connections

    def _edge(self, system: Element, c: etree._Element) -> Edge:
        ends = [self._end(system, c, which) for which in ("start", "end")]
        (a, from_a), (b, from_b) = ends
        text = f"{self.where}: connection {a} - {b}"
        if from_a is None and from_b is None:
            raise SSPError(f"{text}: both connectors are of kind inout, so that the direction is unknown")
        if from_a == from_b:
            kind = "outputs" if from_a else "inputs"
            raise SSPError(f"{text}: both connectors are {kind}; connect an output to an input")
        source, target = (a, b) if from_a or from_b is False else (b, a)
        for mapping in _MAPPINGS:
            if c.find(mapping, NAMESPACES) is not None:
                raise SSPError(f"{text}: a {mapping[4:]} is not supported; use a LinearTransformation")
        factor, offset = 1.0, 0.0
        linear = c.find(f"{SSC}:LinearTransformation", NAMESPACES)
        if linear is not None:
            factor, offset = factor_and_offset(linear, text)
        delay = own_annotation(c, SSD, "delay").get("initial")
        return Edge(
            source,
            target,
            factor,
            offset,
            flag(c.get("suppressUnitConversion")),
            None if delay is None else tuple(numbers(delay, text)),
        )

    def _end(self, system: Element, c: etree._Element, which: str) -> tuple[Node, bool | None]:
        """Return a connection's connector, and whether it gives the value (None: unknown)."""
        name = c.get(f"{which}Connector", "")
        where = c.get(f"{which}Element")
        element = system if where is None else system.children.get(where)
        if element is None:
            raise SSPError(
                f"{self._at(system.path)}: a connection names the unknown element '{where}'"
                + did_you_mean(str(where), system.children)
            )
        kind = element.kinds.get(name)
        if kind is None:
            raise SSPError(
                f"{self._at(element.path)} has no connector '{name}', which a connection names"
                + did_you_mean(name, element.kinds)
            )
        indices = c.get(f"{which}Indices", "").split()
        if not all(re.fullmatch(r"[1-9]\d{0,8}", i) for i in indices):
            raise SSPError(f"{self._at(element.path)}.{name}: indices {indices} must be whole numbers from 1")
        node = Node(element.dictionary or element.path, name, tuple(map(int, indices)))
        gives = None if kind in _EITHER else (kind in _GIVING) != (element is system)
        return node, gives

    def links(self) -> Iterator[Link]:
        """Yield the links to the connectors of components, in the order of the file."""
        for target, edge in self.feeds.items():
            if target.path in self.components:
                yield self._trace(edge)

    def _trace(self, last: Edge) -> Link:
        edges = [last]
        node = last.source
        while node.path not in self.components:
            edge = self.feeds.get(node)
            if edge is None and node.index:
                edge = self.feeds.get(node.whole)
                if edge is not None:  # the same element of the array that feeds this one
                    source = Node(edge.source.path, edge.source.name, node.index)
                    edge = Edge(source, node, edge.factor, edge.offset, edge.keep_unit, edge.initial)
            elif edge is None and any(n.whole == node for n in self.feeds if n.index):
                raise SSPError(
                    f"{self.where}: {node} is fed element by element and read as a whole, which is not "
                    "supported; connect the elements of the components"
                )
            if edge is None:
                break
            if edge in edges:
                raise SSPError(f"{self.where}: {node} feeds itself through connectors of systems")
            edges.append(edge)
            node = edge.source
        return Link(node, tuple(reversed(edges)))
