"""Time is the integer k: the order of the calls, the t of each call, and the sample that it sees."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Block, DeclarationError, Input, Output, State, System, TimeError, simulate
from cosim.core.time_grid import steps_between
from tests.cosim.parts import Counter, Gain, Integrator, Mass, Ramp, Through


class Clock(Block):
    """late = 1 once t is not t0 + k h, bit for bit; k counts exactly below 2^53."""

    t0 = Input(start=-3.7)
    k = State(0.0)
    wrong = State(0.0)
    t_last = Output()

    def step(self, t, h):
        if t != self.t0 + self.k * h:
            self.wrong = 1.0
        self.k += 1.0
        self.t_last = t


@pytest.mark.parametrize("steps", [256_040, 1_000_000])
def test_time_is_exactly_t0_plus_k_h(steps):
    """A running sum is off in the last digits after ten steps of 1 ms; this is not, after a million."""
    h, t0 = 0.001, -3.7
    result = simulate(
        System({"c": Clock()}), start=t0, step=h, stop=t0 + steps * h, record=["c.t_last", "c.wrong", "c.k"]
    )
    assert result["c.k"][-1] == steps + 1
    assert result["c.wrong"][-1] == 0.0
    wanted = t0 + np.arange(steps + 1) * h
    assert np.array_equal(result.time, wanted)
    assert np.array_equal(result["c.t_last"], wanted)


def test_outputs_carry_the_input_of_the_step_before():
    """y_k = u_{k-1} + x_k: the feedthrough of the held input, y_0 of the start value."""
    h, n = 0.1, 7
    system = System({"ramp": Ramp(), "plant": Through()}, [("ramp.u", "plant.u")])
    result = simulate(system, step=h, stop=n * h)
    held = np.array([0.25, *(2.0 + 3.0 * np.arange(n) * h)])  # one shift is worth 0.3
    # ode4 of x' = -x: the Taylor polynomial of e^-h, the same at each step
    factor = 1 - h + h**2 / 2 - h**3 / 6 + h**4 / 24
    x = factor ** np.arange(n + 1)
    assert result["plant.y"] == pytest.approx(held + x, rel=1e-14)  # 8 roundings of 1e-16
    assert result["ramp.u"] == pytest.approx(2.0 + 3.0 * np.arange(n + 1) * h, rel=1e-15)


def test_inputs_are_held_over_the_step_that_follows():
    """x_{k+1} = x_k + h u_k, so x is the sum of u_0 .. u_{k-1}; exact numbers: h is a power of 2."""
    h, n = 0.125, 9
    system = System({"plant": Integrator(), "ramp": Ramp()}, [("ramp.u", "plant.u")])
    result = simulate(system, step=h, stop=n * h, record=["plant.x", "plant.y", "plant.u"])
    u = 2.0 + 3.0 * np.arange(n) * h
    x = np.array([0.0, *np.cumsum(h * u)])
    assert result["plant.x"] == pytest.approx(x, rel=1e-14)
    assert result["plant.y"] == pytest.approx(10.0 * x, rel=1e-14)
    assert np.array_equal(result["plant.u"], [7.0, *u])  # the value that led to y_k


def test_a_slow_block_acts_at_0_3_6_and_holds():
    h = 0.25
    system = System({"slow": Counter(every=3), "timed": Counter(sample_period=0.5)})
    result = simulate(system, step=h, stop=8 * h)
    assert result["slow.n"].tolist() == [1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert result["slow.t_call"].tolist() == [0, 0, 0, 0.75, 0.75, 0.75, 1.5, 1.5, 1.5]
    assert result["timed.n"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5]


@pytest.mark.parametrize("coupling", ["sampled", "continuous"])
def test_a_delayed_connection_is_one_step_late_everywhere(coupling):
    """Into a block and into a plant: x_{k+1} = x_k + h u_{k-1}, at every stage of the step."""
    h, n = 0.25, 6
    system = System({"ramp": Ramp(every=1), "plant": Integrator(), "gain": Gain(K=1.0, every=1)})
    system.connect("ramp.u", "plant.u", initial=-5.0)
    system.connect("ramp.u", "gain.x", initial=-5.0)
    result = simulate(system, step=h, stop=n * h, coupling=coupling, solver="ode4")
    late = np.array([-5.0, *(2.0 + 3.0 * h * np.arange(n))])
    assert np.array_equal(result["gain.u"], late)
    assert result["plant.x"] == pytest.approx([0.0, *np.cumsum(h * late[:-1])], rel=1e-14)


def test_a_delayed_connection_between_rates_is_late_by_the_communication_step():
    """The slow block reads at k = 0, 2, 4 what the source had at k = -1, 1, 3."""
    system = System({"source": Counter(), "slow": Gain(K=10.0, every=2)})
    system.connect("source.n", "slow.x", initial=-1.0)
    result = simulate(system, step=0.5, stop=2.5)
    assert result["slow.u"].tolist() == [-10, -10, 20, 20, 40, 40]


def test_blocks_run_at_every_stage_with_the_time_of_the_stage():
    """ode3 has nodes 0, 1/2, 3/4; the last point has its first stage only."""
    system = System({"counter": Counter(), "slow": Counter(every=2), "plant": Mass()})
    result = simulate(system, step=0.5, stop=2.0, coupling="continuous", solver="ode3")
    assert result["counter.n"].tolist() == [1, 4, 7, 10, 13]
    assert result["slow.n"].tolist() == [1, 1, 2, 2, 3]
    assert result["counter.t_call"].tolist() == result.time.tolist()


@settings(max_examples=25, deadline=None)  # the first example compiles
@given(rates=st.lists(st.integers(1, 7), min_size=1, max_size=4), n=st.integers(1, 40))
def test_any_rates(rates, n):
    """Against a Python loop: the i-th block adds its own count to what it reads, slow or not."""
    blocks = {f"b{i}": Chain(every=rate) for i, rate in enumerate(rates)}
    links = [(f"b{i}.y", f"b{i + 1}.x") for i in range(len(rates) - 1)]
    result = simulate(System(dict(reversed(blocks.items())), links), step=0.5, stop=0.5 * n)
    count, y = [0.0] * len(rates), [0.0] * len(rates)
    for k in range(n + 1):
        for i, rate in enumerate(rates):
            if k % rate == 0:
                count[i] += 1.0
                y[i] = count[i] + 2.0 * (y[i - 1] if i else 0.5)
        assert [result[f"b{i}.y"][k] for i in range(len(rates))] == y


class Chain(Block):
    """y = n + 2 x, n counts"""

    n = State(0.0)
    x = Input(start=0.5)
    y = Output()

    def step(self, t, h):
        self.n += 1.0
        self.y = self.n + 2.0 * self.x


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step": 0.0}, "step=0 s; a communication step must be above zero"),
        ({"step": -0.1}, "above zero"),
        ({"step": math.nan}, "must be a finite number"),
        ({"step": "0.1"}, "must be a finite number"),
        ({"step": 0.03}, "the time from start to stop of 1 s is 33.3333 communication steps"),
        ({"step": 0.1 + 1e-8}, "must be a whole number of them"),
        ({"step": 1e-320}, "steps of .* s, which is too many"),
        ({"stop": 0.0}, "is not after start"),
        ({"stop": math.inf}, "must be a finite number"),
        ({"stop": None}, "stop=None must be a finite number"),
        ({"decimation": 0}, "decimation=0"),
        ({"decimation": 2.5}, "decimation=2.5"),
        ({"coupling": "sample"}, "did you mean 'sampled'"),
        ({"solver": "ode5", "coupling": "continuous"}, "solver 'ode5' is not known"),
        ({"coupling": None}, "coupling 'None' is not known"),
        ({"solver": ["ode3"]}, "is not known; did you mean 'ode3'"),
        ({"record": "ramp.u"}, "give a list of ports"),
        ({"record": [1]}, "must be a list of ports"),
        ({"statistics": 5}, "5 must be a list of ports"),
    ],
)
def test_what_does_not_fit_the_grid_is_refused(options, words):
    with pytest.raises(Exception, match=words.replace("(", r"\(")) as caught:
        simulate(System({"ramp": Ramp()}), **({"step": 0.1, "stop": 1.0} | options))
    assert type(caught.value).__module__ == "cosim.errors"


@pytest.mark.parametrize("period", [0.15, 0.05, 0.1000001, 0.3000001])
def test_a_sample_period_that_is_not_a_multiple_is_refused_never_rounded(period):
    with pytest.raises(TimeError, match=r"ramp: sample period of .* whole number"):
        simulate(System({"ramp": Ramp(sample_period=period)}), step=0.1, stop=1.2)


@pytest.mark.parametrize("options", [{"every": 0}, {"every": 1.5}, {"every": "a"}, {"sample_period": "a"},
                                     {"sample_period": 0.0}, {"sample_period": math.inf},
                                     {"every": 2, "sample_period": 0.1}])  # fmt: skip
def test_wrong_rates_are_refused_where_they_are_given(options):
    with pytest.raises(DeclarationError, match="Ramp"):
        Ramp(**options)


@pytest.mark.parametrize(
    ("period", "h", "proposed"),
    [
        (1.0, 0.03, "0.025"),  # 34 steps would be 0.0294118 s, which does not divide 1 s
        (0.15, 0.1, "0.075"),
        (12.0, 0.7, "0.6"),
        (0.3000001, 0.1, "0.3000001/4"),  # no step of six digits fits
        (math.pi, 0.01, "3.141592653589793/315"),
        (0.05, 0.1, "0.05"),
        (1.0, 0.1 + 1e-8, "0.1"),
    ],
)
def test_the_step_that_an_error_proposes_is_accepted(period, h, proposed):
    with pytest.raises(TimeError, match=f"choose a step such as {proposed} s$") as caught:
        steps_between(period, h, "the time")
    assert "is 3 communication" not in str(caught.value)  # 3.000001 must not look whole
    numerator, _, denominator = proposed.partition("/")
    assert steps_between(period, float(numerator) / float(denominator or 1), "the time") >= 1


def test_a_count_of_steps_beyond_the_precision_of_the_ratio_passes():
    """1e8 / 0.001 is off by one unit in its last place, 1.5e-5 of a step."""
    assert steps_between(1e8, 0.001, "the time") == 10**11
    with pytest.raises(TimeError, match=r"100000000000\.5 communication steps"):
        steps_between(1e8 + 0.0005, 0.001, "the time")


def test_decimal_steps_pass():
    """0.3 / 0.1 and 900 / 0.001 are not whole numbers in binary; they are meant to be."""
    for step, period, stop in ((0.1, 0.3, 1.2), (0.001, 0.007, 900.004), (1 / 3, 1.0, 7.0)):
        system = System({"ramp": Ramp(sample_period=period)})
        assert simulate(system, step=step, stop=stop, record=[], statistics=[]).steps == round(stop / step)


def test_runs_repeat_bit_for_bit_and_leave_the_participants_alone():
    plant = Mass()
    system = System({"plant": plant, "control": Gain()}, [("plant.x", "control.x"), ("control.u", "plant.u")])
    one, two = (simulate(system, step=0.01, stop=3.0) for _ in range(2))
    assert np.array_equal(one["plant.x"], two["plant.x"])
    assert plant.x == 0.8


def test_a_block_gets_its_own_period_and_a_continuous_the_step():
    """h of a block that acts every 3 points is 3 steps; 0.25 and 0.75 are exact."""
    system = System({"fast": Counter(), "slow": Counter(every=3)})
    result = simulate(system, step=0.25, stop=2.0)
    assert set(result["fast.h_call"]) == {0.25}
    assert set(result["slow.h_call"]) == {0.75}
