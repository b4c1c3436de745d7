"""The wavelet network: its equations one by one, its learning, and its bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controllers.adaptive.scwnn import SCWNN, adapt_nodes, hidden_layer, membership, surface
from cosim import Continuous, Input, Output, State, System, simulate

HAT = 2.0 / (math.sqrt(3.0) * math.pi**0.25)


def phi_of(X, c, sigma):
    zeta2 = (((X - c) / sigma) ** 2).sum(axis=1)
    return HAT * (1.0 - zeta2) * np.exp(-0.5 * zeta2)


def test_first_step_is_the_equations_of_the_thesis():
    """One step from given weights against the formulas in NumPy; the same sums, so to rounding."""
    rng = np.random.default_rng(4)
    p, T = 3, 0.005
    net = SCWNN.design(p, 6, g_min=2.0, s_max=5.0, u_max=40.0, eta_sigma=0.0, eta_c=0.0, leak=0.3)
    net.count, net.sample = 4.0, 7.0  # four nodes, not the first sample
    for name in ("c", "w", "theta", "b", "r", "integral"):
        view = getattr(net, name)
        view[...] = rng.standard_normal(view.shape)
    net.sigma[...] = rng.uniform(1.0, 3.0, net.sigma.shape)
    net.u[...] = 40.0 * rng.uniform(-0.5, 0.5, p)
    net.x[...], net.v[...] = 0.02 * rng.standard_normal(p), 0.02 * rng.standard_normal(p)
    w, theta, b, r = (getattr(net, n).copy() for n in ("w", "theta", "b", "r"))
    e, v, u, integral = net.x.copy(), net.v.copy(), net.u / 40.0, net.integral + T * net.x
    X = np.concatenate([e, v])
    s = v + 100.0 * e + 100.0 * integral  # (3.6)
    phi = phi_of(X, net.c[:4], net.sigma[:4])  # (3.14)
    w[:4] += T * np.outer(phi, s)  # (3.45)
    theta[:4] += T * np.outer(phi, s * u)  # (3.46)
    b += T * np.outer(s, X)  # (3.47)
    P = 0.001
    f = (0.01 * w[:4] + P * np.outer(phi, s)).T @ phi + (0.01 * b + P * np.outer(s, X)) @ X  # (3.20)
    g = (0.01 * theta[:4] + P * np.outer(phi, s * u)).T @ phi  # (3.19)
    mu = np.clip(s / 5.0, -1.0, 1.0)
    r -= T * (10.0 * s * mu + 0.3 * r)  # (3.60) with the leak
    u_a = P * s * (phi @ phi + X @ X + u * u * (phi @ phi)) + r * mu  # (3.51), (3.53)
    wanted = (-f - 100.0 * v - 100.0 * e + u_a) / np.maximum(g, 2.0)  # (3.8)
    net.step(0.0, T)
    assert net.s == pytest.approx(s, rel=1e-12)
    assert net.f == pytest.approx(f, rel=1e-12)
    assert net.r == pytest.approx(r, rel=1e-12)
    assert net.u == pytest.approx(40.0 * np.clip(wanted, -1.0, 1.0), rel=1e-12)


def test_centres_and_widths_follow_the_gradient_of_the_wavelets():
    """(3.48), (3.49): eta sum_j s_j (w_j + u_j theta_j) d phi/d sigma, the derivative by differences
    of 1e-6, which leave 1e-8 of it."""
    rng = np.random.default_rng(5)
    p, T, eta = 2, 0.01, 0.7
    net = SCWNN.design(p, 3, eta_sigma=eta, eta_c=eta, eta_pw=0.0, eta_pt=0.0, u_max=1.0)
    net.count, net.sample = 3.0, 5.0
    for name in ("c", "w", "theta"):
        getattr(net, name)[...] = rng.standard_normal(getattr(net, name).shape)
    net.sigma[...] = rng.uniform(1.0, 2.0, net.sigma.shape)
    net.x[...], net.v[...], net.u[...] = 0.3, -0.2, (0.4, -0.9)
    surface(net, T)
    hidden_layer(net)
    c, sigma, X = net.c.copy(), net.sigma.copy(), net.X.copy()
    pull = (net.s * (0.01 * net.w + net.u * 0.01 * net.theta)).sum(axis=1)
    expected_c, expected_sigma = c.copy(), sigma.copy()
    for i in range(3):
        for m in range(4):
            step = np.zeros_like(c)
            step[i, m] = 1e-6
            slope_c = (phi_of(X, c + step, sigma)[i] - phi_of(X, c - step, sigma)[i]) / 2e-6
            slope_sigma = (phi_of(X, c, sigma + step)[i] - phi_of(X, c, sigma - step)[i]) / 2e-6
            expected_c[i, m] += T * eta * pull[i] * slope_c
            expected_sigma[i, m] += T * eta * pull[i] * slope_sigma
    adapt_nodes(net, T)
    assert net.c == pytest.approx(expected_c, abs=1e-9)
    assert net.sigma == pytest.approx(expected_sigma, abs=1e-9)


def test_seven_triangles_sum_to_an_interpolation():
    """mu_sum from the seven memberships of figure 3.3 with weights -1, -2/3, ..., 1 (3.53)."""
    peaks = np.linspace(-1.0, 1.0, 7)
    for s in (-3.0, -0.8, -0.1, 0.0, 0.45, 1.0, 2.0):
        mu = np.maximum(0.0, 1.0 - np.abs(np.clip(s, -1, 1) - peaks) * 3.0)
        assert mu.sum() == pytest.approx(1.0)
        assert membership(s) == pytest.approx(mu @ peaks, abs=1e-12)


def test_memory_is_fixed_and_says_when_it_is_full():
    """Inputs that never repeat need a node each; three fit, the others are counted."""
    net = SCWNN.design(1, 3, E3=0.0)
    for k in range(30):
        net.x[0], net.v[0] = 1.0 + k, -k
        net.step(0.0, 0.005)
    assert net.nodes == 3.0
    assert net.full > 20.0


class Oscillators(Continuous):
    """Two coupled masses, a cubic spring and quadratic drag, under harmonic forces."""

    u = Input("control", shape=2, unit="N")
    x = State((0.5, -0.3), "displacements", shape=2, unit="m")
    v = State(0.0, "velocities", shape=2, unit="m/s")
    f = Output("function that the network must learn", shape=2)

    def derivatives(self, t: float) -> None:
        a, b = self.x[0], self.x[1]
        self.f[0] = -4.0 * a - 30.0 * a**3 + 2.0 * (b - a) - 0.1 * self.v[0] + 1.5 * math.sin(2.0 * t)
        self.f[1] = -6.0 * b + 2.0 * (a - b) - 0.8 * self.v[1] * abs(self.v[1]) + math.sin(3.1 * t)
        for i in range(2):
            self.der_x[i] = self.v[i]
            self.der_v[i] = self.f[i] + 1.2 * self.u[i]

    def outputs(self, t: float) -> None:
        pass


def controlled(**rates):
    net = SCWNN.design(2, 30, u_max=10.0, g_min=1.0, k1=2.0, k2=1.0, s_max=1.0, **rates)
    links = [("plant.x", "net.x"), ("plant.v", "net.v"), ("net.u", "plant.u")]
    ports = ["plant.x", "net.s", "net.nodes", "net.r", "net.f"]
    return simulate(System({"plant": Oscillators(), "net": net}, links), step=0.005, stop=100.0, record=ports)


def error(result, first, last):
    """RMS displacement between two times in s."""
    x = result["plant.x"][round(first / 0.005) : round(last / 0.005)]
    return np.sqrt((x**2).mean())


def test_network_learns_a_nonlinear_system_while_it_controls_it():
    """Against the same controller that does not learn: after 30 s the error is at most a quarter
    (found: an eighth), and it has fallen tenfold from the first 10 s."""
    without = controlled(
        eta_r=0.0,
        eta_pw=0.0,
        eta_iw=0.0,
        eta_pb=0.0,
        eta_ib=0.0,
        eta_pt=0.0,
        eta_it=0.0,
        eta_c=0.0,
        eta_sigma=0.0,
    )
    learning = controlled(eta_r=0.0, eta_iw=50.0, eta_ib=50.0)
    assert error(learning, 30, 100) < 0.25 * error(without, 30, 100)
    assert error(learning, 30, 100) < 0.1 * error(learning, 0, 10)
    change = np.diff(learning["net.nodes"])
    assert (change > 0).sum() > 10
    assert (change < 0).sum() > 10


def test_compensated_network_stays_bounded_and_its_surface_is_kept():
    """With (3.60), the mean of 1/2 s^2 over 10 s does not grow from window to window by more than 5 %
    (the rest is the response to the harmonic load), and r and f stay bounded for 100 s."""
    result = controlled(eta_r=1.0, eta_iw=50.0, eta_ib=50.0)
    V = 0.5 * (result["net.s"][:20000] ** 2).sum(axis=1).reshape(10, 2000).mean(axis=1)
    assert (V[1:] < 1.05 * V[:-1]).all(), V
    assert V[-1] < 0.05 * V[0]  # found: 0.02
    assert np.abs(result["net.r"]).max() < 10.0
    late, early = (np.abs(result["net.f"][a:b]).max() for a, b in ((15000, 20000), (5000, 10000)))
    assert late < 1.5 * early
