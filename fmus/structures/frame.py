"""Straight frame members along a global axis, with shear flexibility, and their assembly.

A member of length L bends in two planes. In each, its end moments follow from the
rotations of its ends from the chord by

    m_1 = k11 theta_1 + k12 theta_2,  m_2 = k12 theta_1 + k11 theta_2
    k11 = (4 + phi) EI / (L (1 + phi)),  k12 = (2 - phi) EI / (L (1 + phi))
    phi = 12 EI / (GA L^2), the share of shear in its flexibility

Nodes have the degrees of freedom ux, uy, uz, rx, ry, rz, or some of them; the others are
fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim import Array

from .structure import Freedoms

AXES = "xyz"
FREEDOMS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Section:
    """Stiffness of a section."""

    EA: float  # axial, N
    GJ: float  # torsional, N*m^2
    EI: dict[str, float]  # bending, by axis of rotation ({"x": ..., "z": ...}), N*m^2
    GA: dict[str, float]  # shear, by direction, N


def end_stiffness(EI: float, GA: float, L: float) -> tuple[float, float]:
    """Return k11 and k12, the moments at the rotated and at the other end for a unit rotation (N*m)."""
    phi = 12.0 * EI / (GA * L * L)
    return (4.0 + phi) * EI / (L * (1.0 + phi)), (2.0 - phi) * EI / (L * (1.0 + phi))


def member(axis: str, L: float, section: Section) -> Array:
    """Return the stiffness (12, 12) of a member; node 2 lies L further along the axis than node 1."""
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


def chord_rotations(axis: str, direction: str, L: float) -> Array:
    """Return the rotations (2, 12) of a member's ends from its chord, bending along `direction`.

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
    """Nodes and members, assembled to M and K; springs and dashpots are added to the matrices."""

    def __init__(self) -> None:
        self.freedoms: Freedoms[str, str] = Freedoms()
        self.members: list[tuple[str, str, Array]] = []
        self.mass: dict[tuple[str, str], float] = {}

    def node(self, name: str, freedoms: tuple[str, ...] = FREEDOMS) -> None:
        """Add a node with these degrees of freedom; the others are fixed."""
        for freedom in freedoms:
            self.freedoms[name, freedom] = len(self.freedoms)

    def add_mass(self, name: str, translation: float, rotation: tuple[float, float, float]) -> None:
        """Add a mass (kg) with its inertia about x, y, z (kg*m^2) to a node."""
        for freedom, value in zip(FREEDOMS, (translation,) * 3 + rotation, strict=True):
            self.mass[name, freedom] = self.mass.get((name, freedom), 0.0) + value

    def connect(self, first: str, second: str, axis: str, L: float, section: Section) -> None:
        """Add a member of length L from one node to another, which lies further along the axis."""
        self.members.append((first, second, member(axis, L, section)))

    def end_rows(self, first: str, second: str, rows: Array) -> Array:
        """Return rows over the 12 freedoms of a member as rows over all degrees of freedom."""
        keys = [(node, freedom) for node in (first, second) for freedom in FREEDOMS]
        return np.array([self.freedoms.row(dict(zip(keys, row, strict=True))) for row in rows])

    def matrices(self) -> tuple[Array, Array]:
        """Return the lumped masses and the stiffness of the members, both (n, n)."""
        n = len(self.freedoms)
        K = np.zeros((n, n))
        for first, second, k in self.members:
            T = self.end_rows(first, second, np.eye(12))
            K += T.T @ k @ T
        return np.diag([self.mass.get(key, 0.0) for key in self.freedoms]), K
