"""Figures of the highway bridge: sensors over time, nodes, hysteresis loops, yield map."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cosim import Array, Result

from .bridge import EI, M_Y, SEGMENT
from .criteria import BEARINGS, curvatures, moments

#: ports of the bearings' displacements, and the names of their runs
COMPARED = {"none.deformation": "without control", "lqg.deformation": "LQG", "bridge.deformation": "this run"}


def figures(result: Result) -> dict[str, Figure]:
    """Return figures 3.7 to 3.9, hysteresis loops of a bearing and a column, and the yield map."""
    found = {
        "figure-3.7-second-sensor": displacements(result, 1, "second"),
        "figure-3.8-seventh-sensor": displacements(result, 6, "seventh"),
        "hysteresis": loops(result, curvatures(result)),
        "yield-map": yield_map(curvatures(result)),
    }
    if "control.nodes" in result:
        found["figure-3.9-nodes"] = nodes(result)
    return found


def displacements(result: Result, sensor: int, name: str) -> Figure:
    """Return the displacement at a sensor (0, 1, ...) in x and y, and that of the runs to compare with."""
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for direction, ax in enumerate(axes):
        for port, label in COMPARED.items():
            if port in result:
                x = 1e3 * result[port][:, 2 * sensor + direction]
                ax.plot(result.time, x, linewidth=0.7, label=label)
        ax.set_ylabel(f"{'xy'[direction]} displacement (mm)")
        ax.grid(alpha=0.3)
    axes[0].set_title(f"Bridge displacement at the position of the {name} sensor")
    _legend_below(figure, axes[0])
    axes[-1].set_xlabel("time (s)")
    axes[-1].set_xlim(0.0, _end_of_motion(result))
    return figure


def _end_of_motion(result: Result) -> float:
    """Return the time after which no bearing moves by more than 2 % of the largest displacement."""
    moved = [np.abs(result[p]).max(axis=1) for p in COMPARED if p in result]
    largest = np.max(moved, axis=0)
    return float(result.time[np.flatnonzero(largest > 0.02 * largest.max())[-1]])


def nodes(result: Result) -> Figure:
    """Return figure 3.9, the number of wavelet nodes over time."""
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    ax: Axes = figure.subplots()
    ax.step(result.time, result["control.nodes"], where="post", linewidth=0.8)
    ax.set(xlabel="time (s)", ylabel="number of wavelet nodes")
    ax.grid(alpha=0.3)
    return figure


def loops(result: Result, phi: Array) -> Figure:
    """Return the loops of the bearing and of the column end that move most."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    deformation = result["bridge.deformation"][:, :BEARINGS]
    i = int(np.abs(deformation).max(axis=0).argmax())
    left.plot(1e3 * deformation[:, i], 1e-3 * result["bridge.force"][:, i], linewidth=0.6)
    left.set(xlabel="deformation (mm)", ylabel="force (kN)", title=f"bearing {i // 2 + 1}, {'xy'[i % 2]}")
    j = int(np.abs(phi).max(axis=0).argmax())
    right.plot(1e3 * phi[:, j], 1e-6 * moments(result)[:, j], linewidth=0.6)
    column = j // (phi.shape[1] // 2) + 1
    right.set(
        xlabel="curvature (1/km)", ylabel="moment (MN·m)", title=f"column {column}, end that bends most"
    )
    for ax in (left, right):
        ax.locator_params(axis="x", nbins=5)
        ax.grid(alpha=0.3)
    return figure


def yield_map(phi: Array) -> Figure:
    """Return the largest curvature over that at yield, along both columns, bending in y and in x."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    ratio = np.abs(phi).max(axis=0) * EI / M_Y
    per_column = len(ratio) // 2
    for c, ax in enumerate(figure.subplots(1, 2, sharex=True, sharey=True)):
        segments = ratio[c * per_column : (c + 1) * per_column].reshape(-1, 2, 2)  # segment, plane, end
        heights = SEGMENT * np.arange(len(segments), -1, -1)
        for plane, direction in enumerate("yx"):
            for k, (top, bottom) in enumerate(pairwise(heights)):
                ax.plot(
                    segments[k, plane], [top, bottom], "o-", color=f"C{plane}",
                    label=f"bending in {direction}" if k == 0 else None,
                )  # fmt: skip
        ax.axvline(1.0, color="black", linewidth=0.8)
        ax.set(title=f"column {c + 1}", xlabel="largest curvature / yield curvature", xlim=(0.0, None))
        ax.set_ylabel("height above the base (m)")
        ax.grid(alpha=0.3)
    _legend_below(figure, figure.axes[0])
    return figure


def _legend_below(figure: Figure, axes: Axes) -> None:
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize="small")
