"""A few modes of a large structure as a state space for controller design.

    x = Phi eta,  Phi' M Phi = 1,  Phi' K Phi = diag(w^2), the lowest w
    eta'' + Phi' C Phi eta' + w^2 eta = Phi' B_u u - Phi' M I a_g

Phi' C Phi is kept whole: dashpots couple the modes. States are eta, eta'; outputs are
displacements R x, then absolute accelerations S (x'' + I a_g), which carry u and a_g.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from cosim import Array

from .condensation import StateSpace


def modal_state_space(
    M: Array,
    C: Array,
    K: Array,
    influence: Array,
    actuators: Array,
    displacements: Array,
    accelerations: Array,
    modes: int,
) -> tuple[StateSpace, Array]:
    """The model (2 modes states), and Phi (n, modes): M is (n), the rows are (rows, n)."""
    if not 1 <= modes <= len(M):
        raise ValueError(f"modal_state_space: {modes} modes; a structure of {len(M)} DOF has 1 to {len(M)}")
    w2, Phi = la.eigh(K, np.diag(M), subset_by_index=[0, modes - 1])
    damping = Phi.T @ C @ Phi
    force, quake = Phi.T @ actuators.T, -Phi.T @ (M[:, None] * influence)
    zero, one = np.zeros((modes, modes)), np.eye(modes)
    acceleration = np.hstack([-np.diag(w2), -damping])
    A = np.vstack([np.hstack([zero, one]), acceleration])
    B = np.vstack([np.zeros_like(force), force])
    E = np.vstack([np.zeros_like(quake), quake])
    R, S = displacements @ Phi, accelerations @ Phi
    r = len(R)
    return StateSpace(
        A=A, B=B, E=E,
        C=np.vstack([np.hstack([R, np.zeros_like(R)]), S @ acceleration]),
        D=np.vstack([np.zeros((r, force.shape[1])), S @ force]),
        F=np.vstack([np.zeros((r, quake.shape[1])), accelerations @ influence + S @ quake]),
    ), Phi  # fmt: skip
