"""Modal truncation, the kinematic observer and viscous dampers."""

from __future__ import annotations

import numpy as np
import pytest

from controllers.design.reduction import modal_state_space
from controllers.laws.viscous_dampers import ViscousDampers
from controllers.observers.kinematic_observer import KinematicObserver


def structure(n=6):
    """Unequal masses and springs, damping that is not proportional."""
    rng = np.random.default_rng(2)
    M = rng.uniform(1.0, 3.0, n)
    K = np.zeros((n, n))
    for i in range(n):
        k = rng.uniform(500.0, 900.0)
        K[i, i] += k
        if i:
            K[i - 1, i - 1] += k
            K[i - 1, i] -= k
            K[i, i - 1] -= k
    C = 0.002 * K
    C[2, 2] += 5.0
    return np.diag(M), C, K


def test_all_modes_give_the_structure_itself():
    """With every mode kept, responses at a frequency are those of (K - w^2 M + i w C)^-1; condition
    numbers near 1e3 leave 1e-10."""
    M, C, K = structure()
    influence, rows = np.ones((6, 1)), np.eye(6)
    model, Phi = modal_state_space(M, C, K, influence, rows[[1, 4]], rows[[0, 5]], rows[[2]], 6)
    assert Phi.T @ M @ Phi == pytest.approx(np.eye(6), abs=1e-12)
    w = 9.0
    x = np.linalg.solve(K - w**2 * M + 1j * w * C, np.column_stack([rows[1], rows[4], -np.diag(M)]))
    resolvent = np.linalg.inv(1j * w * np.eye(12) - model.A)
    y = model.C @ resolvent @ np.hstack([model.B, model.E]) + np.hstack([model.D, model.F])
    acceleration = -(w**2) * x[2] + [0.0, 0.0, 1.0]  # absolute
    assert np.abs(y - np.vstack([x[0], x[5], acceleration])).max() < 1e-10


def test_truncation_keeps_the_lowest_frequencies():
    M, C, K = structure()
    rows = np.eye(6)
    model, _ = modal_state_space(M, 0 * C, K, np.ones((6, 1)), rows[[1]], rows[[0]], rows[[2]], 2)
    full = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    assert np.sort(np.abs(np.linalg.eigvals(model.A)))[::2] == pytest.approx(np.sort(full)[:2], rel=1e-9)


def test_observer_follows_a_ramp_without_error():
    """An alpha-beta filter has no steady error on constant velocity: to rounding after 200 samples."""
    places = np.array([[1.0, 2.0], [1.0, -0.5], [1.0, 0.0]])
    observer = KinematicObserver.design(places, places[:2])
    motion = np.array([0.3, -0.2])
    for k in range(300):
        observer.y[...] = places[:2] @ motion * (k * 0.005)
        observer.step(k * 0.005, 0.005)
    assert observer.v == pytest.approx(places @ motion, rel=1e-9)
    assert observer.x == pytest.approx(places @ motion * 299 * 0.005, rel=1e-9)


def test_observer_refuses_sensors_that_miss_a_motion():
    places = np.array([[1.0, 2.0], [1.0, -0.5]])
    with pytest.raises(ValueError, match="add a sensor"):
        KinematicObserver.design(places, places[:1])


def test_dampers_oppose_velocity_up_to_their_limit():
    dampers = ViscousDampers(p=3, c=50.0, limit=20.0)
    dampers.v[...] = (0.1, -0.3, 9.0)
    dampers.step(0.0, 0.01)
    assert dampers.u == pytest.approx([-5.0, 15.0, -20.0])
