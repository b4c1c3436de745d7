"""An FMU as a participant: FMI 2.0 or 3.0, Co-Simulation or Model Exchange, loaded by FMPy.

    plant = FMU("plant.fmu", start={"m": 2.0})

Arrays are ports with a shape (ports.py). Variables of all numeric types are ports, floats
to the system; so are clocks (clocks.py), and strings and binary data. What
depends on the version of FMI is in fmi2.py and fmi3.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from numbers import Real
from os import PathLike
from pathlib import Path
from types import NoneType
from typing import Any, Literal

import numpy as np

from ..core.participant import Participant, rate
from ..core.port import Direction, Port
from ..core.tableaus import TABLEAUS
from ..errors import FMUError, did_you_mean
from ..loop.instance import Instance, Setting
from ..loop.numbers import Number
from .clocks import clocks_of
from .file.archive import Archive
from .file.display_units import without_units
from .file.model_description import description_of
from .file.shared_library import library_name
from .instance.adapter import Adapter
from .instance.fmi2 import Fmi2
from .instance.fmi3 import Fmi3
from .ports import FMUPort, Shape, ports, single, unit_definitions

Interface = Literal["CoSimulation", "ModelExchange"]
Solver = Literal["ode1", "ode2", "ode3", "ode4", "cvode"]
SOLVERS = (*TABLEAUS, "cvode")
DEFAULT_TOLERANCE = 1e-6

_ADAPTERS: dict[str, type[Adapter]] = {"2": Fmi2, "3": Fmi3}


class FMU:
    """An FMU on disk, and the values it starts with.

    path
        the .fmu file
    start
        values of parameters, inputs or start values by variable name: numbers in the unit of
        the variable, or text with another unit, "2 kN/m"; structural parameters (FMI 3.0)
        change the shapes of the arrays that they size; of a clock, its interval in s
    interface
        "CoSimulation" or "ModelExchange", where the FMU has both; None is Co-Simulation if
        it is there, and Model Exchange under stage coupling
    solver
        of Model Exchange under sampled coupling. "ode1" to "ode4": fixed steps in the
        compiled loop; a step is split at a time event, state events are handled at its end.
        "cvode": variable steps and order from event to event, for stiff plants; state
        events are located; its steps run as a Python callback. Either way the inputs are
        held over the communication step, and an event is no communication point. None is
        ode4, and cvode for an FMU with event indicators
    substeps
        steps of a fixed-step solver in one communication step
    tolerance
        of cvode: relative error aimed at over a run, 1e-6 unless given (its steps are
        controlled tighter); the absolute one of a state is that times its nominal value
    as_block
        acts as a Block does, at communication points in the order of the connections: set
        inputs, doStep from t_k, get outputs at t_k; what a Block that was exported needs
    event_mode
        Co-Simulation of FMI 3.0: events are handled here, at the instant of the event, and
        discrete inputs are set as events; None does so where the FMU has clocks, which need
        it. Without, an FMU handles its events inside its steps
    every, sample_period
        of a block: at every so many-th communication point only, as for a Block
    isolated
        every instance runs in a process of its own (isolation.py): a crash in the FMU's code is
        a SimulationError with what was computed until then, and costs a few microseconds a step
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        start: Mapping[str, Any] | None = None,
        interface: Interface | None = None,
        solver: Solver | None = None,
        substeps: int = 1,
        tolerance: float | None = None,
        as_block: bool = False,
        event_mode: bool | None = None,
        every: int | None = None,
        sample_period: float | None = None,
        isolated: bool = False,
    ) -> None:
        if not isinstance(path, (str, PathLike)):
            raise FMUError(f"{path!r} is no path of an FMU")
        self.path = Path(path)
        #: the participant that was exported to this file, where that is known
        self.source: Participant | None = None
        #: what has to live as long as the file does, such as the folder that holds it
        self.kept: object = None
        if not isinstance(start, (Mapping, NoneType)):
            raise FMUError(f"{self.path.name}: start={start!r} has no names; write {{'m': 2.0}}")
        self.start = dict(start or {})
        self.interface = interface
        self.solver = solver
        self.substeps = substeps
        self.tolerance = DEFAULT_TOLERANCE if tolerance is None else tolerance
        self.as_block = as_block
        self.isolated = isolated
        self.every, self.sample_period = rate(self.path.name, every, sample_period)
        with Archive(self.path) as archive:
            self.description = description_of(archive)
            self.adapter = _ADAPTERS[self.description.fmiVersion.partition(".")[0]]
            self.has_cs = self.description.coSimulation is not None
            self.has_me = self.description.modelExchange is not None
            self._check_interfaces()
            self._check_solver(tolerance is not None)
            self._check_platform(archive)
            self._extraction = archive.extraction()  # shared, and kept for as long as this object is
        self.directory = self._extraction.folder
        self.event_mode = self._event_mode(event_mode)
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        #: the clocks of FMI 3.0
        self.clocks = clocks_of(self.path.name, self.variables.values(), self.start)
        if self.clocks and self.model_exchange:
            raise FMUError(
                f"{self.path.name} has clocks, which are supported with Co-Simulation, and Model Exchange is "
                "used" + ("; leave interface= away" if self.has_cs else "; export it with Co-Simulation")
            )
        numeric = [v for v in self.variables.values() if v.type in self.adapter.NUMBERS]
        numeric = [v for v in numeric if v.type != "Clock" or self.clocks[v.name].is_port]
        self.output_ports = self._ports(v for v in numeric if v.causality in ("output", "local"))
        self.input_ports = self._ports(v for v in numeric if v.causality == "input" and v.alias is None)
        #: other names of inputs (FMI 3.0)
        self.aliases = {
            v.name: v.alias.name
            for v in self.variables.values()
            if v.causality == "input" and v.alias is not None
        }
        texts = [v for v in self.variables.values() if v.type in ("String", "Binary")]
        self.text_inputs = {v.name: v for v in texts if v.causality == "input" and v.alias is None}
        self.text_outputs = {v.name: v for v in texts if v.causality in ("output", "local")}
        self.inputs = self._as_ports(self.input_ports, self.text_inputs)
        self.inputs |= {n: self.inputs[of] for n, of in self.aliases.items() if of in self.inputs}
        self.outputs = self._as_ports(self.output_ports, self.text_outputs)
        #: the outputs proper, without local variables: what is recorded unless it is said
        self.declared_outputs = [
            n for n, p in self.output_ports.items() if p.variables[0].causality == "output"
        ]
        known = self.variables.keys() | self._ports(self.variables.values()) if self.start else set()
        for name in self.start:
            if name not in known:
                raise FMUError(
                    f"{self.path.name} has no variable '{name}'" + did_you_mean(name, self.variables)
                )
        self.start_values()

    def instance(self, name: str, setting: Setting) -> Instance:
        """Return a running instance (cosim/run/instance.py); refuse a setting that the FMU does not fit."""
        from .instance.making import instance_of

        return instance_of(name, self, setting)

    def ports(self, direction: Direction) -> dict[str, Port]:
        """Return the inputs with their aliases, or the outputs and local variables, as ports."""
        return self.inputs if direction == "input" else self.outputs

    def _as_ports(self, numeric: Mapping[str, FMUPort], texts: Mapping[str, Any]) -> dict[str, Port]:
        definitions = unit_definitions(self.description)
        all_ports = [*numeric.values(), *(single(v, self.shape_of(v)) for v in texts.values())]
        return {p.name: p.as_port(definitions) for p in all_ports}

    def _check_interfaces(self) -> None:
        if not (self.has_cs or self.has_me):
            raise FMUError(
                f"{self.path} has neither Co-Simulation nor Model Exchange, and Scheduled Execution is "
                "not supported; export it with one of them"
            )
        has = {"CoSimulation": self.has_cs, "ModelExchange": self.has_me}
        if self.interface is not None and self.interface not in tuple(has):
            raise FMUError(
                f"{self.path.name}: interface '{self.interface}' is not known"
                + did_you_mean(self.interface, has)
            )
        if self.interface is not None and not has[self.interface]:
            other = next(name for name, there in has.items() if there)
            raise FMUError(
                f'{self.path.name}: interface="{self.interface}" is not there, the FMU has {other} only'
            )
        if self.as_block and (not self.has_cs or self.interface == "ModelExchange"):
            why = "it has Model Exchange only" if not self.has_cs else 'interface="ModelExchange" is given'
            raise FMUError(f"{self.path.name}: as_block=True needs Co-Simulation, and {why}")
        if not self.as_block and (self.every, self.sample_period) != (None, None):
            raise FMUError(
                f"{self.path.name}: every and sample_period are those of a block; say as_block=True"
            )

    def _event_mode(self, asked: bool | None) -> bool:
        """Tell whether Co-Simulation uses event mode."""
        clocks = [v.name for v in self.description.modelVariables if v.type == "Clock"]
        if asked and self.model_exchange:
            raise FMUError(
                f"{self.path.name}: event_mode is of Co-Simulation, and Model Exchange, which has it always, "
                "is used; leave event_mode away"
            )
        if self.model_exchange or not (asked or clocks):
            return False
        if not self.description.coSimulation.hasEventMode:
            raise FMUError(
                f"{self.path.name} has no event mode in Co-Simulation, which "
                + (f"its clock {clocks[0]} needs" if clocks else "event_mode=True asks for; leave it out")
            )
        if clocks and asked is False:
            raise FMUError(f"{self.path.name}: event_mode=False, but its clock {clocks[0]} needs event mode")
        return True

    @property
    def model_exchange(self) -> bool:
        """Tell whether sampled coupling uses Model Exchange."""
        return self.interface == "ModelExchange" or not self.has_cs

    def _check_solver(self, has_tolerance: bool) -> None:
        name, solver = self.path.name, self.solver
        if solver is not None and solver not in SOLVERS:
            raise FMUError(f"{name}: solver '{solver}' is not known" + did_you_mean(solver, SOLVERS))
        if not isinstance(self.substeps, int) or self.substeps < 1:
            raise FMUError(f"{name}: substeps={self.substeps!r} is no whole number, 1 or more")
        if not isinstance(self.tolerance, Real) or not 1e-14 <= self.tolerance < 1.0:
            raise FMUError(f"{name}: tolerance={self.tolerance!r} is no number from 1e-14 to 1, such as 1e-6")
        given = [n for n, is_given in (("solver", solver is not None), ("substeps", self.substeps != 1),
                                       ("tolerance", has_tolerance)) if is_given]  # fmt: skip
        if given and not self.model_exchange:
            remedy = 'say interface="ModelExchange" as well' if self.has_me else "leave it away"
            raise FMUError(
                f"{name}: {given[0]} is of Model Exchange, and Co-Simulation, which has a solver of its "
                f"own, is used; {remedy}"
            )
        indicators = bool(self.description.numberOfEventIndicators)
        cvode = solver == "cvode" or (solver is None and indicators)
        if cvode and self.substeps != 1:
            why = "" if solver else ", which an FMU with event indicators has unless solver= is given"
            raise FMUError(f"{name}: substeps are of solvers with fixed steps, not of cvode{why}")
        if has_tolerance and not cvode:
            raise FMUError(
                f'{name}: tolerance is of solver="cvode", and {solver or "ode4"} has fixed steps; '
                "make substeps= larger instead"
            )

    def _check_platform(self, archive: Archive) -> None:
        platform, folders = self.adapter.platform(), archive.platforms()
        if platform not in folders:
            raise FMUError(
                f"{self.path} has no binary for {platform} (it has: {', '.join(folders) or 'none'}); "
                "export it again for this platform, or with its sources"
            )
        interfaces = (self.description.coSimulation, self.description.modelExchange)
        wanted = [library_name(platform, i.modelIdentifier) for i in interfaces if i is not None]
        if not set(wanted) & set(archive.names):
            raise FMUError(
                f"{self.path} has no library {' or '.join(dict.fromkeys(wanted))}, after the modelIdentifier "
                "in its modelDescription.xml"
            )

    def shape_of(self, variable: Any) -> Shape:
        """Return the shape of a variable."""
        return self.adapter.shape(variable, self.start)

    def _ports(self, variables: Iterable[Any]) -> dict[str, FMUPort]:
        found = ports(variables, self.shape_of)
        return {name: port for name, port in found.items() if port.size > 0}

    def start_values(self) -> dict[str, list[Any]]:
        """Return the start values that were given, by variable; refuse what does not fit."""
        joined = self._ports(self.variables.values()) if self.start else {}
        found: dict[str, list[Any]] = {}
        for name, value in self.start.items():
            port = joined.get(name) or next(iter(self._ports([self.variables[name]]).values()))
            kind = port.variables[0].type
            number = self.adapter.NUMBERS[kind][1] if kind in self.adapter.NUMBERS else None
            if number is not None and number.is_float:
                value = without_units(self.path.name, port, self.description.unitDefinitions, value)
            try:
                plain = np.asarray(value, dtype=object if number is None else None)
                if plain.shape == (port.size,):  # a matrix may be given row by row, as FMI has it
                    plain = plain.reshape(port.shape)
                values = np.broadcast_to(plain, port.shape).ravel().tolist()
                fits = all(_fits(kind, number, v) for v in values)
            except (TypeError, ValueError, OverflowError):
                fits = False
            if not fits:
                holds = f" ({number.values})" if number is not None and not number.is_float else ""
                shape = f" of shape {port.shape}" if port.shape else ""
                raise FMUError(f"{self.path.name}: start value {name} = {value!r} is no {kind}{shape}{holds}")
            each = port.size // len(port.variables)
            plain_values = [_plain(number, v) for v in values]
            for i, v in enumerate(port.variables):
                found[v.name] = plain_values[i * each : (i + 1) * each]
        return found

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output port, the input ports on which it depends directly.

        From the model structure: dependencies that are left out mean all, an empty list none.
        """
        port_of = {self.key(v): name for name, p in self.input_ports.items() for v in p.variables}
        declared = {
            self.key(u.variable): u.dependencies
            for u in self.description.outputs
            if u.variable.type in self.adapter.NUMBERS
        }
        everything = set(self.input_ports)
        found: dict[str, set[str]] = {}
        for name, port in self.output_ports.items():
            listed = [declared.get(self.key(variable)) for variable in port.variables]
            if any(d is None for d in listed):
                found[name] = everything
            else:
                keys = (self.key(v) for d in listed for v in d or () if v.type in self.adapter.NUMBERS)
                found[name] = {port_of[k] for k in keys if k in port_of}
        return found

    def key(self, variable: Any) -> tuple[str, int]:
        """Return what aliases have in common: functions that get and set it, and value reference."""
        return self.adapter.NUMBERS[variable.type][0], variable.valueReference

    def __repr__(self) -> str:
        kinds = " and ".join(
            k for k, has in (("Co-Simulation", self.has_cs), ("Model Exchange", self.has_me)) if has
        )
        return f"FMU({self.path.name}: FMI {self.description.fmiVersion}, {kinds})"


def _plain(number: Number | None, value: Any) -> Any:
    """Return a value as FMPy takes it."""
    if number is None:
        return value
    return float(value) if number.is_float else int(value)


def _fits(kind: str, number: Number | None, value: Any) -> bool:
    """Tell whether a type holds a value exactly."""
    if number is None:
        return isinstance(value, bytes if kind == "Binary" else str)
    if number.is_float:
        return math.isfinite(float(value))
    return bool(value == int(value) and number.low <= value <= number.high)
