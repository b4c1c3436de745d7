"""Measurement noise: a signal is sampled, and each sample has an independent error."""

from __future__ import annotations

import math
from typing import Unpack

from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Input, Local, Output, Parameter
from .options import Signal
from .random_stream import normal, seed_streams


class MeasurementNoise(Block):
    """y_k = u_k + sigma N_k at every sample_period, held in between; N_k standard normal.

    The numbers depend on `seed` and the element only (random_stream.py). Sensors with
    independent noise need different seeds.
    """

    DEFAULT_SIZES = {"n": 1}

    sigma = Parameter(1.0, "standard deviation", unit="$unit", shape="n", min=0.0)
    seed = Parameter(1.0, "seed, a whole number", min=0.0, max=2.0**53, whole=True)
    u = Input("true signal", unit="$unit", shape="n")
    y = Output("measured signal", unit="$unit", shape="n")
    streams = Local(0.0, "state of the generators", shape=("n", 6))
    work = Local(0.0, "working memory of the seeding", shape=(3, 3, 3))

    def __init__(
        self, sigma: ArrayLike, *, sample_period: float, seed: int = 1, **options: Unpack[Signal]
    ) -> None:
        super().__init__(sample_period=sample_period, sigma=sigma, seed=seed, **options)

    def initialize(self) -> None:
        seed_streams(math.floor(self.seed) * 1.0, self.streams, self.work)

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = self.u[i] + self.sigma[i] * normal(self.streams[i])
