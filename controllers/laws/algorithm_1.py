"""Algorithm I: the gain falls with every switch (thesis 4.3).

    if sgn s(i) = sgn s(i-1):  M(i) = M(i-1),  else  M(i) = M(i-1) / rate
    u = -M sgn(s)                                                 (4.4)

For systems without noise and disturbance. Chapter 4: rate = 1.1, M(0) = 100, the
memory of sgn(s) starts at 0. What the thesis does not print: a switch is a strictly
opposite sign (leaving the 0 of the start is none, and s = 0 keeps the memory), and M
has a floor of 1; without it M falls to nothing within the 40 s of case 1.

i counts calls: under stage coupling every solver stage is one, which is what
reproduces the printed norms (672 and 765 in cases 1 and 2).
"""

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import sign


class AlgorithmI(Block):
    """M is divided by `rate` at every change of sign of s, down to M_min; start it with M=..."""

    rate = Parameter(1.1, "factor of decrease at a switch", unit="1", min=1.0)
    M_min = Parameter(1.0, "floor of the gain, not printed", unit="N", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = State(100.0, "gain", unit="N")
    sgn = Output("sign of s", unit="1")
    last = Local(0.0, "last sign that was not 0")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        if self.sgn * self.last < 0.0:
            self.M = max(self.M / self.rate, self.M_min)
        if self.sgn != 0.0:
            self.last = self.sgn
        self.u = -self.M * self.sgn  # (4.4)
