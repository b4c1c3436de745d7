"""A linear model for the design of controllers and observers.

    x' = A x + B u + E w                    the thesis' (2.3)
    y  = C x + D u + F w + v                the thesis' (2.4)

u are the forces of the actuators, w the disturbance (wind or ground motion), y the
measurements and v their noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from cosim import Array


@dataclass(frozen=True)
class DesignModel:
    """x' = A x + B u + E w;  y = C x + D u + F w + v"""

    A: Array  # (n, n)
    B: Array  # (n, m)
    E: Array  # (n, p)
    C: Array  # (r, n)
    D: Array  # (r, m)
    F: Array  # (r, p)


def first_order(M: Array, C: Array, K: Array) -> Array:
    """Return A (2n, 2n) of X = [x, x'] for M x'' + C x' + K x = 0, the thesis' (2.2)."""
    n = M.shape[0]
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:] = -la.solve(M, np.hstack([K, C]), assume_a="pos")
    return A
