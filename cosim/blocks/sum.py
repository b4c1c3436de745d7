"""Sum of signals, each with its factor: disturbances that act together, an error of control."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Input, Output, Parameter
from ..functions import dot


class WeightedSum(Block):
    """y = w_1 u_1 + ... + w_n u_n; connect the terms to u[1] .. u[n]."""

    w = Parameter(1.0, "factors", shape="n")
    u = Input("terms", unit="$unit", shape="n")
    y = Output("sum", unit="$unit")

    def __init__(self, w: ArrayLike, *, unit: str | None = None) -> None:
        super().__init__(w=w, unit=unit)

    def step(self, t: float, h: float) -> None:
        self.y = dot(self.w, self.u)
