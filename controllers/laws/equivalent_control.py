"""Equivalent-control-dependent gain (thesis 4.2, after Lee and Utkin 2007).

    M(s) = M_0 (|z| + delta),  u = -M sgn(s)                      (4.4)

z is the average of sgn(s) by a first-order low-pass filter, tau z' + z = sgn(s), of
the signs of the calls before, each held until the next call:

    z(t_i) = z(t_{i-1}) + (1 - e^(-(t_i - t_{i-1}) / tau)) (sgn s(t_{i-1}) - z(t_{i-1}))

Away from the surface |z| goes to 1 and M to M_0 (1 + delta); in a sliding mode M_0 z is
the equivalent control. The thesis gives no numbers for M_0, delta and the filter.
"""

import math

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import sign


class EquivalentControlGain(Block):
    """M = M_0 (|z| + delta), z the low-pass average of sgn(s); z starts at 1, away from the surface."""

    M_0 = Parameter(100.0, "gain on the average", unit="N", min=0.0)
    delta = Parameter(0.01, "least average", unit="1", min=0.0)
    tau = Parameter(0.1, "time constant of the average", unit="s", min=1e-12)
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = Output("gain", unit="N")
    sgn = Output("sign of s", unit="1")
    z = State(1.0, "average of sgn(s)", unit="1")
    before = Local(0.0, "time of the call before", unit="s")
    called = Local(0.0, "1 after the first call")

    def step(self, t: float, h: float) -> None:
        if self.called > 0.0:
            self.z += -math.expm1(-(t - self.before) / self.tau) * (self.sgn - self.z)
        self.before = t
        self.called = 1.0
        self.sgn = sign(self.s)
        self.M = self.M_0 * (abs(self.z) + self.delta)
        self.u = -self.M * self.sgn  # (4.4)
