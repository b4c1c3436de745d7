"""Time delay by a whole number of steps."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Input, Local, Output, Parameter
from .checks import length, set_unit, whole


class Delay(Block):
    """y_k = u_{k - steps}; y_k = initial for k < steps. k counts the block's own calls.

    Under sampled coupling those are the communication points, or the multiples of
    its sample period. Under stage coupling it is called at every stage unless it has
    a sample period; give it one.
    """

    initial = Parameter(0.0, "output until the first input arrives", shape="n")
    u = Input("signal", shape="n")
    y = Output("delayed signal", shape="n")
    buffer = Local(0.0, "the last inputs, a ring", shape=("steps", "n"))
    place = Local(0.0, "row of the oldest input")

    def __init__(
        self,
        steps: int,
        *,
        initial: ArrayLike = 0.0,
        n: int | None = None,
        unit: str | None = None,
        every: int | None = None,
        sample_period: float | None = None,
    ) -> None:
        super().__init__(
            every=every,
            sample_period=sample_period,
            steps=whole(steps, "Delay: steps", 1),
            initial=initial,
            y=initial,
            n=length("Delay", n, initial),
        )
        set_unit(self, unit, "u", "y", "initial")

    def initialize(self) -> None:
        for i in range(self.buffer.shape[0]):
            for j in range(self.buffer.shape[1]):
                self.buffer[i, j] = self.initial[j]

    def step(self, t: float, h: float) -> None:
        i = int(self.place)
        for j in range(self.y.shape[0]):
            self.y[j] = self.buffer[i, j]
            self.buffer[i, j] = self.u[j]
        self.place = (i + 1) % self.buffer.shape[0]
