"""The grid of communication points: every period is a whole number of steps."""

from __future__ import annotations

import math

from ..errors import TimeError


def steps_between(period: float, h: float, what: str) -> int:
    """Return period / h as a whole number of steps; any other ratio is refused."""
    ratio = period / h
    if not ratio < 2**53:
        raise TimeError(f"{what} of {period:g} s is {ratio:g} steps of {h:g} s, which is too many")
    steps = _whole(ratio)
    if steps is None:
        raise TimeError(
            f"{what} of {period:.10g} s is {_shown(ratio)} communication steps of {h:.10g} s; "
            f"it must be a whole number of them: choose a step such as {_fitting(period, ratio)} s"
        )
    return steps


def _whole(ratio: float) -> int | None:
    """Return the whole number of steps to which a ratio is equal but for round-off, None if none."""
    steps = round(ratio)
    # room for the round-off of decimal numbers: at most a millionth of a step, or a hundredth
    # where the ratio is so large that a float64 does not resolve a millionth
    room = max(min(1e-9 * steps, 1e-6), min(2.0 * math.ulp(ratio), 1e-2))
    return steps if steps >= 1 and abs(ratio - steps) <= room else None


def _shown(ratio: float) -> str:
    """Return a ratio in few digits, but in enough not to look whole."""
    text = f"{ratio:.6g}"
    return text if float(text) % 1.0 else f"{ratio:.14g}"


def _fitting(period: float, ratio: float) -> str:
    """Return a shorter step that `steps_between` accepts, in few digits or as a fraction."""
    fewest = max(math.ceil(ratio), 1)
    for steps in range(fewest, min(2 * fewest, fewest + 1000) + 1):
        text = f"{period / steps:.6g}"
        if _whole(period / float(text)) is not None:
            return text
    return f"{period!r}/{fewest}"
