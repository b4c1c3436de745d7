"""Algorithm II at its limits: they apply once a call, after the rise and the fall (thesis, (4.4))."""

from __future__ import annotations

import pytest

from controllers.laws.algorithm_2 import AlgorithmII
from tests.cosim.blocks.drive import trace

H = 0.01


@pytest.mark.parametrize(
    ("start", "signs", "gains"),
    [
        # alpha h = 0.1, beta h = 3: at the upper limit a switch costs 2.9, not 3
        (300.0, [1, -1, -1, 1], [300.0, 297.1, 297.2, 294.3]),
        (1.0, [1, -1, -1], [1.1, 1.0, 1.1]),  # and at the lower limit nothing
        (150.0, [1, 0, -1], [150.1, 150.2, 147.3]),  # 0 is not a switch, and the last sign is kept
    ],
)
def test_gain_by_hand(start: float, signs: list[int], gains: list[float]) -> None:
    law = AlgorithmII(M=start)
    inputs = [[float(s)] for s in signs]
    assert trace(law, inputs, H, "M")[:, 0] == pytest.approx(gains, rel=1e-12)
    forces = [-M * s for M, s in zip(gains, signs, strict=True)]
    assert trace(law, inputs, H, "u")[:, 0] == pytest.approx(forces, rel=1e-12)
