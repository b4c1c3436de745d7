"""One step of a linear structure with nonlinear elements, by Newmark 1/4, 1/2.

    M x'' + C x' + K x + B (f(d) - k0 d) = p,   d = B' x                                 (1)

K is the initial tangent of the whole structure; f are the forces of the nonlinear elements,
k0 their initial tangents, and r = f - k0 d is the part of the forces beyond linear. The load
p is held over the step, so constant average acceleration reads, with dx = x1 - x0,

    (4/h^2 M + 2/h C + K) dx = 2 p + 4/h M v0 - 2 K x0 - B (r0 + r1),  v1 = 2/h dx - v0  (2)

Let F = B' (4/h^2 M + 2/h C + K)^-1 B be the flexibility of the elements' deformations,
and d^ the deformations with r1 = 0. The nonlinear problem that remains has the size of
the elements:

    g(d1) = d1 - d^ + F r(d1) = 0                                                        (3)

It is solved by Newton's method on the elements that have left their initial tangent. The
factors and F are found once for h and for h/2, h/4, ...

If an element's tangent changes within a step, the mean force that the method sees over
the step differs from the force along the path. Where this difference of work is more than
`event_tolerance` of the energy in the structure, the step is taken again as two halves,
and so on: bisection brackets the event. A step that does not converge is halved as well.

The functions work on the variables of a `NonlinearStructure`, s, which declares them.
`advance_with` compiles the force laws of the given elements into a step.

Source: N. M. Newmark, A method of computation for structural dynamics, Journal of the
Engineering Mechanics Division 85 (1959) 67-94, DOI 10.1061/JMCEA3.0000098.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from math import nan
from typing import Any

from cosim import Array
from cosim.functions import solve as solve_dense

from ..elements.element import PLASTIC, YIELDING, Law
from .sparse_ldl import factor, solve, symmetric_product

Advance = Callable[[Any, float, float], None]

LAST_DAMPING = 1.0 / 32.0  # Newton: the smallest share of a correction that is tried


# --------------------------------------------------------------------- force laws


def no_law(s: Any, e: int, h: float) -> tuple[float, float]:
    """End the chain of laws, for the second row of a pair, which has no law of its own."""
    return 0.0, 0.0


#: globals of `row_law` and `pair_law` that `rebound` replaces
number: int = -1
law: Any = None
otherwise: Any = no_law


def row_law(s: Any, e: int, h: float) -> tuple[float, float]:
    """Evaluate row e by `law` if its law has this `number`; leave it to `otherwise` if not."""
    if int(s.law[e]) != number:
        passed_on: tuple[float, float] = otherwise(s, e, h)
        return passed_on
    d, d0 = s.d1[e], s.d[e]
    rate = 2.0 / h * (d - d0) - s.rate[e]
    s.f1[e], s.kt[e], stored, lost = law(e, d, d0, rate, h, s.law_parameters, s.z, s.z1)
    return stored, lost


def pair_law(s: Any, e: int, h: float) -> tuple[float, float]:
    """Evaluate rows e and e + 1 in the same way, by a law of two rows."""
    if int(s.law[e]) != number:
        passed_on: tuple[float, float] = otherwise(s, e, h)
        return passed_on
    both: tuple[float, float] = law(e, s.d1, s.d, s.law_parameters, s.z, s.z1, s.f1, s.kt, s.kc)
    return both


evaluate: Any = no_law


def elements(s: Any, h: float) -> None:
    """Write forces, tangents and energies of all elements at the deformations d1."""
    s.stored1 = 0.0
    s.lost1 = 0.0
    for e in range(s.k0.shape[0]):
        stored, lost = evaluate(s, e, h)
        s.lost_now[e] = lost
        s.stored1 += stored
        s.lost1 += lost


def advance_with(laws: tuple[tuple[Law, int], ...]) -> Advance:
    """Return an `advance` that evaluates elements by these laws; each comes with its number of rows.

    Row e follows the law whose position in `laws` is s.law[e]. The compiled step contains
    these laws and no others.
    """
    chain: Any = no_law
    for position, (function, rows) in reversed(list(enumerate(laws))):
        link = row_law if rows == 1 else pair_law
        chain = rebound(link, number=position, law=function, otherwise=chain)
    step = rebound(trial, elements=rebound(elements, evaluate=chain))
    made: Advance = rebound(advance, trial=step)
    return made


def rebound(function: Callable[..., Any], **names: Any) -> Any:
    """Return a copy of a function in which the given global names have other values."""
    return types.FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)


# ----------------------------------------------------------------------- the step


def prepare(s: Any, h: float) -> None:
    """Factor the matrix of (2), and find the flexibility F, for h, h/2, h/4, ..."""
    s.h_ready = h
    n = s.M.shape[0]
    rows = s.k0.shape[0]
    for level in range(s.D_inv.shape[0]):
        h_level = h / 2.0**level
        for p in range(s.A.shape[0]):
            s.A[p] = s.K[p] + 2.0 / h_level * s.C[p]
        for j in range(n):
            s.A[int(s.A_diagonal[j])] += 4.0 / (h_level * h_level) * s.M[j]
        bad = factor(
            s.A_start, s.A_row, s.A, s.L_start, s.parent, level,
            s.L_row, s.L, s.D_inv, s.load, s.dx, s.path, s.fill,
        )  # fmt: skip
        if bad > 0:  # not positive definite: NaN ends the run at the first step
            s.D_inv[level, bad - 1] = nan
        for e in range(rows):
            for j in range(n):
                s.dx[j] = 0.0
            add_row(s, e, 1.0, s.dx)
            solve(s.L_start, s.L_row, s.L, s.D_inv, level, s.dx)
            for i in range(rows):
                s.F[level, i, e] = row_times(s, i, s.dx)


def row_times(s: Any, e: int, x: Array) -> float:
    """Return row e times x; rows are those of elements, actuators, displacements, accelerations."""
    total = 0.0
    for p in range(int(s.row_start[e]), int(s.row_start[e + 1])):
        total += s.row_value[p] * x[int(s.row_dof[p])]
    return total


def add_row(s: Any, e: int, force: float, load: Array) -> None:
    """Add a force along row e to a load."""
    for p in range(int(s.row_start[e]), int(s.row_start[e + 1])):
        load[int(s.row_dof[p])] += s.row_value[p] * force


def residual(s: Any, level: int) -> float:
    """Write g of (3); return its largest entry, relative to the scale of the element."""
    rows = s.k0.shape[0]
    for e in range(rows):
        s.r1[e] = s.f1[e] - s.k0[e] * s.d1[e]
        s.g[e] = s.d1[e] - s.d_hat[e]
    for e in range(rows):
        if s.k0_coupling[e] != 0.0:
            s.r1[e] -= s.k0_coupling[e] * s.d1[e + 1]
            s.r1[e + 1] -= s.k0_coupling[e] * s.d1[e]
    for e in range(rows):
        if s.r1[e] != 0.0:
            for i in range(rows):
                s.g[i] += s.F[level, i, e] * s.r1[e]
    worst = 0.0
    for e in range(rows):
        size = abs(s.g[e]) / s.scale[e]
        if not size <= worst:  # also true of a NaN
            worst = size
            s.worst = e
    return worst


def newton_direction(s: Any, level: int) -> None:
    """Solve (I + F dK) correction = -g, where dK = kt - k0 is zero on most rows."""
    rows = s.k0.shape[0]
    n = 0
    for e in range(rows):
        s.dk[e] = s.kt[e] - s.k0[e]
        s.dk_coupling[e] = s.kc[e] - s.k0_coupling[e]
    for e in range(rows):
        coupled = s.dk_coupling[e] != 0.0 or (e > 0 and s.dk_coupling[e - 1] != 0.0)
        if s.dk[e] != 0.0 or coupled:
            s.active[n] = e
            n += 1
        s.correction[e] = -s.g[e]
    for a in range(n):
        i = int(s.active[a])
        for b in range(n):
            j = int(s.active[b])
            s.J[a, b] = entry_of_FdK(s, level, i, j)
        s.J[a, a] += 1.0
        s.rhs[a, 0] = -s.g[i]
    solve_dense(s.J[:n, :n], s.rhs[:n])
    for b in range(n):
        j = int(s.active[b])
        for i in range(rows):
            s.correction[i] -= entry_of_FdK(s, level, i, j) * s.rhs[b, 0]
    for a in range(n):
        s.correction[int(s.active[a])] = s.rhs[a, 0]


def entry_of_FdK(s: Any, level: int, i: int, j: int) -> float:
    """Return entry (i, j) of F dK; dK couples the two rows of a pair."""
    value: float = s.F[level, i, j] * s.dk[j]
    if s.dk_coupling[j] != 0.0:
        value += s.F[level, i, j + 1] * s.dk_coupling[j]
    if j > 0 and s.dk_coupling[j - 1] != 0.0:
        value += s.F[level, i, j - 1] * s.dk_coupling[j - 1]
    return value


def trial(s: Any, h: float, level: int) -> float:
    """Take a step from the present state; return the residual of (3) that Newton's method leaves."""
    n = s.M.shape[0]
    rows = s.k0.shape[0]
    for j in range(n):
        s.dx[j] = 2.0 * (s.p[j] - s.Kx[j]) + 4.0 / h * s.M[j] * s.v[j]
    for e in range(rows):
        if s.r[e] != 0.0:
            add_row(s, e, -s.r[e], s.dx)
    solve(s.L_start, s.L_row, s.L, s.D_inv, level, s.dx)
    for e in range(rows):
        s.d_hat[e] = s.d[e] + row_times(s, e, s.dx)
        s.d1[e] = s.d_hat[e]
    elements(s, h)
    left = residual(s, level)
    s.iterations = 0.0
    while not left <= s.tolerance and s.iterations < s.most_iterations:
        s.iterations += 1.0
        newton_direction(s, level)
        before = left
        share = 1.0
        for _ in range(6):  # a shorter correction where the full one increases the residual
            for e in range(rows):
                s.d1[e] += share * s.correction[e]
            elements(s, h)
            left = residual(s, level)
            if left < before or share <= LAST_DAMPING:
                break
            for e in range(rows):
                s.d1[e] -= share * s.correction[e]
            share *= 0.5
    return left


