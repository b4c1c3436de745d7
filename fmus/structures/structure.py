"""A structural model: mass, damping and stiffness, with named degrees of freedom.

    M x'' + C x' + K x = actuators' u - M influence a_g                     (1)
    y = displacements x,   a = accelerations (x'' + influence a_g)          (2)

x is relative to the ground, a_g is the ground acceleration by direction, u are the forces
of the actuators. Frames and OpenSees models return a `Structure`; plants are built from
one, and designs of controllers read its matrices. kg, N*s/m, N/m.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import scipy.linalg as la

from cosim import Array, CosimError

Node = TypeVar("Node")
Direction = TypeVar("Direction")


class StructureError(CosimError):
    """Matrices that do not describe a structure, or that a plant cannot represent."""


class Freedoms(dict[tuple[Node, Direction], int]):
    """Numbers of the degrees of freedom by node and direction; fixed ones are left out."""

    def row(self, weights: Mapping[tuple[Node, Direction], float]) -> Array:
        """Return weights (n,) over all degrees of freedom; weights of fixed ones are ignored."""
        row = np.zeros(len(self))
        for freedom, weight in weights.items():
            if freedom in self:
                row[self[freedom]] += weight
        return row

    def rigid_motion(self, directions: Sequence[Direction]) -> Array:
        """Return the displacements (n, directions) when the ground moves by 1 in each direction."""
        motion = np.zeros((len(self), len(directions)))
        for (_, direction), i in self.items():
            if direction in directions:
                motion[i, directions.index(direction)] = 1.0
        return motion


@dataclass(frozen=True)
class Structure:
    """M, C, K (n, n) of (1); rows (columns of influence) are empty by default."""

    M: Array
    C: Array
    K: Array
    influence: Array = field(default_factory=lambda: np.zeros(0))  # (n, n_g)
    actuators: Array = field(default_factory=lambda: np.zeros(0))  # (n_u, n) strokes for unit displacements
    displacements: Array = field(default_factory=lambda: np.zeros(0))  # (n_y, n)
    accelerations: Array = field(default_factory=lambda: np.zeros(0))  # (n_a, n)
    freedoms: Freedoms = field(default_factory=Freedoms)  # type: ignore[type-arg]

    def __post_init__(self) -> None:
        n = len(self.M)
        for name in ("M", "C", "K"):
            matrix = np.asarray(getattr(self, name), float)
            if matrix.shape != (n, n):
                raise StructureError(
                    f"structure: {name} has shape {matrix.shape}, M has {np.shape(self.M)}; "
                    "M, C and K must be square and of one size (np.diag makes a matrix of lumped masses)"
                )
            if not np.isfinite(matrix).all():
                raise StructureError(f"structure: {name} contains NaN or infinite entries")
            object.__setattr__(self, name, matrix)
        for name in ("influence", "actuators", "displacements", "accelerations"):
            given = np.asarray(getattr(self, name), float)
            columns = name == "influence"
            if given.ndim < 2:
                given = given.reshape((n, -1) if columns else (-1, n)) if given.size % n == 0 else given
            if given.ndim != 2 or given.shape[0 if columns else 1] != n:
                wanted = f"({n}, directions)" if columns else f"(rows, {n})"
                raise StructureError(f"structure: {name} has shape {given.shape}; it must be {wanted}")
            object.__setattr__(self, name, given)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return len(self.M)


@dataclass(frozen=True)
class Modes:
    """Undamped modes of a classically damped structure, normalised by mass.

    shapes (n, n): column i is mode i, shapes' M shapes = 1; omega (n,) in rad/s,
    ascending; damping (n,): 2 zeta omega in rad/s.
    """

    shapes: Array
    omega: Array
    damping: Array

    @property
    def frequency(self) -> Array:
        """Natural frequencies, Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def ratio(self) -> Array:
        """Damping ratios zeta."""
        return self.damping / (2.0 * self.omega)


def modes_of(structure: Structure, tolerance: float = 1e-6) -> Modes:
    """Return the modes of M and K with the modal damping of C; refuse a C that couples them.

    tolerance: largest off-diagonal entry of shapes' C shapes, relative to
    the geometric mean of the two diagonal entries that it couples.
    """
    omega2, shapes = la.eigh(structure.K, structure.M)
    if omega2[0] <= 0.0:
        raise StructureError(
            f"structure: K is not positive definite (lowest omega^2 = {omega2[0]:.3g} 1/s^2); "
            "fix the base of the structure"
        )
    modal = shapes.T @ structure.C @ shapes
    damping = np.diag(modal).copy()
    scale = np.sqrt(np.outer(damping, damping)) if (damping > 0).all() else damping.max() + 1.0
    coupling = np.abs(modal - np.diag(damping)) / scale
    if coupling.max() > tolerance:
        i, j = np.unravel_index(int(np.argmax(coupling)), coupling.shape)
        raise StructureError(
            f"structure: C couples modes {i + 1} and {j + 1} "
            f"(relative {coupling.max():.2g} > {tolerance:g}), but a modal plant needs classical damping; "
            "use NonlinearStructure, which takes any C"
        )
    shapes = shapes * np.sign(shapes[-1])
    return Modes(shapes, np.sqrt(omega2), damping)


def require_freedoms(where: str, chosen: Sequence[int], n: int) -> None:
    """Refuse a choice of degrees of freedom, counted from 1, that a structure of n does not have."""
    if not len(chosen) or any(not 1 <= f <= n for f in chosen):
        raise StructureError(f"{where}: floors {list(chosen)} must be some of 1..{n}")
