"""The linear plants of host.py as matrices, and their exact response to held inputs."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.signal import cont2discrete

from fmus.plants.shear_building import stiffness_matrix

#: of the largest value: both sides are exact but for rounding, 1e-16 in each of 1000 steps
EXACT = 1e-12


def linear_oscillator(m: float = 1.0, c: float = 0.001, k: float = 0.01) -> tuple[np.ndarray, ...]:
    """A, B, C, D of the oscillator with inputs (u, d) and outputs (a, x, v)."""
    A = np.array([[0.0, 1.0], [-k / m, -c / m]])
    B = np.array([[0.0, 0.0], [1.0 / m, 1.0]])
    return A, B, np.vstack([A[1], np.eye(2)]), np.vstack([B[1], np.zeros((2, 2))])


def linear_building() -> tuple[np.ndarray, ...]:
    """A, B, C, D of the building in host.py: inputs ground, force; outputs acceleration, base shear, x."""
    m, k, zeta = np.array([3.0, 2.0, 1.5]), np.array([3000.0, 2000.0, 1000.0]), np.array([0.02, 0.03, 0.05])
    M, K = np.diag(m), stiffness_matrix(k)
    squares, modes = eigh(K, M)
    damping = M @ modes @ np.diag(2.0 * zeta * np.sqrt(squares)) @ modes.T @ M
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, damping)]])
    B = np.block([[np.zeros((3, 4))], [-np.ones((3, 1)), np.linalg.inv(M)]])
    absolute = B[3:].copy()
    absolute[:, 0] = 0.0
    shear = np.zeros((1, 6))
    shear[0, 0] = k[0]
    C = np.vstack([A[3:], shear, np.eye(6)[:3]])
    return A, B, C, np.vstack([absolute, np.zeros((4, 4))])


def exact(system: tuple[np.ndarray, ...], x0: np.ndarray, u: np.ndarray, h: float) -> np.ndarray:
    """Outputs at t_0 .. t_n, at t_k with the input held over the step that ends there (at t_0: u[0])."""
    A, B, C, D = system
    Ad, Bd, *_ = cont2discrete((A, B, C, D), h, method="zoh")
    x, rows = x0, [C @ x0 + D @ u[0]]
    for held in u[:-1]:
        x = Ad @ x + Bd @ held
        rows.append(C @ x + D @ held)
    return np.array(rows)


def relative(computed: np.ndarray, expected: np.ndarray) -> float:
    return float((np.abs(computed - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())
