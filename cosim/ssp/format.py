"""The parts of SSP that the reader and the writer share: namespaces, annotations, units, XML.

SSP has no attribute for the instants at which a component acts, or for the step of a run.
structcosim keeps them in annotations, which other tools skip (SSP 1.0, 4.2: unknown types are
ignored):

    on a component     <participant kind="block" every="2" samplePeriod="0.01"/>
                       <participant solver="cvode" tolerance="1e-8" substeps="4" eventMode="true"
                                    isolated="true"/>
    on a connection    <delay initial="0.5 1.0"/>             one communication step late
    on the experiment  <experiment step="0.01" coupling="sampled" solver="ode3"/>
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from lxml import etree

from ..errors import CosimError
from ..fmi.ports import unit_definitions
from ..units import BASE_UNITS, Definition

SSD, SSC, SSV, SSM, SSB, OWN = "ssd", "ssc", "ssv", "ssm", "ssb", "structcosim"
_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    SSD: f"{_SSP}Description",
    SSC: f"{_SSP}Common",
    SSV: f"{_SSP}ParameterValues",
    SSM: f"{_SSP}ParameterMapping",
    SSB: f"{_SSP}SignalDictionary",
    OWN: "urn:structcosim:ssp:1",
}
ANNOTATION = "structcosim"
VERSIONS = ("1.0", "2.0")
FMU_TYPE = "application/x-fmu-sharedlibrary"
ROOT = "SystemStructure.ssd"
#: elements of SSP 1.0 by type of FMI; SSP 2.0 has an element of the same name for each type of FMI 3.0
TYPES_1 = {
    "Real": "Real",
    "Float64": "Real",
    "Integer": "Integer",
    "Int32": "Integer",
    "Boolean": "Boolean",
    "String": "String",
    "Enumeration": "Enumeration",
    "Binary": "Binary",
}
#: the name of a unit, and its definition if a file or an FMU gives one
Unit: TypeAlias = tuple[str | None, Definition | None]


class SSPError(CosimError):
    """An SSP that cannot be read or written; the text says where and what is supported."""


def tag(prefix: str, name: str) -> str:
    """Return the qualified name of an element, as lxml writes it."""
    return f"{{{NAMESPACES[prefix]}}}{name}"


def parse_xml(text: bytes, where: str) -> etree._Element:
    """Parse XML that may be hostile: entities are not expanded, no other file is loaded."""
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        raise SSPError(f"{where} is not valid XML: {error}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise SSPError(f"{where} has a document type declaration (DTD), which SSP does not use; remove it")
    return root


def own_annotation(element: etree._Element, prefix: str, name: str) -> Mapping[str, str]:
    """Return the attributes of structcosim's annotation `name` of an element, {} without one."""
    place = f"{prefix}:Annotations/{SSC}:Annotation[@type='{ANNOTATION}']/{OWN}:{name}"
    found = element.find(place, NAMESPACES)
    return {} if found is None else {str(k): str(v) for k, v in found.attrib.items()}


def numbers(text: str, where: str) -> list[float]:
    """Return the numbers of a text in the notation of XML Schema."""
    try:
        return [float(_INFINITE.get(part, part)) for part in text.split()]
    except ValueError:
        raise SSPError(f"{where}: '{text}' must be numbers, separated by spaces") from None


def number(text: str, where: str) -> float:
    """Return one number."""
    found = numbers(text, where)
    if len(found) != 1:
        raise SSPError(f"{where}: '{text}' must be one number")
    return found[0]


def whole_numbers(text: str, where: str) -> list[int]:
    """Return the whole numbers of a text."""
    try:
        return [int(part) for part in text.split()]
    except ValueError:
        raise SSPError(f"{where}: '{text}' must be a whole number") from None


def whole_number(text: str, where: str) -> int:
    """Return one whole number."""
    found = whole_numbers(text, where)
    if len(found) != 1:
        raise SSPError(f"{where}: '{text}' must be one whole number")
    return found[0]


def factor_and_offset(element: etree._Element, where: str) -> tuple[float, float]:
    """Return the attributes of a LinearTransformation or a BaseUnit."""
    return number(element.get("factor", "1"), where), number(element.get("offset", "0"), where)


_INFINITE = {"INF": "inf", "-INF": "-inf"}


def flag(text: str | None) -> bool:
    """Return the value of an xs:boolean attribute; false where it is absent."""
    return text in ("true", "1")


@dataclass
class Units:
    """The units that a file defines; pint knows the other names."""

    definitions: dict[str, Definition] = field(default_factory=dict)

    @classmethod
    def of(cls, parent: etree._Element, prefix: str, where: str) -> Units:
        """Read the `Units` element of a file."""
        found = cls()
        for unit in parent.iterfind(f"{prefix}:Units/{SSC}:Unit", NAMESPACES):
            base = unit.find(f"{SSC}:BaseUnit", NAMESPACES)
            if base is not None:
                place = f"{where}, unit '{unit.get('name')}'"
                exponents = [number(base.get(n, "0"), place) for n in BASE_UNITS]
                factor, offset = factor_and_offset(base, place)
                if not all(map(math.isfinite, (*exponents, 1.0 / factor if factor else math.inf, offset))):
                    raise SSPError(
                        f"{place}: exponents, factor {factor} and offset {offset} must be finite, and the "
                        "factor must not be 0"
                    )
                defined = Definition(tuple(map(int, exponents)), factor, offset)
                found.definitions[unit.get("name", "")] = defined
        return found

    def add_fmu(self, description: Any) -> None:
        """Add the units that an FMU defines; an earlier definition of the same name is kept."""
        self.definitions = unit_definitions(description) | self.definitions

    def attributes(self, name: str) -> dict[str, str]:
        """Return the attributes of a unit's BaseUnit, which are those of FMI."""
        unit = self.definitions[name]
        found = {n: str(e) for n, e in zip(BASE_UNITS, unit.exponents, strict=True) if e}
        found |= {"factor": repr(unit.factor)} if unit.factor != 1.0 else {}
        return found | ({"offset": repr(unit.offset)} if unit.offset != 0.0 else {})

    def of_name(self, name: str | None) -> Unit:
        """Return a unit with the definition that the file gives."""
        return name, self.definitions.get(name or "")


def element_name(path: tuple[str, ...]) -> str:
    """Return the participant's name for an element of nested systems; other characters become underscores."""
    name = re.sub(r"\W", "_", "_".join(path))
    return name if re.match(r"[A-Za-z_]", name) else f"_{name}"
