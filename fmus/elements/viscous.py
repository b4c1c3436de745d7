"""Viscous damper with a power law of the rate.

    f = c |d'|^exponent sgn d'              |d'| > rate0        (1)
    f = c rate0^(exponent - 1) d'           |d'| <= rate0       (2)

Without (2) the slope of a law with exponent < 1 would be infinite at d' = 0.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import OWN, Element, Response

FORCE = OWN  # force at the end of the step, N
SCALE = 1e-3  # m; convergence needs a typical deformation, which the law does not have


def viscous(row: Array, c: float, exponent: float = 1.0, rate0: float = 1e-3) -> Element:
    """Make a damper of force c |rate|^exponent (N, with the rate in m/s), linear below rate0 (m/s)."""
    return Element(law, row, (c, exponent, rate0), k0=0.0, scale=SCALE)


def law(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Response:
    c, exponent, rate0 = p[e, 0], p[e, 1], p[e, 2]
    speed = abs(rate)
    if speed <= rate0 or exponent == 1.0:
        slope = c * rate0 ** (exponent - 1.0) if exponent != 1.0 else c
        force = slope * rate  # (2)
    else:
        force = copysign(c * speed**exponent, rate)  # (1)
        slope = exponent * abs(force) / speed
    lost = 0.5 * (z0[e, FORCE] + force) * (d - d0)
    z[e, FORCE] = force
    return force, 2.0 / h * slope, 0.0, lost
