"""Strings and binary data as ports of FMUs: what is connected and recorded beside the floats.

A text is handed on at communication points as a float is: got at t_k, set before the step
from t_k. This is done in Python, and only where a text is connected or recorded. A source
may feed several inputs; String goes to String, Binary to Binary, one value each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import WiringError
from ..fmi.fmu import FMU

if TYPE_CHECKING:
    from .system import System

TYPES = ("String", "Binary")


@dataclass(frozen=True)
class TextPort:
    """A port for a String (str) or Binary (bytes)."""

    participant: str
    name: str
    type: str

    def __str__(self) -> str:
        return f"{self.participant}.{self.name}"


@dataclass(frozen=True)
class TextConnection:
    """source -> target."""

    source: TextPort
    target: TextPort


def text_port(system: System, text: str, direction: str) -> TextPort | None:
    """Return the text port of a name, None if it names no text; `direction` is "input" or "output"."""
    where, _, name = text.partition(".")
    member = system.participants.get(where)
    if not isinstance(member, FMU):
        return None
    if direction == "input":
        name = member.aliases.get(name, name)
    ports = member.text_inputs if direction == "input" else member.text_outputs
    others = member.text_outputs if direction == "input" else member.text_inputs
    if name in others:
        article = {"input": "an output, not an input", "output": "an input, not an output"}[direction]
        raise WiringError(f"{text} is {article}")
    variable = ports.get(name)
    if variable is None:
        return None
    if variable.dimensions:
        raise WiringError(
            f"{text} is an array of type {variable.type}, which is no port; only single ones are"
        )
    return TextPort(where, name, variable.type)


def text_connection(system: System, source: str, target: str, plain: bool) -> TextConnection | None:
    """Return the connection of two text ports, None if neither is one; refuse it if only one is.

    `plain` tells that nothing is asked for that a text cannot have: delay, transformation.
    """
    out, into = text_port(system, source, "output"), text_port(system, target, "input")
    if out is None and into is None:
        return None
    if out is None or into is None or out.type != into.type:
        kinds = [
            f"{port or name} is {f'a {port.type}' if port else 'a number'}"
            for port, name in ((out, source), (into, target))
        ]
        if out is None:
            system.port(source, "output")  # which says so if there is no such port
        if into is None:
            system.port(target, "input")
        raise WiringError(f"{', and '.join(kinds)}: a String goes to a String, a Binary to a Binary")
    if not plain:
        raise WiringError(f"{out} -> {into}: texts cannot be delayed or transformed; leave that away")
    for other in system.text_connections:
        if other.target == into:
            raise WiringError(f"{into} is connected already, to {other.source}; an input has one source")
    return TextConnection(out, into)
