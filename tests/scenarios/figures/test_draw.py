"""The picture of the README is drawn by code."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib import image

from scenarios.chattering.study import Study
from scenarios.figures import draw


def test_the_picture_shows_both_gains(tmp_path: Path) -> None:
    left, right = draw.chattering().axes
    for axes, gain in ((left, "constant"), (right, "algorithm-1")):
        result = Study(case=2, gain=gain).run()  # type: ignore[arg-type]
        assert axes.lines[0].get_xdata() == pytest.approx(result["plant.x"])
        assert "(m)" in axes.get_xlabel()
    draw.main(tmp_path)
    height, width, _ = image.imread(tmp_path / "chattering.png").shape
    assert (width, height) == (2400, 1080)  # 8.0 x 3.6 inches at 300 dpi
