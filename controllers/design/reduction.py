"""Smaller models of large structures.

Static condensation (Guyan): K and M of chosen degrees of freedom, which the others follow
statically, x = T x_keep.

Dominant modes (Davison), from the thesis' (2.2) to its (2.3): the eigenvalues of A nearest
to the origin are kept. With their eigenvectors V_1, the rows (V^-1)_1 of V^-1 that belong
to them and a selection S of as many states,

    x_r = S X,  T = S V_1                                                                (1)
    A_r = T Lambda_1 T^-1,  B_r = T (V^-1 B)_1,  E_r = T (V^-1 E)_1                      (2)

and for measured accelerations y = S_y X'

    C_r = S_y V_1 Lambda_1 T^-1,  D_r = S_y V_1 (V^-1 B)_1,  F_r = S_y V_1 (V^-1 E)_1    (3)

The thesis prints D_r = 0 in (2.4), although accelerations carry the force; here it is kept.

Modal truncation: the modes of the lowest frequencies are kept.

    x = Phi eta,  Phi' M Phi = 1,  Phi' K Phi = diag(w^2)                                (4)
    eta'' + Phi' C Phi eta' + w^2 eta = Phi' B_u u - Phi' M I a_g                        (5)

Phi' C Phi is kept whole, since dashpots couple the modes. States are eta, eta'; outputs
are displacements R x, then absolute accelerations S (x'' + I a_g), which carry u and a_g.

Sources: R. J. Guyan, Reduction of stiffness and mass matrices, AIAA Journal 3 (1965) 380,
DOI 10.2514/3.2874. E. J. Davison, A method for simplifying linear dynamic systems, IEEE
Transactions on Automatic Control 11 (1966) 93-101.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg as la

from cosim import Array

from .design_model import DesignModel, first_order
from .riccati import DesignError


def static_condensation(M: Array, K: Array, keep: Sequence[int]) -> tuple[Array, Array, Array]:
    """Return M and K (k, k) of the degrees of freedom `keep`, and T (n, k) with x = T x_keep."""
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
                "static_condensation: the stiffness of the condensed degrees of freedom is singular; "
                "keep one of every part that can move without strain"
            ) from None
    return T.T @ M @ T, T.T @ K @ T, T


def _real_block(vectors: Array, left: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return real V (N, n), W (n, N), L (n, n) of eigenpairs that contain whole complex pairs."""
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
) -> DesignModel:
    """Return the model in displacements and velocities of the degrees of freedom `keep`, (1) to (3).

    M, C, K (n, n); force (n, m) and disturbance (n, p): forces of a unit u and a unit w;
    measured: degrees of freedom whose accelerations are measured. Counted from 0. As many
    modes are kept as degrees of freedom.
    """
    n, k = M.shape[0], len(keep)
    values, vectors = la.eig(first_order(M, C, K))
    left = la.inv(vectors)
    order = np.argsort(np.abs(values), kind="stable")
    chosen = order[: 2 * k]
    if not np.isclose(values[chosen].imag.sum(), 0.0, atol=1e-6 * np.abs(values[chosen]).max()):
        raise DesignError(
            f"dominant_modes: {2 * k} states cut a complex pair in two "
            f"(eigenvalue {values[chosen[-1]]:.4g}); keep one degree of freedom more or less"
        )
    V, W, L = _real_block(vectors[:, chosen], left[chosen], values[chosen])
    states = np.concatenate([np.asarray(keep, int), np.asarray(keep, int) + n])
    T = V[states]
    condition = np.linalg.cond(T / np.linalg.norm(T, axis=0))
    if condition > 1e10:
        raise DesignError(
            f"dominant_modes: the kept modes cannot be told apart at the degrees of freedom {list(keep)} "
            f"(condition {condition:.1e}); choose others, away from common nodes"
        )
    inputs = np.zeros((2 * n, force.shape[1] + disturbance.shape[1]))
    inputs[n:] = la.solve(M, np.hstack([force, disturbance]), assume_a="pos")
    modal = W @ inputs
    T_inv = la.inv(T)
    rows = V[np.asarray(measured, int) + n]
    m = force.shape[1]
    BE, DF = T @ modal, rows @ modal
    return DesignModel(
        A=T @ L @ T_inv, B=BE[:, :m], E=BE[:, m:], C=rows @ L @ T_inv, D=DF[:, :m], F=DF[:, m:]
    )


def modal_state_space(
    M: Array,
    C: Array,
    K: Array,
    influence: Array,
    actuators: Array,
    displacements: Array,
    accelerations: Array,
    modes: int,
) -> tuple[DesignModel, Array]:
    """Return the model of 2 `modes` states, (4) and (5), and Phi (n, modes).

    M, C, K (n, n); influence (n, directions); actuators B_u', displacements R and
    accelerations S are rows (rows, n).
    """
    if not 1 <= modes <= len(M):
        raise DesignError(
            f"modal_state_space: {modes} modes; a structure of {len(M)} degrees of freedom has 1 to {len(M)}"
        )
    w2, Phi = la.eigh(K, M, subset_by_index=[0, modes - 1])
    damping = Phi.T @ C @ Phi
    force, quake = Phi.T @ actuators.T, -Phi.T @ (M @ influence)
    zero, one = np.zeros((modes, modes)), np.eye(modes)
    acceleration = np.hstack([-np.diag(w2), -damping])
    A = np.vstack([np.hstack([zero, one]), acceleration])
    B = np.vstack([np.zeros_like(force), force])
    E = np.vstack([np.zeros_like(quake), quake])
    R, S = displacements @ Phi, accelerations @ Phi
    r = len(R)
    return DesignModel(
        A=A, B=B, E=E,
        C=np.vstack([np.hstack([R, np.zeros_like(R)]), S @ acceleration]),
        D=np.vstack([np.zeros((r, force.shape[1])), S @ force]),
        F=np.vstack([np.zeros((r, quake.shape[1])), accelerations @ influence + S @ quake]),
    ), Phi  # fmt: skip
