"""A million communication steps: plant FMU, sensor, controller, filter, three recorded signals.

Compared in the same run, as ratios of steps per second, with

    (a) the same loop written in C for this one system, around the same plant FMU
    (b) FMPy's own calls in Python, with the same blocks
    (c) ecos, with the blocks exported as FMUs
"""

import math
import shutil
import subprocess
import sys
import time
from pathlib import Path

import fmpy
import pytest

from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from cosim import FMU, Block, System, simulate
from cosim.blocks import LowPass, SensorDynamics
from fmus.export import as_fmu
from fmus.packaging.other_tools import ecospy
from fmus.plants.oscillator import Oscillator
from tests.benchmarks.fmpy_calls import free, initialised
from tests.others import tool

pytestmark = pytest.mark.benchmark

N = 1_000_000
H = 0.01
RECORDED = ["plant.x", "control.u", "control.M"]
CONNECTIONS = [
    ("plant.x", "surface.x1"),
    ("plant.v", "surface.x2"),
    ("surface.s", "sensor.u"),
    ("sensor.y", "control.s"),
    ("control.u", "filter.u"),
    ("filter.y", "plant.u"),
]


def blocks():
    return {
        "surface": PhasePlaneSurface(),
        "sensor": SensorDynamics(mu=0.008),
        "control": AlgorithmI(),
        "filter": LowPass(tau=0.02),
    }


@pytest.fixture(scope="module")
def plant() -> FMU:
    return as_fmu(Oscillator())


@pytest.fixture(scope="module")
def ours(plant):
    system = System({"plant": plant, **blocks()}, CONNECTIONS)
    simulate(system, step=H, stop=10.0, record=RECORDED)  # compiles
    return min(
        (simulate(system, step=H, stop=N * H, record=RECORDED) for _ in range(5)), key=lambda r: r.seconds
    )


def test_against_a_loop_in_c(plant, ours, tmp_path):
    program = tmp_path / "reference"
    here = Path(__file__).parent
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [sys.executable, "-m", "ziglang", "cc", "-O2", f"-I{headers}", str(here / "reference_loop.c")]
    subprocess.run([*command, "-o", str(program), "-lm", "-ldl"], check=True)
    library = next((plant.directory / "binaries" / fmpy.platform).glob(f"*{fmpy.sharedLibraryExtension}"))
    call = [str(program), str(library), plant.description.guid, str(N)]
    runs = [subprocess.run(call, capture_output=True, text=True, check=True).stdout.split() for _ in range(5)]
    seconds = min(float(run[0]) for run in runs)
    ratio = seconds / ours.seconds
    print(f"\nC {N / seconds / 1e6:.2f}, ours {N / ours.seconds / 1e6:.2f} million steps/s: {ratio:.2f} of C")
    # the same operations in the same order, but for the last bit of exp and expm1, which the C
    # compiler folds: a loop that did something else would be off by far more after 10^6 steps
    assert float(runs[0][1]) == pytest.approx(ours["plant.x"][-1], rel=1e-9)
    assert float(runs[0][2]) == ours["control.M"][-1]


def test_against_fmpy_calls(plant, ours):
    n = 20_000
    api = initialised(plant)
    reference = {v.name: v.valueReference for v in plant.description.modelVariables}
    read, write = [reference["x"], reference["v"]], [reference["u"]]
    y = z = filtered = last = 0.0
    M = 100.0
    r, mu = H / 0.008, 0.008
    decay, approach = math.exp(-r), -math.expm1(-H / 0.02)
    rows = []
    began = time.perf_counter()
    for k in range(n + 1):
        x, v = api.getReal(read)
        s = v + x
        g = (y > 0) - (y < 0)
        if g * last < 0:
            M = max(M / 1.1, 1.0)
        if g:
            last = g
        u = -M * g
        rows.append((x, u, M))
        api.setReal(write, [filtered])
        api.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
        e = y - s
        y, z = s + decay * ((1 + r) * e + H * z), decay * ((1 - r) * z - r * e / mu)
        filtered += approach * (u - filtered)
    seconds = (time.perf_counter() - began) / n * N
    free(api)
    ratio = seconds / ours.seconds
    print(f"\nFMPy's calls {N / seconds / 1e6:.4f} million steps/s: ours is {ratio:.0f} times as fast")
    assert rows[1000] == (ours["plant.x"][1000], ours["control.u"][1000], ours["control.M"][1000])


def test_against_ecos(plant, ours, tmp_path):
    ecos = tool(ecospy)
    n = 20_000
    files = {"plant": plant.path}
    for name, block in blocks().items():
        files[name] = tmp_path / f"{name}.fmu"
        shutil.copy(as_fmu(block).path, files[name])
    structure = ecos.EcosSimulationStructure()
    for name, path in files.items():
        structure.add_model(name, str(path))
    for source, target in CONNECTIONS:
        names = [
            f"{end.replace('.', '::')}[1]"
            if end in ("sensor.u", "sensor.y", "filter.u", "filter.y")
            else end.replace(".", "::")
            for end in (source, target)
        ]
        structure.make_real_connection(*names)
    with ecos.EcosSimulation(H, structure=structure) as simulation:
        simulation.init()
        began = time.perf_counter()
        simulation.step(n)
        seconds = (time.perf_counter() - began) / n * N
        x = simulation.get_real("plant::x")
    # ecos exchanges all values before it steps all FMUs: an output of a block arrives a step later
    system = System({"plant": plant, **blocks()})
    for source, target in CONNECTIONS:
        block = isinstance(system.participants[source.partition(".")[0]], Block)
        system.connect(source, target, initial=0.0 if block else None)
    late = simulate(system, step=H, stop=n * H, record=["plant.x"])
    ratio = seconds / ours.seconds
    print(f"\necos {N / seconds / 1e6:.3f} million steps/s: ours is {ratio:.0f} times as fast")
    assert x == late["plant.x"][-1]
