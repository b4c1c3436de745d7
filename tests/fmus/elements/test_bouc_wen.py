"""The Bouc-Wen law against an adaptive solution of its equation."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from fmus.elements.bouc_wen import bouc_wen
from tests.fmus.elements.paths import check_energy, check_tangent, drive

ELEMENT = bouc_wen(np.ones(1), 5.0, 0.1, 0.4, 2.0, 0.6, 0.4)


def test_bouc_wen_follows_its_differential_equation():
    """Against an adaptive Runge-Kutta solution to 1e-10; the implicit midpoint rule with 5,000
    steps over 12 rad has a truncation error near (12/5000)^2 = 6e-6."""
    k1, alpha, dy, n, beta, gamma = 5.0, 0.1, 0.4, 1.6, 0.6, 0.4

    def z_dot(t, z):
        v = 1.5 * np.cos(t)
        return v / dy * (1.0 - abs(z) ** n * (gamma + beta * np.sign(v * z)))

    t = np.linspace(0.0, 12.0, 5001)
    z = solve_ivp(z_dot, (0, 12), [0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.01).y[0]
    d = 1.5 * np.sin(t)
    out = drive(bouc_wen(np.ones(1), k1, alpha, dy, n, beta, gamma), d[1:])
    assert np.abs(out[:, 0] - alpha * k1 * d[1:] - (1 - alpha) * k1 * dy * z[1:]).max() < 2e-5 * k1 * dy


def test_the_tangent_is_the_derivative_of_the_force():
    check_tangent(ELEMENT)


def test_energies_account_for_the_work_done_on_the_element():
    check_energy(ELEMENT)
