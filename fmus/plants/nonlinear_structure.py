"""A structure with linear M, C, K and any number of nonlinear elements.

    M (x'' + I a_g) + C x' + K x + B (f(d) - k0 d) = B_u u,   d = B' x                (1)

x is relative to the ground, a_g the ground acceleration by direction, u the forces of the
actuators, both held over a step. K contains the initial tangents k0 of the elements.
Elements have one file each in fmus/elements; the step is Newmark's, with substeps
(kernels/newmark.py), and equations are solved sparse (kernels/sparse_ldl.py).

    bearing = bilinear(row, k1, k2, dy)
    plant = NonlinearStructure.build(Structure(M, C, K, influence=I, ...), [bearing, ...])

The elements have memory, so the plant has an `advance` and no derivatives: it runs in sampled
coupling, and as a Co-Simulation FMU.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Self

import numpy as np
import scipy.linalg as la

from cosim import Continuous, Input, Local, Output, Parameter

from ..elements.at_rest import check_at_rest
from ..elements.element import OWN, Element, Law
from ..kernels.newmark import advance, advance_with, measure, rebound
from ..kernels.sparse_ldl import plan
from ..structures.structure import Structure, StructureError

NO_LAW = -1.0  # law of the second row of a pair


class NonlinearStructure(Continuous):
    """Linear structure with nonlinear elements, ground acceleration and actuators."""

    # Sizes: n degrees of freedom, n_1 = n + 1; n_e rows of elements, n_p parameters and n_z places of
    # memory a row; n_u actuators, n_y and n_a rows of outputs, n_g directions of the ground; n_A and n_L
    # entries of the upper triangle of K and of the factor L; n_levels step sizes h, h/2, h/4, ...
    M = Parameter(shape="n", meaning="lumped masses", unit="kg", min=0.0, fixed=True)
    K = Parameter(shape="n_A", meaning="stiffness, stored as in sparse_ldl.py", fixed=True)
    C = Parameter(shape="n_A", meaning="damping, stored as K", fixed=True)
    A_start = Parameter(shape="n_1", meaning="first entry of each column of K and C", fixed=True)
    A_row = Parameter(shape="n_A", meaning="row of each entry", fixed=True)
    A_diagonal = Parameter(shape="n", meaning="place of the diagonal entries", fixed=True)
    L_start = Parameter(shape="n_1", meaning="first entry of each column of L", fixed=True)
    parent = Parameter(shape="n", meaning="elimination tree", fixed=True)
    influence = Parameter(0.0, "displacements when the ground moves by 1", shape=("n_g", "n"), fixed=True)
    row_start = Parameter(0.0, "first entry of each row: elements, u, y, a", shape="n_rows_1", fixed=True)
    row_dof = Parameter(shape="n_entries", meaning="degree of freedom of each entry", fixed=True)
    row_value = Parameter(shape="n_entries", meaning="weight of each entry", fixed=True)
    law = Parameter(0.0, "number of the force law of an element row", shape="n_e", fixed=True)
    law_parameters = Parameter(0.0, "parameters of the force laws", shape=("n_e", "n_p"), fixed=True)
    k0 = Parameter(0.0, "initial tangent", shape="n_e", fixed=True)
    k0_coupling = Parameter(0.0, "initial tangent with the next row", shape="n_e", fixed=True)
    scale = Parameter(1.0, "typical deformation", shape="n_e", fixed=True)
    tolerance = Parameter(1e-9, "Newton: largest residual over scale", unit="1", min=0.0)
    most_iterations = Parameter(30.0, "Newton: iterations before the step is halved", unit="1", min=1.0)
    event_tolerance = Parameter(
        1e-7, "share of the energy beyond which an event halves the step", unit="1", min=0.0
    )

    ground = Input("ground acceleration by direction", unit="m/s^2", shape="n_g")
    u = Input("actuator forces", unit="N", shape="n_u")
    y = Output("displacements of the given rows", unit="m", shape="n_y")
    y_rate = Output("velocities of the same rows", unit="m/s", shape="n_y")
    a = Output("absolute accelerations of the given rows", unit="m/s^2", shape="n_a")
    stroke = Output("displacements of the actuators", unit="m", shape="n_u")
    stroke_rate = Output("velocities of the actuators", unit="m/s", shape="n_u")
    deformation = Output("deformations of the elements (m, or rad at a segment's end)", shape="n_e")
    force = Output("forces of the elements (N, or N*m)", shape="n_e")
    plastic = Output("plastic deformations (m, or 1/m: curvature of a segment)", shape="n_e")
    yielding = Output("1 or -1 while an element yields in that direction", unit="1", shape="n_e")
    dissipated = Output("energy lost in the elements", unit="J", shape="n_e")
    energy = Output("ground, control, kinetic, strain, damping, hysteretic", unit="J", shape=6)
    failure = Output(
        "element (-1: none), time, residual of a step that did not converge", shape=3, start=(-1.0, 0.0, 0.0)
    )

    # the state at the end of the last step
    x = Local(shape="n", meaning="displacements relative to the ground", unit="m")
    v = Local(shape="n", meaning="velocities", unit="m/s")
    Kx = Local(0.0, "K x", shape="n", unit="N")
    d = Local(0.0, "deformations", shape="n_e")
    rate = Local(0.0, "rates of the deformations", shape="n_e")
    f = Local(0.0, "forces of the elements", shape="n_e")
    r = Local(0.0, "forces beyond linear, f - k0 d", shape="n_e")
    z = Local(0.0, "memory of the force laws", shape=("n_e", "n_z"))
    E_lost = Local(0.0, "energy lost by each element", shape="n_e", unit="J")
    stored = Local(0.0, "recoverable energy of the elements", unit="J")
    E_ground = Local(0.0, "work of the ground", unit="J")
    E_control = Local(0.0, "work of the actuators", unit="J")
    E_kinetic = Local(0.0, "kinetic energy", unit="J")
    E_strain = Local(0.0, "strain energy", unit="J")
    E_damping = Local(0.0, "energy lost in C", unit="J")
    E_hysteretic = Local(0.0, "energy lost in the elements", unit="J")
    substeps = Local(0.0, "steps taken, bisections counted")
    failed_element = Local(-1.0, "element of the first failure")
    failed_time = Local(0.0, "its time", unit="s")
    failed_residual = Local(0.0, "its residual")

    # factors and flexibility for h, h/2, h/4, ...
    CACHE_KEYS = ("h_ready",)

    h_ready = Local(0.0, "step h of the factors", unit="s")
    A = Local(0.0, "4/h^2 M + 2/h C + K", shape="n_A")
    L_row = Local(0.0, "row of each entry of L", shape="n_L")
    L = Local(0.0, "factor by level", shape=("n_levels", "n_L"))
    D_inv = Local(0.0, "inverse of the diagonal D by level", shape=("n_levels", "n"))
    F = Local(0.0, "flexibility of the deformations by level", shape=("n_levels", "n_e", "n_e"))

    # working memory of a step; 1 is its end, 0 its start
    path = Local(0.0, "of `factor`", shape="n")
    fill = Local(0.0, "of `factor`", shape="n")
    load = Local(0.0, "right-hand side", shape="n")
    dx = Local(0.0, "x1 - x0 without the elements' part beyond linear", shape="n")
    p = Local(0.0, "load held over the step", shape="n", unit="N")
    p_ground = Local(0.0, "its part from the ground", shape="n", unit="N")
    p_control = Local(0.0, "its part from the actuators", shape="n", unit="N")
    mean_v = Local(0.0, "mean velocity over the step", shape="n", unit="m/s")
    d1 = Local(0.0, "deformations at the end", shape="n_e")
    d_hat = Local(0.0, "deformations with r1 = 0", shape="n_e")
    f1 = Local(0.0, "forces at the end", shape="n_e")
    r1 = Local(0.0, "forces beyond linear at the end", shape="n_e")
    z1 = Local(0.0, "memory at the end", shape=("n_e", "n_z"))
    kt = Local(0.0, "tangent", shape="n_e")
    kc = Local(0.0, "tangent with the next row", shape="n_e")
    dk = Local(0.0, "kt - k0", shape="n_e")
    dk_coupling = Local(0.0, "kc - k0_coupling", shape="n_e")
    g = Local(0.0, "residual of Newton's method", shape="n_e")
    active = Local(0.0, "rows off their initial tangent", shape="n_e")
    correction = Local(0.0, "Newton's correction of d1", shape="n_e")
    J = Local(0.0, "Jacobian on the active rows", shape=("n_e", "n_e"))
    rhs = Local(0.0, "its right-hand side and solution", shape=("n_e", 1))
    lost_now = Local(0.0, "energy lost by each element in the step", shape="n_e", unit="J")
    stored1 = Local(0.0, "recoverable energy at the end", unit="J")
    lost1 = Local(0.0, "energy lost in the step", unit="J")
    worst = Local(0.0, "element with the largest residual")
    iterations = Local(0.0, "iterations of the last step")

    def outputs(self, t: float) -> None:
        measure(self)

    def advance(self, t: float, h: float) -> None:
        advance(self, t, h)

    @classmethod
    def build(
        cls, structure: Structure, elements: Sequence[Element] = (), *, bisections: int = 5, **values: Any
    ) -> Self:
        """Make the plant of a structure with elements.

        structure   lumped masses; its K contains the initial tangents k0 of the elements
        bisections  largest number of times that a step is halved
        values      start values of the plant's other parameters
        """
        M, C, K = np.diag(structure.M).copy(), structure.C, structure.K
        _check(structure, elements)
        n = structure.dof
        nothing = np.zeros((1, n))
        element_rows = np.vstack([e.rows for e in elements]) if elements else nothing
        blocks = [element_rows]
        for rows in (structure.actuators, structure.displacements, structure.accelerations):
            blocks.append(rows if len(rows) else nothing)
        influence = structure.influence if structure.influence.size else np.zeros((n, 1))
        sparse = plan((K != 0) | (C != 0))
        order = sparse.order
        ordered = np.vstack(blocks)[:, order]
        entries = [np.nonzero(row)[0] for row in ordered]
        dofs = np.concatenate(entries).astype(float)
        weights = np.concatenate([row[j] for row, j in zip(ordered, entries, strict=True)])
        kinds = tuple(dict.fromkeys((e.law, len(e.rows)) for e in elements))
        made: Self = _with_laws(cls, kinds)(  # type: ignore[arg-type]  # a class is hashable
            n_u=len(blocks[1]), n_y=len(blocks[2]), n_a=len(blocks[3]),
            n_levels=bisections + 1, n_L=max(int(sparse.L_start[-1]), 1),
            M=M[order], K=sparse.values(K), C=sparse.values(C),
            A_start=sparse.A_start, A_row=sparse.A_row, A_diagonal=sparse.A_start[1:] - 1.0,
            L_start=sparse.L_start, parent=sparse.parent, influence=influence[order].T,
            row_start=np.concatenate(([0], np.cumsum([len(j) for j in entries]))).astype(float),
            row_dof=dofs if len(dofs) else [0.0], row_value=weights if len(weights) else [0.0],
            **_table(elements, len(element_rows), kinds), **values,
        )  # fmt: skip
        return made

    def linear_model(self) -> Structure:
        """Return the structure at its initial tangent, for the design of controllers.

        Its degrees of freedom are in the plant's own order.
        """
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
        return Structure(
            np.diag(self.M), C, K, self.influence.T.copy(), actuators, displacements, accelerations
        )


@lru_cache
def _with_laws(cls: type[NonlinearStructure], kinds: tuple[tuple[Law, int], ...]) -> Any:
    """Return the class whose `advance` evaluates elements by these laws, each with its number of rows."""
    kernel = rebound(cls.advance, advance=advance_with(kinds))
    return type(cls.__name__, (cls,), {"__doc__": cls.__doc__, "advance": kernel})


def _table(elements: Sequence[Element], n_e: int, kinds: tuple[tuple[Law, int], ...]) -> dict[str, Any]:
    """Return the parameters of the plant that have one entry for each row of an element."""
    parameters = np.zeros((n_e, max([1, *(len(e.parameters) for e in elements)])))
    law, k0, coupling, scale = np.full(n_e, NO_LAW), np.zeros(n_e), np.zeros(n_e), np.ones(n_e)
    first = 0
    for e in elements:
        rows = slice(first, first + len(e.rows))
        parameters[rows, : len(e.parameters)] = e.parameters
        law[first] = kinds.index((e.law, len(e.rows)))
        k0[rows], scale[rows] = e.k0, e.scale
        coupling[first] = e.k0_coupling
        first = rows.stop
    n_z = OWN + max([0, *(e.memory for e in elements)])
    return {
        "law": law, "law_parameters": parameters, "n_z": n_z,
        "k0": k0, "k0_coupling": coupling, "scale": scale,
    }  # fmt: skip


def _check(structure: Structure, elements: Sequence[Element]) -> None:
    """Refuse a structure that Newmark's method cannot integrate with these elements."""
    where, n = "NonlinearStructure", structure.dof
    masses = np.diag(structure.M)
    if np.abs(structure.M - np.diag(masses)).max() > 1e-9 * np.abs(masses).max():
        raise StructureError(f"{where}: M is not diagonal; lump the masses")
    rest = structure.K.copy()
    for i, e in enumerate(elements):
        if e.rows.shape[1] != n:
            raise StructureError(
                f"{where}: element {i} has rows of {e.rows.shape[1]} entries, the structure has {n} "
                "degrees of freedom; give each row one entry for each"
            )
        check_at_rest(e, f"element {i}")
        tangent = np.array([[e.k0, e.k0_coupling], [e.k0_coupling, e.k0]])[: len(e.rows), : len(e.rows)]
        rest -= e.rows.T @ tangent @ e.rows
    lowest = la.eigvalsh(rest, subset_by_index=[0, 0])[0]
    if lowest < -1e-8 * np.abs(structure.K).max():
        raise StructureError(
            f"{where}: K without the elements' initial tangents has the negative eigenvalue {lowest:.3g}, "
            "so K does not contain them; add e.rows.T @ e.rows * e.k0 to K for each element e"
        )
