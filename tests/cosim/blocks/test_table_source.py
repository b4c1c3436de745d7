"""A table at a constant interval: the same signal as at instants, and bounded for any time.

Tables at instants are tested where a CSV file becomes one (cli/test_fmu_scenario.py).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import DeclarationError, System, simulate
from cosim.blocks import TableSource
from tests.cosim.blocks.drive import assert_same_bits

ROWS = np.random.default_rng(6).normal(size=(7, 3))
BOTH = pytest.mark.parametrize("interpolation", ["linear", "hold"])


def at(source: TableSource, t: float) -> list[float]:
    """Return the rows' values at t, by the interpreted kernel."""
    source.step(t, 0.1)
    return source.y.tolist()


@BOTH
def test_an_interval_is_the_same_as_its_instants(interpolation):
    """t / dt and t - t_i round differently, and so does v + 1 (v_n - v): by 1e-15 of values up to 3."""
    uniform = TableSource(0.25, ROWS, interpolation=interpolation)
    listed = TableSource(0.25 * np.arange(7), ROWS, interpolation=interpolation)
    for t in np.linspace(-0.3, 1.9, 40):
        assert at(uniform, t) == pytest.approx(at(listed, t), abs=1e-14)
    for i in range(6):
        assert at(uniform, 0.25 * i) == ROWS[i].tolist()


@BOTH
@given(t=st.floats())
def test_any_time_has_a_value_between_the_rows(interpolation, t):
    y = at(TableSource(0.1, [1.0, 5.0, 3.0], interpolation=interpolation), t)
    assert 1.0 - 1e-8 <= y[0] <= 5.0 + 1e-8  # 1e-9 of an interval early, times a rise of 4
    if abs(t) > 1.0:
        assert y == [3.0 if t > 0 else 1.0]


@pytest.mark.parametrize("t", [-1e6, -1.0, math.nan, -math.inf])
def test_the_first_row_is_held_before_it(t):
    assert at(TableSource(0.1, ROWS), t) == ROWS[0].tolist()


def test_one_row_is_a_constant():
    assert at(TableSource(0.1, ROWS[:1]), 0.35) == ROWS[0].tolist()


@BOTH
def test_compiled_and_interpreted_give_the_same_bits(interpolation):
    assert_same_bits(TableSource(0.25, ROWS, interpolation=interpolation), np.zeros((40, 0)), 0.07)


def test_it_acts_at_its_sample_period():
    system = System({"s": TableSource(0.1, [0.0, 1.0, 2.0], every=2, unit="N")})
    result = simulate(system, step=0.05, stop=0.2)
    assert np.ravel(result["s.y"]).tolist() == [0.0, 0.0, 1.0, 1.0, 2.0]
    assert result.units["s.y"] == "N"


@pytest.mark.parametrize("interval", [0.0, -0.1, math.nan, math.inf])
def test_an_interval_must_be_above_zero(interval):
    with pytest.raises(DeclarationError, match=r"the interval of .* s must be above zero"):
        TableSource(interval, ROWS)
