"""Analogue-to-digital conversion: a finite range in finite steps."""

from __future__ import annotations

import math
from typing import Unpack

from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Input, Output, Parameter
from ..functions import clip
from .options import SampledSignal


class AnalogToDigital(Block):
    """Quantisation to 2^bits levels in two's complement, saturated at the range.

        q = full_scale / 2^(bits-1)
        c = floor(u / q + 1/2) limited to [-2^(bits-1), 2^(bits-1) - 1]
        y = q c

    The error is at most q/2 for -full_scale - q/2 <= u < full_scale - q/2, because the
    highest level is one q below full scale.
    """

    DEFAULT_SIZES = {"n": 1}

    full_scale = Parameter(1.0, "range is [-full_scale, full_scale)", unit="$unit", shape="n", min=1e-300)
    bits = Parameter(16.0, "number of bits", min=1.0, max=52.0, whole=True)
    u = Input("analogue signal", unit="$unit", shape="n")
    y = Output("quantised signal", unit="$unit", shape="n")

    def __init__(self, full_scale: ArrayLike, *, bits: int = 16, **options: Unpack[SampledSignal]) -> None:
        super().__init__(full_scale=full_scale, bits=bits, **options)

    def step(self, t: float, h: float) -> None:
        levels = 2.0 ** (self.bits - 1.0)
        for i in range(self.y.shape[0]):
            q = self.full_scale[i] / levels
            # limited before floor, which needs a number in the range of integers
            code = clip(self.u[i] / q, -levels, levels)
            self.y[i] = q * clip(math.floor(code + 0.5) * 1.0, -levels, levels - 1.0)
