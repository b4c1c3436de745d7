"""A system: components by name, and connections between their ports.

    system = System(
        {"plant": FMU("plant.fmu"), "control": SwitchingControl(M=100.0)},
        [("plant.s", "control.s"), ("control.u", "plant.u")],
    )

A port is named `component.port`; elements of an array count from 1, as in Modelica
and in FMU variable names: `building.accel[3]`, `building.accel[2:4]`. Everything that
can be checked without time is checked here.

Strings and binary data are passed on like numbers: read at t_k, set before the step from t_k.
A String goes to a String, a Binary to a Binary, one value each.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from types import NoneType

import numpy as np

from ..arrays import Array
from ..core.component import Component
from ..core.port import Direction, Port
from ..errors import WiringError, did_you_mean


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


class System:
    """Components by name and the connections between them."""

    def __init__(
        self,
        participants: Mapping[str, Component] | None = None,
        connections: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.participants: dict[str, Component] = {}
        self.connections: list[Connection] = []
        #: the connections of strings and binary data
        self.text_connections: list[Connection] = []
        #: the connections of every input port
        self._feeding: dict[tuple[str, str], list[Connection]] = {}
        #: the pairs of components that are connected without delay
        self._links: set[tuple[str, str]] = set()
        if not isinstance(participants, (Mapping, NoneType)):
            raise WiringError(
                f"{participants!r} must be a dictionary of components, such as {{'plant': ...}}"
            )
        for name, component in (participants or {}).items():
            self.add(name, component)
        for connection in connections:
            if not isinstance(connection, (tuple, list)) or len(connection) != 2:
                raise WiringError(f"{connection!r} must be a connection, such as ('plant.x', 'control.x')")
            self.connect(*connection)

    def add(self, name: str, component: Component) -> None:
        """Add a component under a name of letters, digits and underscores."""
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z_]\w*", name):
            raise WiringError(f"component name '{name}' must be letters, digits and underscores")
        if isinstance(component, type) or not isinstance(component, Component):
            wanted = (
                f"{component.__name__}(...)"
                if isinstance(component, type)
                else "a Block, a Continuous or an FMU"
            )
            raise WiringError(f"'{name}' is {component!r}, which cannot take part in a system; give {wanted}")
        if name in self.participants:
            raise WiringError(f"the system already has a component '{name}'; choose another name")
        if any(component is other for other in self.participants.values()):
            raise WiringError(f"'{name}' is the same object as another component; make a second one")
        self.participants[name] = component

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
        (factor, offset), target = factor * source + offset, replaces the conversion of the
        units. A String of an FMU goes to a String input, a Binary to a Binary input.
        """
        for name in (source, target):
            if not isinstance(name, str):
                raise WiringError(f"{name!r} must be a port, written as text: 'component.port'")
        out, into = self.port(source, "output"), self.port(target, "input")
        if out.kind != into.kind:
            kinds = " and ".join(
                f"{port} is a {'number' if port.kind == 'number' else port.kind}" for port in (out, into)
            )
            raise WiringError(f"{kinds}: a String goes to a String, and a Binary to a Binary")
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
                raise WiringError(f"{into} is already connected to {other.source}; an input has one source")
        if out.kind == "number":
            scale, offset = _factors(out, into, transformation)
            self._append(self.connections, Connection(out, into, scale, offset, _initial(out, initial)))
        elif initial is None and transformation is None:
            self._append(self.text_connections, Connection(out, into))
        else:
            raise WiringError(
                f"{out} -> {into}: a {out.kind} cannot be delayed or transformed; leave out initial and "
                "transformation"
            )

    def _append(self, connections: list[Connection], connection: Connection) -> None:
        """Add a connection to its list, unless it closes a cycle of blocks."""
        out, into = connection.source, connection.target
        feeding = self._feeding[into.participant, into.name]
        connections.append(connection)
        feeding.append(connection)
        link = (out.participant, into.participant)
        if link in self._links or connection.initial is not None:
            return  # the order of the blocks does not change
        try:
            self.block_order()
        except WiringError:
            connections.pop()
            feeding.pop()
            raise
        self._links.add(link)

    def port(self, text: str, direction: Direction) -> Port:
        """Find a port by its name; `direction` is "input" or "output" (states count as outputs)."""
        where, dot, name = text.partition(".")
        if not dot:
            raise WiringError(f"'{text}' is not a port; write component.port")
        if where not in self.participants:
            raise WiringError(
                f"'{text}': the system has no component '{where}'" + did_you_mean(where, self.participants)
            )
        component = self.participants[where]
        ports = component.ports(direction)
        base, bracket, index = name.partition("[")
        if name in ports:
            base, index = name, ""
        found = ports.get(base)
        if found is None:
            others = component.ports("input" if direction == "output" else "output")
            if name in others or base in others:
                is_one, wanted = ("output", "input") if direction == "input" else ("input", "output")
                raise WiringError(f"{text} is an {is_one}, not an {wanted}")
            raise WiringError(f"{where} has no {direction} '{base}'" + did_you_mean(base, ports))
        if found.kind != "number" and found.shape:
            raise WiringError(
                f"{text} is an array of type {found.kind}; only single values of that type can be connected"
            )
        port = replace(found, participant=where)
        return _element(port, bracket + index) if index else port

    def block_order(self) -> list[str]:
        """Return the blocks in the order of their connections; a cycle of blocks is an error."""
        graph: dict[str, list[str]] = {n: [] for n, c in self.participants.items() if c.as_block}
        direct = [c for c in self.connections if c.initial is None]
        for c in [*direct, *self.text_connections]:
            if c.source.participant in graph and c.target.participant in graph:
                graph[c.target.participant].append(c.source.participant)
        try:
            return list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            links = [*self.connections, *self.text_connections]
            raise WiringError(cycle_text(error.args[1], links)) from None


def _factors(out: Port, into: Port, transformation: object) -> tuple[float, float]:
    """Return (factor, offset) of a connection of numbers, from its units unless it is given."""
    if transformation is None:
        try:
            return out.conversion_to(into)
        except WiringError as error:
            raise WiringError(f"{out} [{out.unit}] -> {into} [{into.unit}]: {error}") from error
    try:
        scale, offset = map(float, transformation)  # type: ignore[call-overload]
    except (TypeError, ValueError):
        raise WiringError(
            f"transformation={transformation!r} must be two numbers, (factor, offset)"
        ) from None
    if not (math.isfinite(scale) and math.isfinite(offset)):
        raise WiringError(f"{out} -> {into}: transformation {transformation} must be finite")
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
    """Return the message for an algebraic cycle through the named components."""
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
            f"'{port}{index}' cannot index shape {shape}; write [3] or [2:4], for a matrix [2,1]"
        )
    a, b = int(match[1]), int(match[3] or match[1])
    if min(a, b) < 1 or a > shape[0] or b > shape[-1] or (rank == 1 and b < a):
        raise WiringError(f"'{port}{index}' is outside shape {shape}; elements count from 1")
    first, count = ((a - 1) * shape[1] + b - 1, 1) if rank == 2 else (a - 1, b - a + 1)
    return replace(port, first=first, count=count, index=index)
