"""An FMU as a participant: any FMI 2.0 FMU, Co-Simulation or Model Exchange, loaded by FMPy.

    plant = FMU("plant.fmu", start={"m": 2.0})

Scalar variables that are elements of one array (`accel[1]`, `accel[2]`, ...) appear as
one port with a shape. Real, Integer and Boolean variables are ports.
"""

from __future__ import annotations

import math
import re
import shutil
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .errors import FMUError, did_you_mean
from .participant import Participant

_NUMERIC = ("Real", "Integer", "Boolean", "Enumeration")


@dataclass(frozen=True)
class FMUPort:
    """A port of an FMU: the variables that are its elements, in order."""

    name: str
    shape: tuple[int, ...]
    unit: str | None
    type: str
    variables: tuple[Any, ...]


class FMU:
    """An FMU on disk, and the values it starts with.

    path
        the .fmu file
    start
        values of parameters, inputs or start values by variable name
    substeps
        steps of the solver (ode4) in one communication step, for an FMU that has Model
        Exchange only, under sampled coupling
    """

    def __init__(
        self, path: str | PathLike[str], *, start: Mapping[str, Any] | None = None, substeps: int = 1
    ) -> None:
        import fmpy

        self.path = Path(path)
        #: the participant that was exported to this file, where that is known
        self.source: Participant | None = None
        self.start = dict(start or {})
        self.substeps = substeps
        self.description = read_description(self.path)
        self.has_cs = self.description.coSimulation is not None
        self.has_me = self.description.modelExchange is not None
        self._check_platform(fmpy.platform)
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        readable = [
            v for v in self.variables.values() if v.causality in ("output", "local") and v.type in _NUMERIC
        ]
        writable = [v for v in self.variables.values() if v.causality == "input" and v.type in _NUMERIC]
        self.output_ports = _group(readable)
        self.input_ports = _group(writable)
        self.inputs = {n: (p.shape, p.unit) for n, p in self.input_ports.items()}
        self.outputs = {n: (p.shape, p.unit) for n, p in self.output_ports.items()}
        #: the outputs proper, without local variables: what is recorded unless it is said
        self.declared_outputs = [
            n for n, p in self.output_ports.items() if p.variables[0].causality == "output"
        ]
        for name in self.start:
            if name not in self.variables and name not in _group(self.variables.values()):
                raise FMUError(
                    f"{self.path.name} has no variable '{name}'" + did_you_mean(name, self.variables)
                )
        self.start_values()
        if not isinstance(substeps, int) or substeps < 1:
            raise FMUError(f"{self.path.name}: substeps={substeps!r} is no whole number, 1 or more")
        self.directory = _extracted(self.path)
        weakref.finalize(self, shutil.rmtree, str(self.directory), ignore_errors=True)

    def _check_platform(self, platform: str) -> None:
        with zipfile.ZipFile(self.path) as archive:
            folders = {
                n.split("/")[1] for n in archive.namelist() if n.startswith("binaries/") and n.count("/") > 1
            }
        if platform not in folders:
            raise FMUError(
                f"{self.path} has no binary for {platform} (it has: {', '.join(sorted(folders)) or 'none'}); "
                "export it again for this platform, or with its sources"
            )

    def start_values(self) -> dict[str, Any]:
        """Return the start values that were given, by scalar variable; refuse what does not fit."""
        groups = _group(self.variables.values())
        found: dict[str, Any] = {}
        for name, value in self.start.items():
            port = groups[name] if name in groups else FMUPort(name, (), None, "", (self.variables[name],))
            kind = port.variables[0].type
            try:
                values = [value] if kind == "String" else np.broadcast_to(value, port.shape).ravel().tolist()
                fits = kind == "String" or all(float(v) == int(v) for v in values if kind != "Real")
                fits = fits and (kind != "Boolean" or set(values) <= {0, 1})
                fits = fits and (kind == "String" or all(math.isfinite(float(v)) for v in values))
            except (TypeError, ValueError, OverflowError):
                fits = False
            if not fits:
                shape = f" of shape {port.shape}" if port.shape else ""
                raise FMUError(f"{self.path.name}: start value {name} = {value!r} is no {kind}{shape}")
            found |= {v.name: one for v, one in zip(port.variables, values, strict=True)}
        return found

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output port, the input ports on which it depends directly.

        From the model structure: dependencies that are left out mean all, an empty list none.
        """
        port_of = {v.name: name for name, p in self.input_ports.items() for v in p.variables}
        declared = {u.variable.name: u.dependencies for u in self.description.outputs}
        found: dict[str, set[str]] = {}
        for name, port in self.output_ports.items():
            needs: set[str] = set()
            for variable in port.variables:
                listed = declared.get(variable.name)
                if listed is None:
                    needs |= set(self.input_ports)
                else:
                    needs |= {port_of[v.name] for v in listed if v.name in port_of}
            found[name] = needs
        return found

    @staticmethod
    def unit_of(variable: Any) -> str | None:
        """Return the unit of one of FMPy's variables, its own or its declared type's."""
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared is not None else None)
        return str(unit) if unit else None

    def __repr__(self) -> str:
        kinds = " and ".join(
            k for k, has in (("Co-Simulation", self.has_cs), ("Model Exchange", self.has_me)) if has
        )
        return f"FMU({self.path.name}: FMI {self.description.fmiVersion}, {kinds})"


def read_description(path: Path) -> Any:
    """Read and validate the model description of an FMU; return FMPy's object."""
    import fmpy
    from lxml.etree import XMLSyntaxError

    if not path.is_file():
        raise FMUError(f"there is no file {path}; give the path of an .fmu file")
    if not zipfile.is_zipfile(path):
        raise FMUError(f"{path} is no FMU: it is not a ZIP archive; was it copied completely?")
    with zipfile.ZipFile(path) as archive:
        if "modelDescription.xml" not in archive.namelist():
            raise FMUError(f"{path} is no FMU: it has no modelDescription.xml at its top")
        text = archive.read("modelDescription.xml")
    found = re.search(rb'fmiVersion\s*=\s*"([^"]*)"', text)
    version = found[1].decode(errors="replace") if found else "none"
    if version != "2.0":
        raise FMUError(f"{path} has FMI version {version}; FMI 2.0 is supported: export it as FMI 2.0")
    try:
        return fmpy.read_model_description(str(path))
    except XMLSyntaxError as error:
        raise FMUError(f"{path}: modelDescription.xml is broken: {error}") from error
    except Exception as error:  # FMPy raises bare Exception for what its validation finds
        raise FMUError(f"{path} has an invalid modelDescription.xml: {_first_lines(error)}") from error


