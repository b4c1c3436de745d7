"""Switching functions in place of sgn s (the thesis' 4.2, third method): saturation and hysteresis.

    sat s = s for |s| < gamma, otherwise sgn s                              (1)
    sat s = s/gamma for |s| < gamma, otherwise sgn s                        (2)
    hys s = sgn s for |s| > width, otherwise as in the last call            (3)
    u = -M_0 sat s  or  -M_0 hys s

The thesis prints (1). It jumps from gamma to 1 at |s| = gamma, and it has a unit only when s
has none. (2) is the boundary layer of the source, continuous and without unit; the
parameter `scaled` chooses it. (3) starts at sgn s.

Source: J.-J. Slotine and S. S. Sastry, Tracking control of non-linear systems using sliding
surfaces, with application to robot manipulators, International Journal of Control 38 (1983)
465-492, DOI 10.1080/00207178308933088.
"""

from cosim import Block, Input, Local, Output, Parameter
from cosim.functions import sign


def saturation(s: float, gamma: float) -> float:
    """Return sat s of (1)."""
    return s if abs(s) < gamma else sign(s)


def boundary_layer(s: float, gamma: float) -> float:
    """Return sat s of (2)."""
    return s / gamma if abs(s) < gamma else sign(s)


def hysteresis(s: float, width: float, before: float) -> float:
    """Return hys s of (3); `before` is its last value, 0 at the start."""
    return sign(s) if abs(s) > width or before == 0.0 else before


class SaturationControl(Block):
    """u = -M_0 sat s, by (1) or, with scaled=1, by (2)."""

    DEFAULT_UNITS = {"unit": "N"}

    M_0 = Parameter(100.0, "gain", unit="$unit", min=0.0)
    gamma = Parameter(0.1, "half width of the boundary layer", min=0.0)
    scaled = Parameter(0.0, "0: (1), as printed; 1: (2), continuous", min=0.0, max=1.0)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = Output("gain", unit="$unit")
    sgn = Output("sign of s", unit="1")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0
        if self.scaled > 0.5:
            self.u = -self.M * boundary_layer(self.s, self.gamma)
        else:
            self.u = -self.M * saturation(self.s, self.gamma)


class HysteresisControl(Block):
    """u = -M_0 hys s: it switches only when s has left [-width, width] on the other side."""

    DEFAULT_UNITS = {"unit": "N"}

    M_0 = Parameter(100.0, "gain", unit="$unit", min=0.0)
    width = Parameter(0.1, "half width of the loop", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = Output("gain", unit="$unit")
    sgn = Output("sign of s", unit="1")
    before = Local(0.0, "switching function in the last call")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0
        self.before = hysteresis(self.s, self.width, self.before)
        self.u = -self.M * self.before
