"""Every block computes the same bits interpreted and compiled: same operations, same order, same libm."""

import math

import numpy as np
import pytest

from cosim.blocks import (
    AnalogToDigital,
    Constant,
    Delay,
    DiscreteLowPass,
    FirstOrderActuator,
    LowPass,
    MeasurementNoise,
    RecordSource,
    Saturation,
    SensorDynamics,
    StateSpace,
    WeightedSum,
    WhiteNoise,
    function_source,
    transfer_function,
)
from tests.cosim.blocks.drive import assert_same_bits, drive

VALUES = np.random.default_rng(7).normal(size=40)
BLOCKS = {
    "constant": lambda: Constant([1.5, -2.25]),
    "record, linear": lambda: RecordSource(VALUES, 0.013, scale=1.7, start=0.1),
    "record, hold": lambda: RecordSource(VALUES, 0.013, interpolation="hold"),
    "function": lambda: function_source(lambda t: 25.0 * (math.sin(t) + 1.0)),
    "white noise": lambda: WhiteNoise(sample_period=0.01, seed=5, sigma=[1.0, 2.0], mean=0.5),
    "measurement noise": lambda: MeasurementNoise([0.1, 3.0], sample_period=0.01, seed=2),
    "adc": lambda: AnalogToDigital([1.0, 2.0], bits=5),
    "delay": lambda: Delay(3, initial=[1.0, 2.0]),
    "low pass": lambda: LowPass(0.07, n=2),
    "discrete low pass": lambda: DiscreteLowPass(0.07, n=2),
    "saturation": lambda: Saturation([0.4, 1.1]),
    "actuator": lambda: FirstOrderActuator(0.03, [0.4, 1.1]),
    "sensor dynamics": lambda: SensorDynamics(n=2),
    "sum": lambda: WeightedSum([1.0, -0.3, 7.0]),
}


@pytest.mark.parametrize("name", BLOCKS)
def test_interpreted_is_compiled(name):
    """On many seeds, because a rounding that differs is rare."""
    block = BLOCKS[name]()
    for seed in range(10):
        inputs = np.random.default_rng(seed).normal(size=(60, block.zones["input"][1]))
        assert_same_bits(block, inputs, 0.01)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("name", ["transfer function", "state space"])
def test_state_space_interpreted_is_compiled(name, seed):
    """Matrix sums may be vectorised, but never reordered: without fast-math the bits stay."""
    random = np.random.default_rng(seed)
    sensor = {
        "transfer function": lambda: transfer_function(([2.0, 1.0], [0.001, 0.08, 1.3, 4.0])),
        "state space": lambda: StateSpace(*map(random.standard_normal, ((2, 2), (2, 3), (1, 2), (1, 3)))),
    }[name]()
    assert_same_bits(sensor, random.normal(size=(30, sensor.zones["input"][1])), 0.01)


def test_driving_moves_something():
    """The compared memory is written: it changes from step to step."""
    rows = drive(Delay(2, n=1), np.arange(5.0)[:, None], 0.01, jit=True)
    assert (rows[1:] != rows[:-1]).any(axis=1).all()
