"""Linear state feedback with the optimal gain (LQR); with an observer this is LQG control.

    u = -K x_hat,  K = R^-1 (B' X + N')                                     (1)

X solves the Riccati equation (riccati.py), so that int (x' Q x + 2 x' N u + u' R u) dt is
least. x_hat is the estimate at t_k; u is held over [t_k, t_{k+1}]. `weight_outputs` turns
weights on outputs z = C x + D u into Q, N and a part of R.
"""

from __future__ import annotations

from cosim import Array, Block, Input, Output, Parameter
from cosim.functions import matvec

from ..design.design_model import DesignModel
from ..design.riccati import regulator


class StateFeedback(Block):
    """u = -K x_hat"""

    minus_K = Parameter(shape=("m", "n"), meaning="negative gain")
    x_hat = Input("estimated states", shape="n")
    u = Output("control force", shape="m", unit="N")

    def step(self, t: float, h: float) -> None:
        matvec(self.minus_K, self.x_hat, self.u)  # (1)

    @classmethod
    def lqr(
        cls, model: DesignModel, Q: Array, R: Array, N: Array | None = None, every: int | None = None
    ) -> StateFeedback:
        """Make the linear-quadratic regulator of a model."""
        _, K = regulator(model.A, model.B, Q, R, N, what="LQR")
        return cls(minus_K=-K, every=every)


def weight_outputs(C: Array, D: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Return Q, N and the addition to R for z' weight z with z = C x + D u."""
    return C.T @ weight @ C, C.T @ weight @ D, D.T @ weight @ D
