"""Sliding mode control by equivalent control (the thesis' 2.3.1).

    s = P x_hat                                                             (2.13)
    s' = -a s - delta sgn s                                                 (2.14)
    u = (P B)^-1 (-P A x_hat - M sgn s),  M = a |s| + delta                 (2.15)

x_hat is the estimate at t_k, from measurements that carry the force held over
[t_{k-1}, t_k]; u is held over [t_k, t_{k+1}]. In the model the surface is approached at the
rate a, and only delta chatters. sgn acts on each component of s, |s| is the norm.
"""

from __future__ import annotations

import scipy.linalg as la

from cosim import Array, Block, Input, Local, Output, Parameter
from cosim.functions import matvec, norm, sign

from ..design.design_model import DesignModel
from ..design.surface_design import optimal_surface, require_regular


class SlidingMode(Block):
    """u = (P B)^-1 (-P A x_hat - (a |s| + delta) sgn s)   (2.15)"""

    P = Parameter(shape=("m", "n"), meaning="sliding surface")
    PA = Parameter(shape=("m", "n"), meaning="P A")
    PB_inv = Parameter(shape=("m", "m"), meaning="(P B)^-1")
    a = Parameter(1.065, "gain on the distance from the surface", unit="1/s", min=0.0)
    delta = Parameter(0.001, "least gain", min=0.0)
    x_hat = Input("estimated states", shape="n")
    s = Output("sliding variable", shape="m")
    u = Output("control force", shape="m", unit="N")
    rate = Local(shape="m", meaning="wanted change of s")

    def step(self, t: float, h: float) -> None:
        matvec(self.P, self.x_hat, self.s)  # (2.13)
        matvec(self.PA, self.x_hat, self.rate)
        M = self.a * norm(self.s) + self.delta
        for i in range(self.rate.shape[0]):
            self.rate[i] = -self.rate[i] - M * sign(self.s[i])
        matvec(self.PB_inv, self.rate, self.u)  # (2.15)

    @classmethod
    def design(
        cls, model: DesignModel, Q: Array, a: float = 1.065, delta: float = 0.001, every: int | None = None
    ) -> SlidingMode:
        """Make the controller with the surface that minimises int x' Q x dt, (2.10) to (2.13)."""
        P = optimal_surface(model.A, model.B, Q)
        PB = P @ model.B
        require_regular(PB, "SlidingMode")
        return cls(P=P, PA=P @ model.A, PB_inv=la.inv(PB), a=a, delta=delta, every=every)
