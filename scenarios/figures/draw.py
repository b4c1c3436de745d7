"""Draw the pictures of the READMEs: `python -m scenarios.figures.draw [FOLDER]`.

building.png: loop and response of a building with an active brace (building.py).
chattering.png: phase plane of chapter 4, case 2, with the constant gain beside Algorithm I.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cosim import Result
from scenarios.chattering.study import CASES, Study
from scenarios.figures.building import building

HERE = Path(__file__).parent
TRAJECTORY, SURFACE, MARK = "#0b5394", "#d55e00", "#222222"


def chattering() -> Figure:
    """Return the phase planes of case 2: constant gain and Algorithm I."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    M = CASES[2].M
    _phase_plane(left, Study(case=2, gain="constant").run(), f"Constant gain, M = {M:g} N")
    _phase_plane(right, Study(case=2, gain="algorithm-1").run(), f"Algorithm I, M from {M:g} N downwards")
    left.set_ylabel("velocity x₂ (m/s)", fontsize=11)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=10, frameon=False)
    return figure


def _phase_plane(axes: Axes, result: Result, title: str) -> None:
    x, v = result["plant.x"], result["plant.v"]
    axes.plot(x, v, color=TRAJECTORY, linewidth=1.0, label="trajectory")
    axes.plot([0.0, 17.5], [0.0, -17.5], "--", color=SURFACE, linewidth=1.2, label="sliding surface x₂ = −x₁")
    axes.plot(x[0], v[0], "o", color=MARK, markersize=5, label="start")
    axes.set_title(title, fontsize=12)
    axes.set_xlabel("displacement x₁ (m)", fontsize=11)
    axes.text(
        0.03,
        0.97,
        f"norm(u) = {result.statistics['control.u'].norm:.0f} N",
        transform=axes.transAxes,
        va="top",
        fontsize=11,
    )
    axes.tick_params(labelsize=10)
    axes.grid(alpha=0.3)


def main(folder: Path = HERE) -> None:
    """Draw all pictures into a folder."""
    matplotlib.use("Agg")
    building().savefig(folder / "building.png", dpi=300)
    chattering().savefig(folder / "chattering.png", dpi=300)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
