"""Algebraic Riccati equations of regulators and observers, with errors that name the cause.

    A' X + X A - (X B + N) R^-1 (B' X + N') + Q = 0                         (1)
    gain = R^-1 (B' X + N')                                                 (2)

SciPy solves (1) by Schur's method. The conditions for a solution are checked first, so that
an error names the mode or the actuator that violates them.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from cosim import Array, CosimError


class DesignError(CosimError):
    """The conditions of a control design do not hold."""


def require_positive(R: Array, what: str, names: str = "actuator") -> None:
    """Refuse a weight that is not symmetric positive definite, naming the channel."""
    if not np.allclose(R, R.T, rtol=1e-10, atol=0.0):
        raise DesignError(f"{what}: R is not symmetric; use (R + R')/2")
    values, vectors = la.eigh(R)
    if values[0] <= 0.0:
        channel = int(np.argmax(np.abs(vectors[:, 0])))
        raise DesignError(
            f"{what}: R is not positive definite (eigenvalue {values[0]:.3g}, mainly {names} "
            f"{channel + 1}); give every {names} a positive weight"
        )


def require_stabilisable(A: Array, B: Array, what: str, remedy: str) -> None:
    """Refuse a pair with an undamped or unstable mode that B does not reach (Hautus test)."""
    scale = max(float(np.linalg.norm(A, 2)), 1.0)
    b = max(float(np.linalg.norm(B, 2)), float(np.finfo(float).tiny))
    for value in la.eigvals(A):
        if value.real < -1e-10 * scale:
            continue
        pencil = np.hstack([A - value * np.eye(len(A)), B * (scale / b)])
        if np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-9 * scale:
            raise DesignError(
                f"{what}: not stabilisable, mode {value.real:.4g}{value.imag:+.4g}j 1/s "
                f"({abs(value) / (2 * np.pi):.4g} Hz) is neither damped nor reached; {remedy}"
            )


def regulator(
    A: Array,
    B: Array,
    Q: Array,
    R: Array,
    N: Array | None = None,
    what: str = "regulator",
    names: str = "actuator",
    remedy: str = "move or add an actuator",
) -> tuple[Array, Array]:
    """Return the stabilising solution X (n, n) of (1) and the gain (m, n) of (2)."""
    require_positive(R, what, names)
    require_stabilisable(A, B, what, remedy)
    # Scaled to R = 1 and |B| = 1: SI forces and masses differ by twelve orders from states.
    root_inv = la.inv(la.cholesky(R, lower=False))  # R^-1 = root_inv root_inv'
    Bs = B @ root_inv
    c = 1.0 / max(np.linalg.norm(Bs, 2), np.finfo(float).tiny)
    Ns = np.zeros_like(Bs) if N is None else N @ root_inv
    try:
        # X = c^2 Y:  A'Y + Y A - (Y cB + N/c)(..)' + Q/c^2 = 0
        Y = la.solve_continuous_are(A, c * Bs, Q / c**2, np.eye(B.shape[1]), s=Ns / c)
    except (la.LinAlgError, ValueError) as error:
        raise DesignError(
            f"{what}: the Riccati equation has no stabilising solution ({error}); an undamped mode "
            "has no weight in Q; add one"
        ) from error
    X = c**2 * Y
    return X, root_inv @ (Bs.T @ X + Ns.T)
