"""Force laws of one-dimensional elements, and of a column segment bent in one plane.

A law is a function of the deformation at the end of a step,

    force, tangent, stored, lost = law(e, d, d0, rate, h, p, z0, z)

    e        the element's row in p, z0 and z
    d, d0    deformation at the end and at the start of the step
    rate     deformation velocity at the end of the step, 2 (d - d0)/h - rate0
    p        parameters, one row an element
    z0, z    memory at the start (read) and at the end of the step (written)
    force    at the end of the step
    tangent  d force/d d, consistent with the law (rate held by its formula above)
    stored   recoverable energy at the end of the step
    lost     energy dissipated in the step

It has no memory but z, so that a step may be repeated or split: z[e, 1] says whether
and which way the element yields, z[e, 3] is its plastic deformation.

Bilinear, kinematic hardening        p = k1, k2, dy         z = plastic deformation
    f = k2 d + q,  q = (k1 - k2)(d - z),  |q| <= (k1 - k2) dy
Bouc-Wen                             p = k1, alpha, dy, n, beta, gamma     z = z
    f = alpha k1 d + (1 - alpha) k1 dy z,  dy z' = d' (1 - |z|^n (gamma + beta sgn(d' z)))
Gap                                  p = k, gap (its sign is the closing direction)
Viscous damper                       p = c, exponent, rate0 (linear below rate0)
Friction damper                      p = stick stiffness, slip force        z = slip
"""

from __future__ import annotations

from math import copysign

from cosim import Array

#: force, tangent, stored, lost
Law = tuple[float, float, float, float]

LINEAR, BILINEAR, BOUC_WEN, GAP, VISCOUS, FRICTION, SEGMENT, SEGMENT_END, OWN = range(9)


