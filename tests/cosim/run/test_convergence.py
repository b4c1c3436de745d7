"""Orders of the methods, exactness of the linear hold, and compiled = interpreted."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

from cosim import Block, Continuous, Input, LinearContinuous, Output, Parameter, State, System, simulate
from cosim.functions import clip, matvec, sign, transposed_matvec_add
from tests.cosim.parts import Gain, Mass


class Oil(Continuous):
    """z' = -2 z + 1.5 x - z^3: a nonlinear partner of the mass."""

    x = Input()
    z = State(0.3)

    def derivatives(self, t):
        self.der_z = -2.0 * self.z + 1.5 * self.x - self.z * self.z * self.z


def coupled() -> System:
    """Mass and oil, each the other's input, the force through a block: one smooth system of order 3."""
    return System(
        {"oil": Oil(), "mass": Mass(), "gain": Gain(K=-1.3)},
        [("mass.x", "oil.x"), ("oil.z", "gain.x"), ("gain.u", "mass.u")],
    )


def reference(stop: float) -> np.ndarray:
    def slope(t, y):
        x, v, z = y
        a = (-1.3 * z - 0.3 * v - 2.1 * x - 0.9 * x**3) / 1.7
        return [v, a, -2.0 * z + 1.5 * x - z**3]

    return solve_ivp(slope, (0.0, stop), [0.8, -0.4, 0.3], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


@pytest.mark.parametrize(("solver", "order"), [("ode1", 1), ("ode2", 2), ("ode3", 3), ("ode4", 4)])
def test_order_of_convergence(solver, order):
    """The slope of log(error) over log(h) is the order; 0.2 allows for the next order at these steps.

    A block or an input that is one stage late would bring every method down to order 1.
    """
    stop = 2.0
    steps = np.array([20, 40, 80, 160])
    wanted = reference(stop)
    errors = []
    for n in steps:
        result = simulate(coupled(), step=stop / n, stop=stop, coupling="continuous", solver=solver)
        found = [result[name][-1] for name in ("mass.x", "mass.v", "oil.z")]
        errors.append(np.abs(found - wanted).max())
    slope = np.polyfit(np.log(stop / steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.2)


def test_sampled_coupling_is_of_first_order_in_the_held_inputs():
    """A zero-order hold delays by half a step on average: order 1, however exact the plants are."""
    wanted = reference(2.0)[0]
    errors = []
    for n in (40, 80, 160):
        result = simulate(coupled(), step=2.0 / n, stop=2.0)
        errors.append(abs(result["mass.x"][-1] - wanted))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.15)


@pytest.mark.parametrize("max_step", [np.inf, 0.05, 0.03])
def test_advance_takes_equal_substeps_of_at_most_max_step(max_step):
    """One step of 0.2 s: 1, 4 and 7 substeps of ode4, compared with stage coupling at that step."""
    substeps = {np.inf: 1, 0.05: 4, 0.03: 7}[max_step]
    held = simulate(System({"m": Mass(max_step=max_step)}), step=0.2, stop=1.0)
    fine = simulate(
        System({"m": Mass()}), step=0.2 / substeps, stop=1.0, coupling="continuous", solver="ode4"
    )
    # the same additions in another order: a few roundings of 1e-16 a substep
    assert held["m.x"] == pytest.approx(fine["m.x"][::substeps], abs=1e-14)


class Linear(LinearContinuous):
    """x' = A x + B u + c; both matrices are stored transposed."""

    At = Parameter(shape=("n", "n"))
    Bt = Parameter(shape=("m", "n"))
    c = Parameter(shape="n")
    u = Input(shape="m")
    x = State(shape="n")

    def derivatives(self, t):
        for i in range(self.c.shape[0]):
            self.der_x[i] = self.c[i]
        transposed_matvec_add(self.At, self.x, self.der_x)
        transposed_matvec_add(self.Bt, self.u, self.der_x)


class Autonomous(LinearContinuous):
    """x' = A x + c: no inputs."""

    At = Parameter(shape=("n", "n"))
    c = Parameter(shape="n")
    x = State(shape="n")

    def derivatives(self, t):
        for i in range(self.c.shape[0]):
            self.der_x[i] = self.c[i]
        transposed_matvec_add(self.At, self.x, self.der_x)


class Wave(Block):
    """Two different inputs of the time."""

    u = Output(shape=2)

    def step(self, t, h):
        self.u[0] = 1.0 + t * t
        self.u[1] = 2.0 - 3.0 * t


def held(A, B, c, u, x, h):
    """One step of x' = A x + B u + c by scipy's expm of the augmented matrix."""
    n, m = B.shape
    M = np.zeros((n + m + 1, n + m + 1))
    M[:n, :n], M[:n, n : n + m], M[:n, -1] = A, B, c
    return (scipy.linalg.expm(M * h) @ [*x, *u, 1.0])[:n]


@pytest.mark.parametrize("h", [1e-4, 0.1, 1.0, 8.0])
def test_the_linear_hold_is_exact_for_any_step(h):
    """Five random states, two inputs, an affine term; scipy's expm is the same approximant in other order.

    |A| h reaches 20: both lose some e^(|A| h / 20) digits in squaring, 1e-11 of the largest state.
    """
    random = np.random.default_rng(11)
    n, m, steps = 5, 2, 6
    A = random.normal(size=(n, n)) - 1.5 * np.eye(n)
    B, c, x0 = random.normal(size=(n, m)), random.normal(size=n), random.normal(size=n)
    plant = Linear(At=A.T, Bt=B.T, c=c, x=x0)
    system = System({"plant": plant, "wave": Wave()}, [("wave.u", "plant.u")])
    result = simulate(system, step=h, stop=steps * h)
    x = [x0]
    for k in range(steps):
        t = k * h
        x.append(held(A, B, c, [1.0 + t * t, 2.0 - 3.0 * t], x[-1], h))
    assert result["plant.x"] == pytest.approx(np.array(x), abs=1e-11 * np.abs(x).max())


def test_the_linear_hold_without_inputs():
    A = np.array([[-0.3, 2.0], [-1.0, 0.1]])
    result = simulate(System({"p": Autonomous(At=A.T, c=[0.5, -0.2], x=[1.0, 3.0])}), step=0.7, stop=2.1)
    x = np.array([1.0, 3.0])
    for k in range(4):
        assert result["p.x"][k] == pytest.approx(x, rel=1e-13)
        x = held(A, np.zeros((2, 0)), [0.5, -0.2], [], x, 0.7)


class Relay(Block):
    """A switching law with memory, in arithmetic only; it amplifies a difference in the last bit."""

    x = Input()
    v = Input()
    s = State(0.0, shape=2)
    u = Output()

    def step(self, t, h):
        self.s[0] = 0.7 * self.s[0] + 0.3 * (self.v + 2.0 * self.x)
        self.s[1] += h * self.s[0] / (1.0 + self.s[0] * self.s[0])
        self.u = clip(-3.0 * sign(self.s[0]) - self.s[1], -2.5, 2.5)


def test_compiled_is_interpreted_bit_for_bit():
    """10,000 steps of arithmetic without library functions, chaotic enough to show any last bit."""
    links = [("mass.x", "relay.x"), ("mass.v", "relay.v"), ("relay.u", "mass.u")]
    runs = [
        simulate(System({"mass": Mass(), "relay": Relay()}, links), step=0.01, stop=100.0, jit=jit)
        for jit in (True, False)
    ]
    for name in runs[0].signals:
        assert np.array_equal(runs[0][name], runs[1][name]), name
    assert np.abs(runs[0]["mass.x"]).max() > 0.1  # something moves


class Product(Block):
    """y = A x"""

    A = Parameter(shape=("m", "n"))
    x = Input(shape="n")
    y = Output(shape="m")

    def step(self, t, h):
        matvec(self.A, self.x, self.y)


def test_the_coupling_of_a_non_square_gain():
    """u = A x with A (2, 5) in the loop, against numpy."""
    random = np.random.default_rng(3)
    A, B, K = (
        random.normal(size=(5, 5)) - 3.0 * np.eye(5),
        random.normal(size=(5, 2)),
        random.normal(size=(2, 5)),
    )
    x = random.normal(size=5)
    plant = Linear(At=A.T, Bt=B.T, c=np.zeros(5), x=x)
    result = simulate(
        System({"p": plant, "k": Product(A=K)}, [("p.x", "k.x"), ("k.y", "p.u")]), step=0.05, stop=1.0
    )
    for k in range(21):
        # 20 steps of a stable loop, an expm of each side: 1e-14 a step
        assert result["p.x"][k] == pytest.approx(x, rel=1e-11, abs=1e-12)
        x = held(A, B, np.zeros(5), K @ x, x, 0.05)
