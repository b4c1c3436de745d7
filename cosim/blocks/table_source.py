"""A table as a signal: rows at any instants, or at a constant interval."""

from __future__ import annotations

import math
from typing import Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..core.participant import Block
from ..core.variables import Output, Parameter
from ..errors import DeclarationError, check_known
from .options import Sampled


class TableSource(Block):
    """Rows v_0 .. v_{n-1} at instants t_0 <= .. <= t_{n-1}, the ends held outside.

        i = the last one with t_i <= t
        hold:    y = v_i
        linear:  y = v_i + q (v_{i+1} - v_i),  q = (t - t_i) / (t_{i+1} - t_i)

    Two rows at one instant are a jump: the second counts there. An instant that is less
    than 1e-9 of a step after t counts as t.

    At a constant interval, t_i = i interval, the row is found by division:

        i = floor(t / interval + 1e-9) limited to [0, n - 2],  q = t / interval - i
    """

    instants = Parameter(0.0, "instants of the rows", unit="s", shape="n_rows", fixed=True)
    interval = Parameter(0.0, "constant interval of the rows; 0: none", unit="s", min=0.0, fixed=True)
    rows = Parameter(0.0, "values at the instants", unit="$unit", shape=("n_rows", "n"), fixed=True)
    linear = Parameter(1.0, "1: linear interpolation, 0: hold", min=0.0, max=1.0, fixed=True)
    y = Output("signal", unit="$unit", shape="n")

    def __init__(
        self,
        instants: ArrayLike,
        rows: ArrayLike,
        *,
        interpolation: Literal["linear", "hold"] = "linear",
        unit: str | None = None,
        **sampled: Unpack[Sampled],
    ) -> None:
        """Take (n,) instants in s that do not decrease, or one interval, and (n,) or (n, m) values."""
        check_known("TableSource: interpolation", interpolation, ("linear", "hold"), DeclarationError)
        t: Array = np.asarray(instants, dtype=np.float64)
        v: Array = np.asarray(rows, dtype=np.float64)
        v = v[:, None] if v.ndim == 1 else v
        interval = 0.0
        if t.ndim == 0:
            interval = float(t)
            if not (math.isfinite(interval) and interval > 0.0):
                raise DeclarationError(f"TableSource: the interval of {interval} s must be above zero")
            t = np.asarray(interval * np.arange(len(v) if v.ndim else 0))
        if t.ndim != 1 or v.ndim != 2 or len(t) != len(v) or len(t) == 0:
            raise DeclarationError(
                f"TableSource: instants of shape {t.shape} and rows of shape {v.shape} do not fit; "
                "give (n,) and (n,) or (n, m), n at least 1"
            )
        if not (np.isfinite(t).all() and np.isfinite(v).all() and (np.diff(t) >= 0.0).all()):
            raise DeclarationError("TableSource: give finite values, at instants that do not decrease")
        linear = float(interpolation == "linear")
        super().__init__(instants=t, interval=interval, rows=v, linear=linear, unit=unit, **sampled)

    def step(self, t: float, h: float) -> None:
        n = self.instants.shape[0]
        low, high = 0, n  # the last row at or before now is below `high`
        q = 0.0
        if self.interval > 0.0:
            if self.linear != 0.0:
                low, q = row_at(t, self.interval, n)
            else:
                low = min(math.floor(min(t / self.interval, n - 1.0) + 1e-9), n - 1) if t > 0.0 else 0
            high = low + 1
        else:
            now = t + 1e-9 * h
            while high - low > 1:
                middle = (low + high) // 2
                if self.instants[middle] <= now:
                    low = middle
                else:
                    high = middle
            if self.linear != 0.0 and high < n and t > self.instants[low]:
                q = (t - self.instants[low]) / (self.instants[high] - self.instants[low])
        for i in range(self.y.shape[0]):
            v = self.rows[low, i]
            self.y[i] = v if q == 0.0 else v + q * (self.rows[high, i] - v)


def row_at(t: float, interval: float, n: int) -> tuple[int, float]:
    """Return i and q of a time between rows i and i + 1 of n at a constant interval, its ends held."""
    place = min(t / interval, n - 1.0) if t > 0.0 else 0.0
    low = max(min(math.floor(place + 1e-9), n - 2), 0)
    return low, place - low
