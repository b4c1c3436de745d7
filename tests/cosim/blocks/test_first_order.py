"""The low-pass filter (2.17) and the first-order actuator against their closed forms."""

import math

import numpy as np
import pytest

from cosim import Block, Output, System, simulate
from cosim.blocks import DiscreteLowPass, FirstOrderActuator, LowPass, RecordSource


@pytest.mark.parametrize("h", [1e-5, 0.01, 0.1, 3.0])
def test_step_response(h):
    """u_f(t) = 1 - e^(-t / tau) at every t_k. Each step rounds three numbers below 1 and the
    factor e^(-h/tau) damps earlier errors, so 100 steps stay below 100 * 3 * 1.1e-16."""
    ones = RecordSource(np.ones(101), h)
    system = System({"s": ones, "f": LowPass(0.1, n=1)}, [("s.y", "f.u[1]")])
    y = np.ravel(simulate(system, step=h, stop=100 * h, record=["f.y"])["f.y"])
    exact = [-math.expm1(-k * h / 0.1) for k in range(101)]
    assert np.abs(y - exact).max() < 3.3e-14


def test_a_held_input_arrives_one_step_later():
    """u_k acts on u_f from t_k on: at t_k the filter knows u up to u_{k-1}."""
    pulse = RecordSource([0.0, 1.0, 0.0, 0.0], 0.01, interpolation="hold")
    system = System({"s": pulse, "f": LowPass(0.1, n=1)}, [("s.y", "f.u[1]")])
    y = np.ravel(simulate(system, step=0.01, stop=0.03, record=["f.y"])["f.y"])
    a = -math.expm1(-0.1)
    assert y[:2].tolist() == [0.0, 0.0]
    assert y[2:] == pytest.approx([a, a * (1 - a)], rel=1e-15)


def test_block_and_continuous_filter_agree(rng):
    """t_k - t_{k-1} is h to 1e-13 relative (t up to 5 s); a shift by one sample changes y by about 0.1."""
    values = rng.normal(size=501)
    system = System(
        {
            "s": RecordSource(values, 0.01),
            "f": LowPass(0.1, n=1, y=0.4),
            "d": DiscreteLowPass(0.1, n=1, y=0.4),
        },
        [("s.y", "f.u[1]"), ("s.y", "d.u[1]")],
    )
    result = simulate(system, step=0.01, stop=5.0)
    assert np.abs(np.ravel(result["f.y"]) - np.ravel(result["d.y"])).max() < 1e-12


def test_the_discrete_filter_knows_its_own_period():
    """Every second point, 0.02 s: the closed form over 0.02 s."""
    system = System(
        {"s": RecordSource(np.ones(9), 0.01), "d": DiscreteLowPass(0.1, n=1, sample_period=0.02)},
        [("s.y", "d.u[1]")],
    )
    y = np.ravel(simulate(system, step=0.01, stop=0.08, record=["d.y"])["d.y"])
    exact = np.repeat([-math.expm1(-0.2 * k) for k in range(5)], 2)[:9]
    assert np.allclose(y, exact, rtol=0, atol=1e-15)


@pytest.mark.parametrize("participant", [LowPass(0.1, n=1), FirstOrderActuator(0.1, n=1)])
def test_stage_coupling_converges_to_it(participant):
    """ode3 over steps of 0.01 s = tau/10: local error (h/tau)^4/24 = 4e-6, a few e-6 in all."""
    port = "y" if isinstance(participant, LowPass) else "F"
    system = System({"s": RecordSource(np.ones(101), 0.01), "f": participant}, [("s.y", "f.u[1]")])
    result = simulate(system, step=0.01, stop=1.0, coupling="continuous", record=[f"f.{port}"])
    error = np.ravel(result[f"f.{port}"]) + np.expm1(-result.time / 0.1)
    assert 1e-9 < np.abs(error).max() < 2e-5


def test_actuator_never_exceeds_its_limit(rng):
    values = rng.normal(scale=5.0, size=301)
    system = System(
        {"s": RecordSource(values, 0.01), "a": FirstOrderActuator(0.02, 1.5)}, [("s.y", "a.u[1]")]
    )
    force = np.ravel(simulate(system, step=0.01, stop=3.0, record=["a.F"])["a.F"])
    a = -math.expm1(-0.5)
    expected = [0.0]
    for u in values[:-1]:
        expected.append(expected[-1] + a * (min(max(u, -1.5), 1.5) - expected[-1]))
    assert np.abs(force).max() <= 1.5
    assert np.allclose(
        force, expected, rtol=0, atol=1e-14
    )  # the same formula, roundings of numbers up to 1.5


class Period(Block):
    """y = h"""

    y = Output(unit="s")

    def step(self, t, h):
        self.y = h


def test_a_block_gets_its_own_step():
    """Not the communication step: a law that integrates over its sample period must know it."""
    system = System({"a": Period(), "b": Period(sample_period=0.04), "c": Period(every=2)})
    result = simulate(system, step=0.01, stop=0.08)
    assert (result["a.y"] == 0.01).all()
    assert (result["b.y"] == 0.04).all()
    assert (result["c.y"] == 0.02).all()
