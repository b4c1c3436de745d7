"""Sliding surface in the phase plane of an oscillator (the thesis' 4.1).

    s = x_2 + a x_1,  s' = x_2' + a x_2                                     (4.3)

x_1 is the displacement, x_2 the velocity. On s = 0 the state decays: x_1 = e^(-a t) x_1(0).
"""

from cosim import Block, Input, Output, Parameter


class PhasePlaneSurface(Block):
    """s = x2 + a x1, with displacement x1 and velocity x2 at the same instant."""

    a = Parameter(1.0, "rate of decay on the surface", unit="1/s", min=0.0)
    x1 = Input("displacement", unit="m")
    x2 = Input("velocity", unit="m/s")
    s = Output("sliding variable", unit="m/s")

    def step(self, t: float, h: float) -> None:
        self.s = self.x2 + self.a * self.x1  # (4.3)
