"""Algorithm II: the gain grows with time and falls with every switch (thesis 4.4).

    every call:                M = M + alpha Ts
    if sgn s(i) = -sgn s(i-1): M = M - beta Ts as well
    M limited to [M1, M2], u = -M sgn(s)                          (4.4)

For systems with noise and disturbance, 0 < alpha < beta. Chapter 4: M1 = 1, M2 = 300,
M(0) = 150, alpha = 10, beta = 300 (100 in case 5); the memory of sgn(s) starts at 0.
What the thesis does not print: a switch is a strictly opposite sign, and the limits
apply once a call, after both changes.

Ts is the step h of the call. Under stage coupling every solver stage is a call with
the communication step as Ts, which is what reproduces the printed norms (905, 2491).
"""

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import clip, sign


class AlgorithmII(Block):
    """M rises at `alpha` per second and falls by beta Ts at every change of sign of s; start it with M=..."""

    alpha = Parameter(10.0, "rate of increase", unit="N/s", min=0.0)
    beta = Parameter(300.0, "decrease at a switch, per second of Ts", unit="N/s", min=0.0)
    M1 = Parameter(1.0, "lower bound of the gain", unit="N", min=0.0)
    M2 = Parameter(300.0, "upper bound of the gain", unit="N", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = State(150.0, "gain", unit="N")
    sgn = Output("sign of s", unit="1")
    last = Local(0.0, "last sign that was not 0")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        M = self.M + self.alpha * h
        if self.sgn * self.last < 0.0:
            M -= self.beta * h
        self.M = clip(M, self.M1, self.M2)
        if self.sgn != 0.0:
            self.last = self.sgn
        self.u = -self.M * self.sgn  # (4.4)
