"""The bilinear law against the closed form of its loop."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.bilinear import bilinear
from tests.fmus.elements.paths import check_energy, check_tangent, drive

ELEMENT = bilinear(np.ones(1), 5.0, 0.7, 0.4)


def test_bilinear_loop_has_the_corners_and_the_area_of_the_closed_form():
    """Exact up to rounding (1e-12): between corners the law is linear, and one step reaches a corner."""
    k1, k2, dy, top = 4.8e6, 0.6e6, 0.015, 0.09
    q_y = (k1 - k2) * dy
    out = drive(bilinear(np.ones(1), k1, k2, dy), [top, top - 2 * dy, -top, -top + 2 * dy, top])
    upper, lower = k2 * top + q_y, k2 * (top - 2 * dy) - q_y
    assert out[:, 0] == pytest.approx([upper, lower, -upper, -lower, upper], rel=1e-12)
    assert out[1:, 3].sum() == pytest.approx(4 * q_y * (top - dy), rel=1e-12)  # a full loop


def test_the_tangent_is_the_derivative_of_the_force():
    check_tangent(ELEMENT)


def test_energies_account_for_the_work_done_on_the_element():
    check_energy(ELEMENT)
