"""The viscous damper: its power law, its linear part, its energy."""

from __future__ import annotations

import numpy as np

from fmus.elements.viscous import viscous
from tests.fmus.elements.paths import check_tangent, drive

ELEMENT = viscous(np.ones(1), 3.0, 0.5, 0.02)


def test_the_force_is_a_power_of_the_rate_and_linear_below_rate0():
    """One step of 10 ms from rest has the rate 2 d/h: exact up to rounding (1e-12)."""
    for rate in (-0.8, -0.01, 0.005, 0.3):
        force = drive(ELEMENT, [0.005 * rate])[0, 0]
        slow = abs(rate) <= 0.02
        wanted = 3.0 * rate * 0.02**-0.5 if slow else 3.0 * np.sign(rate) * abs(rate) ** 0.5
        np.testing.assert_allclose(force, wanted, rtol=1e-12)


def test_a_linear_damper_loses_the_work_of_its_mean_force():
    """c d'^2 over a period of sin: pi c w A^2; trapezoidal in 2000 steps leaves (2 pi/2000)^2/12 = 1e-6."""
    A, period, steps = 0.02, 2.0, 2000
    path = A * np.sin(np.linspace(0.0, 4.0 * np.pi, 2 * steps + 1))[1:]
    lost = drive(viscous(np.ones(1), 3.0), path, h=period / steps)[steps:, 3].sum()
    np.testing.assert_allclose(lost, np.pi * 3.0 * (2.0 * np.pi / period) * A**2, rtol=1e-3)


def test_the_tangent_is_the_derivative_of_the_force():
    check_tangent(ELEMENT)
