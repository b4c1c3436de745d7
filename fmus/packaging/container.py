"""Export of a system as one FMU: `export_container(system, "loop.fmu", step=0.01)`.

The FMUs of the components and their connections go into a container of
fmu-manipulation-toolbox (`pip install structcosim[container]`), which steps them in C, one
after the other, each with the latest values of the others. An order exists in which this is
sampled coupling: first the blocks, in the order of their connections, which read the plants'
outputs at t_k; then the plants, each before those that drive it, so that all of them receive
values of t_k or of blocks. Unit conversions and late connections are small FMUs of their own.

Variables are named `component.variable`: all outputs, parameters, and unconnected inputs. At
t_k the container shows a plant's output at t_k and a block's output at t_{k-1}, from its last
step. It differs from `simulate` at t_0: an input of a plant has the value of its source after
initialisation, while in `simulate` it keeps its own start value until the first step. Outputs
with feedthrough show the difference at t_0.
"""

from __future__ import annotations

import logging
import os
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from lxml import etree

from cosim import FMU, Block, Input, Output, Parameter, State, System
from cosim.core.port import Port
from cosim.fmi.ports import FMUPort, unit_of
from cosim.ssp.format import Units
from cosim.system.system import Connection

from ..export.description import DefaultExperiment
from ..export.fmu import write_archive
from ..export.link import ExportError
from .parts import Part, fmu_parts


class Conversion(Block):
    """y = factor u + offset"""

    factor = Parameter(1.0, "factor", fixed=True)
    offset = Parameter(0.0, "offset", fixed=True)
    u = Input("value in one unit", shape="n")
    y = Output("value in another", shape="n")

    def step(self, t: float, h: float) -> None:
        for i in range(self.u.shape[0]):
            self.y[i] = self.factor * self.u[i] + self.offset


class Late(Conversion):
    """y = factor u + offset, one step late; it is stepped first, when a block still has its last u"""

    of_block = Parameter(0.0, "1 if a block gives u, 0 if a plant does", fixed=True)
    kept = State(0.0, "u of the last step", shape="n")
    started = State(0.0, "1 after the first step")

    def step(self, t: float, h: float) -> None:
        for i in range(self.u.shape[0]):
            last = self.u[i] if self.of_block > 0.0 and self.started > 0.0 else self.kept[i]
            self.y[i] = self.factor * last + self.offset
            self.kept[i] = self.u[i]
        self.started = 1.0


def export_container(
    system: System,
    path: str | os.PathLike[str],
    *,
    step: float,
    stop: float | None = None,
    start: float = 0.0,
    fmi_version: str = "2.0",
) -> Path:
    """Write a system as one Co-Simulation FMU that steps its components every `step` seconds.

    A host's communication step must be a multiple of `step`. Raises ExportError for systems that a
    container cannot express: blocks with another period than `step`, plants that drive each other,
    Model Exchange, connections that carry text.
    """
    target = Path(path)
    _check(system, step)
    wired, blocks_first = _with_conversions(system)
    order = _order(wired, blocks_first)
    parts = fmu_parts(wired, fmi_version, None)
    files = _build(
        wired, parts, order, target.stem, DefaultExperiment(start, stop or start + 1000 * step, step)
    )
    write_archive(target, files)
    return target


# -------------------------------------------------------------------------- the schedule


def _with_conversions(system: System) -> tuple[System, list[str]]:
    """Return the system with a block for each conversion and delay, and the blocks in their order."""
    wired = System(dict(system.participants))
    before: list[str] = []  # for outputs of plants
    after: dict[str, list[str]] = {}  # for outputs of blocks
    for i, c in enumerate(system.connections):
        if (c.scale, c.offset) == (1.0, 0.0) and c.initial is None:
            wired.connect(str(c.source), str(c.target), transformation=(1.0, 0.0))
            continue
        name = f"conversion_{i + 1}"
        while name in wired.participants:
            name += "_"
        source = c.source.participant
        of_block = system.participants[source].as_block
        values: dict[str, Any] = {"n": c.source.count, "factor": c.scale, "offset": c.offset}
        if c.initial is not None:
            wired.add(name, Late(of_block=float(of_block), kept=c.initial, **values))
        else:
            wired.add(name, Conversion(**values))
        if of_block and c.initial is None:
            after.setdefault(source, []).append(name)
        else:
            before.append(name)
        # `initial`: a late connection may close a cycle, which would be refused otherwise
        wired.connect(str(c.source), f"{name}.u", initial=None if c.initial is None else 0.0)
        wired.connect(f"{name}.y", str(c.target), transformation=(1.0, 0.0))
    blocks = [n for b in system.block_order() for n in (b, *after.get(b, []))]
    return wired, [*before, *blocks]


