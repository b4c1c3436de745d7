"""Figures 2.3, 2.5 and 2.6 of the thesis, and the response profile over the height."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cosim import Array

from .building import STORY_HEIGHTS
from .criteria import FLOORS, TowerResult

_WIND_FLOORS = (30, 50, 70, 75)


def figures(result: TowerResult) -> dict[str, Figure]:
    """Return wind on four floors, response of floor 75 and force, and profiles if the run has them."""
    found = {}
    if "load.w" in result:
        found["wind"] = wind(result.time, result["load.w"])
    if "tower.x" in result and result["tower.x"].shape[1] == len(FLOORS):
        found["response"] = response(result)
    if result.profiles:
        found["profile"] = profile(result)
    return found


def wind(time: Array, forces: Array) -> Figure:
    """Return figure 2.3: wind excitation of floors 30, 50, 70 and 75."""
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    for axes, floor in zip(figure.subplots(4, 1, sharex=True, sharey=True), _WIND_FLOORS, strict=True):
        axes.plot(time, forces[:, floor - 1] / 1e3, linewidth=0.6)
        axes.set_ylabel("force (kN)")
        axes.set_title(f"floor {floor}", fontsize="medium")
        axes.grid(alpha=0.3)
    axes.set_xlabel("time (s)")
    figure.suptitle("Across-wind load")
    return figure


def response(result: TowerResult) -> Figure:
    """Return figures 2.5 and 2.6: displacement and acceleration of floor 75, and the control force."""
    row = FLOORS.index(75)
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    x, a, u = figure.subplots(3, 1, sharex=True)
    without = result.uncontrolled
    for axes, name, label in ((x, "tower.x", "$x_{75}$ (cm)"), (a, "tower.a", "$\\ddot{x}_{75}$ (cm/s²)")):
        axes.plot(without.time, 100 * without[name][:, row], color="0.7", linewidth=0.6, label="no control")
        axes.plot(result.time, 100 * result[name][:, row], linewidth=0.7, label=result.controller)
        axes.set_ylabel(label)
    figure.legend(*x.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize="small")
    if "tower.u" in result:
        u.plot(result.time, result["tower.u"] / 1e3, linewidth=0.6)
    u.set(xlabel="time (s)", ylabel="control force (kN)")
    for axes in (x, a, u):
        axes.grid(alpha=0.3)
    figure.suptitle(f"Floor 75 and control force: {result.controller}")
    return figure


def profile(result: TowerResult) -> Figure:
    """Return RMS and peak of displacement and acceleration by floor, over the height."""
    height = np.cumsum(STORY_HEIGHTS)
    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    grid = figure.subplots(2, 2, sharey=True)
    for axes, (port, kind, label) in zip(
        grid.flat,
        (
            ("tower.x", "rms", "RMS displacement (cm)"),
            ("tower.x", "peak", "peak displacement (cm)"),
            ("tower.a", "rms", "RMS acceleration (cm/s²)"),
            ("tower.a", "peak", "peak acceleration (cm/s²)"),
        ),
        strict=True,
    ):
        for name, statistics in result.profiles.items():
            label_of = {"none": "no control", "lqg": "LQG"}.get(name, result.controller)
            axes.plot(100 * getattr(statistics[port], kind), height, label=label_of)
        axes.set_xlabel(label)
        axes.grid(alpha=0.3)
    grid[0, 0].set_ylabel("height (m)")
    grid[1, 0].set_ylabel("height (m)")
    grid[0, 0].legend()
    figure.suptitle("Response over the height")
    return figure