def event_error(s: Any) -> float:
    """Return the work of the mean forces over the step less the work along the paths of the elements."""
    work = 0.0
    for e in range(s.k0.shape[0]):
        work += 0.5 * (s.f[e] + s.f1[e]) * (s.d1[e] - s.d[e])
    error: float = abs(work - (s.stored1 - s.stored) - s.lost1)
    return error


def accept(s: Any, h: float, level: int) -> None:
    """Make the trial the present state, and update its displacements and energies."""
    n = s.M.shape[0]
    rows = s.k0.shape[0]
    for j in range(n):
        s.load[j] = 0.0
    bent = False
    for e in range(rows):
        if s.r1[e] != 0.0:
            add_row(s, e, -s.r1[e], s.load)
            bent = True
    if bent:
        solve(s.L_start, s.L_row, s.L, s.D_inv, level, s.load)
    kinetic = 0.0
    for j in range(n):
        dx = s.dx[j] + s.load[j]
        v1 = 2.0 / h * dx - s.v[j]
        s.E_ground += s.p_ground[j] * dx
        s.E_control += s.p_control[j] * dx
        s.mean_v[j] = dx / h
        s.x[j] += dx
        s.v[j] = v1
        kinetic += 0.5 * s.M[j] * v1 * v1
        s.Kx[j] = 0.0
        s.load[j] = 0.0
    symmetric_product(s.A_start, s.A_row, s.K, s.x, s.Kx)
    symmetric_product(s.A_start, s.A_row, s.C, s.mean_v, s.load)
    strain = 0.0
    for j in range(n):
        s.E_damping += h * s.mean_v[j] * s.load[j]
        strain += 0.5 * s.x[j] * s.Kx[j]
    for e in range(rows):
        s.rate[e] = 2.0 / h * (s.d1[e] - s.d[e]) - s.rate[e]
        s.d[e] = s.d1[e]
        s.f[e] = s.f1[e]
        s.r[e] = s.r1[e]
        s.E_lost[e] += s.lost_now[e]
        for m in range(s.z.shape[1]):
            s.z[e, m] = s.z1[e, m]
        strain -= 0.5 * s.k0[e] * s.d[e] * s.d[e]
    for e in range(rows):
        if s.k0_coupling[e] != 0.0:
            strain -= s.k0_coupling[e] * s.d[e] * s.d[e + 1]
    s.stored = s.stored1
    s.E_hysteretic += s.lost1
    s.E_kinetic = kinetic
    s.E_strain = strain + s.stored


