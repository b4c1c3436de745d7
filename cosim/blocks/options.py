"""The keywords that blocks share, for type checkers and editors."""

from __future__ import annotations

from typing import TypedDict


class Sampled(TypedDict, total=False):
    """When a block acts; see `Block`."""

    every: int | None
    sample_period: float | None


class Signal(TypedDict, total=False):
    """What a block passes: any signal.

    n
        number of elements: by default as many as the given arrays have, otherwise 1
    unit
        of the signal; None is not checked
    """

    n: int | None
    unit: str | None


class SampledSignal(Sampled, Signal, total=False):
    """A signal, and when the block acts."""
