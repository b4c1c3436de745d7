"""Displacements and velocities at many places of rigid parts from few displacement sensors.

Knows where the sensors are, and nothing of the structure: an alpha-beta filter for each,

    e_k = y_k - (x_{k-1} + h v_{k-1})
    x_k = x_{k-1} + h v_{k-1} + alpha e_k,   v_k = v_{k-1} + beta/h e_k

and T carries the motion of the sensors to that of the places, x_out = T x, v_out = T v. With
beta = alpha^2 / (2 - alpha) the filter is the steady Kalman filter of a white acceleration
(Benedict and Bordner, 1962).
"""

from __future__ import annotations

import numpy as np

from cosim import Array, Block, Input, Local, Output, Parameter
from cosim.functions import matvec


class KinematicObserver(Block):
    """Alpha-beta filters on r sensors, and p places moved by them."""

    T = Parameter(0.0, "motion of the places of unit motion of a sensor", shape=("p", "r"), fixed=True)
    alpha = Parameter(0.5, "share of a surprise that is displacement", unit="1", min=0.0, max=1.0)
    beta = Parameter(1.0 / 6.0, "share of a surprise that is velocity", unit="1", min=0.0, max=2.0)
    y = Input("measured displacements", unit="m", shape="r")
    x = Output("displacements of the places", unit="m", shape="p")
    v = Output("velocities of the places", unit="m/s", shape="p")
    place = Local(0.0, "filtered displacements of the sensors", shape="r")
    speed = Local(0.0, "their velocities", shape="r")

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            predicted = self.place[i] + h * self.speed[i]
            surprise = self.y[i] - predicted
            self.place[i] = predicted + self.alpha * surprise
            self.speed[i] += self.beta / h * surprise
        matvec(self.T, self.place, self.x)
        matvec(self.T, self.speed, self.v)

    @classmethod
    def design(cls, places: Array, sensors: Array, alpha: float = 0.5) -> KinematicObserver:
        """From rows over the structure's degrees of freedom: places (p, n) and sensors (r, n).

        The places must move as a combination of the sensors does; otherwise a ValueError.
        """
        T = places @ np.linalg.pinv(sensors)
        missed = np.abs(T @ sensors - places).max()
        if missed > 1e-3 * np.abs(places).max():
            raise ValueError(
                f"KinematicObserver: the sensors miss {missed:.2g} of the motion of the places; add a sensor "
                "on the part that they do not see"
            )
        return cls(T=T, alpha=alpha, beta=alpha**2 / (2.0 - alpha))
