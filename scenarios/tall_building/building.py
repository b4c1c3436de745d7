"""The 76-story building of chapter 2 as a calibrated cantilever (thesis, 2.4.1).

A vertical Bernoulli-Euler cantilever with rigid floors: one bending stiffness and
one mass per metre for each of four sections of the tower; the mass is lumped at the
floors (half a story below, half above). The rotations of the floors carry no mass
and are condensed statically, which is exact:

    K = K_tt - K_tr K_rr^-1 K_rt                                       (2.1)

Damping is classical: 1 % of critical in modes 1 to 5, above them proportional to the
frequency (stiffness-proportional, so that the highest modes are overdamped, as in the
benchmark of Yang, Agrawal, Samali and Wu, 2004).

The nine numbers below were found by calibrate.py from the benchmark's first five
frequencies, modal masses and shapes; the story heights are those of the benchmark.

Units: m, kg, N, s. The benchmark's mass matrix adds up to 210,863 t (1' M 1), not to the
printed 153,000 t; the fit follows the matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike

from cosim import Array
from fmus.structures.structure import Structure, StructureError

STORY_HEIGHTS: Array = np.concatenate([[10.0], [4.5] * 2, [3.9] * 35, [4.5] * 2, [3.9] * 34, [4.5] * 2])
"""Story heights from the ground up, m: 76 stories, 306.1 m."""

SECTION_TOPS = (19, 38, 57, 76)
"""Last story of each section of the tower, above which columns and core are smaller."""

BENDING_STIFFNESS: tuple[float, ...] = (4.219e14, 3.378e14, 2.003e14, 1.171e14)
"""EI of each section, N*m^2."""

MASS_PER_METRE: tuple[float, ...] = (910.9e3, 785.8e3, 605.5e3, 469.9e3)
"""Mass of each section, kg/m."""

ROOF_MASS = 747.1e3
"""Plant rooms on the top floor, kg."""


def cantilever_stiffness(heights: Array, bending_stiffness: Array) -> Array:
    """Return the lateral stiffness (n, n), N/m, of a cantilever with massless floor rotations.

    heights (n,) in m and bending_stiffness (n,) in N*m^2 are given by story; Hermite beam
    elements, rotations condensed statically.
    """
    n = len(heights)
    full = np.zeros((2 * n + 2, 2 * n + 2))
    for story, (length, EI) in enumerate(zip(heights, bending_stiffness, strict=True)):
        a, b, c, d = 12.0, 6.0 * length, 4.0 * length**2, 2.0 * length**2
        element = np.array([[a, b, -a, b], [b, c, -b, d], [-a, -b, a, -b], [b, d, -b, c]])
        span = slice(2 * story, 2 * story + 4)
        full[span, span] += EI / length**3 * element
    full = full[2:, 2:]  # fixed base
    K_tt, K_tr, K_rr = full[0::2, 0::2], full[0::2, 1::2], full[1::2, 1::2]
    K = K_tt - K_tr @ la.solve(K_rr, K_tr.T, assume_a="pos")
    return np.asarray(0.5 * (K + K.T))


def matrices(
    bending_stiffness: ArrayLike, mass_per_metre: ArrayLike, roof_mass: float
) -> tuple[Array, Array]:
    """Return M and K (76, 76), kg and N/m, from bending stiffness and mass by section of the tower."""
    stories = np.diff((0, *SECTION_TOPS))
    story_mass = STORY_HEIGHTS * np.repeat(mass_per_metre, stories)
    floors = 0.5 * (story_mass + np.append(story_mass[1:], 0.0))
    floors[-1] += roof_mass
    return np.diag(floors), cantilever_stiffness(STORY_HEIGHTS, np.repeat(bending_stiffness, stories))


def classical_damping(M: Array, K: Array, ratio: float = 0.01, constant_modes: int = 5) -> Array:
    """Return C (n, n), N*s/m: `ratio` of critical in the first modes, ratio * omega/omega_5 above them."""
    omega2, shapes = la.eigh(K, M)
    omega = np.sqrt(omega2)
    zeta = ratio * np.maximum(1.0, omega / omega[constant_modes - 1])
    left = M @ shapes
    return np.asarray((left * (2.0 * zeta * omega)) @ left.T)


def default_building() -> Structure:
    """Return the building without damper, 76 degrees of freedom."""
    M, K = matrices(BENDING_STIFFNESS, MASS_PER_METRE, ROOF_MASS)
    return Structure(M, classical_damping(M, K), K)


def load_building(path: str) -> Structure:
    """Return the building of a .npz file with arrays M, C, K in t, kN*s/m, kN/m (the benchmark's units)."""
    try:
        with np.load(path) as data:
            missing = {"M", "C", "K"} - set(data.files)
            if missing:
                raise StructureError(
                    f"{path}: no array {sorted(missing)} (found {sorted(data.files)}); "
                    "the file must hold M, C, K in t, kN*s/m, kN/m"
                )
            M, C, K = (1e3 * np.asarray(data[name], float) for name in ("M", "C", "K"))
            return Structure(M, C, K)
    except (OSError, EOFError, ValueError) as error:
        raise StructureError(f"{path}: not a readable .npz file ({error})") from error


@dataclass(frozen=True)
class Damper:
    """Active tuned mass damper on the top floor (2.19): m in kg, c in N*s/m, k in N/m.

    The printed c_m of 0.2 kN*s/m is a slip by a factor of 1000: 20 % of critical is 201 kN*s/m.
    """

    m: float = 500.0e3
    c: float = 201.0e3
    k: float = 505.1e3


def with_damper(building: Structure, damper: Damper | None = None, stiffness: float = 1.0) -> Structure:
    """Return building and damper, n + 1 degrees of freedom; the last is x_m, relative to the roof (2.19).

    In the symmetric form the equation of floor 76 is the sum of the rows 76 and 77 of
    the printed matrices, and the reaction that the print omits is added (row 76 receives
    k_m x_m + c_m x_m' - u). The force u of the actuator between top floor and damper
    then works on x_m alone: B_c = [0 ... 0 1]'.
    `stiffness` scales the building's K (1.15 and 0.85 are the thesis' cases).
    """
    damper = damper or Damper()
    n = building.dof
    M, C, K = (np.zeros((n + 1, n + 1)) for _ in range(3))
    M[:n, :n], C[:n, :n], K[:n, :n] = building.M, building.C, stiffness * building.K
    M[n - 1 :, n - 1 :] += damper.m
    C[n, n], K[n, n] = damper.c, damper.k
    return Structure(M, C, K)
