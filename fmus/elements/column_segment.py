"""A segment of a column bent in one plane, with hinges that form at its ends.

theta_1, theta_2 are the rotations of the ends from the chord, m_1, m_2 the end moments;
they are rows e and e + 1. The elastic segment has the rotational stiffness

    k = [[k11, k12], [k12, k11]]

Each end is bilinear in moment and curvature (EI, EI1, M_y) with kinematic hardening.
Between events the moments follow two components in parallel: the share r = EI1/EI of the
segment stays elastic, the rest has a hinge wherever an end yields,

    dm = (r k + (1 - r) k_hinged) dtheta                                    (1)
    |m_i - a_i| <= M_y,   da_i = dm_i while end i yields                    (2)
    kappa_i = m_i/EI + (1/r - 1) a_i/EI                                     (3)

a_i is the centre of the elastic range and kappa_i the curvature, whose second term is
plastic. The rotations go straight from their start to their end; each yielding or unloading
on this path is located in closed form.

With `late` an event takes effect at the next step instead, and the moment overshoots until
then, an error of first order in h. The benchmark's own code does this; the option serves the
comparison with it.

Source of the two components: R. W. Clough, K. L. Benuska and E. L. Wilson, Inelastic
earthquake response of tall buildings, Proc. 3rd World Conference on Earthquake
Engineering, 1965.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import OWN, PLASTIC, YIELDING, Element

#: places in the parameters
K11, K12, R, M_Y, LATE, EI_PLACE = range(6)
#: places in the memory of an end
CENTRE = OWN  # a_i, N*m
MOMENT = OWN + 1  # m_i, N*m

MOST_EVENTS = 6  # bound on the pieces of a straight path; two ends make three
ON_BOUND = 1.0 - 1e-12  # share of M_y above which an end is at its bound: rounding of a_i + M_y - a_i


def column_segment(
    rows: Array, k11: float, k12: float, EI: float, EI1: float, M_y: float, late: bool = False
) -> Element:
    """Make a segment; rows (2, n) give the rotations of its ends from the chord for unit displacements.

    k11, k12    rotational stiffness of the elastic segment     N*m
    EI, EI1     bending stiffness before and after yielding     N*m^2
    M_y         yield moment                                    N*m
    late        whether events take effect a step late
    """
    parameters = (k11, k12, EI1 / EI, M_y, float(late), EI)
    return Element(law, rows, parameters, k0=k11, k0_coupling=k12, scale=M_y / (k11 - k12), memory=2)


def law(
    e: int, d: Array, d0: Array, p: Array, z0: Array, z: Array, force: Array, tangent: Array, coupling: Array
) -> tuple[float, float]:
    k11, k12, r, M_y = p[e, K11], p[e, K12], p[e, R], p[e, M_Y]
    if p[e, LATE] != 0.0:
        return law_late(e, d, d0, p, z0, z, force, tangent, coupling)
    step_1, step_2 = d[e] - d0[e], d[e + 1] - d0[e + 1]
    m1, m2 = z0[e, MOMENT], z0[e + 1, MOMENT]
    a1, a2 = z0[e, CENTRE], z0[e + 1, CENTRE]
    rigid_1, rigid_2 = k11 * step_1 + k12 * step_2, k12 * step_1 + k11 * step_2
    stored = stored_energy(k11, k12, r, d0[e], d0[e + 1], m1, m2)
    plastic_per_centre = (1.0 / r - 1.0) / p[e, EI_PLACE]  # (3)
    yields_1 = (m1 - a1) * copysign(1.0, rigid_1) >= M_y * ON_BOUND
    yields_2 = (m2 - a2) * copysign(1.0, rigid_2) >= M_y * ON_BOUND
    work = 0.0
    left = 1.0  # share of the path that remains
    t11, t12, t22 = k11, k12, k11
    for _ in range(MOST_EVENTS):
        t11, t12, t22 = hinged_tangent(k11, k12, r, yields_1, yields_2)
        dm1, dm2 = t11 * step_1 + t12 * step_2, t12 * step_1 + t22 * step_2  # (1)
        share_1 = left if yields_1 else share_until_yield(m1 - a1, dm1, M_y)
        share_2 = left if yields_2 else share_until_yield(m2 - a2, dm2, M_y)
        share = min(left, share_1, share_2)
        work += share * (step_1 * (m1 + 0.5 * share * dm1) + step_2 * (m2 + 0.5 * share * dm2))
        m1 += share * dm1
        m2 += share * dm2
        if yields_1:
            a1 += share * dm1  # (2)
        if yields_2:
            a2 += share * dm2
        left -= share
        if left <= 0.0:
            break
        yields_1 = yields_1 or share_1 <= share
        yields_2 = yields_2 or share_2 <= share
    z[e, CENTRE], z[e, MOMENT] = a1, m1
    z[e + 1, CENTRE], z[e + 1, MOMENT] = a2, m2
    z[e, YIELDING] = copysign(1.0, m1 - a1) if yields_1 else 0.0
    z[e + 1, YIELDING] = copysign(1.0, m2 - a2) if yields_2 else 0.0
    z[e, PLASTIC], z[e + 1, PLASTIC] = plastic_per_centre * a1, plastic_per_centre * a2
    force[e], force[e + 1] = m1, m2
    tangent[e], coupling[e], tangent[e + 1] = t11, t12, t22
    stored_end = stored_energy(k11, k12, r, d[e], d[e + 1], m1, m2)
    return stored_end, work - (stored_end - stored)


def law_late(
    e: int, d: Array, d0: Array, p: Array, z0: Array, z: Array, force: Array, tangent: Array, coupling: Array
) -> tuple[float, float]:
    """Evaluate the segment whose ends start or stop yielding only at the end of a step."""
    k11, k12, r = p[e, K11], p[e, K12], p[e, R]
    step_1, step_2 = d[e] - d0[e], d[e + 1] - d0[e + 1]
    m1, m2 = z0[e, MOMENT], z0[e + 1, MOMENT]
    stored = stored_energy(k11, k12, r, d0[e], d0[e + 1], m1, m2)
    yields_1, yields_2 = z0[e, YIELDING] != 0.0, z0[e + 1, YIELDING] != 0.0
    t11, t12, t22 = hinged_tangent(k11, k12, r, yields_1, yields_2)
    dm1, dm2 = t11 * step_1 + t12 * step_2, t12 * step_1 + t22 * step_2
    work = step_1 * (m1 + 0.5 * dm1) + step_2 * (m2 + 0.5 * dm2)
    end_late(e, m1, dm1, yields_1, p, z0, z)
    end_late(e + 1, m2, dm2, yields_2, p, z0, z)
    force[e], force[e + 1] = m1 + dm1, m2 + dm2
    tangent[e], coupling[e], tangent[e + 1] = t11, t12, t22
    stored_end = stored_energy(k11, k12, r, d[e], d[e + 1], m1 + dm1, m2 + dm2)
    return stored_end, work - (stored_end - stored)


def end_late(e: int, m: float, dm: float, yields: bool, p: Array, z0: Array, z: Array) -> None:
    """Write the moment and the memory of an end, and decide whether it yields in the next step."""
    M_y = p[e, M_Y]
    z[e, MOMENT] = m + dm
    z[e, PLASTIC] = z0[e, PLASTIC] + (dm * (1.0 / p[e, R] - 1.0) / p[e, EI_PLACE] if yields else 0.0)
    a = z0[e, CENTRE]
    if yields:
        a += dm
        z[e, YIELDING] = z0[e, YIELDING] if dm * z0[e, YIELDING] > 0.0 else 0.0
    elif abs(m + dm - a) >= M_y:
        z[e, YIELDING] = copysign(1.0, m + dm - a)
        a = m + dm - copysign(M_y, m + dm - a)
    else:
        z[e, YIELDING] = 0.0
    z[e, CENTRE] = a


def hinged_tangent(
    k11: float, k12: float, r: float, yields_1: bool, yields_2: bool
) -> tuple[float, float, float]:
    """Return the tangent (11, 12, 22) of a segment with hinges at the ends that yield."""
    if yields_1 and yields_2:
        return r * k11, r * k12, r * k11
    hinged = r * k11 + (1.0 - r) * (k11 - k12 * k12 / k11)
    if yields_1:
        return r * k11, r * k12, hinged
    if yields_2:
        return hinged, r * k12, r * k11
    return k11, k12, k11


def share_until_yield(m: float, dm: float, bound: float) -> float:
    """Return the share of the increment dm after which |m| reaches the bound; above 1, it does not."""
    if dm == 0.0:
        return 2.0
    return max(0.0, (copysign(bound, dm) - m) / dm)


def stored_energy(
    k11: float, k12: float, r: float, theta_1: float, theta_2: float, m1: float, m2: float
) -> float:
    """Return 1/2 r theta' k theta + 1/2 m_p' ((1 - r) k)^-1 m_p with m_p = m - r k theta."""
    elastic_1, elastic_2 = k11 * theta_1 + k12 * theta_2, k12 * theta_1 + k11 * theta_2
    m1, m2 = m1 - r * elastic_1, m2 - r * elastic_2
    stored = 0.5 * r * (theta_1 * elastic_1 + theta_2 * elastic_2)
    determinant = (1.0 - r) * (k11 * k11 - k12 * k12)
    return stored + 0.5 * (k11 * (m1 * m1 + m2 * m2) - 2.0 * k12 * m1 * m2) / determinant
