"""State-dependent gain (thesis 4.2, after Lee and Utkin 2007).

    M(x) = M_0 (|x| + delta),  u = -M sgn(s)                      (4.4)

|x| is the Euclidean norm of the state (x1, x2); the thesis gives no numbers for M_0
and delta. x mixes displacement and velocity, so M_0 carries no single unit.
"""

from cosim import Block, Input, Output, Parameter
from cosim.functions import norm, sign


class StateDependentGain(Block):
    """M = M_0 (|x| + delta); connect x[1] .. x[n], n = 2 unless another is given."""

    M_0 = Parameter(10.0, "gain on the norm of the state", min=0.0)
    delta = Parameter(0.1, "least norm", min=0.0)
    x = Input("state", shape="n")
    s = Input("sliding variable")
    u = Output("control force", unit="N")
    M = Output("gain", unit="N")
    sgn = Output("sign of s", unit="1")

    def __init__(self, M_0: float = 10.0, delta: float = 0.1, *, n: int = 2) -> None:
        super().__init__(M_0=M_0, delta=delta, n=n)

    def step(self, t: float, h: float) -> None:
        self.sgn = sign(self.s)
        self.M = self.M_0 * (norm(self.x) + self.delta)
        self.u = -self.M * self.sgn  # (4.4)
