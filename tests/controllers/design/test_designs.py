"""Reduction, Riccati designs, observer, surfaces: against closed forms, `control`, their conditions."""

import control
import numpy as np
import pytest
import scipy.linalg as la

from controllers.design.design_model import DesignModel, first_order
from controllers.design.reduction import dominant_modes, static_condensation
from controllers.design.riccati import DesignError, regulator
from controllers.design.surface_design import optimal_surface
from controllers.laws.continuous_sliding_mode import ContinuousSlidingMode
from controllers.laws.equivalent_force import design as equivalent_force
from controllers.laws.sliding_mode import SlidingMode
from controllers.laws.state_feedback import StateFeedback, weight_outputs
from controllers.observers.observer import Observer, discretise, observer_gain
from cosim import Array


def chain(n: int = 6) -> tuple[Array, Array, Array]:
    """A chain of unequal masses, springs and dashpots."""
    m = np.linspace(3.0, 1.0, n)
    k = np.linspace(90.0, 40.0, n)
    K = np.diag(k) + np.diag(np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    return np.diag(m), 0.002 * K + 0.01 * np.diag(m), K


def reduced(n: int = 6) -> DesignModel:
    M, C, K = chain(n)
    force = np.zeros((n, 1))
    force[n - 1] = 1.0
    return dominant_modes(M, C, K, force, np.eye(n), keep=[1, 3, 5], measured=[3, 5])


def test_static_condensation_keeps_static_answers() -> None:
    """Loads on kept DOF only: the condensed system gives the same displacements, up to round-off."""
    M, _, K = chain()
    keep = [1, 4, 5]
    M_k, K_k, T = static_condensation(M, K, keep)
    load = np.zeros(6)
    load[keep] = [1.0, -2.0, 0.5]
    x = la.solve(K, load)
    np.testing.assert_allclose(la.solve(K_k, load[keep]), x[keep], rtol=1e-12)
    np.testing.assert_allclose(T @ x[keep], x, rtol=1e-12)
    np.testing.assert_allclose(M_k, T.T @ M @ T, rtol=1e-14)


def test_reduction_keeps_the_lowest_eigenvalues_and_their_response() -> None:
    """Eigenvalues to round-off; at 0.3 omega_1 the static part of three modes of six is missing: 4 %."""
    M, C, K = chain()
    model = reduced()
    full = la.eigvals(first_order(M, C, K))
    lowest = full[np.argsort(np.abs(full))][:6]
    np.testing.assert_allclose(np.sort_complex(la.eigvals(model.A)), np.sort_complex(lowest), rtol=1e-9)
    omega = 0.3 * np.abs(lowest[0])
    force = np.zeros(6)
    force[5] = 1.0
    x = la.solve(K + 1j * omega * C - omega**2 * M, force)
    x_r = la.solve(1j * omega * np.eye(6) - model.A, model.B[:, 0])
    np.testing.assert_allclose(x_r[:3], x[[1, 3, 5]], rtol=0.04)
    y = model.C @ x_r + model.D[:, 0]
    np.testing.assert_allclose(y, -(omega**2) * x_r[1:3], rtol=1e-9)


def test_whole_system_is_not_changed_by_the_reduction() -> None:
    """With all DOF kept nothing is reduced: A, B and the accelerations are those of M, C, K."""
    M, C, K = chain(4)
    force = np.array([[0.0], [1.0], [0.0], [2.0]])
    model = dominant_modes(M, C, K, force, np.eye(4), keep=range(4), measured=[2])
    np.testing.assert_allclose(model.A, first_order(M, C, K), atol=1e-9)
    np.testing.assert_allclose(model.B[4:], la.solve(M, force), atol=1e-11)
    np.testing.assert_allclose(model.D, la.solve(M, force)[[2]], atol=1e-11)
    np.testing.assert_allclose(model.C, first_order(M, C, K)[[6]], atol=1e-9)


def test_regulator_is_that_of_control(rng: np.random.Generator) -> None:
    """Two actuators, cross term; `control.lqr` solves the same equation, both to about 1e-12."""
    A, B = rng.normal(size=(5, 5)), rng.normal(size=(5, 2))
    root = rng.normal(size=(7, 7))
    W = root @ root.T
    Q, N, R = W[:5, :5], W[:5, 5:], W[5:, 5:]
    X, gain = regulator(A, B, Q, R, N)
    wanted, X_c, _ = control.lqr(A, B, Q, R, N)
    np.testing.assert_allclose(gain, wanted, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(X, X_c, rtol=1e-8, atol=1e-9)


def test_regulator_does_not_depend_on_units() -> None:
    """Force in N or MN: the same control; twelve orders in R must not cost digits (1e-8 left of 1e-12)."""
    model = reduced()
    Q = np.diag([3.0, 2.0, 1.0, 0.5, 0.5, 0.5])
    _, K = regulator(model.A, model.B, Q, np.array([[0.1]]))
    _, K_N = regulator(model.A, model.B * 1e-6, Q, np.array([[0.1e-12]]))
    np.testing.assert_allclose(K_N, K * 1e6, rtol=1e-8)


def test_observer_gain_is_the_kalman_gain_with_cross_term() -> None:
    """(2.6), (2.7) against control.care in its dual form."""
    model = reduced()
    S_ww, S_vv = np.diag(np.linspace(1.0, 2.0, 6)), np.diag([1e-3, 2e-3])
    L = observer_gain(model, S_ww, S_vv)
    Q_0, S_0 = model.E @ S_ww @ model.E.T, model.E @ S_ww @ model.F.T
    R_0 = S_vv + model.F @ S_ww @ model.F.T
    _, _, G = control.care(model.A.T, model.C.T, Q_0, R_0, S_0)
    np.testing.assert_allclose(L, np.asarray(G).T, rtol=1e-7, atol=1e-9)
    assert la.eigvals(model.A - L @ model.C).real.max() < 0.0


def run_observer(shift: int) -> float:
    """Largest error in 100 steps of a plant that is the model; the observer gets u_{k-1+shift}."""
    model, h, steps = reduced(), 0.01, 100
    L = observer_gain(model, np.eye(6), 1e-3 * np.eye(2))
    A_o, B_o, L_o = discretise(model, L, h)
    observer = Observer(A_d=A_o, B_d=B_o, L_d=L_o, sample_period=h)
    exponent = la.expm(np.block([[model.A * h, model.B * h], [np.zeros((1, 7))]]))
    A_d, B_d = exponent[:6, :6], exponent[:6, 6:]
    u = np.where(np.arange(steps + 2) % 2, 1.0, -1.0) * np.linspace(1.0, 2.0, steps + 2)
    # y held over the step is an approximation of order h; take a plant sampled the same way
    x = np.zeros(6)
    worst = 0.0
    for k in range(1, steps):
        x = A_d @ x + B_d[:, 0] * u[k - 1]
        y = model.C @ x + model.D[:, 0] * u[k - 1]
        observer.y[:] = y
        observer.u_last[0] = u[k - 1 + shift]
        observer.step(k * h, h)
        worst = max(worst, float(np.abs(observer.x_hat - x).max()))
    return worst


def test_observer_uses_the_force_that_the_measurement_carries() -> None:
    """u_{k-1} belongs to y_k. With u_k the feedthrough does not cancel: the error is larger by an order.

    The error with the right u is that of holding y over 10 ms, not zero.
    """
    right, wrong = run_observer(0), run_observer(1)
    assert wrong > 5.0 * right


def test_observer_converges_from_a_wrong_state() -> None:
    """Without disturbance, (2.8): the error decays at the slowest observer eigenvalue, here within 60 s."""
    model, h = reduced(), 0.01
    L = observer_gain(model, 100.0 * np.eye(6), 1e-3 * np.eye(2))
    A_o, B_o, L_o = discretise(model, L, h)
    observer = Observer(A_d=A_o, B_d=B_o, L_d=L_o, sample_period=h)
    A_d = la.expm(model.A * h)
    x = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    slowest = -la.eigvals(model.A - L @ model.C).real.max()
    first = np.abs(x).max()
    for k in range(6000):
        x = A_d @ x
        observer.y[:] = model.C @ x
        observer.step(k * h, h)
    assert slowest * 60.0 > 5.0
    assert np.abs(observer.x_hat - x).max() < 0.02 * first


def test_sliding_mode_moves_as_designed(rng: np.random.Generator) -> None:
    """s' = -a s - delta sgn s in the model (2.14); linear part: one eigenvalue -a, the others stable."""
    model = reduced()
    Q = np.diag([5.0, 3.0, 2.0, 1.0, 1.0, 0.3])
    law = SlidingMode.design(model, Q, a=2.0, delta=0.01)
    A, B, P = model.A, model.B, law.P
    x = rng.normal(size=6)
    law.x_hat[:] = x
    law.step(0.0, 0.01)
    s_dot = P @ (A @ x + B @ law.u)
    np.testing.assert_allclose(s_dot, -2.0 * law.s - 0.01 * np.sign(law.s), rtol=1e-9)
    np.testing.assert_allclose(law.s, P @ x, rtol=1e-12)
    # with u linear (delta = 0), one eigenvalue is -a, the others are stable
    closed = A - B @ la.solve(P @ B, P @ A + 2.0 * P)
    values = la.eigvals(closed)
    assert np.abs(values + 2.0).min() < 1e-8
    assert values.real.max() < 0.0


def test_sliding_surface_is_optimal(rng: np.random.Generator) -> None:
    """Any other surface costs more: the Lyapunov cost of x_2 = -P_1 z_1 is least at P_1 (two actuators)."""
    A, B = rng.normal(size=(5, 5)), np.vstack([np.zeros((3, 2)), rng.normal(size=(2, 2)) + 2 * np.eye(2)])
    root = rng.normal(size=(5, 5))
    Q = root @ root.T + np.eye(5)
    P = optimal_surface(A, B, Q)
    np.testing.assert_allclose(P[:, 3:], np.eye(2), atol=1e-12)

    def cost(P_1: Array) -> float:
        F = A[:3, :3] - A[:3, 3:] @ P_1
        if la.eigvals(F).real.max() >= 0:
            return np.inf
        T = np.vstack([np.eye(3), -P_1])
        return float(np.trace(la.solve_continuous_lyapunov(F.T, -T.T @ Q @ T)))

    best = cost(P[:, :3])
    for _ in range(20):
        assert cost(P[:, :3] + 1e-3 * rng.normal(size=(2, 3))) > best


def test_continuous_sliding_mode_is_linear_and_approaches_at_its_rate(rng: np.random.Generator) -> None:
    model = reduced()
    law = ContinuousSlidingMode.design(model, np.diag([5.0, 3.0, 2.0, 1.0, 1.0, 0.3]), rate=1.5)
    x = rng.normal(size=6)
    law.x_hat[:] = x
    law.step(0.0, 0.01)
    np.testing.assert_allclose(law.P @ (model.A @ x + model.B @ law.u), -1.5 * (law.P @ x), rtol=1e-9)


def test_force_in_two_blocks_is_the_force_in_one(rng: np.random.Generator) -> None:
    """With switching = -M sgn s the two blocks are (2.15), to round-off."""
    model, Q = reduced(), np.diag([5.0, 3.0, 2.0, 1.0, 1.0, 0.3])
    one = SlidingMode.design(model, Q, a=0.7, delta=0.02)
    surface, force = equivalent_force(model, Q)
    x = rng.normal(size=6)
    one.x_hat[:] = surface.x_hat[:] = force.x_hat[:] = x
    one.step(0.0, 0.01)
    surface.step(0.0, 0.01)
    force.switching = -(0.7 * abs(surface.s) + 0.02) * np.sign(surface.s)
    force.step(0.0, 0.01)
    assert force.u == pytest.approx(float(one.u[0]), rel=1e-12)


def test_output_weights(rng: np.random.Generator) -> None:
    """z' W z expanded by hand."""
    C, D, W = rng.normal(size=(3, 4)), rng.normal(size=(3, 2)), np.diag([1.0, 2.0, 3.0])
    Q, N, R = weight_outputs(C, D, W)
    x, u = rng.normal(size=4), rng.normal(size=2)
    z = C @ x + D @ u
    assert x @ Q @ x + 2 * x @ N @ u + u @ R @ u == pytest.approx(z @ W @ z, rel=1e-12)
    assert StateFeedback.lqr(
        DesignModel(-np.eye(4), np.eye(4)[:, :2], C, C, D, D), Q, R + np.eye(2), N
    ).minus_K.shape == (2, 4)


def test_failing_conditions_name_the_culprit() -> None:
    A = np.diag([0.5, -1.0])
    with pytest.raises(DesignError, match=r"not stabilisable, mode 0\.5.*neither damped nor reached"):
        regulator(A, np.array([[0.0], [1.0]]), np.eye(2), np.eye(1))
    with pytest.raises(DesignError, match=r"R is not positive definite .*actuator 2"):
        regulator(A, np.eye(2), np.eye(2), np.diag([1.0, -0.1]))
    with pytest.raises(DesignError, match="not symmetric"):
        regulator(A, np.eye(2), np.eye(2), np.array([[1.0, 0.2], [0.0, 1.0]]))
    with pytest.raises(DesignError, match=r"fewer than 2 independent ways.*actuator 2"):
        optimal_surface(np.eye(3), np.array([[1.0, 0.0], [2.0, 0.0], [0.5, 0.0]]), np.eye(3))
    M, _C, K = chain()
    with pytest.raises(DesignError, match="must be distinct"):
        static_condensation(M, K, [1, 1])
    free = K.copy()
    free[0], free[:, 0] = 0.0, 0.0
    with pytest.raises(DesignError, match="singular"):
        static_condensation(M, free, [2, 3])
    model = reduced()
    blind = DesignModel(
        np.diag([0.1, -1.0]),
        np.ones((2, 1)),
        np.eye(2),
        np.array([[0.0, 1.0]]),
        np.zeros((1, 1)),
        np.zeros((1, 2)),
    )
    with pytest.raises(DesignError, match=r"observer: not stabilisable, mode 0\.1.*sensor"):
        observer_gain(blind, np.eye(2), np.eye(1))
    with pytest.raises(DesignError, match=r"take one"):
        equivalent_force(
            DesignModel(model.A, np.hstack([model.B, model.B]), model.E, model.C, model.D, model.F), np.eye(6)
        )


def test_singular_PB_is_refused() -> None:
    from controllers.design.surface_design import require_regular

    with pytest.raises(DesignError, match=r"P B is singular.*actuator\s+2"):
        require_regular(np.array([[1.0, 0.0], [2.0, 0.0]]), "law")
