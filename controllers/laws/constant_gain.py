"""Sliding mode control with a constant gain (the thesis' 4.1).

    u = -M sgn s                                                            (4.4)

Chapter 4 has M = 100 in cases 1 and 2, and M = 300 in cases 3 to 6. s is that of t_k; u is
held until the next call.
"""

from cosim import Block, Input, Output, Parameter
from cosim.functions import sign


class ConstantGain(Block):
    """u = -M_0 sgn s; the output M is M_0, as in the other gain laws."""

    DEFAULT_UNITS = {"unit": "N"}

    M_0 = Parameter(100.0, "gain", unit="$unit", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = Output("gain in use", unit="$unit")
    sgn = Output("sign of s", unit="1")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0
        self.u = -self.M * self.sgn  # (4.4)
