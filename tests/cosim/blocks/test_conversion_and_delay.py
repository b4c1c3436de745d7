"""Analogue-to-digital conversion, saturation, delay: properties over any input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import DeclarationError, System, simulate
from cosim.blocks import AnalogToDigital, Delay, RecordSource, Saturation
from tests.cosim.blocks.drive import trace

levels = st.integers(1, 24)
scales = st.floats(1e-6, 1e6)
fractions = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=20)


@given(levels, scales, fractions)
def test_adc_bounds(bits, full_scale, parts):
    """Inside the range the error is at most half a level; outside it the end levels answer.

    1e-9 of a level is for the rounding of u / q next to a switching point, relative
    2^24 levels * 1e-16.
    """
    q = full_scale / 2.0 ** (bits - 1)
    u = np.array(parts) * full_scale
    y = trace(AnalogToDigital(full_scale, bits=bits, n=1), u[:, None], 1.0, "y")[:, 0]
    assert y.min() >= -full_scale
    assert y.max() <= full_scale - q
    inside = (u >= -full_scale) & (u <= full_scale - q)
    assert (np.abs(y - u)[inside] <= q * (0.5 + 1e-9)).all()
    assert (y[u > full_scale - q] == full_scale - q).all()
    assert (y[u < -full_scale] == -full_scale).all()


@given(levels, scales, st.integers(-(2**24), 2**24))
def test_adc_keeps_its_own_levels(bits, full_scale, code):
    """What is a level already is not changed: converting twice is converting once."""
    once = trace(AnalogToDigital(full_scale, bits=bits, n=1), np.array([[code * full_scale]]), 1.0, "y")
    assert trace(AnalogToDigital(full_scale, bits=bits, n=1), once, 1.0, "y") == once


def test_adc_by_hand():
    """3 bits over [-1, 1): levels -1, -0.75 .. 0.75, halves upwards, ends held for any size."""
    u = np.array([0.0, 0.124, 0.125, -0.125, -0.126, 0.7, 5.0, -1e300, 1e300])
    y = trace(AnalogToDigital(1.0, bits=3, n=1), u[:, None], 1.0, "y")[:, 0]
    assert y.tolist() == [0.0, 0.0, 0.25, 0.0, -0.25, 0.75, 0.75, -1.0, 0.75]


@pytest.mark.parametrize("bits", [0, 53, 2.5])
def test_adc_refuses(bits):
    with pytest.raises(DeclarationError, match="bits"):
        AnalogToDigital(1.0, bits=bits)


@given(st.integers(1, 7), st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=30), st.floats(-5, 5))
def test_delay_is_a_shift(steps, values, initial):
    u = np.array(values)[:, None] * [1.0, -2.0]
    y = trace(Delay(steps, initial=initial, n=2), u, 1.0, "y")
    expected = np.vstack([np.full((steps, 2), initial), u])[: len(u)]
    assert np.array_equal(y, expected)


def test_delay_in_a_run_counts_its_own_sample_period():
    """Three samples of 0.02 s in a run of 0.01 s: 0.06 s late, held in between."""
    values = np.arange(1.0, 22.0)
    system = System(
        {"r": RecordSource(values, 0.01), "d": Delay(3, initial=-1.0, n=1, sample_period=0.02)},
        [("r.y", "d.u[1]")],
    )
    result = simulate(system, step=0.01, stop=0.2, record=["d.y"])
    expected = np.repeat(np.concatenate([[-1.0] * 3, values[::2]]), 2)[:21]
    assert np.array_equal(np.ravel(result["d.y"]), expected)


@pytest.mark.parametrize("steps", [0, -1, 1.5])
def test_delay_refuses(steps):
    with pytest.raises(DeclarationError, match="steps"):
        Delay(steps)


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=10), st.floats(0, 5))
def test_saturation(values, limit):
    u = np.array(values)[:, None] * [1.0, 0.5]
    y = trace(Saturation([limit, 2.0]), u, 1.0, "y")
    assert np.array_equal(y, np.clip(u, [-limit, -2.0], [limit, 2.0]))


def test_sizes_must_agree():
    with pytest.raises(DeclarationError, match=r"Saturation\.limit: shape \(2,\) does not fit .* n is 3"):
        Saturation([1.0, 2.0], n=3)