def _first_lines(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return " ".join(lines[:4])


def _extracted(path: Path) -> Path:
    import fmpy

    try:
        return Path(fmpy.extract(str(path)))
    except Exception as error:  # FMPy raises bare Exception for an illegal path
        raise FMUError(f"{path} cannot be extracted: {error}") from error


def _group(variables: Any) -> dict[str, FMUPort]:
    """Join scalar variables `x[1]`, `x[2]` (or `K[1,1]`, ...) to array ports; keep the others."""
    groups: dict[str, dict[tuple[int, ...], Any]] = {}
    ports: dict[str, FMUPort] = {}
    for v in variables:
        match = re.fullmatch(r"(.*[^\]])\[(\d+(?:,\s*\d+)*)\]", v.name)
        if match:
            index = tuple(int(i) for i in match[2].split(","))
            groups.setdefault(match[1], {})[index] = v
        else:
            ports[v.name] = FMUPort(v.name, (), FMU.unit_of(v), v.type, (v,))
    for base, members in groups.items():
        shape = tuple(max(index[d] for index in members) for d in range(len(next(iter(members)))))
        count = 1
        for n in shape:
            count *= n
        kinds = {(v.type, FMU.unit_of(v)) for v in members.values()}
        ordered = sorted(members)
        if base in ports or len(members) != count or len(kinds) != 1 or ordered[0] != (1,) * len(shape):
            ports |= {v.name: FMUPort(v.name, (), FMU.unit_of(v), v.type, (v,)) for v in members.values()}
            continue
        type_, unit = kinds.pop()
        ports[base] = FMUPort(base, shape, unit, type_, tuple(members[i] for i in ordered))
    return ports
