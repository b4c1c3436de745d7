"""The grid of communication points: every period is a whole number of steps."""

from __future__ import annotations

from ..errors import TimeError


def steps_between(period: float, h: float, what: str) -> int:
    """Return period / h as a whole number of steps; any other ratio is refused."""
    ratio = period / h
    if not ratio < 2**53:
        raise TimeError(f"{what} of {period:g} s is {ratio:g} steps of {h:g} s, which is too many")
    steps = round(ratio)
    # allow for the round-off of decimal numbers, but for no more than a millionth of a step
    if steps < 1 or abs(ratio - steps) > min(1e-9 * steps, 1e-6):
        near = period / max(round(ratio + 0.5), 1)
        raise TimeError(
            f"{what} of {period:g} s is {ratio:.6g} communication steps of {h:g} s; "
            f"it must be a whole number of them: choose a step such as {near:.6g} s"
        )
    return steps
