"""Continuous sliding mode control after Yang, Wu and Agrawal (1995).

    s = P x_hat                                                             (1)
    u = u_eq - delta (P B)' s,  u_eq = -(P B)^-1 P A x_hat                  (2)

With the Lyapunov function V = s' s/2, V' = s' P B (u - u_eq) = -delta |(P B)' s|^2. There is
no sign function, so nothing chatters. This law stands in for the modified method (MSMC) of
Wu and Yang (2004) in the thesis' table 2.2, whose equations the thesis does not print.

x_hat is the estimate at t_k; u is held over [t_k, t_{k+1}]. For one actuator
(P B)(P B)' = c and s' = -delta c s, so `design` takes that rate.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from cosim import Array, Block, Input, Output, Parameter
from cosim.functions import matvec, matvec_add

from ..design.design_model import DesignModel
from ..design.surface_design import optimal_surface, require_regular


class ContinuousSlidingMode(Block):
    """u = -G x_hat - N s with s = P x_hat, G = (P B)^-1 P A, N = delta (P B)'"""

    P = Parameter(shape=("m", "n"), meaning="sliding surface")
    minus_G = Parameter(shape=("m", "n"), meaning="-(P B)^-1 P A, equivalent control")
    minus_N = Parameter(shape=("m", "m"), meaning="-delta (P B)'")
    x_hat = Input("estimated states", shape="n")
    s = Output("sliding variable", shape="m")
    u = Output("control force", shape="m", unit="N")

    def step(self, t: float, h: float) -> None:
        matvec(self.P, self.x_hat, self.s)  # (1)
        matvec(self.minus_G, self.x_hat, self.u)
        matvec_add(self.minus_N, self.s, self.u)  # (2)

    @classmethod
    def design(
        cls, model: DesignModel, Q: Array, rate: float, every: int | None = None
    ) -> ContinuousSlidingMode:
        """Make the controller with the surface of `optimal_surface` and the weight Q.

        rate: least rate of approach to the surface in 1/s; delta = rate/c with the smallest
        eigenvalue c of (P B)(P B)'.
        """
        P = optimal_surface(model.A, model.B, Q)
        PB = P @ model.B
        require_regular(PB, "ContinuousSlidingMode")
        delta = rate / np.linalg.svd(PB, compute_uv=False)[-1] ** 2
        return cls(P=P, minus_G=-la.solve(PB, P @ model.A), minus_N=-delta * PB.T, every=every)
