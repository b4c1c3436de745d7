"""Bouc-Wen element: smooth hysteresis.

    f = alpha k1 d + (1 - alpha) k1 dy z                        (1)
    dy z' = d' (1 - |z|^n (gamma + beta sgn(d' z)))             (2)

z starts at 0 and tends to +-(beta + gamma)^(-1/n). (2) is integrated by the implicit
midpoint rule, solved by Newton's method; the rate cancels, so the law does not depend on
the speed along the path.

Source: Y.-K. Wen, Method for random vibration of hysteretic systems, Journal of the
Engineering Mechanics Division 102 (1976) 249-263, DOI 10.1061/JMCEA3.0002106.
"""

from __future__ import annotations

from math import copysign

from cosim import Array

from .element import OWN, YIELDING, Element, Response

Z = OWN  # z, without unit
NEWTON_STEPS = 30
NEWTON_TOLERANCE = 1e-14  # of z, whose size is near 1
YIELD_SHARE = 0.95  # of the bound of z; beyond it the element is reported as yielding


def bouc_wen(
    row: Array, k1: float, alpha: float, dy: float, n: float = 2.0, beta: float = 0.5, gamma: float = 0.5
) -> Element:
    """Make an element of stiffness k1 (N/m), and of alpha k1 when it is far beyond dy (m).

    n sets the sharpness of the knee; beta and gamma set the shape of the loop.
    """
    return Element(law, row, (k1, alpha, dy, n, beta, gamma), k0=k1, scale=dy)


def law(e: int, d: float, d0: float, rate: float, h: float, p: Array, z0: Array, z: Array) -> Response:
    k1, alpha, dy, n, beta, gamma = p[e, 0], p[e, 1], p[e, 2], p[e, 3], p[e, 4], p[e, 5]
    step = (d - d0) / dy
    start = z0[e, Z]
    end = start
    slope = 1.0  # dz/dd at the end of the step
    for _ in range(NEWTON_STEPS):
        middle = 0.5 * (start + end)
        power = abs(middle) ** n
        sense = gamma + beta * copysign(1.0, step * middle)
        power_slope = n * power / middle if middle != 0.0 else 0.0
        residual = end - start - step * (1.0 - sense * power)  # (2)
        jacobian = 1.0 + 0.5 * step * sense * power_slope
        slope = (1.0 - sense * power) / (dy * jacobian)
        change = residual / jacobian
        end -= change
        if abs(change) < NEWTON_TOLERANCE:
            break
    z[e, Z] = end
    q = (1.0 - alpha) * k1 * dy
    z[e, YIELDING] = 1.0 if abs(end) > YIELD_SHARE * (beta + gamma) ** (-1.0 / n) else 0.0
    stored = 0.5 * alpha * k1 * d * d + 0.5 * q * dy * end * end
    work = 0.5 * q * (start + end) * (d - d0)
    lost = work - 0.5 * q * dy * (end * end - start * start)
    return alpha * k1 * d + q * end, alpha * k1 + q * slope, stored, lost  # (1)
