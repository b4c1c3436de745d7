"""Force laws, each against its closed form or an independent integration of its equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.elements import hysteresis as law


def drive(function, parameters, path, h=0.01):
    """Force, stored and lost energy along a path of deformations, one step a point."""
    p = np.zeros((2, 6))
    p[1, : len(parameters)] = parameters
    z0, z = np.zeros((2, 4)), np.zeros((2, 4))
    rate, d0 = 0.0, 0.0
    out = []
    for d in path:
        rate = 2.0 / h * (d - d0) - rate
        out.append(function(1, d, d0, rate, h, p, z0, z))
        z0[:], d0 = z, d
    return np.array(out)


def test_bilinear_loop_has_the_corners_and_the_area_of_the_closed_form():
    """Exact up to rounding (1e-12): between corners the law is linear, and one step reaches a corner."""
    k1, k2, dy, top = 4.8e6, 0.6e6, 0.015, 0.09
    q_y = (k1 - k2) * dy
    out = drive(law.bilinear, (k1, k2, dy), [top, top - 2 * dy, -top, -top + 2 * dy, top])
    assert out[:, 0] == pytest.approx(
        [
            k2 * top + q_y,
            k2 * (top - 2 * dy) - q_y,
            -k2 * top - q_y,
            k2 * (2 * dy - top) + q_y,
            k2 * top + q_y,
        ],
        rel=1e-12,
    )
    assert out[1:, 3].sum() == pytest.approx(4 * q_y * (top - dy), rel=1e-12)  # a full loop


@pytest.mark.parametrize(("function", "parameters"), [
    (law.bilinear, (5.0, 0.7, 0.4)),
    (law.friction, (5.0, 1.3)),
    (law.gap, (4.0, -0.3)),
    (law.bouc_wen, (5.0, 0.1, 0.4, 2.0, 0.6, 0.4)),
    (law.viscous, (3.0, 0.5, 0.02)),
])  # fmt: skip
def test_tangent_is_the_derivative_of_the_force(function, parameters):
    """Central differences with 1e-6 leave a relative error near 1e-8; 1e-5 leaves room at curvature."""
    p = np.zeros((1, 6))
    p[0, : len(parameters)] = parameters
    z0, z = np.zeros((1, 4)), np.zeros((1, 4))
    z0[0, 0] = 0.05
    for d in (-0.9, -0.31, 0.1, 0.2, 0.8):
        h, d0, rate0 = 0.01, 0.15, 0.2

        def force(x, d0=d0, h=h, rate0=rate0):
            return function(0, x, d0, 2.0 / h * (x - d0) - rate0, h, p, z0, z)[:2]

        slope = (force(d + 1e-6)[0] - force(d - 1e-6)[0]) / 2e-6
        assert force(d)[1] == pytest.approx(slope, rel=1e-5, abs=1e-5)


def test_energies_account_for_the_work_done_on_the_element():
    """Work by the trapezoid of 20,000 steps; its kinks leave 1e-5 of the work of a yielding law."""
    path = 0.9 * np.sin(np.linspace(0.0, 13.0, 20_001)) * np.linspace(0.2, 1.0, 20_001)
    for function, parameters in [
        (law.bilinear, (5.0, 0.7, 0.4)),
        (law.friction, (5.0, 1.3)),
        (law.gap, (4.0, 0.3)),
        (law.bouc_wen, (5.0, 0.1, 0.4, 2.0, 0.6, 0.4)),
    ]:
        out = drive(function, parameters, path)
        mean = 0.5 * (out[1:, 0] + out[:-1, 0])
        work = (mean * np.diff(path)).sum()
        assert out[-1, 2] - out[0, 2] + out[1:, 3].sum() == pytest.approx(work, rel=1e-5)
        assert (out[:, 3] >= -1e-12).all()


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
    out = drive(law.bouc_wen, (k1, alpha, dy, n, beta, gamma), d[1:])
    assert np.abs(out[:, 0] - alpha * k1 * d[1:] - (1 - alpha) * k1 * dy * z[1:]).max() < 2e-5 * k1 * dy


def segment_path(path, late=0.0):
    k11, k12, r, M_y, EI = 3.4e4, -2.3e4, 0.02, 50.0, 2.1e4
    p = np.tile([k11, k12, r, M_y, late, EI], (3, 1))
    z0, z = np.zeros((3, 4)), np.zeros((3, 4))
    force, tangent, coupling = np.zeros(3), np.zeros(3), np.zeros(3)
    d0, history, energy = np.zeros(3), [], np.zeros(2)
    for theta in path:
        d = np.array([0.0, *theta])
        stored, lost = law.segment(1, d, d0, p, z0, z, force, tangent, coupling)
        energy += [0.0, lost]
        energy[0] = stored
        history.append(force[1:].copy())
        z0[:], d0 = z, d
    return np.array(history), energy, (tangent[1], coupling[1], tangent[2]), z


def test_segment_in_uniform_bending_is_bilinear_in_moment_and_curvature():
    """theta and -theta: both ends yield at once, dm = (k11 - k12) dtheta with r beyond My.

    Exact up to rounding: the events are found in closed form.
    """
    k, r, M_y = 3.4e4 + 2.3e4, 0.02, 50.0
    theta_y = M_y / k
    moments, _, _, z = segment_path([(4 * theta_y, -4 * theta_y), (0.0, 0.0)])
    top = M_y * (1.0 + 3.0 * r)
    assert moments[0] == pytest.approx([top, -top], rel=1e-12)
    # back by 4 theta_y: elastic over 2 theta_y, then yielding the other way
    assert moments[1] == pytest.approx(
        [top - 2 * M_y - 2 * r * M_y] * 1 + [-(top - 2 * M_y - 2 * r * M_y)], rel=1e-12
    )
    assert z[1, 3] == pytest.approx(
        (1 / r - 1) / 2.1e4 * (3 * r - 2 * r) * M_y, rel=1e-9
    )  # plastic curvature


def test_segment_does_not_depend_on_how_a_straight_path_is_cut():
    """The path within a step is followed exactly, so 1 step or 57 give the same (1e-10)."""
    end = (6e-3, -1e-3)
    coarse = segment_path([end])
    fine = segment_path([(a * end[0], a * end[1]) for a in np.linspace(0, 1, 58)[1:]])
    assert fine[0][-1] == pytest.approx(coarse[0][-1], rel=1e-10)
    assert fine[1] == pytest.approx(coarse[1], rel=1e-10)


def test_segment_tangents_are_those_of_two_parallel_components():
    """One hinge: r k + (1 - r) (k11 - k12^2/k11) at the far end; both: r k."""
    k11, k12, r = 3.4e4, -2.3e4, 0.02
    one = segment_path([(2e-3, 5e-4)])[2]
    assert one == pytest.approx((r * k11, r * k12, r * k11 + (1 - r) * (k11 - k12**2 / k11)), rel=1e-12)
    both = segment_path([(9e-3, -9e-3)])[2]
    assert both == pytest.approx((r * k11, r * k12, r * k11), rel=1e-12)


@pytest.mark.parametrize("steps", [40, 101, 333])
def test_late_events_overshoot_by_at_most_one_elastic_step(steps):
    """The step in which My is passed is taken with the elastic tangent; afterwards both run parallel."""
    k, r = 3.4e4 + 2.3e4, 0.02
    end = np.array([9e-3, -9e-3])
    exact = segment_path([end])[0][-1]
    late = segment_path([a * end for a in np.linspace(0, 1, steps + 1)[1:]], late=1.0)[0][-1]
    assert 0.0 < late[0] - exact[0] <= (1.0 - r) * k * 9e-3 / steps * (1.0 + 1e-9)
