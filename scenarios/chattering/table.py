"""The table of chapter 4: all cases, gain laws and couplings beside the printed numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from cosim import Array
from scenarios.printed import number, read_printed

from .study import CASES, GAINS, CaseNumber, Coupling, Plant, Study

#: seeds over which the table gives the spread of a noisy case
SPREAD = range(1, 11)
#: (case, gain) -> printed norm of u and mean of sgn s
PRINTED = {
    (int(row["case"]), row["gain"]): (number(row["norm_u"]), number(row["mean_sgn"]))
    for row in read_printed(Path(__file__).parent)
}


@dataclass(frozen=True, kw_only=True)
class Table:
    """Run all cases and compare them with the print."""

    seed: int = 1
    """seed of the white noise in cases 3 and 6"""
    plant: Plant = "fmu"
    """run the plant as a native FMU, or as Python in the loop"""
    comparison: bool = True
    """add the gain laws that the thesis mentions and does not run"""

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for every case, gain law and coupling."""
        return [self._row(study) for study in self._studies()]

    def _studies(self) -> Iterator[Study]:
        for case in get_args(CaseNumber):
            for gain in GAINS:
                if self.comparison or (case, gain) in PRINTED:
                    for coupling in get_args(Coupling):
                        yield Study(case=case, gain=gain, coupling=coupling, seed=self.seed, plant=self.plant)

    def _row(self, study: Study) -> dict[str, Any]:
        result = study.run()
        norm, mean = PRINTED.get((study.case, study.law), (None, None))
        return {
            "case": study.case,
            "gain": study.law,
            "coupling": study.coupling,
            "norm_u": result.statistics["control.u"].norm,
            "mean_sgn": result.statistics["control.sgn"].mean,
            "printed_norm_u": norm,
            "printed_mean_sgn": mean,
            "note": "; ".join(_notes(study, norm, result["control.u"])),
        }

    def text(self, rows: list[dict[str, Any]]) -> str:
        """Return one line per case and gain law, the print beside both couplings."""
        head = (
            f"{'case':<4}  {'gain':<18}  |  {'norm(u): printed':>16} {'continuous':>10} {'sampled':>10}  |"
            f"  {'mean(sgn s): printed':>20} {'continuous':>10} {'sampled':>8}"
        )
        lines = [head, "-" * len(head)]
        pairs: dict[tuple[int, str], dict[str, dict[str, Any]]] = {}
        for row in rows:
            pairs.setdefault((row["case"], row["gain"]), {})[row["coupling"]] = row
        for (case, gain), by in pairs.items():
            c, s = by["continuous"], by["sampled"]
            norm = "-" if c["printed_norm_u"] is None else f"{c['printed_norm_u']:.0f}"
            mean = "-" if c["printed_mean_sgn"] is None else f"{c['printed_mean_sgn']:.4f}"
            note = f"  {c['note']}" if c["note"] else ""
            lines.append(
                f"{case:<4}  {gain:<18}  |  {norm:>16} {c['norm_u']:>10.2f} {s['norm_u']:>10.2f}  |"
                f"  {mean:>20} {c['mean_sgn']:>+10.5f} {s['mean_sgn']:>+8.5f}{note}"
            )
        return "\n".join(lines)


def _notes(study: Study, printed: float | None, u: Array) -> Iterator[str]:
    """Yield remarks on a cell: a misprint, a print that cannot be reached, the spread over noise seeds."""
    if printed is not None:
        found = float(np.linalg.norm(u))
        before = norm_before_first_switch(u)
        M = CASES[study.case].M
        if study.law == "constant" and not math.isclose(printed, found, rel_tol=1e-3):
            yield f"print: probably a misprint of {M * math.sqrt(len(u)):.0f} = {M:g} sqrt {len(u)}"
        if study.law == "constant" and study.case == 6:
            yield f"print: M = 300, but {printed:.0f} = {M:g} sqrt {len(u) - 1}, so M = {M:g} here"
        if before > printed:
            yield f"{printed:.0f} is not reproduced: the norm is {before:.0f} before u first changes its sign"
    if CASES[study.case].noise and study.law == CASES[study.case].tuned:
        norms = [replace(study, seed=s).run().statistics["control.u"].norm for s in SPREAD]
        yield f"{min(norms):.0f} to {max(norms):.0f} over {len(norms)} seeds ({study.coupling})"


def norm_before_first_switch(u: Array) -> float:
    """Return the norm of u up to the sample before it first changes its sign."""
    changed = np.flatnonzero(u[1:] * u[:-1] < 0.0)
    return float(np.linalg.norm(u[: changed[0] + 1] if len(changed) else u))
