"""The alpha-beta filter by its poles, and its steady errors."""

from __future__ import annotations

import numpy as np
import pytest

from controllers.observers.kinematic_observer import KinematicObserver
from tests.cosim.blocks.drive import trace

H = 0.005


@pytest.mark.parametrize("alpha", [0.2, 0.5, 0.8])
def test_poles_are_those_of_the_steady_kalman_filter(alpha: float) -> None:
    """z^2 - (2 - alpha - beta) z + (1 - alpha) with beta = alpha^2 / (2 - alpha), from the free response.

    Two unknowns from 30 equations without noise: least squares leave roundings.
    """
    filter_ = KinematicObserver.design(np.eye(1), np.eye(1), alpha)
    y = np.zeros((32, 1))
    y[0] = 1.0
    x = trace(filter_, y, H, "x")[:, 0]
    (minus_sum, product), *_ = np.linalg.lstsq(np.column_stack([x[1:-1], x[:-2]]), -x[2:], rcond=None)
    beta = alpha**2 / (2.0 - alpha)
    assert minus_sum == pytest.approx(-(2.0 - alpha - beta), rel=1e-9)
    assert product == pytest.approx(1.0 - alpha, rel=1e-9)


def test_a_steady_motion_is_followed_without_error() -> None:
    """y = 3 t: displacement and velocity are exact once the start has decayed (poles of 0.71, 200 steps)."""
    filter_ = KinematicObserver.design(np.eye(1), np.eye(1))
    y = 3.0 * H * np.arange(200.0)[:, None]
    assert trace(filter_, y, H, "x")[-1] == pytest.approx(y[-1], rel=1e-9)
    assert trace(filter_, y, H, "v")[-1] == pytest.approx([3.0], rel=1e-9)
