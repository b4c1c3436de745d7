"""First-order low-pass filter of the control force (thesis 2.3.2, eq. 2.17).

    tau u_f' + u_f = u                                            (2.17)

For u held over [t, t + h], exactly

    u_f(t + h) = u_f(t) + (1 - e^(-h / tau)) (u - u_f(t))

In the ports u is the signal and y the filtered one, u_f.
"""

from __future__ import annotations

import math
from typing import Unpack

from numpy.typing import ArrayLike

from ..core.participant import Block, Continuous
from ..core.variables import Input, Local, Output, Parameter, State
from .options import SampledSignal, Signal


class LowPass(Continuous):
    """(2.17) as a continuous participant: under sampled coupling exact over a step, from u_k to y_{k+1}."""

    DEFAULT_SIZES = {"n": 1}

    tau = Parameter(0.1, "time constant", unit="s", min=1e-12)
    u = Input("signal", unit="$unit", shape="n")
    y = State(0.0, "filtered signal", unit="$unit", shape="n")
    held = Local(0.0, "step for which approach is valid", unit="s")
    approach = Local(0.0, "1 - e^(-h / tau)")

    def __init__(self, tau: float = 0.1, *, y: ArrayLike = 0.0, **options: Unpack[Signal]) -> None:
        super().__init__(tau=tau, y=y, **options)

    def derivatives(self, t: float) -> None:
        for i in range(self.y.shape[0]):
            self.der_y[i] = (self.u[i] - self.y[i]) / self.tau  # (2.17)

    def advance(self, t: float, h: float) -> None:
        if h != self.held:
            self.held, self.approach = h, -math.expm1(-h / self.tau)
        for i in range(self.y.shape[0]):
            self.y[i] += self.approach * (self.u[i] - self.y[i])


class DiscreteLowPass(Block):
    """(2.17) as a block in the computer: y_k follows from the inputs up to u_{k-1}, held.

        y_k = y_{k-1} + (1 - e^(-(t_k - t_{k-1}) / tau)) (u_{k-1} - y_{k-1})

    The same numbers as LowPass under sampled coupling, bit for bit as far as the
    differences of the times are. y_0 is the start value.
    """

    DEFAULT_SIZES = {"n": 1}

    tau = Parameter(0.1, "time constant", unit="s", min=1e-12)
    u = Input("signal", unit="$unit", shape="n")
    y = Output("filtered signal", unit="$unit", shape="n")
    held = Local(0.0, "signal at the call before", unit="$unit", shape="n")
    before = Local(0.0, "time of the call before", unit="s")
    called = Local(0.0, "1 after the first call")

    def __init__(self, tau: float = 0.1, *, y: ArrayLike = 0.0, **options: Unpack[SampledSignal]) -> None:
        super().__init__(tau=tau, y=y, **options)

    def step(self, t: float, h: float) -> None:
        approach = -math.expm1(-(t - self.before) / self.tau) if self.called > 0.0 else 0.0
        for i in range(self.y.shape[0]):
            self.y[i] += approach * (self.held[i] - self.y[i])
            self.held[i] = self.u[i]
        self.before = t
        self.called = 1.0
