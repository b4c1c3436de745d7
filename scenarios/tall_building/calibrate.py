"""Calibration of the default building and of the default wind.

    python -m scenarios.tall_building.calibrate building MCK.npz
    python -m scenarios.tall_building.calibrate wind [SEEDS]

**Building.** Finds the nine numbers of building.py from the benchmark's matrices: least
squares in the logarithms of four bending stiffnesses, four masses per metre and the mass on
the roof. Residuals are the logarithms of the ratios of frequency and modal mass, and the
differences of the shapes, of the first five modes.

**Wind.** Calibrates the default wind to the printed response without control. Found by hand:
the Strouhal number, the bandwidth and the lengths, so that the spectrum gives the printed
ratios of acceleration to displacement and of LQG's criteria over the three stiffnesses (a low
peak, below the first mode, and a broad band). Found here: the two RMS coefficients C_s and
C_t for a seed: their ratio from sigma_x76/sigma_a75, their level such that the largest and
the smallest of the four errors are equal and opposite. The peaks then depend on the seed
alone; and since 900 s are only some 18 correlation times of a mode with 1 % damping, so does
the reduction that any control achieves. With SEEDS the script tries that many seeds and lists
those whose peaks are within 3 %. The default seed 722 is the one of the first 1100 with which
LQG comes nearest to its printed criteria: its uncontrolled building swings about 1.15 times
as much as the same spectrum gives on average. The benchmark's single record seems to do the
same: a damper of 500 t at the printed stroke adds some 4 % of damping to the 1 %, which
reduces a stationary response in a flat spectrum to about 0.44, where 0.369 is printed.

Not here: the weights of the sliding surface and of LQG, and S_vv (control.py), which were
fitted to the printed tables by a script that is lost.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import scipy.linalg as la
from scipy.optimize import fsolve, least_squares
from scipy.signal import cont2discrete, lfilter, ss2tf

from cosim import Array
from fmus.loads.wind import AcrossWind, across_wind
from fmus.structures.structure import Modes, Structure, modes_of

from .building import (
    BENDING_STIFFNESS,
    MASS_PER_METRE,
    ROOF_MASS,
    STORY_HEIGHTS,
    default_building,
    load_building,
    matrices,
)
from .criteria import FLOOR_75, FLOOR_76, FLOORS, UNCONTROLLED
from .plant import DURATION, SEED

# ------------------------------------------------------------------------------------ building

FITTED_MODES = 5
IN_USE = np.array([*BENDING_STIFFNESS, *MASS_PER_METRE, ROOF_MASS])


def first_modes(M: Array, K: Array) -> tuple[Array, Array, Array]:
    """Return omega (5,), shapes (n, 5) with 1 at the top floor, and modal masses (5,)."""
    omega2, shapes = la.eigh(K, M, subset_by_index=(0, FITTED_MODES - 1))
    return np.sqrt(omega2), shapes / shapes[-1], 1.0 / shapes[-1] ** 2


def fit_building(target: Structure, start: Array = IN_USE) -> Array:
    """Return the nine numbers in N*m^2, kg/m and kg."""
    omega, shapes, mass = first_modes(target.M, target.K)

    def residuals(logarithms: Array) -> Array:
        w, s, m = first_modes(*_matrices(np.exp(logarithms)))
        return np.concatenate([100 * np.log(w / omega), 10 * np.log(m / mass), (s - shapes).ravel()])

    return np.asarray(np.exp(least_squares(residuals, np.log(start)).x))


def _matrices(parameters: Array) -> tuple[Array, Array]:
    return matrices(parameters[:4], parameters[4:8], parameters[8])


def report_building(target: Structure, parameters: Array) -> str:
    """Return the remaining differences."""
    omega, shapes, mass = first_modes(target.M, target.K)
    M, K = _matrices(parameters)
    w, s, m = first_modes(M, K)
    mac = (s * shapes).sum(0) ** 2 / ((s * s).sum(0) * (shapes * shapes).sum(0))
    lines = ["mode  frequency  modal mass  1 - MAC"]
    lines += [
        f"{i + 1:4} {100 * (w[i] / omega[i] - 1):+9.3f} % {100 * (m[i] / mass[i] - 1):+9.2f} %"
        f"  {1 - mac[i]:.1e}"
        for i in range(FITTED_MODES)
    ]
    total = (
        f"1' M 1: {M.sum() / 1e3:.0f} t, the benchmark's {target.M.sum() / 1e3:.0f} t (153,000 t is printed)"
    )
    return "\n".join([*lines, total])


# ---------------------------------------------------------------------------------------- wind

WIND_MODES = 12
PERIOD = 0.1


def responses(modes: Modes, load: Array) -> tuple[Array, Array]:
    """Return x of floor 76 and the acceleration of floor 75; exact for a load linear between samples."""
    floor_75, roof = FLOORS[FLOOR_75] - 1, FLOORS[FLOOR_76] - 1
    x76, a75 = np.zeros(len(load)), np.zeros(len(load))
    for i in range(WIND_MODES):
        w, d, shape = modes.omega[i] ** 2, modes.damping[i], modes.shapes[:, i]
        A, B = np.array([[0.0, 1.0], [-w, -d]]), np.array([[0.0], [1.0]])
        C, D = np.array([[1.0, 0.0], [-w, -d]]), np.array([[0.0], [1.0]])
        discrete = cont2discrete((A, B, C, D), PERIOD, method="foh")
        (b_x, b_a), poles = ss2tf(*discrete[:4])
        force = load @ shape
        x76 += shape[roof] * lfilter(b_x, poles, force)
        a75 += shape[floor_75] * lfilter(b_a, poles, force)
    return x76, a75


def fit_wind(seed: int, modes: Modes, wind: AcrossWind | None = None) -> tuple[float, float, Array]:
    """Return C_s, C_t, and the four figures that they give, in cm and cm/s^2."""
    wind = wind or AcrossWind()
    parts = []
    for shedding, turbulence in ((1.0, 0.0), (0.0, 1.0)):
        unit = replace(wind, shedding=shedding, turbulence=turbulence)
        parts.append(responses(modes, across_wind(STORY_HEIGHTS, DURATION, seed, unit, PERIOD)))
    (x_s, a_s), (x_t, a_t) = parts

    def four_figures(c: Array) -> Array:
        x, a = c[0] * x_s + c[1] * x_t, c[0] * a_s + c[1] * a_t
        rms = np.sqrt(np.mean(x**2)), np.sqrt(np.mean(a**2))
        return 100.0 * np.array([*rms, np.abs(x).max(), np.abs(a).max()])

    target = np.array(list(UNCONTROLLED.values()))
    c = fsolve(lambda c: four_figures(c)[:2] / target[:2] - 1.0, np.array([wind.shedding, wind.turbulence]))
    error = four_figures(c) / target
    c /= 0.5 * (error.max() + error.min())
    return float(c[0]), float(c[1]), four_figures(c)


# ---------------------------------------------------------------------------------------- both


def calibrate_building(path: str) -> None:
    """Fit the building, and print the fit beside the numbers in use."""
    target = load_building(path)
    for title, numbers in (("found", fit_building(target)), ("in use", IN_USE)):
        print(f"{title}:", " ".join(f"{v:.4g}" for v in numbers), report_building(target, numbers), sep="\n")


def calibrate_wind(seeds: int) -> None:
    """Print the calibration of the default seed, or of every seed with fitting peaks."""
    modes = modes_of(default_building())
    printed = np.array(list(UNCONTROLLED.values()))
    for seed in range(seeds) if seeds else (SEED,):
        shedding, turbulence, figures = fit_wind(seed, modes)
        error = figures / printed - 1.0
        if not seeds or np.abs(error).max() < 0.03:
            cells = zip(UNCONTROLLED, figures, error, strict=True)
            text = ", ".join(f"{n} {v:.2f} ({e:+.1%})" for n, v, e in cells)
            print(f"seed {seed}: C_s = {shedding:.4f}, C_t = {turbulence:.4f}; {text}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["building", path]:
            calibrate_building(path)
        case ["wind", *seeds]:
            calibrate_wind(int(seeds[0]) if seeds else 0)
        case _:
            sys.exit(__doc__)
