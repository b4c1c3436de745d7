"""Small participants that the tests of the core share."""

from __future__ import annotations

from cosim import FMU, Block, Continuous, Input, LinearContinuous, Output, Parameter, State, System


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


class Three(Block):
    """y = (1, 20, 300) x_i + t; M = [[1, 2, 3], [4, 5, 6]]"""

    x = Input(shape=3)
    y = Output(shape=3)
    M = Output(shape=(2, 3))
    accel = Output(unit="m/s^2")

    def step(self, t, h):
        self.y[0] = self.x[0] + 1.0
        self.y[1] = self.x[1] + 20.0
        self.y[2] = self.x[2] + 300.0
        for i in range(2):
            for j in range(3):
                self.M[i, j] = 3.0 * i + j + 1.0


class Diverges(Continuous):
    """x' = x^2: infinite at t = 1 / x0 = 0.5, whatever the solver makes of it; no outputs."""

    x = State(2.0)

    def derivatives(self, t):
        self.der_x = self.x * self.x


class Chain(LinearContinuous):
    """Two masses, two forces, accelerations as feedthrough outputs, not symmetric."""

    k = Parameter(3.0)
    u = Input(shape=2)
    x = State([0.5, -0.2], shape=2)
    v = State([0.1, 0.7], shape=2)
    a = Output(shape=2)

    def derivatives(self, t):
        self.der_x[0] = self.v[0]
        self.der_x[1] = self.v[1]
        self.der_v[0] = self.u[0] - self.k * self.x[0] + 0.4 * self.x[1] - 0.1 * self.v[0]
        self.der_v[1] = 0.5 * self.u[1] + 0.3 * self.x[0] - 2.0 * self.x[1]

    def outputs(self, t):
        self.a[0] = self.der_v[0]
        self.a[1] = self.der_v[1]


def closed(plant: Continuous | FMU) -> System:
    """Close a loop around a Chain: the second mass is watched, the first one is pushed."""
    return System({"plant": plant, "g": Gain(K=-0.8)}, [("plant.x[2]", "g.x"), ("g.u", "plant.u[1]")])
