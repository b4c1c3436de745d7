"""Time delay by a whole number of steps."""

from __future__ import annotations

from typing import Unpack

from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Input, Local, Output, Parameter
from .options import SampledSignal


class Delay(Block):
    """y_k = u_{k - steps}; y_k = initial for k < steps. k counts the block's own calls.

    Under sampled coupling those are the communication points, or the multiples of
    its sample period. Under stage coupling it is called at every stage unless it has
    a sample period; give it one.
    """

    DEFAULT_SIZES = {"n": 1}

    initial = Parameter(0.0, "output until the first input arrives", unit="$unit", shape="n")
    u = Input("signal", unit="$unit", shape="n")
    y = Output("delayed signal", unit="$unit", shape="n")
    buffer = Local(0.0, "the last inputs, a ring", shape=("steps", "n"))
    place = Local(0.0, "row of the oldest input")

    def __init__(self, steps: int, *, initial: ArrayLike = 0.0, **options: Unpack[SampledSignal]) -> None:
        super().__init__(steps=steps, initial=initial, y=initial, **options)

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
