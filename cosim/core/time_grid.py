"""The grid of communication points: periods are whole numbers of steps."""

from __future__ import annotations

from ..errors import TimeError


def steps_between(period: float, h: float, what: str) -> int:
    """Return period / h, a whole number of steps; another ratio is refused."""
    ratio = period / h
    if not ratio < 2**53:
        raise TimeError(f"{what} of {period:g} s is {ratio:g} steps of {h:g} s, more than can be counted")
    steps = round(ratio)
    # room for the round-off of decimal numbers, and never for more than a millionth of a step
    if steps < 1 or abs(ratio - steps) > min(1e-9 * steps, 1e-6):
        near = period / max(round(ratio + 0.5), 1)
        raise TimeError(
            f"{what} of {period:g} s is {ratio:.6g} communication steps of {h:g} s; "
            f"it must be a whole number of them: choose a step such as {near:.6g} s"
        )
    return steps
