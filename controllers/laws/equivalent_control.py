"""Gain that depends on the equivalent control (the thesis' 4.2).

    tau z' + z = sgn s                                                      (1)
    M = M_0 (|z| + delta)                                                   (2)
    u = -M sgn s                                                            (4.4)

z is an average of sgn s. (1) is exact for signs that are held between the calls:

    z_k = z_{k-1} + (1 - e^(-(t_k - t_{k-1})/tau)) (sgn s_{k-1} - z_{k-1})

Away from the surface |z| tends to 1 and M to M_0 (1 + delta); in a sliding mode M_0 z is
the equivalent control. The thesis gives no numbers for M_0, delta and tau.

Source: H. Lee and V. I. Utkin, Chattering suppression methods in sliding mode control
systems, Annual Reviews in Control 31 (2007) 179-188.
"""

import math

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import sign


class EquivalentControlGain(Block):
    """M = M_0 (|z| + delta), where z averages sgn s; z starts at 1, its value away from the surface."""

    DEFAULT_UNITS = {"unit": "N"}

    M_0 = Parameter(100.0, "gain on the average", unit="$unit", min=0.0)
    delta = Parameter(0.01, "least average", unit="1", min=0.0)
    tau = Parameter(0.1, "time constant of the average", unit="s", min=1e-12)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = Output("gain", unit="$unit")
    sgn = Output("sign of s", unit="1")
    z = State(1.0, "average of sgn(s)", unit="1")
    before = Local(0.0, "time of the last call", unit="s")
    called = Local(0.0, "1 after the first call")

    def step(self, t: float, h: float) -> None:
        if self.called > 0.0:
            self.z += -math.expm1(-(t - self.before) / self.tau) * (self.sgn - self.z)  # (1)
        self.before = t
        self.called = 1.0
        self.sgn = sign(self.s)
        self.M = self.M_0 * (abs(self.z) + self.delta)  # (2)
        self.u = -self.M * self.sgn  # (4.4)
