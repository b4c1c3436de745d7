"""Iterated coupling: a structure and a damper that exchange motion and force, as two plants."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import (
    FMU,
    CoSimulation,
    Input,
    LinearContinuous,
    OptionError,
    Output,
    Parameter,
    Simulation,
    SimulationError,
    State,
    System,
    WiringError,
    schedule,
    simulate,
)
from cosim.run.coupling.quasi_newton import NoConvergence, QuasiNewton
from fmus.export import export
from tests.cosim.fmi.metronome import metronome
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Gain, Mass, Ramp


class Structure(LinearContinuous):
    """m x'' + c x' + k x = f + w"""

    m, c, k = Parameter(2.0), Parameter(0.3), Parameter(50.0)
    f = Input(unit="kN")
    w = Input(unit="N")
    x = State(0.1, unit="m")
    v = State(-0.4, unit="m/s")
    a = Output(unit="m/s^2")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = (1000.0 * self.f + self.w - self.c * self.v - self.k * self.x) / self.m

    def outputs(self, t):
        self.a = self.der_v


class Damper(LinearContinuous):
    """A mass on a spring and a dashpot; the reaction on the structure feeds its motion through."""

    m, c, k = Parameter(0.3), Parameter(0.7), Parameter(6.0)
    x_top = Input(unit="m")
    v_top = Input(unit="m/s")
    x = State(0.05, unit="m")
    v = State(0.2, unit="m/s")
    reaction = Output(unit="N")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = -(self.c * (self.v - self.v_top) + self.k * (self.x - self.x_top)) / self.m

    def outputs(self, t):
        self.reaction = self.c * (self.v - self.v_top) + self.k * (self.x - self.x_top)


class Both(LinearContinuous):
    """The two as one: the exact solution for a load that is held."""

    w = Input(unit="N")
    x, v, y, z = State(0.1), State(-0.4), State(0.05), State(0.2)
    r = Output()

    def derivatives(self, t):
        reaction = 0.7 * (self.z - self.v) + 6.0 * (self.y - self.x)
        self.der_x = self.v
        self.der_v = (reaction + self.w - 0.3 * self.v - 50.0 * self.x) / 2.0
        self.der_y = self.z
        self.der_z = -reaction / 0.3

    def outputs(self, t):
        self.r = 0.7 * (self.z - self.v) + 6.0 * (self.y - self.x)


WIRES = [("one.x", "two.x_top"), ("one.v", "two.v_top"), ("two.reaction", "one.f"), ("push.u", "one.w")]
RECORD = ["one.x", "one.a", "two.x", "two.reaction"]


def pair(one=None, two=None) -> System:
    """Structure and damper; the reaction is converted from N to kN on its way."""
    return System({"push": Ramp(sample_period=0.1), "one": one or Structure(), "two": two or Damper()}, WIRES)


def exact(step: float):
    system = System({"push": Ramp(sample_period=0.1), "p": Both()}, [("push.u", "p.w")])
    return simulate(system, step=step, stop=2.0, record=["p.x", "p.y", "p.r"])


def errors(steps, **options):
    found = []
    for h in steps:
        wanted, got = exact(h), simulate(pair(), step=h, stop=2.0, record=RECORD, **options)
        names = (("p.x", "one.x"), ("p.y", "two.x"), ("p.r", "two.reaction"))
        later = slice(round(0.1 / h), None)  # plain coupling does not know the reaction at the start
        found.append([np.abs(wanted[a] - got[b])[later].max() / np.abs(wanted[a]).max() for a, b in names])
    return np.array(found)


def test_the_delay_of_plain_coupling_is_of_first_order_and_iterated_coupling_of_second():
    """Half the step, half the one error and a quarter of the other; to 10 %, the next order here."""
    steps = (0.0125, 0.00625)
    plain, iterated = errors(steps), errors(steps, coupling="iterated")
    assert np.log2(plain[0] / plain[1]) == pytest.approx(np.ones(3), abs=0.1)
    assert np.log2(iterated[0] / iterated[1]) == pytest.approx(2 * np.ones(3), abs=0.1)
    assert (iterated[1] < plain[1] / 50).all()


def test_fmus_give_what_python_gives(tmp_path):
    """FMUs of both versions; the exponentials are computed by the same code, steps converge to 1e-8."""
    one = export(Structure(), tmp_path / "one.fmu")
    two = export(Damper(), tmp_path / "two.fmu", fmi_version="3.0")
    options = {"step": 0.0125, "stop": 2.0, "record": RECORD, "coupling": "iterated"}
    wanted = simulate(pair(), **options)
    for first, second in ((FMU(one), FMU(two)), (FMU(one), Damper())):
        got = simulate(pair(first, second), **options)
        for name in RECORD:
            assert got[name] == pytest.approx(wanted[name], abs=1e-9 * np.abs(wanted[name]).max())


def test_what_is_exchanged_agrees_at_every_communication_point():
    """The interface conditions, checked from the recorded signals alone: to the tolerance."""
    tolerance = 1e-10
    record = ["two.x_top", "two.v_top", "one.f", "one.x", "one.v", "two.reaction"]
    result = simulate(pair(), step=0.02, stop=2.0, record=record, coupling="iterated", tolerance=tolerance)
    for target, source, scale in zip(record[:3], record[3:], (1.0, 1.0, 1e-3), strict=True):
        size = np.abs(result[target]).max()
        assert result[target] == pytest.approx(scale * result[source], abs=2 * tolerance * size)