def _check(system: System, step: float) -> None:
    for texts in system.text_connections:
        raise ExportError(
            f"{texts.source} -> {texts.target} carries text, which a container cannot connect; "
            "export the system as an SSP"
        )
    for name, component in system.participants.items():
        if component.as_block:
            period = component.sample_period or (component.every or 1) * step
            if abs(period - step) > 1e-9 * step:
                raise ExportError(
                    f"{name} acts every {period:g} s and the container steps all FMUs every {step:g} s; "
                    "export it with this step, or as an SSP"
                )
        if isinstance(component, FMU) and component.model_exchange:
            raise ExportError(
                f"{name} is for Model Exchange, which a container integrates by a method of its own; "
                "use its Co-Simulation interface, or export the system as an SSP"
            )


def _order(system: System, blocks: list[str]) -> list[str]:
    """Return the components in the order of their steps: blocks, then each plant before its drivers."""
    plants = [n for n in system.participants if n not in blocks]
    first: dict[str, set[str]] = {name: set() for name in plants}
    for c in system.connections:
        a, b = c.source.participant, c.target.participant
        if a in first and b in first and a != b:
            first[a].add(b)
    try:
        return [*blocks, *TopologicalSorter(first).static_order()]
    except CycleError as error:
        names = " and ".join(dict.fromkeys(error.args[1]))
        raise ExportError(
            f"{names} drive each other; in a container the last one would receive values of t_k+1 "
            "instead of t_k; export the system as an SSP"
        ) from None


# -------------------------------------------------------------------------- the container


def _build(
    system: System, parts: dict[str, Part], order: list[str], name: str, experiment: DefaultExperiment
) -> dict[str, bytes]:
    """Return the files of the container."""
    try:
        from fmu_manipulation_toolbox.container import FMUContainer, FMUContainerError
    except ImportError:
        raise ExportError(
            "a container needs fmu-manipulation-toolbox: pip install structcosim[container]"
        ) from None
    version = max(part.description.fmiVersion[0] for part in parts.values())
    with tempfile.TemporaryDirectory() as folder, _errors():
        for part in parts.values():
            (Path(folder) / f"{part.name}.fmu").write_bytes(part.file)
        try:
            container = FMUContainer(_identifier(name), folder, fmi_version=int(version))
            for each in order:
                container.get_fmu(f"{each}.fmu")
            _wire(container, system, parts)
            container.start_time, container.stop_time = experiment.start, experiment.stop
            container.make_fmu(f"{_identifier(name)}.container", experiment.step, sequential=True)
        except FMUContainerError as error:
            raise ExportError(f"the container cannot be built: {error}") from error
        with zipfile.ZipFile(Path(folder) / f"{_identifier(name)}.container") as archive:
            files = {n: archive.read(n) for n in archive.namelist()}
    files["modelDescription.xml"] = _described(files["modelDescription.xml"], parts)
    return files


def _identifier(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in name)


