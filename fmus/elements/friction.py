"""Friction damper: Coulomb friction behind an elastic brace.

    f = k (d - z),  |f| <= slip_force                           (1)
    z' = d' while |f| = slip_force and f d' > 0, otherwise 0    (2)

z is the slip. The return to the bound is exact when the deformation goes straight from d0
to d.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import PLASTIC, YIELDING, Element, Response


def friction(row: Array, k: float, slip_force: float) -> Element:
    """Make a damper that sticks with stiffness k (N/m) and slips at slip_force (N)."""
    return Element(law, row, (k, slip_force), k0=k, scale=slip_force / k, memory=0)


def law(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Response:
    k, slip_force = p[e, 0], p[e, 1]
    force = k * (d - z0[e, PLASTIC])  # (1)
    slip = 0.0
    tangent = k
    if abs(force) > slip_force:
        bound = copysign(slip_force, force)
        slip = (force - bound) / k  # (2)
        force = bound
        tangent = 0.0
    z[e, PLASTIC] = z0[e, PLASTIC] + slip
    z[e, YIELDING] = copysign(1.0, slip) if slip != 0.0 else 0.0
    return force, tangent, 0.5 * force * force / k, slip_force * abs(slip)
