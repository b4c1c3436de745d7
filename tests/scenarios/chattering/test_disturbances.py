"""The disturbances of the plant in cases 3 and 4, by the statistics of the signals."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Array, simulate
from scenarios.chattering.study import Study


def disturbance(case: int) -> Array:
    """Return the disturbance of x2' at the 4001 points of a run."""
    system = Study(case=case).build()
    return simulate(system, step=0.01, stop=40.0, record=["total.y"])["total.y"]


def test_case_3_has_white_noise_of_variance_1() -> None:
    """Of 4001 samples the standard deviation scatters by 1.1 %, the mean by 0.016: bounds of 4 of these."""
    noise = disturbance(3)
    assert noise.std() == pytest.approx(1.0, abs=0.045)
    assert abs(noise.mean()) < 0.064
    neighbours = np.corrcoef(noise[1:], noise[:-1])[0, 1]
    assert abs(neighbours) < 0.064  # white: 1 / sqrt(4001), four times


def test_case_4_has_el_centro_in_g() -> None:
    """The largest acceleration is 0.211 g, as figure 4.28 shows; the record has almost no mean."""
    ground = disturbance(4)
    assert np.abs(ground).max() == pytest.approx(0.211, abs=0.0005)
    assert abs(ground.mean()) < 1e-3
