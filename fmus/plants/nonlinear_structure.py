"""A structure with linear M, C, K and any number of hysteretic elements.

    M (x'' + I a_g) + C x' + K x + B (f(d) - k0 d) = B_u u,   d = B^T x

x is relative to the ground, a_g the ground acceleration by direction, u the actuators'
forces, both held over a step. K contains the elements' initial tangents k0. Elements:
hysteresis.py; integration by Newmark 1/4, 1/2 with substeps: newmark.py; equations are
solved sparse: sparse_ldl.py.

What moves is history, not states with derivatives: `advance` alone carries it on, so the
structure is for sampled coupling and for Co-Simulation FMUs.

A structure is built from matrices and lists of elements,

    NonlinearStructure.build(M, C, K, influence, elements=[...], ...)

and a force law of one's own is a function like those in hysteresis.py, given to `build`
as `law`; elements made with `own` follow it.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from cosim import Array, Continuous, Input, Local, Output, Parameter

from ..elements import hysteresis as laws
from ..kernels.newmark import advance, measure, with_law
from ..kernels.sparse_ldl import plan

#: a force law: (e, d, d0, rate, h, p, z0, z) -> force, tangent, stored, lost
Law = Callable[..., tuple[float, float, float, float]]


@dataclass(frozen=True)
class Element:
    """One element: its force law, and what of the displacements deforms it."""

    kind: int
    rows: Array  # (1 or 2, n): deformation of unit displacements
    parameters: tuple[float, ...]
    k0: float  # initial tangent, contained in K
    scale: float  # a deformation of the size that matters: what convergence is measured against
    k0_coupling: float = 0.0  # of the two ends of a segment


@dataclass(frozen=True)
class LinearModel:
    """M x'' + C x' + K x = actuators' u - M influence a_g, in an order of its own."""

    M: Array  # (n)
    C: Array  # (n, n)
    K: Array  # (n, n)
    influence: Array  # (n, n_g)
    actuators: Array  # (n_u, n)
    displacements: Array  # (n_y, n)
    accelerations: Array  # (n_a, n)


def bilinear(row: Array, k1: float, k2: float, dy: float) -> Element:
    """Bilinear with kinematic hardening: stiffness k1, k2 beyond the deformation dy."""
    return Element(laws.BILINEAR, np.atleast_2d(row), (k1, k2, dy), k1, dy)


def bouc_wen(
    row: Array, k1: float, alpha: float, dy: float, n: float = 2.0, beta: float = 0.5, gamma: float = 0.5
) -> Element:
    """Bouc-Wen: stiffness k1, alpha k1 when far beyond dy."""
    return Element(laws.BOUC_WEN, np.atleast_2d(row), (k1, alpha, dy, n, beta, gamma), k1, dy)


def gap(row: Array, k: float, opening: float) -> Element:
    """Stiffness k once the deformation is beyond `opening` (in the direction of its sign)."""
    return Element(laws.GAP, np.atleast_2d(row), (k, opening), 0.0, abs(opening))


def viscous_damper(row: Array, c: float, exponent: float = 1.0, rate0: float = 1e-3) -> Element:
    """Force c |rate|^exponent; below rate0 linear, so that it has a slope there."""
    return Element(laws.VISCOUS, np.atleast_2d(row), (c, exponent, rate0), 0.0, 1e-3)


def friction_damper(row: Array, k: float, slip_force: float) -> Element:
    """Sticks with stiffness k, slips at slip_force."""
    return Element(laws.FRICTION, np.atleast_2d(row), (k, slip_force), k, slip_force / k)


def segment(
    rows: Array, k11: float, k12: float, EI: float, EI1: float, M_y: float, late: bool = False
) -> Element:
    """A column segment in one plane; rows are the rotations of its two ends from the chord."""
    parameters = (k11, k12, EI1 / EI, M_y, float(late), EI)
    return Element(laws.SEGMENT, rows, parameters, k11, M_y / (k11 - k12), k12)


def own(row: Array, parameters: Sequence[float], k0: float, scale: float) -> Element:
    """An element with the law that `build` is given."""
    return Element(laws.OWN, np.atleast_2d(row), tuple(parameters), k0, scale)


def _advance(law: Law) -> Callable[..., None]:
    """The kernel `advance` of a structure whose own elements follow `law`."""
    template = NonlinearStructure.advance
    return types.FunctionType(
        template.__code__, {**template.__globals__, "advance": with_law(law)}, "advance"
    )


class NonlinearStructure(Continuous):
    """Linear structure, hysteretic elements, ground acceleration and actuators."""

    # sizes: n degrees of freedom, n_e element rows, n_u actuators, n_y and n_a outputs
    M = Parameter(shape="n", unit="kg", min=0.0, fixed=True)
    K = Parameter(shape="n_A", fixed=True)  # entries of the upper triangle: sparse_ldl.py
    C = Parameter(shape="n_A", fixed=True)
    A_start = Parameter(shape="n_1", fixed=True)
    A_row = Parameter(shape="n_A", fixed=True)
    A_diagonal = Parameter(shape="n", fixed=True)
    L_start = Parameter(shape="n_1", fixed=True)
    parent = Parameter(shape="n", fixed=True)
    influence = Parameter(0.0, "of the ground's directions", shape=("n_g", "n"), fixed=True)
    row_start = Parameter(0.0, "rows: elements, actuators, y, a", shape="n_rows_1", fixed=True)
    row_dof = Parameter(shape="n_entries", fixed=True)
    row_value = Parameter(shape="n_entries", fixed=True)
    kind = Parameter(0.0, "force law of an element row", shape="n_e", fixed=True)
    law = Parameter(0.0, "parameters of the force laws", shape=("n_e", 6), fixed=True)
    k0 = Parameter(0.0, "initial tangent", shape="n_e", fixed=True)
    k0_coupling = Parameter(0.0, "initial tangent with the next row", shape="n_e", fixed=True)
    scale = Parameter(1.0, "deformation that matters", shape="n_e", fixed=True)
    tolerance = Parameter(1e-9, "Newton: largest residual over scale", unit="1", min=0.0)
    most_iterations = Parameter(30.0, "Newton: iterations before the step is halved", unit="1", min=1.0)
    event_tolerance = Parameter(
        1e-7, "halve a step for more than this share of the energy", unit="1", min=0.0
    )

    ground = Input("ground acceleration by direction", unit="m/s2", shape="n_g")
    u = Input("actuator forces", unit="N", shape="n_u")
    y = Output("displacements asked for", unit="m", shape="n_y")
    y_rate = Output("their velocities", unit="m/s", shape="n_y")
    a = Output("absolute accelerations asked for", unit="m/s2", shape="n_a")
    stroke = Output("displacement of the actuators", unit="m", shape="n_u")
    stroke_rate = Output("velocity of the actuators", unit="m/s", shape="n_u")
    deformation = Output("of the elements (m, or rad at a segment's end)", shape="n_e")
    force = Output("of the elements (N, or N m)", shape="n_e")
    plastic = Output("plastic deformation (m, or 1/m: a segment's curvature)", shape="n_e")
    yielding = Output("whether and which way an element yields", unit="1", shape="n_e")
    dissipated = Output("energy lost in the elements", unit="J", shape="n_e")
    energy = Output("ground, control, kinetic, strain, damping, hysteretic", unit="J", shape=6)
    failure = Output(
        "element (-1: none), time, residual of a step that did not converge", shape=3, start=(-1.0, 0.0, 0.0)
    )

    # the state: displacements, velocities, and the elements' memory
    x = Local(unit="m", shape="n")
    v = Local(unit="m/s", shape="n")
    Kx = Local(0.0, "K x", shape="n")
    d = Local(0.0, "deformation, its rate, force, and force beyond linear", shape="n_e")
    rate = Local(shape="n_e")
    f = Local(shape="n_e")
    r = Local(shape="n_e")
    z = Local(0.0, "memory of the force laws", shape=("n_e", 4))
    E_lost = Local(shape="n_e", unit="J")
    stored = Local(unit="J")
    E_ground = Local(unit="J")
    E_control = Local(unit="J")
    E_kinetic = Local(unit="J")
    E_strain = Local(unit="J")
    E_damping = Local(unit="J")
    E_hysteretic = Local(unit="J")
    substeps = Local(0.0, "steps taken, bisections counted")
    failed_element = Local(-1.0)
    failed_time = Local(unit="s")
    failed_residual = Local()
    failed_pivot = Local(0.0, "1 + index of a pivot that is not positive")

    # factors and flexibility for h, h/2, h/4, ...; working memory of a step
    h_ready = Local(unit="s")
    A = Local(shape="n_A")
    L_row = Local(shape="n_L")
    L = Local(shape=("n_levels", "n_L"))
    D_inv = Local(shape=("n_levels", "n"))
    F = Local(shape=("n_levels", "n_e", "n_e"))
    path = Local(shape="n")
    fill = Local(shape="n")
    load = Local(shape="n")
    dx = Local(shape="n")
    p = Local(shape="n")
    p_ground = Local(shape="n")
    p_control = Local(shape="n")
    mean_v = Local(shape="n")
    d1 = Local(shape="n_e")
    d_hat = Local(shape="n_e")
    f1 = Local(shape="n_e")
    r1 = Local(shape="n_e")
    z1 = Local(shape=("n_e", 4))
    kt = Local(shape="n_e")
    kc = Local(shape="n_e")
    dk = Local(shape="n_e")
    dk_coupling = Local(shape="n_e")
    g = Local(shape="n_e")
    active = Local(shape="n_e")
    correction = Local(shape="n_e")
    rhs = Local(shape="n_e")
    J = Local(shape=("n_e", "n_e"))
    lost_now = Local(shape="n_e")
    stored1 = Local()
    lost1 = Local()
    worst = Local()
    iterations = Local()

    def outputs(self, t: float) -> None:
        measure(self)

    def advance(self, t: float, h: float) -> None:
        advance(self, t, h)

    @classmethod
    def build(
        cls,
        M: Array,
        C: Array,
        K: Array,
        influence: Array,
        elements: Sequence[Element] = (),
        *,
        actuators: Array | None = None,
        displacements: Array | None = None,
        accelerations: Array | None = None,
        bisections: int = 5,
        law: Law | None = None,
        **values: Any,
    ) -> Self:
        """From matrices and elements.

        M            (n) lumped masses
        C, K         (n, n); K with the elements' initial tangents in it
        influence    (n, directions) displacements when the ground moves by 1
        actuators    (n_u, n) stroke of unit displacements: the force acts likewise
        displacements, accelerations    rows of the outputs y and a
        bisections   a step is halved at most so many times
        law          of the elements made with `own`
        """
        if law is not None:
            cls = type(cls.__name__, (cls,), {"__doc__": cls.__doc__, "advance": _advance(law)})
        n = len(M)
        nothing = np.zeros((1, n))
        elements = elements or [Element(laws.LINEAR, nothing, (0.0,), 0.0, 1.0)]
        element_rows = np.vstack([e.rows for e in elements])
        blocks = [
            element_rows,
            *(nothing if r is None else np.atleast_2d(r) for r in (actuators, displacements, accelerations)),
        ]
        sparse = plan((np.asarray(K) != 0) | (np.asarray(C) != 0))
        order = sparse.order
        rows = np.vstack(blocks)[:, order]
        entries = [np.nonzero(row)[0] for row in rows]
        n_e = len(element_rows)
        first = np.cumsum([0] + [len(e.rows) for e in elements])[:-1]
        table = np.zeros((n_e, 6))
        kind, k0, coupling, scale = np.zeros(n_e), np.zeros(n_e), np.zeros(n_e), np.ones(n_e)
        for i, e in zip(first, elements, strict=True):
            size = len(e.rows)
            table[i : i + size, : len(e.parameters)] = e.parameters
            kind[i : i + size] = [e.kind, laws.SEGMENT_END][:size]
            k0[i : i + size] = e.k0
            coupling[i] = e.k0_coupling
            scale[i : i + size] = e.scale
        dofs = np.concatenate(entries).astype(float)
        weights = np.concatenate([row[j] for row, j in zip(rows, entries, strict=True)])
        return cls(
            n_u=len(blocks[1]), n_y=len(blocks[2]), n_a=len(blocks[3]),
            n_levels=bisections + 1, n_L=max(int(sparse.L_start[-1]), 1),
            M=np.asarray(M, float)[order], K=sparse.values(K), C=sparse.values(C),
            A_start=sparse.A_start, A_row=sparse.A_row, A_diagonal=sparse.A_start[1:] - 1.0,
            L_start=sparse.L_start, parent=sparse.parent,
            influence=np.asarray(influence, float)[order].T,
            row_start=np.concatenate(([0], np.cumsum([len(j) for j in entries]))).astype(float),
            row_dof=dofs if len(dofs) else [0.0], row_value=weights if len(weights) else [0.0],
            kind=kind, law=table, k0=k0, k0_coupling=coupling, scale=scale, **values,
        )  # fmt: skip

    def linear_model(self) -> LinearModel:
        """The structure at its initial tangent, for the design of controllers."""
        n = len(self.M)
        start, entry = self.A_start.astype(int), self.A_row.astype(int)
        column = np.repeat(np.arange(n), np.diff(start))
        C, K = np.zeros((n, n)), np.zeros((n, n))
        for A, values in ((C, self.C), (K, self.K)):
            A[entry, column] = values
            A[column, entry] = values
        first = self.row_start.astype(int)
        rows = np.zeros((len(first) - 1, n))
        row = np.repeat(np.arange(len(first) - 1), np.diff(first))
        rows[row, self.row_dof[: first[-1]].astype(int)] = self.row_value[: first[-1]]
        parts = np.cumsum([len(self.k0), len(self.u), len(self.y)])
        _, actuators, displacements, accelerations = np.split(rows, parts)
        return LinearModel(
            self.M.copy(), C, K, self.influence.T.copy(), actuators, displacements, accelerations
        )