def loads(s: Any) -> None:
    """Write the loads of the inputs, which are held over the step."""
    n = s.M.shape[0]
    for j in range(n):
        pull = 0.0
        for i in range(s.ground.shape[0]):
            pull += s.influence[i, j] * s.ground[i]
        s.p_ground[j] = -s.M[j] * pull
        s.p_control[j] = 0.0
    first = s.k0.shape[0]
    for i in range(s.u.shape[0]):
        add_row(s, first + i, s.u[i], s.p_control)
    for j in range(n):
        s.p[j] = s.p_ground[j] + s.p_control[j]


def advance(s: Any, t: float, h: float) -> None:
    """Advance the structure from t to t + h, in as many bisections as the elements need."""
    if h != s.h_ready:
        prepare(s, h)
    loads(s)
    deepest = s.D_inv.shape[0] - 1
    level = 0
    done = 0  # in units of h / 2**deepest
    while done < 2**deepest:
        h_level = h / 2.0**level
        left = trial(s, h_level, level)
        converged = left <= s.tolerance
        energy = s.E_kinetic + s.E_strain + s.E_hysteretic
        fine = converged and event_error(s) <= s.event_tolerance * energy
        if not fine and level < deepest:
            level += 1
            continue
        if not converged and s.failed_element < 0.0:
            s.failed_element = s.worst
            s.failed_time = t + h * done / 2.0**deepest
            s.failed_residual = left
        accept(s, h_level, level)
        s.substeps += 1.0
        done += 2 ** (deepest - level)
        while level > 0 and done % 2 ** (deepest - level + 1) == 0:
            level -= 1


