"""Chapter 4 with its blocks as FMUs: surface, gain law and noise, bit for bit.

A switching controller amplifies the last bit of every signal, and these trajectories switch at
almost every step: with one wrong bit, or one late sample, they diverge.
"""

from __future__ import annotations

import numpy as np
import pytest

from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.algorithm_2 import AlgorithmII
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from cosim import FMU, System, simulate
from cosim.blocks import WhiteNoise
from fmus.export import export
from fmus.plants.oscillator import Oscillator

STEP = 0.01
RECORD = ["plant.x", "plant.v", "surface.s", "control.u", "control.M", "noise.y"]
CONNECTIONS = [
    ("plant.x", "surface.x1"),
    ("plant.v", "surface.x2"),
    ("surface.s", "control.s"),
    ("control.u", "plant.u"),
    ("noise.y", "plant.d"),
]


def blocks(law, rate):
    return {
        "noise": WhiteNoise(seed=3, sample_period=2 * STEP, unit="m/s^2"),
        "control": law(**rate),
        "surface": PhasePlaneSurface(**rate),
    }


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("law", [AlgorithmI, AlgorithmII])
def test_blocks_as_fmus_give_the_same_bits(tmp_path, version, law):
    paths = {
        name: export(block, tmp_path / f"{name}.fmu", fmi_version=version)
        for name, block in blocks(law, {}).items()
    }
    couplings = [({}, {}), ({"sample_period": STEP}, {"coupling": "continuous", "solver": "ode3"})]
    for rate, options in couplings:
        native = {n: FMU(p, as_block=True, **rate) for n, p in paths.items() if n != "noise"}
        native["noise"] = FMU(paths["noise"], as_block=True, sample_period=2 * STEP)
        runs = [
            simulate(
                System({"plant": Oscillator(), **members}, CONNECTIONS),
                step=STEP,
                stop=20.0,
                record=RECORD,
                **options,
            )
            for members in (blocks(law, rate), native)
        ]
        for name in RECORD:
            assert np.array_equal(runs[0][name], runs[1][name]), (name, options)
        u = runs[0]["control.u"]
        assert np.sum(u[1:] * u[:-1] < 0) > 20
        assert np.unique(runs[0]["noise.y"]).size > 900
