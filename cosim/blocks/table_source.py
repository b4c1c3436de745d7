"""A table as a signal: rows at any instants."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..core.participant import Block
from ..core.variables import Output, Parameter
from ..errors import DeclarationError, did_you_mean
from .checks import set_unit


class TableSource(Block):
    """Rows v_0 .. v_{n-1} at instants t_0 <= .. <= t_{n-1}, the ends held outside.

        i = the last one with t_i <= t
        hold:    y = v_i
        linear:  y = v_i + (t - t_i) / (t_{i+1} - t_i) (v_{i+1} - v_i)

    Two rows at one instant are a jump: the second counts there. An instant that is less
    than 1e-9 of a step after t is at t.
    """

    instants = Parameter(0.0, "instants of the rows", unit="s", shape="n_rows", fixed=True)
    rows = Parameter(0.0, "values at the instants", shape=("n_rows", "n"), fixed=True)
    linear = Parameter(1.0, "1: linear interpolation, 0: hold", min=0.0, max=1.0, fixed=True)
    y = Output("signal", shape="n")

    def __init__(
        self,
        instants: ArrayLike,
        rows: ArrayLike,
        *,
        interpolation: Literal["linear", "hold"] = "linear",
        unit: str | None = None,
    ) -> None:
        """Take (n,) instants in s that do not decrease, and (n,) or (n, m) values."""
        if interpolation not in ("linear", "hold"):
            hint = did_you_mean(str(interpolation), ["linear", "hold"])
            raise DeclarationError(f"TableSource: interpolation '{interpolation}' is not known{hint}")
        t, v = np.asarray(instants, dtype=np.float64), np.asarray(rows, dtype=np.float64)
        v = v[:, None] if v.ndim == 1 else v
        if t.ndim != 1 or v.ndim != 2 or len(t) != len(v) or len(t) == 0:
            raise DeclarationError(
                f"TableSource: instants of shape {t.shape} and rows of shape {v.shape} do not fit; "
                "give (n,) and (n,) or (n, m), n at least 1"
            )
        if not (np.isfinite(t).all() and np.isfinite(v).all() and (np.diff(t) >= 0.0).all()):
            raise DeclarationError("TableSource: give finite values, at instants that do not decrease")
        super().__init__(instants=t, rows=v, linear=float(interpolation == "linear"), n=v.shape[1])
        set_unit(self, unit, "y", "rows")

    def step(self, t: float, h: float) -> None:
        now = t + 1e-9 * h
        low, high = 0, self.instants.shape[0]  # the last row at or before now is below `high`
        while high - low > 1:
            middle = (low + high) // 2
            if self.instants[middle] <= now:
                low = middle
            else:
                high = middle
        q = 0.0
        if self.linear != 0.0 and high < self.instants.shape[0] and t > self.instants[low]:
            q = (t - self.instants[low]) / (self.instants[high] - self.instants[low])
        for i in range(self.y.shape[0]):
            v = self.rows[low, i]
            self.y[i] = v if q == 0.0 else v + q * (self.rows[high, i] - v)
