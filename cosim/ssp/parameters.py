"""Parameter values of an SSP (SSV, SSM): the start values of connectors and variables.

A binding of a component names its variables; a binding of a system names the variables of its
elements, `element.variable`, or its own connectors. A later binding overrides an earlier one, and
a binding of a system overrides those of its elements. Values for unknown names are ignored, as
the standard requires (SSP 2.0, 5.2.3), so that one set may serve many systems.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lxml import etree

from ..units import conversion
from .format import (
    NAMESPACES,
    SSC,
    SSD,
    SSM,
    SSV,
    SSPError,
    Unit,
    Units,
    factor_and_offset,
    flag,
    numbers,
    parse_xml,
    tag,
    whole_numbers,
)
from .structure import Element, Node

_REALS = {"Real", "Float64", "Float32"}
_INTEGERS = {"Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))}


@dataclass(frozen=True)
class Value:
    """A parameter value in the unit that its file gives; `kind` is its type in the file."""

    kind: str
    value: Any
    unit: str | None
    units: Units
    factor: float = 1.0
    offset: float = 0.0
    keep_unit: bool = False

    def in_unit(self, unit: Unit, units: Units) -> Any:
        """Return the value in a variable's unit, after the transformation of the mapping."""
        if self.kind not in _REALS:
            return self.value
        known = units.definitions | self.units.definitions
        own = known.get(self.unit or "")
        scale, shift = (1.0, 0.0) if self.keep_unit else conversion(self.unit, unit[0], own, unit[1])
        if (scale, shift, self.factor, self.offset) == (1.0, 0.0, 1.0, 0.0):
            return self.value
        return (self.factor * (scale * np.asarray(self.value) + shift) + self.offset).tolist()


class Parameters:
    """The start values that the bindings of all elements give, by connector or variable name."""

    def __init__(self, root: Element, read: Callable[[str, str], bytes], where: str) -> None:
        self.read = read
        self.where = where
        self.values: dict[Node, Value] = {}
        self._bind(root)

    def of(self, element: Element) -> dict[str, Value]:
        """Return the values for the variables of a component."""
        return {node.name: value for node, value in self.values.items() if node.path == element.path}

    def _bind(self, element: Element) -> None:
        for child in element.children.values():
            self._bind(child)
        for binding in element.xml.iterfind(f"{SSD}:ParameterBindings/{SSD}:ParameterBinding", NAMESPACES):
            for name, value in self._binding(element, binding):
                for node in _nodes(element, name):
                    self.values[node] = value

    def _binding(self, element: Element, binding: etree._Element) -> Iterator[tuple[str, Value]]:
        where = f"{self.where}: parameter binding of {'.'.join(element.path) or 'the root system'}"
        values = self._document(binding, "ParameterValues", SSV, "ParameterSet", where)
        if values is None:
            raise SSPError(f"{where} has neither a source nor values; give one of them")
        units = Units.of(values, SSV, where)
        prefix = binding.get("prefix", "")
        given = {
            prefix + p.get("name", ""): _value(p, units, f"{where}, parameter '{p.get('name')}'")
            for p in values.iterfind(f"{SSV}:Parameters/{SSV}:Parameter", NAMESPACES)
        }
        mapped = binding.find(f"{SSD}:ParameterMapping", NAMESPACES)
        if mapped is None:
            yield from given.items()
            return
        mapping = self._document(mapped, None, SSM, "ParameterMapping", where)
        for entry in () if mapping is None else mapping.iterfind(f"{SSM}:MappingEntry", NAMESPACES):
            name = entry.get("source", "")
            if name in given:
                yield entry.get("target", ""), _mapped(given[name], entry, f"{where}, mapping of '{name}'")

    def _document(
        self, element: etree._Element, inside: str | None, prefix: str, name: str, where: str
    ) -> etree._Element | None:
        """Return a parameter set or mapping, from a file of the package or in place."""
        source = element.get("source")
        kind = element.get("type", "application/x-ssp-parameter-")
        if not kind.startswith("application/x-ssp-parameter-"):
            raise SSPError(f"{where}: type '{kind}' is not supported; use SSV and SSM")
        if element.get("sourceBase", "SSD") != "SSD":
            raise SSPError(f"{where}: sourceBase '{element.get('sourceBase')}' is not supported; use SSD")
        if source:
            found = parse_xml(self.read(source, where), f"{self.where}/{source}")
            if found.tag != tag(prefix, name):
                raise SSPError(f"{where}: the root element of {source} must be a {name}")
            return found
        outer = element if inside is None else element.find(f"{SSD}:{inside}", NAMESPACES)
        return None if outer is None else outer.find(f"{prefix}:{name}", NAMESPACES)


