"""Sources: a record is its own values at grid points, over any length; functions; constants."""

import math

import numpy as np
import pytest

from cosim import (
    Block,
    CompiledKernelsWarning,
    DeclarationError,
    GroundMotion,
    Input,
    Output,
    System,
    simulate,
)
from cosim.blocks import Constant, RecordSource, WeightedSum, function_source

VALUES = np.random.default_rng(3).normal(size=90_001)


def signal(source, step, stop, start=0.0, **options):
    result = simulate(System({"s": source}), step=step, stop=stop, start=start, record=["s.y"], **options)
    return np.ravel(result["s.y"])


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
@pytest.mark.parametrize("dt", [0.01, 0.001, 1 / 3, 0.005])
def test_a_record_is_exact_on_its_grid(interpolation, dt):
    """900 s at 1 ms and more: the values of the record, bit for bit: no shift, no drift."""
    y = signal(RecordSource(VALUES, dt, interpolation=interpolation), dt, 90_000 * dt)
    assert np.array_equal(y, VALUES)


def test_exact_on_the_grid_when_time_starts_elsewhere():
    y = signal(RecordSource(VALUES[:5000], 0.01), 0.01, 37.0, start=7.0)
    assert np.array_equal(y, VALUES[700:3701])


def test_linear_between_grid_points():
    """Closed form: interpolation on a line is the line; roundings of values up to 5 are 1e-15 each."""
    line = RecordSource(2.0 + 3.0 * np.arange(11) * 0.1, 0.1)
    y = signal(line, 0.02, 1.0)
    assert np.allclose(y, 2.0 + 3.0 * np.arange(51) * 0.02, rtol=0, atol=4e-15)


def test_hold_between_grid_points():
    y = signal(RecordSource(VALUES[:10], 0.04, interpolation="hold"), 0.01, 0.39)
    assert np.array_equal(y, np.repeat(VALUES[:10], 4))


def test_zero_outside():
    """Linear ends at its last value; hold keeps that for one interval, as it does every value."""
    source = {"record": [1.0, 2.0, 3.0], "dt": 0.1, "start": 0.2}
    assert signal(RecordSource(**source), 0.1, 0.6).tolist() == [0, 0, 1, 2, 3, 0, 0]
    assert signal(RecordSource(**source), 0.05, 0.5).tolist()[7:] == [2.5, 3, 0, 0]
    assert signal(RecordSource(**source, interpolation="hold"), 0.05, 0.5).tolist()[7:] == [2, 3, 3, 0]


def test_scale_and_stage_times():
    """Under stage coupling a source runs at the stages; the recorded values are those at t_k."""
    y = signal(RecordSource(VALUES[:50], 0.01, scale=2.0), 0.01, 0.49, coupling="continuous")
    assert np.array_equal(y, 2.0 * VALUES[:50])


def test_a_record_brings_dt_unit_and_start():
    source = RecordSource(GroundMotion(0.5, np.array([1.0, 2.0]), "made", start=0.5))
    assert source.variables["y"].unit == "m/s^2"
    assert signal(source, 0.5, 1.5).tolist() == [0, 1, 2, 0]


def test_units_are_converted_at_a_connection():
    """A record in g reaches an input in m/s^2 as 9.80665 times: standard gravity."""
    system = System({"g": RecordSource([1.0, 1.0], 1.0, unit="g_0"), "s": WeightedSum([1.0], unit="m/s2")})
    system.connect("g.y", "s.u[1]")
    assert np.ravel(simulate(system, step=1.0, stop=1.0, record=["s.y"])["s.y"]) == pytest.approx(9.80665)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"record": [1.0, 2.0]}, "values need dt"),
        ({"record": [1.0, 2.0], "dt": 0.1, "interpolation": "Linear "}, "did you mean 'linear'"),
        ({"record": [1.0, np.nan], "dt": 0.1}, "not a number"),
        ({"record": [1.0, 2.0], "dt": 0.0}, "outside its bounds"),
        ({"record": GroundMotion(0.1, np.ones(3), "made"), "dt": 0.2}, "resample"),
        ({"record": np.ones((3, 2)), "dt": 0.2}, "dimensions"),
    ],
)
def test_record_sources_refuse(arguments, text):
    with pytest.raises(DeclarationError, match=text):
        RecordSource(**arguments)


def twice(x):
    return 2.0 * x


def ramp(t):
    return twice(t) + 1.0


def test_functions_compile_with_closures_and_their_own_functions():
    amplitude = 25.0
    system = System(
        {
            "a": function_source(lambda t: amplitude * (math.sin(t) + 1.0), unit="m/s2"),
            "b": function_source(ramp),
            "c": function_source(math.cos),
        }
    )
    result = simulate(system, step=0.1, stop=1.0)
    t = result.time
    assert result["a.y"].tolist() == [25.0 * (math.sin(x) + 1.0) for x in t]
    assert result["b.y"].tolist() == [2.0 * x + 1.0 for x in t]
    assert result["c.y"].tolist() == [math.cos(x) for x in t]
    assert result.units["a.y"] == "m/s2"


def test_a_function_of_python_is_called_back():
    table = {0: 1.5, 1: -2.5}
    with pytest.warns(CompiledKernelsWarning):
        y = signal(function_source(lambda t: table[round(t)]), 1.0, 1.0)
    assert y.tolist() == [1.5, -2.5]


def test_a_function_source_takes_a_function():
    with pytest.raises(DeclarationError, match="function of time"):
        function_source(3.0)


class Pair(Block):
    """y = u"""

    u = Input(shape=2)
    y = Output(shape=2)

    def step(self, t, h):
        self.y[0] = self.u[0]
        self.y[1] = self.u[1]


def test_constant_is_a_vector_or_a_number():
    system = System({"c": Constant([1.0, -2.0], unit="N"), "p": Pair(), "one": Constant(3.0)})
    system.connect("c.y", "p.u")
    result = simulate(system, step=1.0, stop=2.0)
    assert result["p.y"].tolist() == [[1.0, -2.0]] * 3
    assert np.ravel(result["one.y"]).tolist() == [3.0] * 3


def test_sum():
    system = System({"c": Constant([2.0, 3.0]), "one": Constant(7.0), "s": WeightedSum([1.0, -1.0, 0.5])})
    system.connect("c.y", "s.u[1:2]")
    system.connect("one.y", "s.u[3]")
    assert simulate(system, step=1.0, stop=1.0)["s.y"].tolist() == [2.5, 2.5]
