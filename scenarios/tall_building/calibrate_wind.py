"""Calibrate the default wind to the printed uncontrolled response of the tall building.

    python -m scenarios._fit_wind [seeds]

What was found by hand: the Strouhal number, the bandwidth and the lengths, so that the
spectrum gives the printed ratios of acceleration to displacement and of LQG's criteria over
the three stiffnesses (a low peak, below the first mode, and a broad band).

What this script finds: the two RMS coefficients C_s and C_t for a seed: their ratio from
sigma_x76/sigma_a75, their level so that the largest and the smallest of the four errors are
equal and opposite. The peaks then depend on the seed alone; and since 900 s are only some
18 correlation times of a mode with 1 % damping, so does the reduction that any control
achieves. With a number the script tries so many seeds
and lists those whose peaks are within 3 %. The default seed 722 is the one of the first
1100 with which LQG comes nearest to its printed criteria: its uncontrolled building
swings about 1.15 times as much as the same spectrum gives on average, which the
benchmark's single record seems to do as well: a damper of 500 t at the printed stroke adds
some 4 % of damping to the 1 %, which reduces a stationary response in a flat spectrum to
about 0.44, where 0.369 is printed.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from scipy.optimize import fsolve
from scipy.signal import cont2discrete, lfilter, ss2tf

from cosim import Array
from fmus.loads.wind import AcrossWind, across_wind
from fmus.structures.structure import Modes, modes_of

from .building import STORY_HEIGHTS, default_building
from .criteria import UNCONTROLLED
from .study import SEED

MODES = 12
PERIOD = 0.1


def responses(modes: Modes, load: Array) -> tuple[Array, Array]:
    """Displacement of floor 76 and acceleration of floor 75, m: exact for a load linear between samples."""
    x76, a75 = np.zeros(len(load)), np.zeros(len(load))
    for i in range(MODES):
        w, d, shape = modes.omega[i] ** 2, modes.damping[i], modes.shapes[:, i]
        A, B = np.array([[0.0, 1.0], [-w, -d]]), np.array([[0.0], [1.0]])
        C, D = np.array([[1.0, 0.0], [-w, -d]]), np.array([[0.0], [1.0]])
        discrete = cont2discrete((A, B, C, D), PERIOD, method="foh")
        (b_x, b_a), poles = ss2tf(*discrete[:4])
        force = load @ shape
        x76 += shape[75] * lfilter(b_x, poles, force)
        a75 += shape[74] * lfilter(b_a, poles, force)
    return x76, a75


def calibrate(seed: int, modes: Modes, wind: AcrossWind | None = None) -> tuple[float, float, Array]:
    """C_s, C_t, and the four figures (cm, cm/s2) that they give."""
    wind = wind or AcrossWind()
    parts = []
    for shedding, turbulence in ((1.0, 0.0), (0.0, 1.0)):
        unit = replace(wind, shedding=shedding, turbulence=turbulence)
        parts.append(responses(modes, across_wind(STORY_HEIGHTS, 900.0, seed, unit, PERIOD)))
    (x_s, a_s), (x_t, a_t) = parts

    def figures(c: Array) -> Array:
        x, a = c[0] * x_s + c[1] * x_t, c[0] * a_s + c[1] * a_t
        rms = np.sqrt(np.mean(x**2)), np.sqrt(np.mean(a**2))
        return 100.0 * np.array([*rms, np.abs(x).max(), np.abs(a).max()])

    target = np.array(list(UNCONTROLLED.values()))
    c = fsolve(lambda c: figures(c)[:2] / target[:2] - 1.0, np.array([wind.shedding, wind.turbulence]))
    error = figures(c) / target
    c /= 0.5 * (error.max() + error.min())
    return float(c[0]), float(c[1]), figures(c)


def main(seeds: int) -> None:
    """Show the calibration of the default seed, or of every seed with fitting peaks."""
    modes = modes_of(default_building())
    printed = np.array(list(UNCONTROLLED.values()))
    for seed in range(seeds) if seeds else (SEED,):
        shedding, turbulence, figures = calibrate(seed, modes)
        error = figures / printed - 1.0
        if not seeds or np.abs(error).max() < 0.03:
            print(f"seed {seed}: C_s = {shedding:.4f}, C_t = {turbulence:.4f}", end="; ")
            print(
                ", ".join(
                    f"{n} {v:.2f} ({e:+.1%})" for n, v, e in zip(UNCONTROLLED, figures, error, strict=True)
                )
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
