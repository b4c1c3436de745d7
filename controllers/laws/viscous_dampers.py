"""Viscous dampers in place of a controller.

    u_j = -c v_j,  |u_j| <= limit                                           (1)

v_j is the velocity across damper j at t_k; the force is limited like that of an actuator
and held over [t_k, t_{k+1}], so the step must be short compared with the period of vibration.
"""

from __future__ import annotations

from cosim import Block, Input, Output, Parameter
from cosim.functions import clip


class ViscousDampers(Block):
    """u_j = -c v_j within +-limit"""

    c = Parameter(1e6, "damping constant of each damper", unit="N*s/m", min=0.0)
    limit = Parameter(1e6, "largest force", unit="N", min=0.0)
    v = Input("velocity across the dampers", unit="m/s", shape="p")
    u = Output("force", unit="N", shape="p")

    def step(self, t: float, h: float) -> None:
        for j in range(self.v.shape[0]):
            self.u[j] = clip(-self.c * self.v[j], -self.limit, self.limit)  # (1)
