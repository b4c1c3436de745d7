"""Blocks of a measurement and control chain: sources, sensors, noise, conversion, delay, filter, actuator."""

from .actuator import FirstOrderActuator, Saturation
from .adc import AnalogToDigital
from .delay import Delay
from .lowpass import DiscreteLowPass, LowPass
from .noise import MeasurementNoise
from .sensor import SensorDynamics, StateSpace, StrictlyProper, transfer_function
from .sources import Constant, RecordSource, WhiteNoise, function_source
from .sum import WeightedSum
from .table_source import TableSource

__all__ = [
    "AnalogToDigital",
    "Constant",
    "Delay",
    "DiscreteLowPass",
    "FirstOrderActuator",
    "LowPass",
    "MeasurementNoise",
    "RecordSource",
    "Saturation",
    "SensorDynamics",
    "StateSpace",
    "StrictlyProper",
    "TableSource",
    "WeightedSum",
    "WhiteNoise",
    "function_source",
    "transfer_function",
]
