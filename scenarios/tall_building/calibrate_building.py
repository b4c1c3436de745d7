"""Find the nine numbers of the default building from the benchmark's matrices.

    python -m scenarios._fit_tall_building ../shared/data/tall_building/mck.npz

Least squares in the logarithms of four bending stiffnesses, four masses per metre and the
mass on the roof; residuals are the logarithms of the ratios of frequency and modal mass and
the differences of the shapes of the first five modes.
"""

from __future__ import annotations

import sys

import numpy as np
import scipy.linalg as la
from scipy.optimize import least_squares

from cosim import Array
from fmus.structures.structure import Structure

from .building import (
    BENDING_STIFFNESS,
    MASS_PER_METRE,
    ROOF_MASS,
    SECTION_TOPS,
    STORY_HEIGHTS,
    cantilever_stiffness,
    load_building,
    lumped_mass,
)

MODES = 5
START = np.array([*BENDING_STIFFNESS, *MASS_PER_METRE, ROOF_MASS])


def first_modes(M: Array, K: Array) -> tuple[Array, Array, Array]:
    """Return omega (5,), shapes (n, 5) with 1 at the top floor, and modal masses (5,)."""
    omega2, shapes = la.eigh(K, M, subset_by_index=(0, MODES - 1))
    return np.sqrt(omega2), shapes / shapes[-1], 1.0 / shapes[-1] ** 2


def matrices(parameters: Array) -> tuple[Array, Array]:
    """M and K of the nine numbers."""
    counts = np.diff((0, *SECTION_TOPS))
    EI, mass = parameters[:8].reshape(2, 4)
    K = cantilever_stiffness(STORY_HEIGHTS, np.repeat(EI, counts))
    M = np.diag(lumped_mass(STORY_HEIGHTS, np.repeat(mass, counts), float(parameters[8])))
    return M, K


def fit(target: Structure, start: Array = START) -> Array:
    """Return the nine numbers, N m2, kg/m, kg."""
    omega, shapes, mass = first_modes(target.M, target.K)

    def residuals(logarithms: Array) -> Array:
        w, s, m = first_modes(*matrices(np.exp(logarithms)))
        return np.concatenate([100 * np.log(w / omega), 10 * np.log(m / mass), (s - shapes).ravel()])

    return np.asarray(np.exp(least_squares(residuals, np.log(start)).x))


def report(target: Structure, parameters: Array) -> str:
    """Return what is left of the differences."""
    omega, shapes, mass = first_modes(target.M, target.K)
    M, K = matrices(parameters)
    w, s, m = first_modes(M, K)
    mac = (s * shapes).sum(0) ** 2 / ((s * s).sum(0) * (shapes * shapes).sum(0))
    lines = ["mode  frequency  modal mass  1 - MAC"]
    lines += [
        f"{i + 1:4} {100 * (w[i] / omega[i] - 1):+9.3f} % {100 * (m[i] / mass[i] - 1):+9.2f} %"
        f"  {1 - mac[i]:.1e}"
        for i in range(MODES)
    ]
    total = (
        f"1' M 1: {M.sum() / 1e3:.0f} t, the benchmark's {target.M.sum() / 1e3:.0f} t (153,000 t is printed)"
    )
    return "\n".join([*lines, total])


def main(path: str) -> None:
    """Fit, and show the fit and the numbers that stand in fmus/tall_building.py."""
    target = load_building(path)
    found = fit(target)
    print("found:", " ".join(f"{v:.4g}" for v in found), report(target, found), sep="\n")
    print("in use:", " ".join(f"{v:.4g}" for v in START), report(target, START), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1])