def measure(s: Any) -> None:
    """Write the outputs.

    The absolute acceleration follows from M (x'' + I a_g) = p_control - C x' - K x - B r
    with the control force that was held over the step that ends now.
    """
    n = s.M.shape[0]
    rows = s.k0.shape[0]
    row = rows + s.u.shape[0]
    for i in range(s.y.shape[0]):
        s.y[i] = row_times(s, row + i, s.x)
        s.y_rate[i] = row_times(s, row + i, s.v)
    row += s.y.shape[0]
    for j in range(n):
        s.load[j] = 0.0
    symmetric_product(s.A_start, s.A_row, s.C, s.v, s.load)
    for j in range(n):
        s.load[j] = s.p_control[j] - s.load[j] - s.Kx[j]
    for e in range(rows):
        if s.r[e] != 0.0:
            add_row(s, e, -s.r[e], s.load)
    for j in range(n):
        s.load[j] /= s.M[j]
    for i in range(s.a.shape[0]):
        s.a[i] = row_times(s, row + i, s.load)
    for e in range(rows):
        s.deformation[e] = s.d[e]
        s.force[e] = s.f[e]
        s.plastic[e] = s.z[e, PLASTIC]
        s.yielding[e] = s.z[e, YIELDING]
        s.dissipated[e] = s.E_lost[e]
    for i in range(s.u.shape[0]):
        s.stroke[i] = row_times(s, rows + i, s.x)
        s.stroke_rate[i] = row_times(s, rows + i, s.v)
    s.energy[0] = s.E_ground
    s.energy[1] = s.E_control
    s.energy[2] = s.E_kinetic
    s.energy[3] = s.E_strain
    s.energy[4] = s.E_damping
    s.energy[5] = s.E_hysteretic
    if s.failure[0] >= 0.0:  # the last point reported it; NaN ends the run now
        for i in range(s.y.shape[0]):
            s.y[i] = nan
    s.failure[0] = s.failed_element
    s.failure[1] = s.failed_time
    s.failure[2] = s.failed_residual
