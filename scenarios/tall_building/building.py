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

from cosim import Array, CosimError

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


class StructureError(CosimError):
    """Matrices that do not form a structure, or a structure that a plant cannot take."""


@dataclass(frozen=True)
class Structure:
    """Linear structure M x'' + C x' + K x = f (2.1); kg, N s/m, N/m, all (n, n)."""

    M: Array
    C: Array
    K: Array

    def __post_init__(self) -> None:
        n = self.M.shape[0]
        for name, matrix in (("M", self.M), ("C", self.C), ("K", self.K)):
            if matrix.shape != (n, n):
                raise StructureError(
                    f"structure: {name} has shape {matrix.shape}, M has {self.M.shape}; "
                    "M, C and K must be square and of one size"
                )
            if not np.isfinite(matrix).all():
                raise StructureError(f"structure: {name} contains NaN or infinite entries")

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return int(self.M.shape[0])


@dataclass(frozen=True)
class Modes:
    """Undamped modes of a classically damped structure, mass-normalised.

    shapes (n, n): column i is mode i, shapes' M shapes = I; omega (n,) in rad/s,
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
    """Modes of M, K with the modal damping of C; refuses a C that couples them.

    tolerance: largest off-diagonal entry of shapes' C shapes, relative to
    the geometric mean of the two diagonal entries it couples.
    """
    omega2, shapes = la.eigh(structure.K, structure.M)
    if omega2[0] <= 0.0:
        raise StructureError(
            f"structure: K is not positive definite (lowest omega^2 = {omega2[0]:.3g}); "
            "a fixed base is needed"
        )
    modal = shapes.T @ structure.C @ shapes
    damping = np.diag(modal).copy()
    scale = np.sqrt(np.outer(damping, damping)) if (damping > 0).all() else damping.max() + 1.0
    coupling = np.abs(modal - np.diag(damping)) / scale
    if coupling.max() > tolerance:
        i, j = np.unravel_index(int(np.argmax(coupling)), coupling.shape)
        raise StructureError(
            f"structure: C couples modes {i + 1} and {j + 1} "
            f"(relative {coupling.max():.2g} > {tolerance:g}); the modal step needs classical "
            "damping, use a dense matrix exponential for this C"
        )
    shapes = shapes * np.sign(shapes[-1])
    return Modes(shapes, np.sqrt(omega2), damping)


def cantilever_stiffness(heights: Array, bending_stiffness: Array) -> Array:
    """Lateral stiffness (n, n), N/m, of a cantilever with massless floor rotations.

    heights (n,) m and bending_stiffness (n,) N*m^2 by story. Hermite beam elements,
    rotations condensed statically.
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


def lumped_mass(heights: Array, mass_per_metre: Array, roof_mass: float) -> Array:
    """Floor masses (n,), kg: half of the story below and above; the top floor also roof_mass."""
    story_mass = heights * mass_per_metre
    floors: Array = 0.5 * (story_mass + np.append(story_mass[1:], 0.0))
    floors[-1] += roof_mass
    return floors


def classical_damping(M: Array, K: Array, ratio: float = 0.01, constant_modes: int = 5) -> Array:
    """C (n, n), N s/m: `ratio` of critical in the first modes, above them ratio * omega/omega_5."""
    omega2, shapes = la.eigh(K, M)
    omega = np.sqrt(omega2)
    zeta = ratio * np.maximum(1.0, omega / omega[constant_modes - 1])
    left = M @ shapes
    return np.asarray((left * (2.0 * zeta * omega)) @ left.T)


def default_building(
    heights: Array = STORY_HEIGHTS,
    section_tops: tuple[int, ...] = SECTION_TOPS,
    bending_stiffness: tuple[float, ...] = BENDING_STIFFNESS,
    mass_per_metre: tuple[float, ...] = MASS_PER_METRE,
    roof_mass: float = ROOF_MASS,
    damping_ratio: float = 0.01,
) -> Structure:
    """The building without damper, 76 DOF; parameters by section of the tower."""
    counts = np.diff((0, *section_tops))
    if section_tops[-1] != len(heights):
        raise StructureError(
            f"default_building: the last section ends at story {section_tops[-1]}, "
            f"but there are {len(heights)} story heights"
        )
    K = cantilever_stiffness(heights, np.repeat(bending_stiffness, counts))
    M = np.diag(lumped_mass(heights, np.repeat(mass_per_metre, counts), roof_mass))
    return Structure(M, classical_damping(M, K, damping_ratio), K)


def load_building(path: str) -> Structure:
    """M, C, K of a .npz file with arrays M, K, C in t, kN s/m, kN/m (the benchmark's units)."""
    try:
        with np.load(path) as data:
            missing = {"M", "C", "K"} - set(data.files)
            if missing:
                raise StructureError(
                    f"{path}: no array {sorted(missing)} (found {sorted(data.files)}); "
                    "the file must hold M, C, K in t, kN s/m, kN/m"
                )
            return Structure(*(1e3 * np.asarray(data[name], float) for name in ("M", "C", "K")))
    except (OSError, EOFError, ValueError) as error:
        raise StructureError(f"{path}: not a readable .npz file ({error})") from error


@dataclass(frozen=True)
class Damper:
    """Active tuned mass damper on the top floor (2.19): kg, N s/m, N/m.

    The printed c_m of 0.2 kN s/m is a slip of 1000: 20 % of critical is 201 kN s/m.
    """

    m: float = 500.0e3
    c: float = 201.0e3
    k: float = 505.1e3


def with_damper(building: Structure, damper: Damper | None = None, stiffness: float = 1.0) -> Structure:
    """Building and damper, n + 1 DOF; the last is x_m, relative to the top floor (2.19).

    In the symmetric form the equation of floor 76 is the sum of the rows 76 and 77 of
    the printed matrices with the reaction added that the print omits (row 76 receives
    k_m x_m + c_m x_m' - u). The force u of the actuator, which stands between
    top floor and damper, then works on x_m alone: B_c = [0 ... 0 1]'.
    `stiffness` scales the building's K (1.15 and 0.85 are the thesis' cases).
    """
    damper = damper or Damper()
    n = building.dof
    M, C, K = (np.zeros((n + 1, n + 1)) for _ in range(3))
    M[:n, :n], C[:n, :n], K[:n, :n] = building.M, building.C, stiffness * building.K
    M[n - 1 :, n - 1 :] += damper.m
    C[n, n], K[n, n] = damper.c, damper.k
    return Structure(M, C, K)