def linear(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """f = k d"""
    k = p[e, 0]
    return k * d, k, 0.5 * k * d * d, 0.0


def bilinear(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """Linear with hardening, in parallel with elastic and perfectly plastic."""
    k1, k2, dy = p[e, 0], p[e, 1], p[e, 2]
    k = k1 - k2
    q_y = k * dy
    q = k * (d - z0[e, 0])
    slip = 0.0
    tangent = k1
    if abs(q) > q_y:
        bound = copysign(q_y, q)
        slip = (q - bound) / k
        q = bound
        tangent = k2
    z[e, 0] = z[e, 3] = z0[e, 0] + slip
    z[e, 1] = copysign(1.0, slip) if slip != 0.0 else 0.0
    return k2 * d + q, tangent, 0.5 * k2 * d * d + 0.5 * q * q / k, q_y * abs(slip)


def bouc_wen(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """Implicit midpoint in z by Newton; the rate cancels, the law is rate-independent."""
    k1, alpha, dy, n, beta, gamma = p[e, 0], p[e, 1], p[e, 2], p[e, 3], p[e, 4], p[e, 5]
    step = (d - d0) / dy
    start = z0[e, 0]
    end = start
    slope = 1.0
    for _ in range(30):
        middle = 0.5 * (start + end)
        power = abs(middle) ** n
        sense = gamma + beta * copysign(1.0, step * middle)
        power_slope = n * power / middle if middle != 0.0 else 0.0
        residual = end - start - step * (1.0 - sense * power)
        jacobian = 1.0 + 0.5 * step * sense * power_slope
        slope = (1.0 - sense * power) / (dy * jacobian)
        change = residual / jacobian
        end -= change
        if abs(change) < 1e-14:
            break
    z[e, 0] = end
    q = (1.0 - alpha) * k1 * dy
    z[e, 1] = 1.0 if abs(end) > 0.95 * (beta + gamma) ** (-1.0 / n) else 0.0
    stored = 0.5 * alpha * k1 * d * d + 0.5 * q * dy * end * end
    work = 0.5 * q * (start + end) * (d - d0)
    lost = work - 0.5 * q * dy * (end * end - start * start)
    return alpha * k1 * d + q * end, alpha * k1 + q * slope, stored, lost


def gap(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """A spring once the gap is closed."""
    k, opening = p[e, 0], p[e, 1]
    closure = d - opening if opening >= 0.0 else opening - d
    if closure <= 0.0:
        z[e, 1] = 0.0
        return 0.0, 0.0, 0.0, 0.0
    z[e, 1] = 1.0
    return copysign(k * closure, opening), k, 0.5 * k * closure * closure, 0.0


def viscous(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """Power law of the rate."""
    c, exponent, rate0 = p[e, 0], p[e, 1], p[e, 2]
    speed = abs(rate)
    if speed <= rate0 or exponent == 1.0:
        slope = c * rate0 ** (exponent - 1.0) if exponent != 1.0 else c
        force = slope * rate
    else:
        force = copysign(c * speed**exponent, rate)
        slope = exponent * abs(force) / speed
    lost = 0.5 * (z0[e, 0] + force) * (d - d0)
    z[e, 0] = force
    return force, 2.0 / h * slope, 0.0, lost


def friction(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Law:
    """Elastic and perfectly plastic."""
    k, slip_force = p[e, 0], p[e, 1]
    q = k * (d - z0[e, 0])
    slip = 0.0
    tangent = k
    if abs(q) > slip_force:
        bound = copysign(slip_force, q)
        slip = (q - bound) / k
        q = bound
        tangent = 0.0
    z[e, 0] = z[e, 3] = z0[e, 0] + slip
    z[e, 1] = copysign(1.0, slip) if slip != 0.0 else 0.0
    return q, tangent, 0.5 * q * q / k, slip_force * abs(slip)


def segment(
    e: int, d: Array, d0: Array, p: Array, z0: Array, z: Array, force: Array, tangent: Array, coupling: Array
) -> tuple[float, float]:
    """A column segment in one plane; rows e and e + 1 are the rotations of its ends.

    Each end is bilinear in moment and curvature (EI, EI1, My) with kinematic hardening.
    Between events the moments follow the tangent of two components in parallel (Clough):
    the share r = EI1/EI of the elastic segment stays elastic, the rest has a hinge where
    an end yields,

        dm = (r k + (1 - r) k_hinged) dtheta,   |m_i - a_i| <= My

    and the centre a_i follows m_i while end i yields. The rotations go straight from d0
    to d; every yielding or unloading on that way is found where it happens. With `late`
    it takes effect at the next step instead, the moment overshooting meanwhile: first
    order in h, and how the benchmark's own code goes about it (for comparison).

    p = k_11, k_12 (rotational stiffness of the elastic segment), r, My, late, EI
    z = centre a_i, whether and which way the end yields, moment m_i, plastic curvature;
        an end's curvature is m_i / EI + its plastic curvature
    Writes both ends; returns stored and lost.
    """
    k11, k12, r, M_y = p[e, 0], p[e, 1], p[e, 2], p[e, 3]
    if p[e, 4] != 0.0:
        return segment_late(e, d, d0, p, z0, z, force, tangent, coupling)
    step_1, step_2 = d[e] - d0[e], d[e + 1] - d0[e + 1]
    m1, m2 = z0[e, 2], z0[e + 1, 2]
    a1, a2 = z0[e, 0], z0[e + 1, 0]
    rigid_1, rigid_2 = k11 * step_1 + k12 * step_2, k12 * step_1 + k11 * step_2
    stored = segment_energy(k11, k12, r, d0[e], d0[e + 1], m1, m2)
    gained = (1.0 / r - 1.0) / p[e, 5]
    on_1 = (m1 - a1) * copysign(1.0, rigid_1) >= M_y * (1.0 - 1e-12)
    on_2 = (m2 - a2) * copysign(1.0, rigid_2) >= M_y * (1.0 - 1e-12)
    work = 0.0
    left = 1.0
    t11, t12, t22 = k11, k12, k11
    for _ in range(6):
        t11, t12, t22 = segment_tangent(k11, k12, r, on_1, on_2)
        dm1, dm2 = t11 * step_1 + t12 * step_2, t12 * step_1 + t22 * step_2
        share_1 = left if on_1 else until_yield(m1 - a1, dm1, M_y)
        share_2 = left if on_2 else until_yield(m2 - a2, dm2, M_y)
        share = min(left, share_1, share_2)
        work += share * (step_1 * (m1 + 0.5 * share * dm1) + step_2 * (m2 + 0.5 * share * dm2))
        m1 += share * dm1
        m2 += share * dm2
        if on_1:
            a1 += share * dm1
        if on_2:
            a2 += share * dm2
        left -= share
        if left <= 0.0:
            break
        on_1 = on_1 or share_1 <= share
        on_2 = on_2 or share_2 <= share
    z[e, 0], z[e, 1], z[e, 2] = a1, copysign(1.0, m1 - a1) if on_1 else 0.0, m1
    z[e + 1, 0], z[e + 1, 1], z[e + 1, 2] = a2, copysign(1.0, m2 - a2) if on_2 else 0.0, m2
    z[e, 3], z[e + 1, 3] = gained * a1, gained * a2
    force[e], force[e + 1] = m1, m2
    tangent[e], coupling[e], tangent[e + 1] = t11, t12, t22
    stored_end = segment_energy(k11, k12, r, d[e], d[e + 1], m1, m2)
    return stored_end, work - (stored_end - stored)


def segment_late(
    e: int, d: Array, d0: Array, p: Array, z0: Array, z: Array, force: Array, tangent: Array, coupling: Array
) -> tuple[float, float]:
    """The segment whose ends start or stop yielding at the end of a step only."""
    k11, k12, r = p[e, 0], p[e, 1], p[e, 2]
    step_1, step_2 = d[e] - d0[e], d[e + 1] - d0[e + 1]
    m1, m2 = z0[e, 2], z0[e + 1, 2]
    stored = segment_energy(k11, k12, r, d0[e], d0[e + 1], m1, m2)
    on_1, on_2 = z0[e, 1] != 0.0, z0[e + 1, 1] != 0.0
    t11, t12, t22 = segment_tangent(k11, k12, r, on_1, on_2)
    dm1, dm2 = t11 * step_1 + t12 * step_2, t12 * step_1 + t22 * step_2
    work = step_1 * (m1 + 0.5 * dm1) + step_2 * (m2 + 0.5 * dm2)
    end_late(e, m1, dm1, on_1, p, z0, z)
    end_late(e + 1, m2, dm2, on_2, p, z0, z)
    force[e], force[e + 1] = m1 + dm1, m2 + dm2
    tangent[e], coupling[e], tangent[e + 1] = t11, t12, t22
    stored_end = segment_energy(k11, k12, r, d[e], d[e + 1], m1 + dm1, m2 + dm2)
    return stored_end, work - (stored_end - stored)


def end_late(e: int, m: float, dm: float, on: bool, p: Array, z0: Array, z: Array) -> None:
    """Moment and state of an end; what it does next is decided here, a step late."""
    M_y = p[e, 3]
    z[e, 2] = m + dm
    z[e, 3] = z0[e, 3] + (dm * (1.0 / p[e, 2] - 1.0) / p[e, 5] if on else 0.0)
    a = z0[e, 0]
    if on:
        a += dm
        z[e, 1] = z0[e, 1] if dm * z0[e, 1] > 0.0 else 0.0
    elif abs(m + dm - a) >= M_y:
        z[e, 1] = copysign(1.0, m + dm - a)
        a = m + dm - copysign(M_y, m + dm - a)
    else:
        z[e, 1] = 0.0
    z[e, 0] = a


def segment_tangent(k11: float, k12: float, r: float, on_1: bool, on_2: bool) -> tuple[float, float, float]:
    """Tangent (11, 12, 22) of a segment with hinges at the ends that yield."""
    if on_1 and on_2:
        return r * k11, r * k12, r * k11
    hinged = r * k11 + (1.0 - r) * (k11 - k12 * k12 / k11)
    if on_1:
        return r * k11, r * k12, hinged
    if on_2:
        return hinged, r * k12, r * k11
    return k11, k12, k11


def until_yield(m: float, dm: float, bound: float) -> float:
    """Share of the increment dm after which |m| reaches its bound; above 1: not reached."""
    if dm == 0.0:
        return 2.0
    return max(0.0, (copysign(bound, dm) - m) / dm)


def segment_energy(
    k11: float, k12: float, r: float, theta_1: float, theta_2: float, m1: float, m2: float
) -> float:
    """1/2 r theta k theta + 1/2 m_p ((1 - r) k)^-1 m_p, m_p = m - r k theta"""
    elastic_1, elastic_2 = k11 * theta_1 + k12 * theta_2, k12 * theta_1 + k11 * theta_2
    m1, m2 = m1 - r * elastic_1, m2 - r * elastic_2
    stored = 0.5 * r * (theta_1 * elastic_1 + theta_2 * elastic_2)
    determinant = (1.0 - r) * (k11 * k11 - k12 * k12)
    return stored + 0.5 * (k11 * (m1 * m1 + m2 * m2) - 2.0 * k12 * m1 * m2) / determinant
