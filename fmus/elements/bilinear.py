"""Bilinear element with kinematic hardening: a lead-rubber bearing, a yielding brace.

    f = k2 d + q                                            (1)
    q = k (d - z),  k = k1 - k2,  |q| <= k dy               (2)
    z' = d' while |q| = k dy and q d' > 0, otherwise 0      (3)

A linear spring in parallel with an elastic and perfectly plastic one; z is the plastic
deformation of the latter. The return to the bound (2) is exact when the deformation goes
straight from d0 to d.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import PLASTIC, YIELDING, Element, Response


def bilinear(row: Array, k1: float, k2: float, dy: float) -> Element:
    """Make an element of stiffness k1, and of stiffness k2 beyond the deformation dy (N/m, N/m, m)."""
    return Element(law, row, (k1, k2, dy), k0=k1, scale=dy, memory=0)


def law(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Response:
    k1, k2, dy = p[e, 0], p[e, 1], p[e, 2]
    k = k1 - k2
    q_y = k * dy
    q = k * (d - z0[e, PLASTIC])  # (2)
    slip = 0.0
    tangent = k1
    if abs(q) > q_y:
        bound = copysign(q_y, q)
        slip = (q - bound) / k  # (3)
        q = bound
        tangent = k2
    z[e, PLASTIC] = z0[e, PLASTIC] + slip
    z[e, YIELDING] = copysign(1.0, slip) if slip != 0.0 else 0.0
    return k2 * d + q, tangent, 0.5 * k2 * d * d + 0.5 * q * q / k, q_y * abs(slip)
