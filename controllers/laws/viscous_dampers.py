"""Viscous dampers, as a controller without a controller: u = -c v.

v is the velocity across each damper; the force is limited like an actuator's. What they
do between samples is held, so the step must be short against what they damp.
"""

from __future__ import annotations

from cosim import Block, Input, Output, Parameter
from cosim.functions import clip


class ViscousDampers(Block):
    """u_j = -c v_j, limited to +-limit."""

    c = Parameter(1e6, "damping of each", unit="N*s/m", min=0.0)
    limit = Parameter(1e6, "largest force", unit="N", min=0.0)
    v = Input("velocity across the dampers", unit="m/s", shape="p")
    u = Output("force", unit="N", shape="p")

    def step(self, t: float, h: float) -> None:
        for j in range(self.v.shape[0]):
            self.u[j] = clip(-self.c * self.v[j], -self.limit, self.limit)
