"""Figures of a case of chapter 4: phase plane, displacement, control force, gain, and close-ups."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cosim import Result

_X, _V = "displacement x₁ (m)", "velocity x₂ (m/s)"
_T, _U = "time (s)", "control force u (N)"


def figures(result: Result) -> dict[str, Figure]:
    """Return the thesis' figures of a case: phase plane, x1(t), u(t), M(t), and two close-ups."""
    x, v, u, M = (result[n] for n in ("plant.x", "plant.v", "control.u", "control.M"))
    t = result.time
    sliding = (x < 0.5 * x.max()) & (x > 0.25 * x.max()) & (t > t[x.argmax()])
    close_up = "Phase plane, close-up of the sliding mode"
    return {
        "phase_plane": _plot(x, v, _X, _V, "Phase plane", surface=True),
        "phase_plane_close_up": _plot(x[sliding], v[sliding], _X, _V, close_up, surface=True),
        "displacement": _plot(t, x, _T, _X, "Displacement"),
        "control_force": _plot(t, u, _T, _U, "Control force"),
        "control_force_close_up": _plot(
            t[500:600], u[500:600], _T, _U, "Control force, close-up", steps=True
        ),
        "gain": _plot(t, M, _T, "sliding gain M (N)", "Sliding gain"),
    }


def _plot(
    x: Any, y: Any, x_label: str, y_label: str, title: str, *, surface: bool = False, steps: bool = False
) -> Figure:
    figure = Figure(figsize=(6.0, 4.0))
    axes = figure.add_axes((0.14, 0.13, 0.83, 0.78))  # fixed: laying out costs as much as drawing
    axes.plot(x, y, linewidth=0.8, drawstyle="steps-post" if steps else "default", label="trajectory")
    if surface:
        ends = np.array([np.min(x), np.max(x)])
        axes.plot(ends, -ends, "--", color="tab:red", linewidth=1.0, label="sliding surface x₂ = -x₁")
        axes.legend()
    axes.set(xlabel=x_label, ylabel=y_label, title=title)
    axes.grid(alpha=0.3)
    return figure
