"""The model description of an FMU: parsed strictly, validated by FMPy, and checked where FMPy is lenient.

FMPy parses modelDescription.xml with entities, and only from an archive or a file named .xml. So
the text is parsed here first, and FMPy gets an archive in memory that contains nothing else.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import Any

from lxml import etree

from ...errors import FMUError
from .archive import Archive
from .display_units import display_units

_LISTS = ("dependencies", "dependenciesKind", "clocks")
_CLOCK = {
    "intervalDecimal": float,
    "shiftDecimal": float,
    "resolution": int,
    "intervalCounter": int,
    "shiftCounter": int,
}


def read_description(path: Path) -> Any:
    """Return FMPy's object of the model description of an FMU, validated.

    Raises FMUError if the file, or its model description, is not valid.
    """
    with Archive(path) as archive:
        return description_of(archive)


def description_of(archive: Archive) -> Any:
    """Return FMPy's object of the model description in an archive, validated."""
    return _validated(archive, parse(archive))


def parse(archive: Archive) -> Any:
    """Return the root element of modelDescription.xml; raise FMUError for other versions of FMI."""
    path, text = archive.path, archive.read("modelDescription.xml")
    # libxml2 bounds depth, sizes and the growth by entities, unless huge_tree is set
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(text, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FMUError(f"{path}: modelDescription.xml is broken: {error}") from error
    if root.getroottree().docinfo.doctype:
        raise FMUError(
            f"{path}: modelDescription.xml has a DOCTYPE, which FMI does not use and entity bombs need; "
            "remove it"
        )
    version = root.get("fmiVersion", "none")
    if root.tag != "fmiModelDescription":
        raise FMUError(
            f"{path}: modelDescription.xml must describe an FMU, and its root is {str(root.tag)[:80]!r}"
        )
    if version != "2.0" and not re.fullmatch(r"3\.\d.*", version):
        raise FMUError(
            f"{path} has FMI version {version[:80]}; FMI 2.0 and 3.0 are supported: export it as one of them"
        )
    return root


def _validated(archive: Archive, root: Any) -> Any:
    import fmpy
    from fmpy.model_description import ValidationError

    path = archive.path
    for element in root.iterfind("ModelStructure//*"):
        for name in _LISTS:  # a list may contain any white space; FMPy splits at single blanks
            if name in element.attrib:
                element.set(name, " ".join(element.get(name).split()))
    for element in root.iterfind("ModelVariables/*[@clocks]"):
        element.set("clocks", " ".join(element.get("clocks").split()))
    if root.get("fmiVersion") == "2.0":
        _add_variability(root)
    only = io.BytesIO()
    with zipfile.ZipFile(only, "w") as written:
        written.writestr("modelDescription.xml", etree.tostring(root.getroottree(), encoding="UTF-8"))
    try:
        description = fmpy.read_model_description(only)
    except ValidationError as error:
        problems = [" ".join(str(p).split())[:300] for p in error.problems]
        more = f"; and {len(problems) - 3} more" if len(problems) > 3 else ""
        raise FMUError(
            f"{path} has an invalid modelDescription.xml: {'; '.join(problems[:3])}{more}"
        ) from error
    except Exception as error:  # FMPy raises bare Exception, and KeyError and such for what it does not check
        reason = str(error) if type(error) is Exception else f"FMPy cannot interpret it ({error!r})"
        raise FMUError(f"{path} has an invalid modelDescription.xml: {reason[:400]}") from error
    _check_structure(archive, root, description)
    _complete(root, description)
    return description


def _add_variability(root: Any) -> None:
    """Make variables other than reals discrete where their variability is missing, as in FMI 3.0.

    In FMI 2.0 the default is "continuous" for all types, but only reals may be continuous, so that
    other types must state their variability. Many files omit it (the outputs of pythonfmu, the
    Reference FMUs of 2019), and can only mean "discrete".
    """
    for element in root.iterfind("ModelVariables/ScalarVariable"):
        is_signal = element.get("causality", "local") in ("local", "input", "output")
        if is_signal and "variability" not in element.attrib and element.find("Real") is None:
            element.set("variability", "discrete")


def _complete(root: Any, description: Any) -> None:
    """Fill the fields of FMPy's object that FMPy does not read."""
    for unit, element in zip(description.unitDefinitions, root.iterfind("UnitDefinitions/Unit"), strict=True):
        unit.displayUnits = display_units(element)
    elements: dict[str, Any] = {}
    for element in root.iterfind("ModelVariables/*"):
        names = [element.get("name"), *(alias.get("name") for alias in element.iterfind("Alias"))]
        elements.update((name, element) for name in names)
    for variable in description.modelVariables:
        element = elements[variable.name]
        inner = next(iter(element.iterchildren("Real")), element)  # of FMI 2.0
        if inner.get("relativeQuantity") is not None:
            variable.relativeQuantity = inner.get("relativeQuantity") in ("true", "1")
        if variable.type == "Clock":
            for name, kind in _CLOCK.items():
                if name in element.attrib:
                    setattr(variable, name, kind(element.get(name)))


def _check_structure(archive: Archive, root: Any, description: Any) -> None:
    """Refuse references that pass FMPy's validation but would lead to a wrong variable."""
    path = archive.path
    n = len(description.modelVariables)
    if description.fmiVersion == "2.0":
        for unknown in root.iterfind("ModelStructure/*/Unknown"):
            listed = [unknown.get("index"), *unknown.get("dependencies", "").split()]
            if not all(1 <= int(i) <= n for i in listed):  # FMPy takes 0 for the last variable
                raise FMUError(
                    f"{path}: line {unknown.sourceline} of modelDescription.xml refers to a variable by its "
                    f"number, which must be from 1 to {n}"
                )
        inputs: dict[tuple[str, int], str] = {}
        for v in description.modelVariables:
            if v.causality == "input":
                kind = "Integer" if v.type == "Enumeration" else v.type
                other = inputs.setdefault((kind, v.valueReference), v.name)
                if other != v.name:
                    raise FMUError(
                        f"{path}: inputs {other} and {v.name} have the same value reference "
                        f"{v.valueReference}, so one would overwrite the other"
                    )
    for interface in (description.modelExchange, description.coSimulation):
        name = interface.modelIdentifier if interface is not None else ""
        if re.search(r"[/\\:\0]", name):
            raise FMUError(f"{path}: modelIdentifier {name[:80]!r} is a path; it must be the name of a file")
