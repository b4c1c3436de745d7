"""A system: participants by name, and connections between their ports.

    system = System(
        {"plant": FMU("plant.fmu"), "control": SwitchingControl(M=100.0)},
        [("plant.s", "control.s"), ("control.u", "plant.u")],
    )

A port is named `participant.port`; elements of an array count from 1, as in Modelica
and in FMU variable names: `building.accel[3]`, `building.accel[2:4]`. Everything that
can be checked without time is checked here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from types import NoneType
from typing import TypeAlias

import numpy as np

from ..core.participant import Block, Participant
from ..core.variables import Array
from ..errors import WiringError, did_you_mean
from ..fmi.fmu import FMU
from ..units import conversion
from .text_ports import TextConnection, text_connection

Member: TypeAlias = Participant | FMU


@dataclass(frozen=True)
class Port:
    """One end of a connection: `count` floats of a participant's port, from `first` on."""

    participant: str
    name: str
    shape: tuple[int, ...]
    unit: str | None
    first: int = 0
    count: int = 1
    index: str = ""

    def __str__(self) -> str:
        return f"{self.participant}.{self.name}{self.index}"


@dataclass(frozen=True)
class Connection:
    """source -> target, with target = scale * source + offset; `initial` makes it one step late."""

    source: Port
    target: Port
    scale: float = 1.0
    offset: float = 0.0
    initial: Array | None = None

    def __str__(self) -> str:
        delayed = "" if self.initial is None else " (one step late)"
        factor = ""
        if (self.scale, self.offset) != (1.0, 0.0):
            units = self.source.unit, self.target.unit
            same = None in units or units[0] == units[1]
            factor = f" [* {self.scale:g} + {self.offset:g}]" if same else f" [{units[0]} -> {units[1]}]"
        return f"{self.target} <- {self.source}{factor}{delayed}"


def inputs_of(member: Member) -> dict[str, tuple[tuple[int, ...], str | None]]:
    """Return the input ports of a participant: name -> (shape, unit)."""
    if isinstance(member, Participant):
        return {n: (v.shape, v.unit) for n, v in member.variables.items() if v.kind == "input"}  # type: ignore[misc]
    return member.inputs


def outputs_of(member: Member) -> dict[str, tuple[tuple[int, ...], str | None]]:
    """Return the ports that can be read: outputs and states."""
    if isinstance(member, Participant):
        kinds = ("output", "state")
        return {n: (v.shape, v.unit) for n, v in member.variables.items() if v.kind in kinds}  # type: ignore[misc]
    return member.outputs


def is_block(member: Member) -> bool:
    """Tell whether a participant acts at communication points: a Block, or an FMU in its place."""
    return member.as_block if isinstance(member, FMU) else isinstance(member, Block)


