"""Observer of a reduced model from noisy measurements (the thesis' 2.2.2).

    x_hat' = A x_hat + B u + L (y - C x_hat - D u)                          (2.5)
    L = (P_0 C' + S_0) R_0^-1                                               (2.6)
    Q_0 = E S_ww E',  S_0 = E S_ww F',  R_0 = S_vv + F S_ww F'              (2.7)
    e' = (A - L C) e + E w - L (F w + v)                                    (2.8)

P_0 solves the Riccati equation of the filter with the cross term S_0: the disturbance that
moves the structure is in the measured accelerations too.

Which sample: y_k is measured at t_k and carries the force held over [t_{k-1}, t_k]. The
block takes that force as `u_last` and closes the step that ends at t_k,

    x_hat_k = A_d x_hat_{k-1} + B_d u_{k-1} + L_d y_k                       (1)

which is the exact solution of (2.5) for u and y constant over the step. With the force of
the next step instead, D u does not cancel and the estimate is wrong from the first step on.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from cosim import Array, Block, Input, Local, Parameter, State
from cosim.functions import assign, matvec, matvec_add

from ..design.design_model import DesignModel
from ..design.riccati import regulator


def observer_gain(model: DesignModel, S_ww: Array, S_vv: Array) -> Array:
    """Return L (n, r) of (2.6); S_ww (p, p) and S_vv (r, r) are the spectral densities of w and v."""
    Q_0 = model.E @ S_ww @ model.E.T
    S_0 = model.E @ S_ww @ model.F.T
    R_0 = S_vv + model.F @ S_ww @ model.F.T
    _, gain = regulator(
        model.A.T, model.C.T, Q_0, 0.5 * (R_0 + R_0.T), S_0,
        what="observer", names="sensor", remedy="no sensor sees it: move or add a sensor",
    )  # fmt: skip
    return np.asarray(gain.T)


class Observer(Block):
    """Estimated states from measurements and the force that they carry, (2.5) and (1)"""

    A_d = Parameter(shape=("n", "n"), meaning="transition of the estimate over one step")
    B_d = Parameter(shape=("n", "m"), meaning="effect of the held force")
    L_d = Parameter(shape=("n", "r"), meaning="effect of the measurement")
    y = Input("measurements at t_k", shape="r")
    u_last = Input("force held over [t_{k-1}, t_k]", shape="m", unit="N")
    x_hat = State(shape="n", meaning="estimated states")
    x_next = Local(shape="n", meaning="working memory")

    def step(self, t: float, h: float) -> None:
        matvec(self.A_d, self.x_hat, self.x_next)
        matvec_add(self.B_d, self.u_last, self.x_next)
        matvec_add(self.L_d, self.y, self.x_next)  # (1)
        assign(self.x_next, self.x_hat)

    @classmethod
    def design(cls, model: DesignModel, S_ww: Array, S_vv: Array, period: float) -> Observer:
        """Make the observer of a model with the gain (2.6), for a sample period in s."""
        A_d, B_d, L_d = discretise(model, observer_gain(model, S_ww, S_vv), period)
        return cls(A_d=A_d, B_d=B_d, L_d=L_d, sample_period=period)


def discretise(model: DesignModel, L: Array, period: float) -> tuple[Array, Array, Array]:
    """Return A_d, B_d, L_d of the observer with the gain L (n, r), exact for held u and y."""
    n, m = model.B.shape
    inputs = np.hstack([model.B - L @ model.D, L])
    k = inputs.shape[1]
    exponent = np.zeros((n + k, n + k))
    exponent[:n] = period * np.hstack([model.A - L @ model.C, inputs])
    transition = la.expm(exponent)
    return transition[:n, :n], transition[:n, n : n + m], transition[:n, n + m :]
