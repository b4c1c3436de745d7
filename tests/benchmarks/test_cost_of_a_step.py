"""The cost of a communication step by kind of participant: a plant in feedback with a gain.

    plain      the plant as an FMU of FMI 2.0, Co-Simulation, and a compiled block
    callback   the block in Python
    arrays     the plant as an FMU of FMI 3.0, with arrays for ports
    isolated   the plant as an FMU in a process of its own: set inputs, doStep, get outputs

The table has microseconds, and ratios to the plain FMU; FMPy's own calls are timed in the same run.
Under `long` it takes a million steps. Isolation costs a switch between two processes, 0.2 to 1
times FMPy's calls, depending on how busy the cores are.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from cosim import FMU, Block, Input, LinearContinuous, Output, State, System, simulate
from fmus.export import export
from tests.benchmarks.fmpy_calls import free, initialised

pytestmark = pytest.mark.benchmark

H = 0.01
N = 3  # masses


class Masses(LinearContinuous):
    """x_i'' = u_i - 2 x_i + x_{i-1} + x_{i+1}"""

    u = Input(shape=N)
    x = State([1.0, 0.0, -0.5], shape=N)
    v = State(np.zeros(N), shape=N)

    def derivatives(self, t):
        for i in range(N):
            left = self.x[i - 1] if i > 0 else 0.0
            right = self.x[i + 1] if i < N - 1 else 0.0
            self.der_x[i] = self.v[i]
            self.der_v[i] = self.u[i] - 2.0 * self.x[i] + left + right


class Gain(Block):
    v = Input(shape=N)
    u = Output(shape=N)

    def step(self, t, h):
        for i in range(N):
            self.u[i] = -0.1 * self.v[i]


class PythonGain(Gain):
    compiled = False


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("masses")
    return {v: export(Masses(), folder / f"masses{v[0]}.fmu", fmi_version=v) for v in ("2.0", "3.0")}


def run(plant: FMU, gain: type[Block], steps: int) -> tuple[float, np.ndarray]:
    """Return microseconds per step, and the final displacements."""
    system = System({"plant": plant, "gain": gain()}, [("plant.v", "gain.v"), ("gain.u", "plant.u")])
    simulate(system, step=H, stop=10 * H)  # compiles
    result = simulate(system, step=H, stop=steps * H, record=["plant.x"], decimation=steps)
    return 1e6 * result.seconds / steps, result["plant.x"]


def fmpy_calls(plant: FMU, steps: int) -> float:
    """Return microseconds per step of FMPy's own calls, without a block."""
    api = initialised(plant)
    read = [v.valueReference for v in plant.output_ports["v"].variables]
    write = [v.valueReference for v in plant.input_ports["u"].variables]
    began = time.perf_counter()
    for k in range(steps):
        v = api.getReal(read)
        api.setReal(write, [-0.1 * x for x in v])
        api.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
    took = time.perf_counter() - began
    free(api)
    return 1e6 * took / steps


@pytest.mark.parametrize("steps", [20_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_cost_of_a_step(files, steps):
    kinds: dict[str, Callable[[int], tuple[float, np.ndarray]]] = {
        "plain": partial(run, FMU(files["2.0"]), Gain),
        "callback": partial(run, FMU(files["2.0"]), PythonGain),
        "arrays": partial(run, FMU(files["3.0"]), Gain),
        "isolated": partial(run, FMU(files["2.0"], isolated=True), Gain),
        "isolated arrays": partial(run, FMU(files["3.0"], isolated=True), Gain),
    }
    costs, ends = {}, {}
    for name, call in kinds.items():
        costs[name], ends[name] = call(steps)
    by_hand = fmpy_calls(FMU(files["2.0"]), 5_000)
    print(f"\n{steps:,} steps; FMPy's own calls {by_hand:.1f} us a step")
    for name, cost in costs.items():
        print(f"{name:16}{cost:8.2f} us a step, {cost / costs['plain']:6.1f} of plain")
    for name, final in ends.items():
        assert np.array_equal(final, ends["plain"]), name