def _nodes(element: Element, name: str) -> Iterator[Node]:
    """Yield the nodes that a name in a binding stands for: variables below the element, or a connector."""
    if element.is_component:
        yield Node(element.path, name)
        return
    if name in element.kinds:
        yield Node(element.path, name)
    for child in element.children.values():
        start = f"{child.path[-1]}."
        if name.startswith(start):
            yield from _nodes(child, name.removeprefix(start))


def _value(parameter: etree._Element, units: Units, where: str) -> Value:
    """Read one parameter of a set; several values are an array, row by row."""
    found = next((c for c in parameter if c.tag.startswith(f"{{{NAMESPACES[SSV]}}}")), None)
    if found is None:
        raise SSPError(f"{where} has no value; give an element such as <ssv:Real value=...>")
    kind = str(found.tag).rpartition("}")[2]
    each = [str(v.get("value")) for v in found.iterfind(f"{SSV}:Value", NAMESPACES)]
    text = str(found.get("value", ""))
    values: list[Any]
    if kind in _REALS:
        values = list(numbers(text, where))
    elif kind in _INTEGERS:
        values = list(whole_numbers(text, where))
    elif kind == "Boolean":
        values = [flag(part) for part in text.split()]
    elif kind in ("String", "Enumeration", "Binary"):
        values = each or [text]
    else:
        raise SSPError(f"{where}: type {kind} is not supported")
    if kind == "Binary":
        try:
            values = [bytes.fromhex(v) for v in values]
        except ValueError:
            raise SSPError(f"{where}: '{text}' must be hexadecimal digits, two for each byte") from None
    sizes = [d.get("size", "") for d in parameter.iterfind(f"{SSC}:Dimension", NAMESPACES)]
    if not all(size.isascii() and size.isdigit() and len(size) < 10 for size in sizes):
        raise SSPError(f"{where}: dimensions {sizes} must be whole numbers")
    shape = [int(size) for size in sizes]
    if shape or len(values) != 1:
        try:
            plain = np.array(values, dtype=object).reshape(shape or [-1]).tolist()
        except ValueError:
            raise SSPError(f"{where} has {len(values)} values for dimensions {shape}") from None
        return Value(kind, plain, found.get("unit"), units)
    return Value(kind, values[0], found.get("unit"), units)


def _mapped(value: Value, entry: etree._Element, where: str) -> Value:
    """Apply the transformation of a mapping entry."""
    for child in entry:
        name = str(child.tag).rpartition("}")[2]
        if name.endswith("MappingTransformation"):
            raise SSPError(f"{where}: a {name} is not supported; use a LinearTransformation")
    linear = entry.find(f"{SSC}:LinearTransformation", NAMESPACES)
    keep = flag(entry.get("suppressUnitConversion"))
    if linear is None:
        return replace(value, keep_unit=keep)
    factor, offset = factor_and_offset(linear, where)
    if value.kind not in _REALS:
        raise SSPError(
            f"{where}: a LinearTransformation needs real numbers, and the value is of type {value.kind}"
        )
    return replace(value, factor=factor, offset=offset, keep_unit=keep)
