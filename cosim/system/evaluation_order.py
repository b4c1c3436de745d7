"""The order in which outputs and blocks are evaluated at an instant, under stage coupling."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter

from ..core.port import Port
from ..errors import WiringError
from .system import Connection, cycle_text


def evaluation_order(
    blocks: Iterable[str],
    feedthrough: Mapping[str, Mapping[str, set[str]]],
    connections: list[Connection],
    recorded: Iterable[Port],
) -> list[dict[str, bool]]:
    """Order blocks and outputs by dependence, in rounds; the members of a round are independent.

    feedthrough
        for every component that moves, the inputs on which each output depends directly
    recorded
        the ports that are read in addition to those that are connected

    An output that depends on inputs follows their sources; the others come first. A component
    may therefore be read in several rounds: its accelerations after the forces that follow
    from its displacements. The value tells whether a component is read after its inputs are set.
    """
    used = [*recorded, *(c.source for c in connections)]
    graph: dict[tuple[str, str], list[tuple[str, str]]] = {(name, ""): [] for name in blocks}
    graph |= {(p.participant, p.name): [] for p in used if p.name in feedthrough.get(p.participant, {})}
    for c in connections:
        if c.initial is None:
            a, b = c.source.participant, c.target.participant
            source = (a, c.source.name if a in feedthrough else "")
            for name, port in graph:
                if name == b and (b not in feedthrough or c.target.name in feedthrough[b][port]):
                    graph[name, port].append(source)
    sorter = TopologicalSorter(graph)
    try:
        sorter.prepare()
    except CycleError as error:
        path = [name for name, _ in error.args[1]]
        raise WiringError(cycle_text(path, connections)) from None
    rounds: list[dict[str, bool]] = []
    while sorter.is_active():
        ready = sorter.get_ready()
        sorter.done(*ready)
        rounds.append({})
        for name, port in ready:
            after_inputs = name in feedthrough and bool(feedthrough[name][port])
            rounds[-1][name] = after_inputs or rounds[-1].get(name, False)
    return rounds
