"""The numbers of the bridge and its control, by their effects: damping, base shear, weight of force."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Result
from scenarios.highway_bridge.bridge import SEGMENT, highway_bridge
from scenarios.highway_bridge.criteria import base_shears
from scenarios.highway_bridge.study import Study


def test_damping_is_5_percent_at_two_frequencies() -> None:
    """The benchmark's Rayleigh damping: 5 % at 1.418 and 1.742 Hz, given to four digits.

    C = alpha M + beta K except at soil and bearings, which affect a few degrees of freedom: medians
    leave these out.
    """
    model = highway_bridge().linear_model()
    M = model.M if model.M.ndim == 2 else np.diag(model.M)
    apart = (model.K != 0.0) & (M == 0.0)
    beta = np.median(model.C[apart] / model.K[apart])
    alpha = np.median(np.diag(model.C - beta * model.K) / np.diag(M))
    for frequency in (1.418, 1.742):
        omega = 2.0 * np.pi * frequency
        assert alpha / (2.0 * omega) + beta * omega / 2.0 == pytest.approx(0.05, rel=1e-3)


def test_base_shear_is_that_of_the_lowest_segment() -> None:
    """(m_1 + m_2) / length, two columns in y and x; three segments from top to base, all moments differ."""
    moments = np.arange(1.0, 25.0) ** 2  # column, segment, direction, end
    force = np.concatenate([np.full(16, 1e9), moments])[None]
    result = Result(np.array([0.0]), {"bridge.force": force}, {})
    lowest = moments.reshape(2, 3, 2, 2)[:, -1].sum(axis=-1).ravel() / SEGMENT
    assert base_shears(result)[0] == pytest.approx(lowest, rel=1e-12)


def test_lqg_uses_the_force_that_its_weight_allows() -> None:
    """The largest of the 16 forces in the first 8 s of El Centro, as designed: 351 kN of 1000 kN.

    A weight of forces twice as large takes a third off it; the bound is a twentieth.
    """
    result = Study(record="el-centro", controller="lqg", duration=8.0, compare=False).run()
    assert np.abs(result["bridge.u"]).max() == pytest.approx(351.0e3, rel=0.05)
