"""The oscillator of the thesis' chapter 4: mass, damper and spring, driven by a control force.

    x' = v
    v' = (u - c v - k x) / m + d
    a  = v'

u is the control force, d a disturbance that enters as an acceleration. With m = 1 this is
the thesis' x2' = -(k/m) x1 - (c/m) x2 + u + d (section 4.1), whose numbers are the
defaults.
"""

from __future__ import annotations

from cosim import Input, LinearContinuous, Output, Parameter, State


class Oscillator(LinearContinuous):
    """m x'' + c x' + k x = u + m d"""

    m = Parameter(1.0, "mass", unit="kg", min=1e-12)
    c = Parameter(0.001, "damping", unit="N*s/m", min=0.0)
    k = Parameter(0.01, "stiffness", unit="N/m", min=0.0)
    u = Input("control force", unit="N")
    d = Input("disturbance", unit="m/s^2")
    x = State(14.0, "displacement", unit="m")
    v = State(25.0, "velocity", unit="m/s")
    a = Output("acceleration", unit="m/s^2")

    def derivatives(self, t: float) -> None:
        self.der_x = self.v
        self.der_v = (self.u - self.c * self.v - self.k * self.x) / self.m + self.d

    def outputs(self, t: float) -> None:
        self.a = self.der_v
