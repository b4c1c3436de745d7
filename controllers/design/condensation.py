"""Smaller models of large structures (thesis.txt, 2.2.1).

Two steps, each usable alone:

    static_condensation   K and M of chosen DOF, the others follow statically (Guyan)
    dominant_modes        state-order reduction to chosen states (Davison, 1966), (2.2) -> (2.3)

Davison's reduction keeps the n eigenvalues of A nearest to the origin. With the kept
eigenvectors V_1 of A, the rows of V^-1 that belong to them and a selection S of n
states,

    x_r = S X,  T = S V_1,  A_r = T Lambda_1 T^-1,  B_r = T (V^-1 B)_1,  E_r = T (V^-1 E)_1

and for measured accelerations y = S_y X'

    C_yr = S_y V_1 Lambda_1 T^-1,  D_yr = S_y V_1 (V^-1 B)_1,  F_yr = S_y V_1 (V^-1 E)_1   (2.4)

The thesis prints D_yr = 0, although accelerations do carry the force; here it is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from cosim import Array

from .riccati import DesignError


@dataclass(frozen=True)
class StateSpace:
    """x' = A x + B u + E w;  y = C x + D u + F w + v   (2.3), (2.4)."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    E: Array  # (n, p)
    C: Array  # (r, n)
    D: Array  # (r, m)
    F: Array  # (r, p)


def static_condensation(M: Array, K: Array, keep: Sequence[int]) -> tuple[Array, Array, Array]:
    """M and K (k, k) of the DOF `keep`, and the transformation T (n, k): x = T x_keep."""
    n = K.shape[0]
    kept = np.asarray(keep, int)
    if len(set(kept.tolist())) != len(kept) or kept.min() < 0 or kept.max() >= n:
        raise DesignError(f"static_condensation: keep {list(keep)} must be distinct, within 0..{n - 1}")
    rest = np.setdiff1d(np.arange(n), kept)
    T = np.zeros((n, len(kept)))
    T[kept, np.arange(len(kept))] = 1.0
    if len(rest):
        try:
            T[rest] = -la.solve(K[np.ix_(rest, rest)], K[np.ix_(rest, kept)], assume_a="sym")
        except la.LinAlgError:
            raise DesignError(
                "static_condensation: the stiffness of the condensed DOF is singular; "
                "keep a DOF of every part that can move without strain"
            ) from None
    return T.T @ M @ T, T.T @ K @ T, T


def first_order(M: Array, C: Array, K: Array) -> Array:
    """A (2n, 2n) of X = [x, x'] (2.2)."""
    n = M.shape[0]
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:] = -la.solve(M, np.hstack([K, C]), assume_a="pos")
    return A


def _real_block(vectors: Array, left: Array, values: Array) -> tuple[Array, Array, Array]:
    """Real V (N, n), W (n, N), L (n, n) of eigenpairs that contain both members of each pair."""
    V, W, L = [], [], np.zeros((len(values), len(values)))
    i = 0
    for value, v, w in zip(values, vectors.T, left, strict=True):
        if value.imag < 0.0:
            continue
        if value.imag == 0.0:
            V.append(v.real)
            W.append(w.real)
            L[i, i] = value.real
            i += 1
        else:
            V += [v.real, v.imag]
            W += [2.0 * w.real, -2.0 * w.imag]
            L[i : i + 2, i : i + 2] = [[value.real, value.imag], [-value.imag, value.real]]
            i += 2
    return np.column_stack(V), np.vstack(W), L


def dominant_modes(
    M: Array,
    C: Array,
    K: Array,
    force: Array,
    disturbance: Array,
    keep: Sequence[int],
    measured: Sequence[int],
) -> StateSpace:
    """Davison's reduction to displacements and velocities of the DOF `keep` (2.3), (2.4).

    force (n, m) and disturbance (n, p): columns of influence of u and w on the DOF;
    measured: DOF whose accelerations are measured. As many modes are kept as DOF.
    """
    n, k = M.shape[0], len(keep)
    values, vectors = la.eig(first_order(M, C, K))
    left = la.inv(vectors)
    order = np.argsort(np.abs(values), kind="stable")
    chosen = order[: 2 * k]
    if not np.isclose(values[chosen].imag.sum(), 0.0, atol=1e-6 * np.abs(values[chosen]).max()):
        raise DesignError(
            f"dominant_modes: {2 * k} states cut a complex pair in two "
            f"(eigenvalue {values[chosen[-1]]:.4g}); keep one DOF more or less"
        )
    V, W, L = _real_block(vectors[:, chosen], left[chosen], values[chosen])
    states = np.concatenate([np.asarray(keep, int), np.asarray(keep, int) + n])
    T = V[states]
    condition = np.linalg.cond(T / np.linalg.norm(T, axis=0))
    if condition > 1e10:
        raise DesignError(
            f"dominant_modes: the kept modes cannot be told apart at DOF {list(keep)} "
            f"(condition {condition:.1e}); choose DOF away from common nodes"
        )
    inputs = np.zeros((2 * n, force.shape[1] + disturbance.shape[1]))
    inputs[n:] = la.solve(M, np.hstack([force, disturbance]), assume_a="pos")
    modal = W @ inputs
    T_inv = la.inv(T)
    rows = V[np.asarray(measured, int) + n]
    m = force.shape[1]
    BE, DF = T @ modal, rows @ modal
    return StateSpace(A=T @ L @ T_inv, B=BE[:, :m], E=BE[:, m:], C=rows @ L @ T_inv, D=DF[:, :m], F=DF[:, m:])
