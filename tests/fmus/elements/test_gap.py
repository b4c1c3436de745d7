"""The gap: open, closed, in both directions."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.gap import gap
from tests.fmus.elements.paths import check_energy, check_tangent, drive

ELEMENT = gap(np.ones(1), 4.0, 0.3)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_gap_acts_only_when_it_has_closed(direction):
    """Exact: force 4 (0.5 - 0.3), energy 4 (0.5 - 0.3)^2/2, whichever way it closes."""
    out = drive(gap(np.ones(1), 4.0, 0.3 * direction), np.array([0.29, 0.5, -0.5]) * direction)
    np.testing.assert_allclose(out[:, 0], [0.0, 0.8 * direction, 0.0], rtol=1e-15)
    np.testing.assert_allclose(out[:, 2], [0.0, 0.08, 0.0], rtol=1e-15)


def test_the_tangent_is_the_derivative_of_the_force():
    check_tangent(ELEMENT)


def test_energies_account_for_the_work_done_on_the_element():
    check_energy(ELEMENT)
