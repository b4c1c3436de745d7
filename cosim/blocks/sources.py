"""Signal sources: constant, ground motion or other record, function of time, white noise."""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Local, Output, Parameter
from ..errors import DeclarationError, check_known
from ..ground_motion.ground_motion import GroundMotion
from .options import Sampled, Signal
from .random_stream import normal, seed_streams


class Constant(Block):
    """y = value, for a number or a vector."""

    value = Parameter(0.0, "value", unit="$unit", shape="n")
    y = Output("signal", unit="$unit", shape="n")

    def __init__(self, value: ArrayLike = 0.0, *, unit: str | None = None) -> None:
        given = np.atleast_1d(np.asarray(value, dtype=np.float64))
        super().__init__(value=given, y=given, unit=unit)

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = self.value[i]


class RecordSource(Block):
    """A ground motion or another record as a signal: v_0 .. v_{n-1} at start + i dt, zero outside.

        q = (t - start) / dt,  i = floor q
        hold:    y = scale v_i                                  0 <= q < n
        linear:  y = scale (v_i + (q - i) (v_{i+1} - v_i))      0 <= q <= n - 1

    A q within 1e-12 of a whole number (relative above 1) is taken as that number: t = k h
    and i dt are then the same instant, rounded differently. Values at grid points are
    therefore those of the record, bit for bit, over any length.
    """

    values = Parameter(0.0, "values", shape="n_values", fixed=True)
    dt = Parameter(0.01, "sample interval of the record", unit="s", min=1e-12, fixed=True)
    start = Parameter(0.0, "time of the first value", unit="s")
    scale = Parameter(1.0, "factor on the record")
    linear = Parameter(1.0, "1: linear interpolation, 0: hold", min=0.0, max=1.0, fixed=True)
    y = Output("signal", unit="$unit")

    def __init__(
        self,
        record: GroundMotion | ArrayLike,
        dt: float | None = None,
        *,
        interpolation: Literal["linear", "hold"] = "linear",
        scale: float = 1.0,
        start: float | None = None,
        unit: str | None = None,
        **sampled: Unpack[Sampled],
    ) -> None:
        """Take a GroundMotion with its dt, unit and start, or values with dt and unit."""
        check_known("RecordSource: interpolation", interpolation, ("linear", "hold"), DeclarationError)
        if isinstance(record, GroundMotion):
            if dt is not None:
                raise DeclarationError(
                    f"RecordSource: record '{record.name}' has its own dt = {record.dt:g} s; "
                    "leave dt out, or use record.resample(dt)"
                )
            values, dt, unit = record.values, record.dt, unit or record.unit
            start = record.start if start is None else start
        else:
            values = np.asarray(record, dtype=np.float64)
        if dt is None:
            raise DeclarationError("RecordSource: values need dt, the sample interval in s")
        super().__init__(
            values=values,
            dt=dt,
            start=start or 0.0,
            scale=scale,
            linear=float(interpolation == "linear"),
            unit=unit,
            **sampled,
        )

    def step(self, t: float, h: float) -> None:
        n = self.values.shape[0]
        q = (t - self.start) / self.dt
        self.y = 0.0
        if -1.0 < q < n + 1.0:
            nearest = math.floor(q + 0.5)
            if abs(q - nearest) <= 1e-12 * max(1.0, abs(q)):
                q = nearest * 1.0
            i = math.floor(q)
            if 0 <= i < n:
                if q == i or self.linear == 0.0:
                    self.y = self.scale * self.values[i]
                elif i < n - 1:
                    v = self.values[i]
                    self.y = self.scale * (v + (q - i) * (self.values[i + 1] - v))


def f(t: float) -> float:
    """Stand for the function of a `function_source`, which replaces it."""
    return t


class _FunctionOfTime(Block):
    """y = f(t)"""

    y = Output("signal", unit="$unit")

    def step(self, t: float, h: float) -> None:
        self.y = f(t)


def function_source(
    function: Callable[[float], float], *, unit: str | None = None, **sampled: Unpack[Sampled]
) -> Block:
    """Return a block with y = function(t), for any function of time in s that returns a number.

        function_source(lambda t: 25.0 * (math.sin(t) + 1.0), unit="m/s^2")

    A function in Numba's subset is compiled with the block, closures over numbers
    included; any other runs as a callback, with a CompiledKernelsWarning.
    """
    if not callable(function):
        raise DeclarationError(f"function_source needs a function of time, got {function!r}")
    template = _FunctionOfTime.step
    step = types.FunctionType(template.__code__, {**template.__globals__, "f": function}, "step")
    name = "FunctionSource"
    y = Output("signal", unit="$unit")
    made: Any = type(name, (Block,), {"y": y, "step": step, "__doc__": "y = f(t)"})
    block: Block = made(unit=unit, **sampled)
    return block


class WhiteNoise(Block):
    """Independent normal numbers, one in every sample_period, held in between.

        y_k = mean + sigma N_k,  N_k standard normal (random_stream.py)

    The numbers depend on `seed` and the element only: not on the communication step, the
    coupling, the random state of the process, or the number of elements.
    """

    DEFAULT_SIZES = {"n": 1}

    mean = Parameter(0.0, "mean", unit="$unit", shape="n")
    sigma = Parameter(1.0, "standard deviation", unit="$unit", shape="n", min=0.0)
    seed = Parameter(1.0, "seed, a whole number", min=0.0, max=2.0**53, whole=True)
    y = Output("noise", unit="$unit", shape="n")
    streams = Local(0.0, "state of the generators", shape=("n", 6))
    work = Local(0.0, "working memory of the seeding", shape=(3, 3, 3))

    def __init__(
        self,
        *,
        sample_period: float,
        seed: int = 1,
        sigma: ArrayLike = 1.0,
        mean: ArrayLike = 0.0,
        **options: Unpack[Signal],
    ) -> None:
        super().__init__(sample_period=sample_period, seed=seed, sigma=sigma, mean=mean, **options)

    def initialize(self) -> None:
        seed_streams(math.floor(self.seed) * 1.0, self.streams, self.work)

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = self.mean[i] + self.sigma[i] * normal(self.streams[i])
