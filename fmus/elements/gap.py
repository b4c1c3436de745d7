"""Gap: a spring that acts once a gap has closed, such as a bumper or a deck's end at its abutment.

    f = k (d - opening)   for d > opening >= 0                  (1)
    f = k (d - opening)   for d < opening < 0                   (2)
    f = 0                 otherwise

The sign of `opening` is the direction in which the gap closes.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import YIELDING, Element, Response


def gap(row: Array, k: float, opening: float) -> Element:
    """Make an element of stiffness k (N/m) beyond the deformation `opening` (m, not zero)."""
    return Element(law, row, (k, opening), k0=0.0, scale=abs(opening), memory=0)


def law(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Response:
    k, opening = p[e, 0], p[e, 1]
    closure = d - opening if opening >= 0.0 else opening - d
    if closure <= 0.0:
        z[e, YIELDING] = 0.0
        return 0.0, 0.0, 0.0, 0.0
    z[e, YIELDING] = 1.0  # closed
    return copysign(k * closure, opening), k, 0.5 * k * closure * closure, 0.0
