"""Displacements and velocities at many places of rigid parts from few displacement sensors.

The observer needs the places of the sensors and no model of the structure. An alpha-beta filter
for each sensor estimates its displacement x and velocity v,

    e_k = y_k - (x_{k-1} + h v_{k-1})                                       (1)
    x_k = x_{k-1} + h v_{k-1} + alpha e_k,   v_k = v_{k-1} + beta/h e_k     (2)

and T maps the motion of the sensors to that of the places,

    x_out = T x,  v_out = T v                                               (3)

With beta = alpha^2/(2 - alpha) the filter is the steady Kalman filter for a white
acceleration. y_k is sampled at t_k, and the outputs are estimates at t_k.

Source: T. R. Benedict and G. W. Bordner, Synthesis of an optimal set of radar
track-while-scan smoothing equations, IRE Transactions on Automatic Control 7 (1962) 27-32,
DOI 10.1109/TAC.1962.1105477.
"""

from __future__ import annotations

import numpy as np

from cosim import Array, Block, Input, Local, Output, Parameter
from cosim.functions import matvec


class KinematicObserver(Block):
    """Alpha-beta filters on r sensors, and the motion of p places."""

    T = Parameter(0.0, "motion of the places for a unit motion of each sensor", shape=("p", "r"), fixed=True)
    alpha = Parameter(0.5, "gain on the displacement", unit="1", min=0.0, max=1.0)
    beta = Parameter(1.0 / 6.0, "gain on the velocity", unit="1", min=0.0, max=2.0)
    y = Input("measured displacements", unit="m", shape="r")
    x = Output("displacements of the places", unit="m", shape="p")
    v = Output("velocities of the places", unit="m/s", shape="p")
    place = Local(0.0, "filtered displacements of the sensors", shape="r")
    speed = Local(0.0, "filtered velocities of the sensors", shape="r")

    def step(self, t: float, h: float) -> None:
        for i in range(self.y.shape[0]):
            predicted = self.place[i] + h * self.speed[i]
            error = self.y[i] - predicted  # (1)
            self.place[i] = predicted + self.alpha * error
            self.speed[i] += self.beta / h * error  # (2)
        matvec(self.T, self.place, self.x)  # (3)
        matvec(self.T, self.speed, self.v)

    @classmethod
    def design(cls, places: Array, sensors: Array, alpha: float = 0.5) -> KinematicObserver:
        """Make the observer from rows over the structure's degrees of freedom.

        places (p, n) and sensors (r, n). Raises ValueError when the motion of the places is not
        a combination of that of the sensors.
        """
        T = places @ np.linalg.pinv(sensors)
        missed = np.abs(T @ sensors - places).max()
        if missed > 1e-3 * np.abs(places).max():
            raise ValueError(
                f"KinematicObserver: the sensors miss {missed:.2g} of the motion of the places; add a sensor "
                "on the part whose motion they do not measure"
            )
        return cls(T=T, alpha=alpha, beta=alpha**2 / (2.0 - alpha))
