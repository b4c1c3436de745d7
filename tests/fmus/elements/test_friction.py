"""The friction damper against the closed form of its loop."""

from __future__ import annotations

import numpy as np

from fmus.elements.friction import friction
from tests.fmus.elements.paths import check_energy, check_tangent, drive

ELEMENT = friction(np.ones(1), 5.0, 1.3)


def test_a_loop_is_a_parallelogram():
    """Exact up to rounding (1e-12): slip force 1.3 N, sticking over 2 * 1.3/5 m at each return."""
    top, stick = 0.9, 2.0 * 1.3 / 5.0
    out = drive(ELEMENT, [top, top - stick, -top, -top + stick, top])
    np.testing.assert_allclose(out[:, 0], [1.3, -1.3, -1.3, 1.3, 1.3], rtol=1e-12)
    np.testing.assert_allclose(out[1:, 3].sum(), 2 * 1.3 * (2 * top - stick), rtol=1e-12)


def test_the_tangent_is_the_derivative_of_the_force():
    check_tangent(ELEMENT)


def test_energies_account_for_the_work_done_on_the_element():
    check_energy(ELEMENT)