class System:
    """Participants by name and the connections between them."""

    def __init__(
        self,
        participants: Mapping[str, Member] | None = None,
        connections: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.participants: dict[str, Member] = {}
        self.connections: list[Connection] = []
        #: those of strings and binary data
        self.text_connections: list[TextConnection] = []
        #: the connections of every input port, and the pairs of participants that are connected without delay
        self._feeding: dict[tuple[str, str], list[Connection]] = {}
        self._links: set[tuple[str, str]] = set()
        if not isinstance(participants, (Mapping, NoneType)):
            raise WiringError(f"{participants!r} is no dictionary of participants, such as {{'plant': ...}}")
        for name, member in (participants or {}).items():
            self.add(name, member)
        for connection in connections:
            if not isinstance(connection, (tuple, list)) or len(connection) != 2:
                raise WiringError(f"{connection!r} is no connection; write ('plant.x', 'control.x')")
            self.connect(*connection)

    def add(self, name: str, member: Member) -> None:
        """Add a participant under a name (letters, digits, underscores)."""
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z_]\w*", name):
            raise WiringError(f"participant name '{name}' must be letters, digits and underscores")
        if not isinstance(member, (Participant, FMU)):
            made = (
                f"{member.__name__}(...)" if isinstance(member, type) else "a Block, a Continuous or an FMU"
            )
            raise WiringError(f"'{name}' is {member!r}, which is no participant; give {made}")
        if name in self.participants:
            raise WiringError(f"there is a participant '{name}' already; choose another name")
        if any(member is other for other in self.participants.values()):
            raise WiringError(f"'{name}' is the same object as another participant; make a second one")
        self.participants[name] = member

    def connect(
        self,
        source: str,
        target: str,
        *,
        initial: Array | float | None = None,
        transformation: tuple[float, float] | None = None,
    ) -> None:
        """Connect an output or state to an input.

        The same unit is passed through, a compatible one converted, any other refused. A
        scalar output may feed every element of an array input. `initial` delays the
        connection by one communication step and is the source's value, in its unit,
        before the first point: the way to break a cycle of blocks. `transformation`
        (factor, offset), target = factor * source + offset, takes the place of the units'
        conversion. A String of an FMU goes to a String input, a Binary to a Binary one.
        """
        for name in (source, target):
            if not isinstance(name, str):
                raise WiringError(f"{name!r} is no port; write participant.port, as text")
        texts = text_connection(self, source, target, initial is None and transformation is None)
        if texts is not None:
            self._add_texts(texts)
            return
        out = self.port(source, "output")
        into = self.port(target, "input")
        if out.count != into.count and out.count != 1:
            raise WiringError(
                f"{out} has shape {out.shape if not out.index else (out.count,)}, "
                f"{into} has shape {into.shape if not into.index else (into.count,)}; "
                "connect elements or slices, such as building.accel[2:4]"
            )
        feeding = self._feeding.setdefault((into.participant, into.name), [])
        for other in feeding:
            if other.target.first < into.first + into.count and into.first < (
                other.target.first + other.target.count
            ):
                raise WiringError(f"{into} is connected already, to {other.source}; an input has one source")
        try:
            scale, offset = _factors(transformation) or conversion(out.unit, into.unit)
            if transformation is None and (self.is_relative(out) or self.is_relative(into)):
                offset = 0.0
        except WiringError as error:
            raise WiringError(f"{out} [{out.unit}] -> {into} [{into.unit}]: {error}") from error
        if not (math.isfinite(scale) and math.isfinite(offset)):
            raise WiringError(f"{out} -> {into}: transformation {transformation} is not finite")
        connection = Connection(out, into, scale, offset, _initial(out, initial))
        self.connections.append(connection)
        feeding.append(connection)
        link = (out.participant, into.participant)
        if link in self._links or initial is not None:
            return  # the order of blocks is what it was
        try:
            self.block_order()
        except WiringError:
            self.connections.pop()
            feeding.pop()
            raise
        self._links.add(link)

    def _add_texts(self, connection: TextConnection) -> None:
        self.text_connections.append(connection)
        try:
            self.block_order()
        except WiringError:
            self.text_connections.pop()
            raise

    def is_relative(self, port: Port) -> bool:
        """Tell whether a port is a difference, such as one of temperatures, whose unit has no offset."""
        member = self.participants[port.participant]
        if not isinstance(member, FMU):
            return False
        return (member.input_ports.get(port.name) or member.output_ports[port.name]).relative

    def port(self, text: str, direction: str) -> Port:
        """Find a port by its name; `direction` is "input" or "output" (states count as outputs)."""
        where, dot, name = text.partition(".")
        if not dot or where not in self.participants:
            raise WiringError(
                f"'{text}': there is no participant '{where}'" + did_you_mean(where, self.participants)
                if dot
                else f"'{text}' is no port; write participant.port"
            )
        member = self.participants[where]
        ports = inputs_of(member) if direction == "input" else outputs_of(member)
        if direction == "input" and isinstance(member, FMU):
            name = member.aliases.get(name, name)
        if name in ports:
            shape, unit = ports[name]
            count = 1
            for n in shape:
                count *= n
            return Port(where, name, shape, unit, 0, count)
        base, bracket, index = name.partition("[")
        if bracket and base in ports:
            return _element(Port(where, base, *ports[base]), bracket + index)
        others = outputs_of(member) if direction == "input" else inputs_of(member)
        if base in others:
            raise WiringError(
                f"{text} is an {'output' if direction == 'input' else 'input'}, not an {direction}"
            )
        if isinstance(member, FMU) and name in member.text_inputs | member.text_outputs:
            raise WiringError(f"{text} is text, not a number")
        raise WiringError(f"{where} has no {direction} '{base}'" + did_you_mean(base, ports))

    def block_order(self) -> list[str]:
        """Return the blocks in the order of their connections; a cycle of blocks is an error."""
        blocks = [n for n, m in self.participants.items() if is_block(m)]
        graph: dict[str, list[str]] = {name: [] for name in blocks}
        direct = (c for c in self.connections if c.initial is None)
        links = [(c.source.participant, c.target.participant) for c in direct]
        links += [(c.source.participant, c.target.participant) for c in self.text_connections]
        for a, b in links:
            if a in graph and b in graph:
                graph[b].append(a)
        try:
            return list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            raise WiringError(cycle_text(error.args[1], self.connections)) from None


def _factors(transformation: object) -> tuple[float, float] | None:
    if transformation is None:
        return None
    try:
        scale, offset = map(float, transformation)  # type: ignore[call-overload]
    except (TypeError, ValueError):
        raise WiringError(f"transformation={transformation!r} is no (factor, offset)") from None
    return scale, offset


def _initial(source: Port, value: Array | float | None) -> Array | None:
    """Return the value of a delayed connection before the first point, with the shape of its source."""
    if value is None:
        return None
    try:
        array = np.array(np.broadcast_to(np.asarray(value, dtype=np.float64).ravel(), source.count))
    except (TypeError, ValueError):
        array = np.array([np.nan])
    if not np.isfinite(array).all():
        raise WiringError(f"initial={value!r} does not fit {source}: give {source.count} finite number(s)")
    return array


def cycle_text(path: list[str], connections: list[Connection]) -> str:
    """Return the message for an algebraic cycle through the named participants."""
    links = []
    for a, b in pairwise(path):
        found = [c for c in connections if (c.source.participant, c.target.participant) == (a, b)]
        links.append(f"{found[0].source} -> {found[0].target}" if found else f"{a} -> {b}")
    return (
        f"algebraic cycle: {', '.join(links)}; break it with connect(..., initial=...), "
        "which makes that connection one communication step late"
    )


def _element(port: Port, index: str) -> Port:
    """Return the part of an array port that an index such as [3], [2:4] or [2,1] names."""
    match = re.fullmatch(r"\[(\d{1,9})(?:([:,])(\d{1,9}))?\]", index)
    shape = port.shape
    rank = 2 if match and match[2] == "," else 1
    if not match or len(shape) != rank:
        raise WiringError(
            f"'{port}{index}': cannot index shape {shape} so; write [3] or [2:4], for a matrix [2,1]"
        )
    a, b = int(match[1]), int(match[3] or match[1])
    low = (a, b) if rank == 2 else (a, a)
    if min(a, b) < 1 or a > shape[0] or b > shape[-1] or (rank == 1 and b < a):
        raise WiringError(f"'{port}{index}' is outside shape {shape}; elements count from 1")
    if rank == 2:
        return Port(port.participant, port.name, shape, port.unit, (a - 1) * shape[1] + b - 1, 1, index)
    return Port(port.participant, port.name, shape, port.unit, low[0] - 1, b - a + 1, index)
