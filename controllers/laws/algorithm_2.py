"""Algorithm II: the gain grows with time and falls with every switch (the thesis' 4.4).

    M_k = M_{k-1} + alpha T_s                                               (1)
    M_k = M_k - beta T_s   if sgn s_k = -sgn s_{k-1}                        (2)
    M_1 <= M_k <= M_2                                                       (3)
    u = -M sgn s                                                            (4.4)

For systems with noise and disturbance, 0 < alpha < beta. Chapter 4 has M_1 = 1, M_2 = 300,
M_0 = 150, alpha = 10 and beta = 300 (100 in case 5); the sign before the first call is 0.
The thesis leaves two things open: here a switch is a strictly opposite sign, and (3)
applies once in a call, after (1) and (2).

T_s is the step h of the call. Under stage coupling every stage of the solver is a call with
the communication step as T_s, which reproduces the printed norms (905, 2491).
"""

from cosim import Block, Input, Local, Output, Parameter, State
from cosim.functions import clip, sign


class AlgorithmII(Block):
    """M rises by alpha T_s and falls by beta T_s at every change of sign of s; M=... sets its start."""

    DEFAULT_UNITS = {"unit": "N"}

    alpha = Parameter(10.0, "rate of increase", unit="$unit/s", min=0.0)
    beta = Parameter(300.0, "decrease at a switch, per second of T_s", unit="$unit/s", min=0.0)
    M1 = Parameter(1.0, "lower bound of the gain", unit="$unit", min=0.0)
    M2 = Parameter(300.0, "upper bound of the gain", unit="$unit", min=0.0)
    s = Input("sliding variable")
    u = Output("control force", unit="$unit")
    M = State(150.0, "gain", unit="$unit")
    sgn = Output("sign of s", unit="1")
    last = Local(0.0, "last sign that was not 0")

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        M = self.M + self.alpha * h  # (1)
        if self.sgn * self.last < 0.0:
            M -= self.beta * h  # (2)
        self.M = clip(M, self.M1, self.M2)  # (3)
        if self.sgn != 0.0:
            self.last = self.sgn
        self.u = -self.M * self.sgn  # (4.4)
