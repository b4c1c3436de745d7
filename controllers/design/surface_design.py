"""Sliding surface by linear-quadratic design (the thesis' 2.3.1).

The model (2.9) is brought to the form (2.10), (2.11): x_2 are the states of the actuators
and z_1 = x_1 - B_1 B_2^-1 x_2, so that the force enters x_2 only.

    z_1' = A_11 z_1 + A_12 x_2                                              (2.10)
    x_2' = A_21 z_1 + A_22 x_2 + B_2 u                                      (2.11)

x_2 is the control of (2.10), for which J = int x' Q x dt is minimised:

    x_2 = -P_1 z_1                                                          (2.12)
    s = P_1 z_1 + x_2 = P x                                                 (2.13)

The printed form assumes B_1 = 0, which a reduction by modes does not give; the
transformation follows Yang, Wu and Agrawal (1995).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from cosim import Array

from .design_model import DesignModel
from .riccati import DesignError, regulator


def optimal_surface(A: Array, B: Array, Q: Array) -> Array:
    """Return P (m, n) of s = P x for x' = A x + B u and the weight Q (n, n)."""
    n, m = B.shape
    # x_2 are the m states that the actuators move most directly
    _, _, order = la.qr(B.T, pivoting=True)
    second = np.sort(order[:m])
    first = np.setdiff1d(np.arange(n), second)
    B_2 = B[second]
    values = np.linalg.svd(B_2, compute_uv=False)
    if values[-1] <= 1e-10 * values[0] or values[0] == 0.0:
        weakest = int(np.argmin(np.linalg.norm(B, axis=0)))
        raise DesignError(
            f"optimal_surface: the forces act in fewer than {m} independent ways "
            f"(det B_2 = 0, look at actuator {weakest + 1}); remove a redundant actuator"
        )
    D = np.eye(n)[np.concatenate([first, second])]
    D[: n - m] -= B[first] @ la.solve(B_2, np.eye(n)[second])
    D_inv = la.inv(D)
    At, Qt = D @ A @ D_inv, D_inv.T @ Q @ D_inv
    a, b = slice(0, n - m), slice(n - m, n)
    _, P_1 = regulator(
        At[a, a], At[a, b], Qt[a, a], 0.5 * (Qt[b, b] + Qt[b, b].T), Qt[a, b], what="optimal_surface",
        names="actuator state", remedy="the surface cannot stabilise it; move the actuator",
    )  # fmt: skip
    return np.asarray(np.hstack([P_1, np.eye(m)]) @ D)


def design_surface(model: DesignModel, Q: Array, what: str) -> tuple[Array, Array, Array]:
    """Return P of the optimal surface, P A and P B; raise DesignError, naming `what`, if P B is singular."""
    P = optimal_surface(model.A, model.B, Q)
    require_regular(P @ model.B, what)
    return P, P @ model.A, P @ model.B


def require_regular(PB: Array, what: str) -> None:
    """Refuse a singular P B, naming the actuator that does not move any surface."""
    values = np.linalg.svd(PB, compute_uv=False)
    if values[-1] <= 1e-12 * max(values[0], np.finfo(float).tiny):
        weakest = int(np.argmin(np.linalg.norm(PB, axis=0)))
        raise DesignError(
            f"{what}: P B is singular (smallest singular value {values[-1]:.2g}); actuator "
            f"{weakest + 1} does not move the surface: change P or remove it"
        )
