"""An FMU as read from its file: its description, its variables as ports, and its start values.

Arrays are ports with a shape (ports.py). Variables of all numeric types are ports, whose values
are floats in a system; so are clocks (clocks.py). Strings and binary data are ports as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Any

import numpy as np

from ..core.port import Direction, Port
from ..errors import FMUError, did_you_mean
from ..loop.numbers import Number
from .clocks import clocks_of
from .file.archive import Archive
from .file.display_units import without_units
from .file.model_description import description_of
from .file.shared_library import library_name
from .ports import FMUPort, Shape, port_of, ports, shape_of, unit_definitions
from .versions import version_of


class FMUFile:
    """An .fmu file that is unpacked, and the start values of an instance.

    Raises FMUError if the file, or a start value, is not valid or not supported.
    """

    def __init__(self, path: str | PathLike[str], start: Mapping[str, Any] | None) -> None:
        if not isinstance(path, (str, PathLike)):
            raise FMUError(f"{path!r} is not the path of an FMU")
        self.path = Path(path)
        if not isinstance(start, (Mapping, NoneType)):
            raise FMUError(f"{self.path.name}: start={start!r} has no names; write {{'m': 2.0}}")
        with Archive(self.path) as archive:
            #: FMPy's object of modelDescription.xml
            self.description = description_of(archive)
            self.version = version_of(self.description)
            self.has_cs = self.description.coSimulation is not None
            self.has_me = self.description.modelExchange is not None
            self._check_interfaces()
            self._check_platform(archive)
            self._extraction = archive.extraction()  # shared, and kept as long as this object
        self.directory = self._extraction.folder
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        self._take_start(start or {})

    def _take_start(self, start: Mapping[str, Any]) -> None:
        """Take over start values, which may change the shapes of ports; refuse those that do not fit."""
        self._start = dict(start)
        #: the clocks of FMI 3.0
        self.clocks = clocks_of(self.path.name, self.variables.values(), self.start)
        numeric = [v for v in self.variables.values() if v.type in self.version.numbers]
        numeric = [v for v in numeric if v.type != "Clock" or self.clocks[v.name].is_port]
        texts = [v for v in self.variables.values() if v.type in ("String", "Binary")]
        self.output_ports = self._ports(v for v in numeric if v.causality in ("output", "local"))
        self.input_ports = self._ports(v for v in numeric if v.causality == "input" and v.alias is None)
        self.text_inputs = self._texts(v for v in texts if v.causality == "input" and v.alias is None)
        self.text_outputs = self._texts(v for v in texts if v.causality in ("output", "local"))
        self.inputs: dict[str, Port] = {**self.input_ports, **self.text_inputs}
        self.outputs: dict[str, Port] = {**self.output_ports, **self.text_outputs}
        for v in self.variables.values():  # other names of inputs (FMI 3.0)
            if v.causality == "input" and v.alias is not None and v.alias.name in self.inputs:
                self.inputs[v.name] = self.inputs[v.alias.name]
        #: the names of the outputs, without the local variables
        self.declared_outputs = [
            n for n, p in self.output_ports.items() if p.variables[0].causality == "output"
        ]
        self._start_values = self._checked_start_values()

    def start_values(self) -> dict[str, list[Any]]:
        """Return the given start values by variable, as lists in its unit, as FMPy takes them."""
        return self._start_values

    def ports(self, direction: Direction) -> dict[str, Port]:
        """Return the inputs with their aliases, or the outputs and local variables, as ports."""
        return self.inputs if direction == "input" else self.outputs

    def _check_interfaces(self) -> None:
        if not (self.has_cs or self.has_me):
            raise FMUError(
                f"{self.path} has neither Co-Simulation nor Model Exchange, and Scheduled Execution is "
                "not supported; export it with one of them"
            )

    def _check_platform(self, archive: Archive) -> None:
        platform, folders = self.version.platform, archive.platforms()
        if platform not in folders:
            raise FMUError(
                f"{self.path} has no binary for {platform} (available: {', '.join(folders) or 'none'}); "
                "export it again for this platform"
            )
        interfaces = (self.description.coSimulation, self.description.modelExchange)
        wanted = [library_name(platform, i.modelIdentifier) for i in interfaces if i is not None]
        if not set(wanted) & set(archive.names):
            raise FMUError(
                f"{self.path} has no library {' or '.join(dict.fromkeys(wanted))}, which the modelIdentifier "
                "in its modelDescription.xml names; export it again"
            )

    @property
    def start(self) -> Mapping[str, Any]:
        """The start values by name. They are checked once, so they cannot be changed; see `with_start`."""
        return MappingProxyType(self._start)

    def shape_of(self, variable: Any) -> Shape:
        """Return the shape of a variable, which structural parameters in `start` may change."""
        return shape_of(variable, self.start)

    def _ports(self, variables: Iterable[Any]) -> dict[str, FMUPort]:
        found = ports(variables, self.shape_of, unit_definitions(self.description))
        return {name: port for name, port in found.items() if port.size > 0}

    def _texts(self, variables: Iterable[Any]) -> dict[str, FMUPort]:
        return {v.name: port_of(v.name, self.shape_of(v), (v,), {}) for v in variables}

    # -------------------------------------------------------------------- start values

    def _checked_start_values(self) -> dict[str, list[Any]]:
        joined = self._ports(self.variables.values()) if self.start else {}
        for name in self.start:
            if name not in self.variables and name not in joined:
                raise FMUError(
                    f"{self.path.name} has no variable '{name}'" + did_you_mean(name, self.variables)
                )
        found: dict[str, list[Any]] = {}
        for name, value in self.start.items():
            port = joined.get(name) or next(iter(self._ports([self.variables[name]]).values()))
            values = self._values_of(name, port, value)
            each = port.size // len(port.variables)
            for i, v in enumerate(port.variables):
                found[v.name] = values[i * each : (i + 1) * each]
        return found

    def _values_of(self, name: str, port: FMUPort, value: Any) -> list[Any]:
        """Return a start value as FMPy takes it: a list with every element of the port."""
        kind = port.variables[0].type
        number = self.version.numbers[kind][1] if kind in self.version.numbers else None
        if number is not None and number.is_float:
            value = without_units(self.path.name, port, self.description.unitDefinitions, value)
        try:
            plain = np.asarray(value, dtype=object if number is None else None)
            if plain.shape == (port.size,):  # a matrix may be given row by row, as in FMI
                plain = plain.reshape(port.shape)
            values = np.broadcast_to(plain, port.shape).ravel().tolist()
            fits = all(_fits(kind, number, v) for v in values)
        except (TypeError, ValueError, OverflowError):
            fits = False
        if not fits:
            holds = f" ({number.values})" if number is not None and not number.is_float else ""
            shape = f" of shape {port.shape}" if port.shape else ""
            raise FMUError(
                f"{self.path.name}: start value {name} = {value!r} does not fit type {kind}{shape}{holds}"
            )
        if number is None:
            return values
        return [float(v) if number.is_float else int(v) for v in values]

    # -------------------------------------------------------------------- dependencies

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output port, the input ports on which it depends directly.

        It comes from the model structure, in which missing dependencies mean all, and an empty list none.
        """
        port_of = {self.key(v): name for name, p in self.input_ports.items() for v in p.variables}
        numbers = self.version.numbers
        declared = {
            self.key(u.variable): u.dependencies
            for u in self.description.outputs
            if u.variable.type in numbers
        }
        everything = set(self.input_ports)
        found: dict[str, set[str]] = {}
        for name, port in self.output_ports.items():
            listed = [declared.get(self.key(variable)) for variable in port.variables]
            if any(d is None for d in listed):
                found[name] = everything
            else:
                keys = (self.key(v) for d in listed for v in d or () if v.type in numbers)
                found[name] = {port_of[k] for k in keys if k in port_of}
        return found

    def key(self, variable: Any) -> tuple[str, int]:
        """Return the key that aliases share: the name of their functions, and their value reference."""
        return self.version.numbers[variable.type][0], variable.valueReference


def _fits(kind: str, number: Number | None, value: Any) -> bool:
    """Return whether a type holds a value exactly."""
    if number is None:
        return isinstance(value, bytes if kind == "Binary" else str)
    if number.is_float:
        return math.isfinite(float(value))
    return bool(value == int(value) and number.low <= value <= number.high)
