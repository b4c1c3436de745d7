"""A small tower that tests of plants and of exports share."""

import numpy as np
import scipy.linalg as la

from fmus.structures.structure import Structure


def small_tower() -> Structure:
    """Five floors, classically damped, two modes overdamped."""
    M = np.diag([3.0, 2.5, 2.0, 2.0, 1.5]) * 1e6
    k = np.array([9.0, 8.0, 6.0, 5.0, 4.0]) * 1e8
    K = np.diag(k) + np.diag(np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    omega2, shapes = la.eigh(K, M)
    zeta = np.array([0.01, 0.05, 0.6, 1.3, 2.0])
    left = M @ shapes
    return Structure(M, (left * (2 * zeta * np.sqrt(omega2))) @ left.T, K)
