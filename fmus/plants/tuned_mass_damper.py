"""An active tuned mass damper as a separate plant (the thesis' (2.19)).

    m y'' = u - k (y - x_top) - c (y' - v_top),  x_m = y - x_top
    reaction on the floor: k x_m + c x_m' - u

y is the position of the mass in space. Motion (x_top, v_top) and force couple the damper to a
building, each held over a communication step; the difference from the single plant
`DampedTower` falls with the step, as the study of the tall building reports. The step itself
is exact for held inputs.
"""

from __future__ import annotations

from cosim import Input, LinearContinuous, Output, Parameter, State


class TunedMassDamper(LinearContinuous):
    """m y'' = u - k (y - x_top) - c (y' - v_top)"""

    m = Parameter(1.0, "mass", unit="kg", min=1e-12)
    c = Parameter(0.0, "damping", unit="N*s/m", min=0.0)
    k = Parameter(1.0, "stiffness", unit="N/m", min=0.0)
    x_top = Input("displacement of the floor below", unit="m")
    v_top = Input("velocity of the floor below", unit="m/s")
    u = Input("force of the actuator on the mass", unit="N")
    y = State(0.0, "position of the mass in space", unit="m")
    y_dot = State(0.0, "velocity of the mass in space", unit="m/s")
    x_m = Output("stroke, relative to the floor", unit="m")
    v_m = Output("relative velocity", unit="m/s")
    reaction = Output("force on the floor", unit="N")

    def derivatives(self, t: float) -> None:
        self.der_y = self.y_dot
        self.der_y_dot = (
            self.u - self.k * (self.y - self.x_top) - self.c * (self.y_dot - self.v_top)
        ) / self.m

    def outputs(self, t: float) -> None:
        self.x_m = self.y - self.x_top
        self.v_m = self.y_dot - self.v_top
        self.reaction = self.k * self.x_m + self.c * self.v_m - self.u
