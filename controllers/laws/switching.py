"""Switching functions in place of sgn(s) (thesis 4.2, item 3): saturation and hysteresis.

    sat(s) = s  for |s| < gamma,  sgn(s)  for |s| >= gamma        (as printed)

The printed form mixes a sliding variable with a pure number: it has a unit only when
s is without one, and it jumps from gamma to 1 at |s| = gamma. Slotine and Sastry's own
boundary layer, s / gamma inside, is continuous and has no unit; `scaled` chooses it.

    hys(s) = sgn(s) for |s| > width, otherwise as before          (starts at sgn(s))
"""

from cosim import Block, Input, Local, Output, Parameter
from cosim.functions import sign


def saturation(s: float, gamma: float) -> float:
    """Return s for |s| < gamma, otherwise its sign: as the thesis prints it."""
    return s if abs(s) < gamma else sign(s)


def boundary_layer(s: float, gamma: float) -> float:
    """Return s / gamma for |s| < gamma, otherwise its sign: continuous."""
    return s / gamma if abs(s) < gamma else sign(s)


def hysteresis(s: float, width: float, before: float) -> float:
    """Return the sign of s outside [-width, width], inside it what was before (0: the sign)."""
    return sign(s) if abs(s) > width or before == 0.0 else before


class SaturationControl(Block):
    """u = -M_0 sat(s), with the printed sat or, scaled=1, the continuous one."""

    M_0 = Parameter(100.0, "gain", unit="N", min=0.0)
    gamma = Parameter(0.1, "half width of the boundary layer", min=0.0)
    scaled = Parameter(0.0, "1: s / gamma in the layer, 0: s, as printed", min=0.0, max=1.0)
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = Output("gain", unit="N")
    sgn = Output("sign of s", unit="1")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0
        if self.scaled > 0.5:
            self.u = -self.M * boundary_layer(self.s, self.gamma)
        else:
            self.u = -self.M * saturation(self.s, self.gamma)


class HysteresisControl(Block):
    """u = -M_0 hys(s): a switch only when s has left [-width, width] on the other side."""

    M_0 = Parameter(100.0, "gain", unit="N", min=0.0)
    width = Parameter(0.1, "half width of the loop", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = Output("gain", unit="N")
    sgn = Output("sign of s", unit="1")
    before = Local(0.0, "switching function at the call before")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0
        self.before = hysteresis(self.s, self.width, self.before)
        self.u = -self.M * self.before
