"""Straight frame members along a global axis, with shear flexibility, and their assembly.

A member of length L bends in two planes; in each, with k_s its shear and

    phi = 12 EI / (GA L^2)                     share of shear in its flexibility
    k_11 = (4 + phi) EI / (L (1 + phi)),  k_12 = (2 - phi) EI / (L (1 + phi))
    k_s = (k_11 + k_12) / L,  transverse stiffness 2 k_s / L

Nodes have the degrees of freedom ux, uy, uz, rx, ry, rz; those left out of a node are
fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

AXES = "xyz"
FREEDOMS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Section:
    """Stiffness of a section; EI_rz is bending about z (motion in the plane across z)."""

    EA: float
    GJ: float
    EI: dict[str, float]  # by axis of rotation: {"x": ..., "z": ...}
    GA: dict[str, float]  # by direction of the shear


def end_stiffness(EI: float, GA: float, L: float) -> tuple[float, float]:
    """k_11 and k_12: end moments of unit rotations at the near and the far end."""
    phi = 12.0 * EI / (GA * L * L)
    return (4.0 + phi) * EI / (L * (1.0 + phi)), (2.0 - phi) * EI / (L * (1.0 + phi))


def member(axis: str, L: float, section: Section) -> NDArray[np.float64]:
    """Stiffness (12, 12) of a member from node 1 to node 2, which lies L further along the axis."""
    K = np.zeros((12, 12))
    a = AXES.index(axis)
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    K[np.ix_([a, 6 + a], [a, 6 + a])] += section.EA / L * pair
    K[np.ix_([3 + a, 9 + a], [3 + a, 9 + a])] += section.GJ / L * pair
    for direction in AXES:
        if direction != axis:
            rotations = chord_rotations(axis, direction, L)
            rotation = next(o for o in AXES if o not in (axis, direction))
            k11, k12 = end_stiffness(section.EI[rotation], section.GA[direction], L)
            K += rotations.T @ np.array([[k11, k12], [k12, k11]]) @ rotations
    return K


def chord_rotations(axis: str, direction: str, L: float) -> NDArray[np.float64]:
    """Rotations (2, 12) of a member's ends from its chord, bending along `direction`.

    A small rotation r about the third axis moves a point that lies L further along the
    axis by r x (L axis): +L r along `direction` where (rotation, axis, direction) is an
    even permutation of xyz, else -L r.
    """
    a, b = AXES.index(axis), AXES.index(direction)
    c = 3 - a - b
    even = (b - a) % 3 == 1  # then r about c = a x b turns axis towards direction
    rows = np.zeros((2, 12))
    slope = (1.0 if even else -1.0) / L
    rows[:, 6 + b], rows[:, b] = -slope, slope
    rows[0, 3 + c] = rows[1, 9 + c] = 1.0
    return rows


class Frame:
    """Nodes, members, springs and dashpots, assembled to M, C and K."""

    def __init__(self) -> None:
        self.index: dict[tuple[str, str], int] = {}
        self.members: list[tuple[str, str, NDArray[np.float64]]] = []
        self.mass: dict[tuple[str, str], float] = {}

    def node(self, name: str, freedoms: tuple[str, ...] = FREEDOMS) -> None:
        for freedom in freedoms:
            self.index[name, freedom] = len(self.index)

    def add_mass(self, name: str, translation: float, rotation: tuple[float, float, float]) -> None:
        for freedom, value in zip(FREEDOMS, (translation,) * 3 + rotation, strict=True):
            self.mass[name, freedom] = self.mass.get((name, freedom), 0.0) + value

    def connect(self, first: str, second: str, axis: str, L: float, section: Section) -> None:
        self.members.append((first, second, member(axis, L, section)))

    @property
    def size(self) -> int:
        return len(self.index)

    def row(self, weights: dict[tuple[str, str], float]) -> NDArray[np.float64]:
        """A row over all degrees of freedom; fixed ones are left out."""
        row = np.zeros(self.size)
        for key, weight in weights.items():
            if key in self.index:
                row[self.index[key]] += weight
        return row

    def end_rows(self, first: str, second: str, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows over the 12 freedoms of a member as rows over all."""
        keys = [(node, freedom) for node in (first, second) for freedom in FREEDOMS]
        return np.array([self.row(dict(zip(keys, row, strict=True))) for row in rows])

    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lumped masses (n) and the stiffness of the members (n, n)."""
        K = np.zeros((self.size, self.size))
        for first, second, k in self.members:
            T = self.end_rows(first, second, np.eye(12))
            K += T.T @ k @ T
        M = np.array([self.mass.get(key, 0.0) for key in self.index])
        return M, K

    def influence(self, directions: tuple[str, ...] = ("ux", "uy")) -> NDArray[np.float64]:
        return np.array([[float(f == d) for d in directions] for _, f in self.index])