def _wire(container: Any, system: System, parts: dict[str, Part]) -> None:
    fed: set[tuple[str, str]] = set()
    for c in system.connections:
        for source, target in _pairs(c, parts):
            container.add_link(f"{c.source.participant}.fmu", source, f"{c.target.participant}.fmu", target)
            fed.add((c.target.participant, target))
    for link in container.links.values():
        link.name = f"connection.{link.name}"  # a local variable: not the name of the output
    for part in parts.values():
        own = not isinstance(part.component, Conversion)
        for v in part.description.modelVariables if own else ():
            name, file = f"{part.name}.{v.name}", f"{part.name}.fmu"
            if v.causality == "output":
                container.add_output(file, v.name, name)
            elif v.causality in ("input", "parameter") and (part.name, v.name) not in fed:
                container.add_input(name, file, v.name)
        if isinstance(part.component, FMU):
            for name, values in part.component.start_values().items():
                container.add_start_value(f"{part.name}.fmu", name, " ".join(map(str, values)))


def _pairs(c: Connection, parts: dict[str, Part]) -> Iterator[tuple[str, str]]:
    """Yield the links of a connection: elements, or whole arrays of FMI 3.0, which cannot be divided."""
    sources, targets = (_names(end, parts[end.participant].ports[end.name]) for end in (c.source, c.target))
    if len(sources) == 1 and len(targets) > 1 and c.source.count == 1:
        sources = sources * len(targets)
    if len(sources) != len(targets):
        raise ExportError(f"{c}: an array and its elements cannot be linked in a container; use FMI 2.0")
    yield from zip(sources, targets, strict=True)


def _names(end: Port, port: FMUPort) -> list[str]:
    if len(port.variables) == port.size:
        return port.elements()[end.first : end.first + end.count]
    if end.count != port.size:
        raise ExportError(f"{end}: a part of an array cannot be linked in a container; use FMI 2.0")
    return [port.name]


def _described(text: bytes, parts: dict[str, Part]) -> bytes:
    """Return modelDescription.xml with the gaps and mistakes of the toolbox repaired.

    It gets units, loses initial unknowns whose start value is exact, as FMI requires, and loses
    the author, license and time of the toolbox.
    """
    root = etree.fromstring(text)
    for name in ("author", "license", "copyright", "generationDateAndTime"):
        root.attrib.pop(name, None)
    units = Units()
    unit_by_name: dict[str, str] = {}
    for part in parts.values():
        units.add_fmu(part.description)
        for v in part.description.modelVariables:
            unit = unit_of(v)
            if unit is not None:
                unit_by_name[f"{part.name}.{v.name}"] = unit
    used: set[str] = set()
    exact: set[str] = set()
    for i, v in enumerate(root.find("ModelVariables")):
        real = v if v.tag != "ScalarVariable" else v.find("Real")
        unit = unit_by_name.get(v.get("name", "").removeprefix("connection."))
        if real is not None and unit in units.definitions and real.tag in ("Real", "Float64", "Float32"):
            real.set("unit", unit)
            used.add(unit)
        if real is not None and (starts := v.findall("Start")):  # numbers have an attribute already
            v.set("start", " ".join(start.get("value") for start in starts))
            for start in starts:
                v.remove(start)
        if v.get("initial") == "exact":
            exact |= {str(i + 1)} if v.tag == "ScalarVariable" else {v.get("valueReference")}
    for unknown in [*root.iterfind("ModelStructure//InitialUnknown"), *root.iterfind(".//InitialUnknowns/*")]:
        if unknown.get("index", unknown.get("valueReference")) in exact:
            unknown.getparent().remove(unknown)
    for empty in [e for e in root.iterfind("ModelStructure/*") if e.tag in ("Outputs", "InitialUnknowns")]:
        if not len(empty):
            empty.getparent().remove(empty)
    if used:
        section = etree.Element("UnitDefinitions")
        for name in sorted(used):
            unit_element = etree.SubElement(section, "Unit", name=name)
            etree.SubElement(unit_element, "BaseUnit", units.attributes(name))
        root.find("CoSimulation").addnext(section)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8"))


@contextmanager
def _errors() -> Iterator[None]:
    """Keep the toolbox's log quiet, and raise the errors that it logs."""
    logger = logging.getLogger("fmu_manipulation_toolbox")
    found: list[str] = []

    class Keep(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            found.append(record.getMessage())

    handler = Keep(logging.ERROR)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagate
    if found:
        raise ExportError(f"the container cannot be built: {'; '.join(found)}")
