"""Measurement chains: signals through sensors, noise and converter to the block that reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from cosim import Participant, System


def measure(system: System, signals: Sequence[str], chain: Mapping[str, Participant], reader: str) -> None:
    """Connect scalar ports, in order, through a chain of blocks u -> y to the array port `reader`.

    The blocks are added to the system under their names; an empty chain connects directly.
    """
    for name, block in chain.items():
        system.add(name, block)
    names = list(chain)
    entry = f"{names[0]}.u" if names else reader
    for i, signal in enumerate(signals):
        system.connect(signal, f"{entry}[{i + 1}]")
    for before, after in pairwise(names):
        system.connect(f"{before}.y", f"{after}.u")
    if names:
        system.connect(f"{names[-1]}.y", reader)
