"""The checks that all laws share find a wrong tangent and a wrong energy, whatever the scale."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.element import Element
from tests.fmus.elements.paths import check_energy, check_tangent

CORNERS = (0.01, 0.03)  # m
SLOPES = (2e6, 0.0, 9e6)  # N/m between the corners


def trilinear(wrong_tangent=(1.0, 1.0, 1.0), wrong_energy=1.0) -> Element:
    """Make an elastic element with three branches, whose tangents and energy are multiplied."""

    def law(e, d, d0, rate, h, p, z0, z):
        x, corner, force, energy, branch = abs(d), 0.0, 0.0, 0.0, 0
        while branch < 2 and x > CORNERS[branch]:
            length = CORNERS[branch] - corner
            energy += force * length + 0.5 * SLOPES[branch] * length**2
            force += SLOPES[branch] * length
            corner = CORNERS[branch]
            branch += 1
        k, x = SLOPES[branch], x - corner
        tangent = k + max(k, 1e3) * (wrong_tangent[branch] - 1.0)
        energy += force * x + 0.5 * k * x**2
        return np.copysign(force + k * x, d), tangent, energy * wrong_energy, 0.0

    return Element(law, np.ones(1), (), k0=SLOPES[0], scale=CORNERS[0])


def test_a_right_law_passes():
    check_tangent(trilinear())
    check_energy(trilinear())


@pytest.mark.parametrize("branch", [0, 1, 2])
def test_a_wrong_tangent_is_found_in_each_branch(branch):
    """One in a hundred wrong, and 10 N/m in the flat branch, which is 1e-6 of the steepest."""
    with pytest.raises(AssertionError, match="N/m, but the force has the slope"):
        check_tangent(trilinear(wrong_tangent=[1.01 if i == branch else 1.0 for i in range(3)]))


def test_a_wrong_energy_is_found():
    with pytest.raises(AssertionError):
        check_energy(trilinear(wrong_energy=1.001))
