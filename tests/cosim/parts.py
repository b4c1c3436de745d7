"""Small participants that the tests of the core share."""

from __future__ import annotations

from cosim import Block, Continuous, Input, LinearContinuous, Output, Parameter, State


class Ramp(Block):
    """u = 2 + 3 t"""

    u = Output()

    def step(self, t, h):
        self.u = 2.0 + 3.0 * t


class Gain(Block):
    """u = K x"""

    K = Parameter(-2.0)
    x = Input()
    u = Output()

    def step(self, t, h):
        self.u = self.K * self.x


class Counter(Block):
    """n counts the calls and t_call is the time of the last one."""

    n = State(0.0)
    t_call = Output(start=-1.0)
    h_call = Output()

    def step(self, t, h):
        self.n += 1.0
        self.t_call = t
        self.h_call = h


class Mass(Continuous):
    """m x'' + c x' + k x + b x^3 = u, with the acceleration as feedthrough output."""

    m = Parameter(1.7)
    c = Parameter(0.3)
    k = Parameter(2.1)
    b = Parameter(0.9)
    u = Input()
    x = State(0.8)
    v = State(-0.4)
    a = Output()

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = (self.u - self.c * self.v - self.k * self.x - self.b * self.x * self.x * self.x) / self.m

    def outputs(self, t):
        self.a = self.der_v


class Integrator(LinearContinuous):
    """x' = u: x counts held inputs, so that a shift of one sample shows."""

    u = Input(start=7.0)
    x = State(0.0)
    y = Output()

    def derivatives(self, t):
        self.der_x = self.u

    def outputs(self, t):
        self.y = 10.0 * self.x


class Through(Continuous):
    """y = u + x, x' = -x: an output that depends on the input at once."""

    u = Input(start=0.25)
    x = State(1.0)
    y = Output()

    def derivatives(self, t):
        self.der_x = -self.x

    def outputs(self, t):
        self.y = self.u + self.x
