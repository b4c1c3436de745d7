"""Complex modes of a classically damped structure with one attached damper.

The structure is given in its own modal coordinates eta (normalised by mass, w_j = omega_j^2,
d_j = 2 zeta_j omega_j); the damper m, c, k is attached to the degree of freedom where the
mode shapes are a_j, and x_m is its stroke:

    eta_j'' + d_j eta_j' + w_j eta_j = a_j (k x_m + c x_m' - u) + forces
    m (sum_j a_j eta_j'' + x_m'') + c x_m' + k x_m = u                   the thesis' (2.19)

Elimination of eta leaves one scalar equation for the eigenvalues s, a secular equation as in
divide-and-conquer eigensolvers. With d_j(s) = s^2 + d_j s + w_j, e(s) = m s^2 + c s + k:

    e(s) + m s^2 (c s + k) sum_j a_j^2 / d_j(s) = 0

A root near the pole of mode i is found from a form that is smooth there:

    d_i(s) = r_i(s) = -a_i^2 m s^2 (c s + k) / (e(s) + m s^2 (c s + k) sum_{j/=i} a_j^2 / d_j(s))

It gives the small number d_i(s) without cancellation; the eigenvector follows from the first
equation. The matrices are symmetric, so left and right eigenvectors agree and no matrix is
inverted:

    phi' (2 s M + C) phi = n,   z' = s z + phi' f / n,   x = sum of phi z over all s.

`scipy.linalg.eig` gives the same numbers, as the tests show, but this code runs in a compiled
kernel and so inside an exported FMU, whose damper and stiffness are set before
initialisation. All functions work on memory of the caller and allocate nothing.
"""

from __future__ import annotations

import math

from cosim import Array

MAX_ITERATIONS = 60


def _others(s: complex, skip: int, w: Array, d: Array, a: Array) -> tuple[complex, complex]:
    """Return sum_j a_j^2/d_j(s) and its derivative, without the term `skip`."""
    total = 0.0j
    slope = 0.0j
    for j in range(len(w)):
        if j != skip:
            pole = 1.0 / (s * (s + d[j]) + w[j])
            term = a[j] * a[j] * pole
            total += term
            slope -= term * pole * (2.0 * s + d[j])
    return total, slope


def _residual(
    s: complex, i: int, w: Array, d: Array, a: Array, m: float, c: float, k: float
) -> tuple[complex, complex]:
    """Return F(s), which is 0 at an eigenvalue, and F'(s); i is the nearest pole, or -1 for none.

    F = d_i (e + q H) + q a_i^2 with q = m s^2 (c s + k); d_i = 1 and no last term for i = -1.
    """
    H, dH = _others(s, i, w, d, a)
    e = m * s * s + c * s + k
    de = 2.0 * m * s + c
    q = m * s * s * (c * s + k)
    dq = m * s * (3.0 * c * s + 2.0 * k)
    g = e + q * H
    dg = de + dq * H + q * dH
    if i < 0:
        return g, dg
    pole = s * (s + d[i]) + w[i]
    return pole * g + q * a[i] * a[i], (2.0 * s + d[i]) * g + pole * dg + dq * a[i] * a[i]


def _root(
    start: complex,
    i: int,
    w: Array,
    d: Array,
    a: Array,
    m: float,
    c: float,
    k: float,
    roots: Array,
    count: int,
) -> complex:
    """Return a root by Newton's method, with the roots found so far and their conjugates divided out."""
    s = start
    for _ in range(MAX_ITERATIONS):
        F, dF = _residual(s, i, w, d, a, m, c, k)
        if abs(F) == 0.0:
            break
        log_slope = dF / F
        for n in range(count):
            near = complex(roots[n, 0], roots[n, 1])
            if abs(s - near) < 0.5 * abs(s):
                log_slope -= 1.0 / (s - near)
            if roots[n, 1] != 0.0 and abs(s - near.conjugate()) < 0.5 * abs(s):
                log_slope -= 1.0 / (s - near.conjugate())
        delta = 1.0 / log_slope
        s -= delta
        if abs(delta) < 4e-16 * abs(s):
            break
    return s


def coupled_modes(
    w: Array, d: Array, a: Array, m: float, c: float, k: float, roots: Array, phi_re: Array, phi_im: Array
) -> int:
    """Write eigenvalues and scaled eigenvectors; return their number, 0 if an iteration failed.

    w, d, a (n,): omega^2, 2 zeta omega and shape at the damper, by mode of the structure.
    roots (2n+2, 2): real and imaginary part, imaginary part >= 0.
    phi_re, phi_im (2n+2, n+1): eigenvector in (eta, x_m), scaled so that phi' (2 s M + C) phi = 1.
    A complex root stands for its pair; a real one for itself.
    """
    n = len(w)
    count = 0
    # Weakly coupled modes first, the damper and the mode nearest to it last.
    nearest = 0
    for j in range(n):
        if abs(w[j] - k / m) < abs(w[nearest] - k / m):
            nearest = j
    for step in range(n + 1):
        if step < n:
            i = n - 1 - step
            if i <= nearest:
                i -= 1
            if i < 0:
                i = nearest
            square, half = w[i], 0.5 * d[i]
        else:
            i, square, half = -1, k / m, 0.5 * c / m
        discriminant = half * half - square
        sides = 1 if discriminant < 0.0 else 2
        for side in range(sides):
            if discriminant < 0.0:
                start = complex(-half, math.sqrt(-discriminant))
            elif side == 0:
                start = complex(-half - math.sqrt(discriminant), 0.0)
            else:
                start = complex(-square / (half + math.sqrt(discriminant)), 0.0)
            s = _root(start * (1.0 + 1e-9), i, w, d, a, m, c, k, roots, count)
            if not math.isfinite(abs(s)) or s.real > 1e-9 * abs(s):
                return 0
            if abs(s.imag) <= 1e-14 * abs(s):
                s = complex(s.real, 0.0)
            if s.imag < 0.0:
                s = s.conjugate()
            roots[count, 0], roots[count, 1] = s.real, s.imag
            # eigenvector: eta_j = a_j (c s + k) x_m / d_j(s), with eta_i = 1 for a mode of the structure
            if i >= 0:
                H, _ = _others(s, i, w, d, a)
                e = m * s * s + c * s + k
                # from the second equation: m s^2 a_i eta_i + (e + q H) x_m = 0
                x_m = -m * s * s * a[i] / (e + m * s * s * (c * s + k) * H)
            else:
                x_m = 1.0 + 0.0j
            norm = 0.0j
            top = x_m
            for j in range(n):
                eta = 1.0 + 0j if j == i else a[j] * (c * s + k) * x_m / (s * (s + d[j]) + w[j])
                phi_re[count, j], phi_im[count, j] = eta.real, eta.imag
                norm += (2.0 * s + d[j]) * eta * eta
                top += a[j] * eta
            norm += 2.0 * s * m * top * top + c * x_m * x_m
            size = abs(norm)
            root = complex(math.sqrt(0.5 * (size + norm.real)), math.sqrt(max(0.0, 0.5 * (size - norm.real))))
            if norm.imag < 0.0:
                root = root.conjugate()
            phi_re[count, n], phi_im[count, n] = x_m.real, x_m.imag
            for j in range(n + 1):
                value = complex(phi_re[count, j], phi_im[count, j]) / root
                phi_re[count, j], phi_im[count, j] = value.real, value.imag
            count += 1
    return count
