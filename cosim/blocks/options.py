"""The keywords that blocks share, for type checkers and editors."""

from __future__ import annotations

from typing import TypedDict


class Sampled(TypedDict, total=False):
    """The instants at which a block acts; see `Block`."""

    every: int | None
    sample_period: float | None


class Signal(TypedDict, total=False):
    """The signal that a block passes on.

    n
        number of elements: by default as many as the given arrays have, otherwise 1
    unit
        of the signal; None is not checked
    """

    n: int | None
    unit: str | None


class SampledSignal(Sampled, Signal, total=False):
    """A signal, and the instants at which the block acts."""
