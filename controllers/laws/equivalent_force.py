"""Sliding mode control of a state-space model with any gain law (the thesis' 2.3.1 and 5.2).

    s = P x_hat                                                             (2.13)
    u = (P B)^-1 (-P A x_hat + switching),  switching = -M sgn s            (2.15)

(2.15) in two blocks, with a gain law of chapter 4 between them that gives `switching`:
StateSurface, then Algorithm I or II or another, then EquivalentForce. There is one
actuator. x_hat is the estimate at t_k; u is held over [t_k, t_{k+1}].
"""

from __future__ import annotations

import numpy as np

from cosim import Array, Block, Input, Output, Parameter
from cosim.functions import dot

from ..design.design_model import DesignModel
from ..design.riccati import DesignError
from ..design.surface_design import optimal_surface, require_regular


class StateSurface(Block):
    """s = P x_hat   (2.13)"""

    P = Parameter(0.0, "sliding surface", shape="n")
    x_hat = Input("estimated states", shape="n")
    s = Output("sliding variable")

    def step(self, t: float, h: float) -> None:
        self.s = dot(self.P, self.x_hat)


class EquivalentForce(Block):
    """u = (P B)^-1 (-P A x_hat + switching)   (2.15)"""

    PA = Parameter(0.0, "P A", shape="n")
    PB_inv = Parameter(0.0, "(P B)^-1")
    x_hat = Input("estimated states", shape="n")
    switching = Input("-M sgn s of a gain law")
    u = Output("control force", unit="N")

    def step(self, t: float, h: float) -> None:
        self.u = self.PB_inv * (self.switching - dot(self.PA, self.x_hat))


def design(model: DesignModel, Q: Array) -> tuple[StateSurface, EquivalentForce]:
    """Make the surface and the force for one actuator; Q (n, n) as for `SlidingMode.design`."""
    if model.B.shape[1] != 1:
        raise DesignError(
            f"equivalent_force: the model has {model.B.shape[1]} actuators, but "
            "the gain laws of chapter 4 take one; use SlidingMode"
        )
    P = optimal_surface(model.A, model.B, Q)
    PB = P @ model.B
    require_regular(PB, "equivalent_force")
    row = np.ascontiguousarray
    return (
        StateSurface(P=row(P[0])),
        EquivalentForce(PA=row((P @ model.A)[0]), PB_inv=1.0 / float(PB[0, 0])),
    )
