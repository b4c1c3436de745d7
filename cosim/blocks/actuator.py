"""Actuators: a limit on the force, and a first-order lag behind it."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from ..core.participant import Block, Continuous
from ..core.variables import Input, Output, Parameter, State
from ..functions import clip


class Saturation(Block):
    """y = u limited to [-limit, limit]"""

    DEFAULT_SIZES = {"n": 1}

    limit = Parameter(1.0, "largest magnitude", unit="$unit", shape="n", min=0.0)
    u = Input("command", unit="$unit", shape="n")
    y = Output("limited command", unit="$unit", shape="n")

    def __init__(self, limit: ArrayLike, *, n: int | None = None, unit: str | None = "N") -> None:
        super().__init__(limit=limit, n=n, unit=unit)

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = clip(self.u[i], -self.limit[i], self.limit[i])


class FirstOrderActuator(Continuous):
    """tau F' + F = u limited to [-limit, limit]

    With |F(0)| <= limit the force never exceeds the limit: it approaches a limited
    command. Exact for a command held over a step:

        F(t + h) = F(t) + (1 - e^(-h / tau)) (sat u - F(t))
    """

    DEFAULT_SIZES = {"n": 1}

    tau = Parameter(0.01, "time constant", unit="s", min=1e-12)
    limit = Parameter(1.0, "largest force", unit="N", shape="n", min=0.0)
    u = Input("command", unit="N", shape="n")
    F = State(0.0, "force", unit="N", shape="n")

    def __init__(self, tau: float, limit: ArrayLike = math.inf, *, n: int | None = None) -> None:
        super().__init__(tau=tau, limit=limit, n=n)

    def derivatives(self, t: float) -> None:
        for i in range(self.F.shape[0]):
            self.der_F[i] = (clip(self.u[i], -self.limit[i], self.limit[i]) - self.F[i]) / self.tau

    def advance(self, t: float, h: float) -> None:
        approach = -math.expm1(-h / self.tau)
        for i in range(self.F.shape[0]):
            self.F[i] += approach * (clip(self.u[i], -self.limit[i], self.limit[i]) - self.F[i])
