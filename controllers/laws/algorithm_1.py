"""Algorithm I: the gain falls with every switch (the thesis' 4.3).

    M_k = M_{k-1} / rate   if sgn s_k = -sgn s_{k-1}, otherwise M_{k-1}     (1)
    u = -M sgn s                                                            (4.4)

For systems without noise and disturbance. Chapter 4 has rate = 1.1 and M_0 = 100; the sign
before the first call is 0. The thesis leaves two things open. Here a switch is a strictly
opposite sign, so that leaving the 0 of the start is not one, and s = 0 keeps the last sign;
and M has a floor of 1, without which it vanishes within the 40 s of case 1.

k counts calls. Under stage coupling every stage of the solver is a call, which reproduces
the printed norms (672 and 765 in cases 1 and 2). s is that of t_k; u is held until the next
call.
"""

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import sign


class AlgorithmI(Block):
    """M is divided by `rate` at every change of sign of s, down to M_min; M=... sets its start."""

    DEFAULT_UNITS = {"unit": "N"}

    rate = Parameter(1.1, "divisor of the gain at a switch", unit="1", min=1.0)
    M_min = Parameter(1.0, "floor of the gain, not printed", unit="$unit", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = State(100.0, "gain", unit="$unit")
    sgn = Output("sign of s", unit="1")
    last = Local(0.0, "last sign that was not 0")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        if self.sgn * self.last < 0.0:
            self.M = max(self.M / self.rate, self.M_min)  # (1)
        if self.sgn != 0.0:
            self.last = self.sgn
        self.u = -self.M * self.sgn  # (4.4)
