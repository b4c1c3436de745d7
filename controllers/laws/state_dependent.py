"""Gain that depends on the state (the thesis' 4.2).

    M = M_0 (|x| + delta)                                                   (1)
    u = -M sgn s                                                            (4.4)

|x| is the Euclidean norm of the state (x_1, x_2). x mixes displacement and velocity, so M_0
has no unit of its own. The thesis gives no numbers for M_0 and delta.

Source: H. Lee and V. I. Utkin, Chattering suppression methods in sliding mode control
systems, Annual Reviews in Control 31 (2007) 179-188.
"""

from cosim import Block, Input, Output, Parameter
from cosim.functions import norm, sign


class StateDependentGain(Block):
    """M = M_0 (|x| + delta) with x[1] to x[n]; n is 2 by default."""

    DEFAULT_SIZES = {"n": 2}
    DEFAULT_UNITS = {"unit": "N"}

    M_0 = Parameter(10.0, "gain on the norm of the state", min=0.0)
    delta = Parameter(0.1, "least norm", min=0.0)
    x = Input("state", shape="n")
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = Output("gain", unit="$unit")
    sgn = Output("sign of s", unit="1")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0 * (norm(self.x) + self.delta)  # (1)
        self.u = -self.M * self.sgn  # (4.4)
