"""The tables of the tall building: those of the thesis, and three studies beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from .coupling import coupling_errors
from .plant import DURATION, SEED
from .study import Plant, Study
from .thesis_tables import thesis_rows, thesis_text
from .variants import variant_rows, variant_text

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Run a study of the tall building."""

    study: Literal["thesis", "realism", "beyond", "coupling"] = "thesis"
    """thesis: tables 2.1 and 2.2; realism: imperfections of the loop; beyond: gain laws of chapter 4
    and actuator dynamics; coupling: the damper as an FMU of its own"""
    data: str | None = None
    """.npz file with the matrices M, C, K in t, kN*s/m, kN/m"""
    wind: str | None = None
    """.npz or .csv file with forces on the floors"""
    seed: int = SEED
    """seed of the default wind"""
    duration: float = DURATION
    """length of a run, s"""
    plant: Plant = "fmu"
    """run the plant as a native FMU, or as Python in the loop"""
    workers: int = 0
    """runs at the same time; 0 for one per core"""

    def rows(self) -> list[Row]:
        """Run the study."""
        if self.study == "coupling":
            return coupling_errors(self.data, self.wind, self.seed, self.duration)
        base = Study(
            data=self.data, wind=self.wind, seed=self.seed, duration=self.duration,
            plant=self.plant, record=False,
        )  # fmt: skip
        if self.study == "thesis":
            return thesis_rows(base, self.workers)
        return variant_rows(self.study, base, self.workers)

    def text(self, rows: list[Row]) -> str:
        """Return the rows as text, with remarks that are computed from them."""
        if self.study == "thesis":
            return thesis_text(rows, self._fitted())
        return coupling_text(rows) if self.study == "coupling" else variant_text(rows)

    def _fitted(self) -> list[str]:
        """Return the names of the parameters of this run that were fitted to the print."""
        found = ["weights of the sliding surface and of LQG, and S_vv (control.py)"]
        if self.wind is None:
            found.append("parameters of the wind (calibrate.py)")
        if self.wind is None and self.seed == SEED:
            found.append(f"seed {SEED}, the nearest to the print of the first 1100")
        return found


def coupling_text(rows: list[Row]) -> str:
    """Return the errors of the coupling as text."""
    lines = [f"{'step (ms)':>10} {'coupling':>10} {'error of x76':>14} {'error of x_m':>14} {'order':>7}"]
    for row in rows:
        order = "" if row["order"] is None else f"{row['order']:.2f}"
        lines.append(
            f"{1e3 * row['step']:10g} {row['coupling']:>10} {row['x76']:14.3e} {row['x_m']:14.3e} {order:>7}"
        )
    return "\n".join([*lines, "peak error over peak response, against the single plant at the same step"])
