"""A block that leaves as an FMU computes the same bits, one step later: the way of every FMU.

`fmi2DoStep` from t_k to t_{k+1} runs the block at t_k, and its outputs are read at t_{k+1}.
"""

import numpy as np

from cosim import FMU, System, simulate
from cosim.blocks import WhiteNoise
from fmus.export import export


def test_white_noise_is_the_same_bits(tmp_path):
    """Seeding, recurrence, logarithm and cosine, in native code without Python."""
    noise = WhiteNoise(sample_period=0.01, seed=9, sigma=2.0, mean=0.25, n=2)
    fmu = FMU(export(noise, tmp_path / "noise.fmu"))
    block = simulate(System({"w": noise}), step=0.01, stop=5.0)["w.y"]
    native = simulate(System({"w": fmu}), step=0.01, stop=5.0).columns()
    for i in range(2):
        assert np.array_equal(native[f"w.y[{i + 1}]"][1:], block[:-1, i])
        assert np.unique(native[f"w.y[{i + 1}]"]).size > 400
