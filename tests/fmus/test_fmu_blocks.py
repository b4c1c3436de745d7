"""Blocks, sensors, filters and gain laws of ours leave as FMUs and compute what their kernels do.

Each is driven with random inputs, as an FMU and as plain Python. The bound is 1e-12 of the value, for
functions of libm that may round apart; a switching law amplifies nothing here, because its input is given.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CDLL
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from controllers.algorithm_1 import AlgorithmI
from controllers.algorithm_2 import AlgorithmII
from controllers.equivalent_control import EquivalentControlGain
from controllers.state_dependent import StateDependentGain
from controllers.switching import HysteresisControl, SaturationControl
from cosim.blocks.actuator import FirstOrderActuator, Saturation
from cosim.blocks.adc import AnalogToDigital
from cosim.blocks.delay import Delay
from cosim.blocks.lowpass import DiscreteLowPass, LowPass
from cosim.blocks.noise import MeasurementNoise
from cosim.blocks.sensor import SensorDynamics, StateSpace
from cosim.blocks.sources import RecordSource, WhiteNoise
from cosim.blocks.sum import WeightedSum
from cosim.participant import Block, Participant
from fmus.description import elements
from fmus.export import export

from .host import OK, Host

H, STEPS = 0.01, 200
BLOCKS: dict[str, Callable[[], Participant]] = {
    "saturation": lambda: Saturation(1.5, n=2),
    "actuator": lambda: FirstOrderActuator(0.1, 1.5),
    "converter": lambda: AnalogToDigital(10.0, n=3),
    "delay": lambda: Delay(3, n=2),
    "low-pass": lambda: LowPass(n=2),
    "discrete low-pass": lambda: DiscreteLowPass(n=2),
    "measurement noise": lambda: MeasurementNoise(0.1, sample_period=H),
    "sensor": lambda: SensorDynamics(n=2),
    "state space": lambda: StateSpace([[0, 1], [-4, -0.3]], [[0], [1]], [[1, 0]], [[0.5]]),
    "record": lambda: RecordSource(np.sin(np.arange(50.0)), 0.02),
    "white noise": lambda: WhiteNoise(sample_period=H),
    "sum": lambda: WeightedSum([1.0, -2.0]),
    "algorithm I": AlgorithmI,
    "algorithm II": AlgorithmII,
    "saturated switching": SaturationControl,
    "switching with hysteresis": HysteresisControl,
    "state-dependent gain": StateDependentGain,
    "equivalent control gain": EquivalentControlGain,
}


def kernels(participant: Participant, inputs: np.ndarray) -> np.ndarray:
    """Outputs and states after every step, by the kernels as plain Python."""
    work = participant.fresh()
    ports = [e.slot for e in elements(work, arrays=False) if e.role.causality == "output"]
    first, n = work.zones["input"]
    work.memory[first : first + n] = inputs[0]
    if "initialize" in work.kernels:
        work.initialize()  # type: ignore[attr-defined]
    rows = []
    for k, u in enumerate(inputs):
        work.memory[first : first + n] = u
        if isinstance(work, Block):
            work.step(k * H, H)
        else:
            work.advance(k * H, H)  # type: ignore[attr-defined]
            for name in ("derivatives", "outputs"):
                if name in work.kernels:
                    getattr(work, name)(k * H + H)
        rows.append(work.memory[ports].copy())
    return np.array(rows)


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_as_fmu_is_its_kernels(tmp_path: Path, name: str) -> None:
    block = BLOCKS[name]()
    path = export(block, tmp_path / "block.fmu")
    assert validate_fmu(str(path)) == []
    with ZipFile(path) as archive:
        library = next(n for n in archive.namelist() if n.startswith("binaries/"))
        h = Host(path, CDLL(archive.extract(library, tmp_path)))
    listed = elements(block, arrays=False)
    into = [e.slot for e in listed if e.variable.kind == "input"]
    outof = [e.slot for e in listed if e.role.causality == "output"]
    inputs = np.random.default_rng(8).normal(size=(STEPS, len(into)))
    h.instantiate()
    h.set(*zip(into, map(float, inputs[0]), strict=True))
    h.prepare()
    assert h.call("EnterInitializationMode") == OK
    assert h.call("ExitInitializationMode") == OK
    found = []
    for k, u in enumerate(inputs):
        assert h.set(*zip(into, map(float, u), strict=True)) == OK
        assert h.step(k * H, H) == OK, h.log
        found.append(h.get(*outof))
    h.free()
    expected = kernels(block, inputs)
    assert np.ptp(expected, axis=0).max() > 0.0
    assert np.abs(np.array(found) - expected).max() <= 1e-12 * np.abs(expected).max()
