"""The loop of a building with an active brace, and its response: the picture of the README.

Left: the loop of a building and an active brace. Middle: two of its signals over a few
communication steps, sampled and held. Right: the drift of the first story under El Centro.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from cosim import Block, Input, Output, Parameter, Result, System, el_centro, simulate
from cosim.blocks import RecordSource
from fmus.export import as_fmu
from fmus.plants.shear_building import ShearBuilding

BLUE, GREY, RED = "#1f5a8a", "#9a9a9a", "#b5442e"
STEP = 0.005


class Brace(Block):
    """An active brace in the first story: u = -c v."""

    c = Parameter(4e5, "gain", unit="N*s/m", min=0.0)
    v = Input("velocity of the first floor", unit="m/s")
    u = Output("force on the first floor", unit="N")

    def step(self, t: float, h: float) -> None:
        self.u = -self.c * self.v


def run(c: float) -> Result:
    """Run the README's building with a brace of gain c, in N*s/m."""
    building = ShearBuilding.build(m=[2e4] * 5, k=[3e7] * 5, ratio=0.02)
    system = System(
        {"ground": RecordSource(el_centro()), "building": as_fmu(building), "brace": Brace(c=c)},
        [
            ("ground.y", "building.ground_acceleration"),
            ("building.v[1]", "brace.v"),
            ("brace.u", "building.force[1]"),
        ],
    )
    return simulate(system, step=STEP, stop=20.0)


def _box(axes: Axes, x: float, y: float, text: str, colour: str) -> None:
    axes.add_patch(
        FancyBboxPatch((x - 0.40, y - 0.075), 0.80, 0.15, boxstyle="round,pad=0.02", fc="white", ec=colour)
    )
    axes.text(x, y, text, ha="center", va="center", fontsize=7.5)


def _arrow(axes: Axes, *points: tuple[float, float]) -> None:
    x, y = zip(*points, strict=True)
    axes.plot(x[:-1], y[:-1], color="black", lw=0.9, solid_capstyle="butt")
    axes.annotate("", points[-1], points[-2], arrowprops={"arrowstyle": "-|>", "lw": 0.9, "color": "black"})


def _loop(axes: Axes) -> None:
    """Draw the block diagram."""
    axes.set(xlim=(0.0, 1.3), ylim=(0.0, 1.0))
    axes.axis("off")
    _box(axes, 0.62, 0.86, "El Centro, 1940", GREY)
    _box(axes, 0.62, 0.55, "five-story building\nnative FMU, FMPy", BLUE)
    _box(axes, 0.62, 0.14, "active brace $u=-c\\,v$\nPython, compiled", RED)
    _arrow(axes, (0.62, 0.765), (0.62, 0.645))
    axes.text(0.65, 0.705, "$a_g$", fontsize=7.5, va="center")
    _arrow(axes, (1.04, 0.55), (1.17, 0.55), (1.17, 0.14), (1.04, 0.14))
    axes.text(1.20, 0.345, "$v_k$\nsampled", fontsize=7.5, va="center", ha="left", clip_on=False)
    _arrow(axes, (0.20, 0.14), (0.07, 0.14), (0.07, 0.55), (0.20, 0.55))
    axes.text(0.04, 0.345, "$u_k$\nheld", fontsize=7.5, va="center", ha="right", clip_on=False)


def _signals(above: Axes, below: Axes, result: Result) -> None:
    """Draw velocity and force over a few communication steps."""
    part = slice(int(2.30 / STEP), int(2.36 / STEP) + 1)
    t, v, u = result.time[part], result["building.v"][part, 0], result["brace.u"][part] / 1e3
    fine = np.linspace(t[0], t[-1], 200)
    above.plot(fine, np.interp(fine, t, v), color=BLUE, lw=1.0)
    above.plot(t, v, "o", color=BLUE, ms=3)
    above.set_ylabel("$v$ (m/s)")
    above.tick_params(labelbottom=False)
    below.step(t, u, where="post", color=RED, lw=1.0)
    below.plot(t, u, "o", color=RED, ms=3)
    below.set(ylabel="$u$ (kN)", xlabel="time (s)")


def building() -> Figure:
    """Return the figure."""
    without, braced = run(0.0), run(4e5)
    figure = Figure(figsize=(7.2, 2.6), dpi=300)
    _loop(figure.add_axes((0.055, 0.03, 0.26, 0.94)))
    above = figure.add_axes((0.435, 0.57, 0.18, 0.37))
    below = figure.add_axes((0.435, 0.16, 0.18, 0.37), sharex=above)
    _signals(above, below, braced)
    drift = figure.add_axes((0.70, 0.16, 0.285, 0.78))
    drift.plot(without.time, 1e3 * without["building.drift"][:, 0], color=GREY, lw=0.8, label="no control")
    drift.plot(braced.time, 1e3 * braced["building.drift"][:, 0], color=BLUE, lw=0.8, label="active brace")
    drift.set(xlabel="time (s)", ylabel="drift of the first story (mm)", xlim=(0.0, 20.0))
    drift.legend(frameon=False, fontsize=7, loc="upper right", ncols=2, borderaxespad=0.1, columnspacing=1.0)
    low, high = drift.get_ylim()
    drift.set_ylim(low, high + 0.18 * (high - low))
    for axes in (above, below, drift):
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_fontsize(7.5)
        axes.yaxis.label.set_fontsize(7.5)
        axes.spines[["top", "right"]].set_visible(False)
    return figure