def test_a_coupling_that_plain_coupling_cannot_carry_is_stable():
    """A heavy damper on a light structure: the delay feeds energy in, and without it the motion decays."""

    def heavy() -> System:
        return pair(Structure(m=0.1), Damper(m=2.0, k=300.0, c=3.0))

    plain = simulate(heavy(), step=0.05, stop=20.0, record=["one.x"])
    iterated = simulate(heavy(), step=0.05, stop=20.0, record=["one.x"], coupling="iterated")
    assert np.abs(plain["one.x"]).max() > 1e3
    assert np.abs(iterated["one.x"]).max() < 3.0


def test_snapshots_of_an_iterated_run_return_exactly():
    with Simulation(pair(), step=0.05, record=RECORD, coupling="iterated") as simulation:
        simulation.run(0.5)
        there = simulation.snapshot()
        one = simulation.run(1.5)
        simulation.restore(there)
        two = simulation.run(1.5)
    assert all(np.array_equal(one[name], two[name]) for name in RECORD)


def test_the_schedule_says_what_is_repeated():
    agree = "agree at t_k+1 to 1e-08 (Python callback)"
    assert schedule(pair(), step=0.05, coupling="iterated").splitlines() == [
        "iterated coupling",
        "at t_k:",
        "  one: outputs",
        "  two: outputs",
        "  push: step (every 2)",
        "to t_k+1:",
        "  one.w <- push.u",
        f"  one, two: step, repeated until one.x, one.v, two.reaction {agree}",
    ]


def test_what_cannot_be_iterated_is_refused(tmp_path):
    with pytest.raises(WiringError, match="has nothing to iterate"):
        simulate(
            System({"m": Mass(), "g": Gain()}, [("m.x", "g.x")]), step=0.1, stop=1.0, coupling="iterated"
        )
    system = System({"theirs": FMU(probe(tmp_path / "p.fmu", "2.0")), "m": Mass()}, [("m.x", "theirs.r_in")])
    with pytest.raises(WiringError, match="theirs cannot be iterated: it cannot get and set its state"):
        simulate(system, step=0.1, stop=1.0, coupling="iterated")
    with pytest.raises(OptionError, match="tolerance=0 must be a number between 0 and 1"):
        simulate(pair(), step=0.1, stop=1.0, coupling="iterated", tolerance=0)


def test_newton_solves_linear_systems_at_once_and_keeps_its_jacobian():
    """Linear, not symmetric: one solve by differences of 1e-6 leaves 1e-9, the next step round-off."""
    random = np.random.default_rng(2)
    A, b = random.standard_normal((4, 4)), random.standard_normal(4)
    solver = QuasiNewton(4, 1e-12)
    for offset in (0.0, 1.0, 2.0):
        w = solver.solve(lambda w, c=offset: A @ w + b + c, np.zeros(4))
        assert w == pytest.approx(np.linalg.solve(np.eye(4) - A, b + offset), rel=1e-10)
    assert solver.evaluations[0] <= 4 + 4 * 3


def test_newton_says_when_there_is_no_solution():
    with pytest.raises(NoConvergence):
        QuasiNewton(1, 1e-9).solve(lambda w: w + 1.0 + w * w, np.array([0.3]))


def test_a_trial_that_goes_far_does_not_loosen_the_tolerance():
    """w^2 = 1 from 0.02: the first step goes to 25, where the residual is 600 times that of the solution."""
    w = QuasiNewton(1, 1e-3).solve(lambda w: w - (w * w - 1.0), np.array([0.02]))
    assert abs(w[0] * w[0] - 1.0) <= 1e-3 * 1.001  # of |g(w)|, which is 1 to the tolerance


class Backwards(LinearContinuous):
    """x' = -x, y = -1 - u / 2"""

    u = Input()
    x = State(1.0)
    y = Output()

    def derivatives(self, t):
        self.der_x = -self.x

    def outputs(self, t):
        self.y = -1.0 - 0.5 * self.u


def test_an_fmu_that_asks_to_end_while_the_start_is_iterated(tmp_path):
    """A negative rate, set as a discrete input, is an event in which the metronome asks to end."""
    system = System({"m": FMU(metronome(tmp_path / "m.fmu"), interface=CoSimulation(True)), "b": Backwards()})
    system.connect("m.x", "b.u")
    system.connect("b.y", "m.rate")
    with pytest.raises(SimulationError, match=r"m asked to end .* at t = 0 s, at the start of the run"):
        simulate(system, step=0.25, stop=1.0, coupling="iterated")


class Jumps(LinearContinuous):
    """Its output answers any change of the input by more than that change, in the other direction."""

    u = Input()
    x = State(0.3)
    y = Output()

    def derivatives(self, t):
        self.der_x = -self.x

    def outputs(self, t):
        self.y = self.x + 3.0 * self.u * self.u + 1.0


def test_a_coupling_without_solution_ends_the_run_with_what_was_computed():
    """y = x + 3 u^2 + 1 with u = y has no real solution: seen at the start, said with place and size."""
    system = System({"a": Jumps(), "b": Jumps()}, [("a.y", "b.u"), ("b.y", "a.u")])
    with pytest.raises(SimulationError, match=r"a, b did not converge at t = 0 s: [ab]\.y is off by"):
        simulate(system, step=0.1, stop=1.0, coupling="iterated")
