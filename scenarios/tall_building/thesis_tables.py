"""Tables 2.1 and 2.2 of the thesis: the printed cells beside the computed ones, and their differences."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, cast

from scenarios.printed import read_printed

from .campaign import run_all
from .control import Controller
from .criteria import LIMITS, NAMES, UNITS, broken_limits
from .study import Study

Row = dict[str, Any]

STIFFNESS_ERRORS = (0.0, 0.15, -0.15)
NEAR_PRINT = ("J1", "J2", "J3", "J4", "J7", "J8", "J9", "J10")
"""Criteria of the response. J5, J6, J11, J12 and the four unnumbered ones are those of the effort."""
TOLERANCE = 0.15


@dataclass(frozen=True)
class Column:
    """One column of a printed table: controller, gain a, and three cells (stiffness errors) by criterion."""

    table: str
    controller: Controller
    a: float | None
    printed: dict[str, tuple[float, ...]]

    @property
    def title(self) -> str:
        """The head of the column."""
        return str(self.controller) + ("" if self.a is None else f", a = {self.a:g}")


def _columns() -> tuple[Column, ...]:
    rows = read_printed(Path(__file__).parent)
    found = []
    for (table, controller, a), cells in groupby(rows, lambda r: (r["table"], r["controller"], r["a"])):
        printed = {r["criterion"]: tuple(float(r[e]) for e in ("0", "+15 %", "-15 %")) for r in cells}
        found.append(Column(table, cast(Controller, controller), float(a) if a else None, printed))
    return tuple(found)


PRINTED = _columns()


def thesis_rows(base: Study, workers: int = 0) -> list[Row]:
    """Return tables 2.1 and 2.2: six columns, three stiffnesses, 16 criteria."""
    cases = [(column, i) for column in PRINTED for i in range(len(STIFFNESS_ERRORS))]
    studies = [
        replace(
            base,
            controller=column.controller,
            stiffness_error=STIFFNESS_ERRORS[i],
            a=base.a if column.a is None else column.a,
        )
        for column, i in cases
    ]
    return [
        {
            "table": column.table,
            "controller": column.controller,
            "a": column.a,
            "stiffness_error": STIFFNESS_ERRORS[i],
            "criterion": name,
            "printed": column.printed[name][i],
            "computed": (found or {}).get(name, math.nan),
        }
        for (column, i), found in zip(cases, run_all(studies, workers), strict=True)
        for name in NAMES
    ]


# ------------------------------------------------------------------ differences from the print

Cells = dict[tuple[str, float | None, float], dict[str, float]]


def cells_of(rows: list[Row], which: str = "computed") -> Cells:
    """Return the criteria by controller, a and stiffness error: the "computed" or the "printed" ones."""
    cells: Cells = {}
    for row in rows:
        cells.setdefault((row["controller"], row["a"], row["stiffness_error"]), {})[row["criterion"]] = row[
            which
        ]
    return cells


def wins_over_lqg(rows: list[Row], error: float, which: str = "computed") -> int:
    """Return in how many of the 16 criteria filtered SMC, a = 1.065, is below LQG."""
    cells = cells_of(rows, which)
    filtered, lqg = cells["filtered-smc", 1.065, error], cells["lqg", None, error]
    return sum(filtered[name] < lqg[name] for name in NAMES)


def broken_orderings(rows: list[Row]) -> list[str]:
    """Return the orderings of the printed tables that the computed ones do not have.

    Filtered below unfiltered: J5, J6, J12 in every case, J11 and max_u at 0 and -15 %.
    Larger a: lower J1 to J4, higher J5 and J6. Limits kept at both a.
    """
    cells = cells_of(rows)
    found = []
    for error in STIFFNESS_ERRORS:
        for a in (1.065, 1.265):
            filtered, plain = cells["filtered-smc", a, error], cells["smc", a, error]
            for name in ("J5", "J6", "J12") + (("J11", "max_u") if error <= 0.0 else ()):
                if filtered[name] >= plain[name]:
                    change = 100 * (filtered[name] / plain[name] - 1)
                    found.append(
                        f"dK {error:+.0%}, a {a}: {name} of filtered SMC is {change:.2f} % above unfiltered"
                    )
            for controller in ("filtered-smc", "smc"):
                over = broken_limits(cells[controller, a, error])
                found += [
                    f"dK {error:+.0%}, a {a}, {controller}: {name} above {LIMITS[name]:g}" for name in over
                ]
        for controller in ("filtered-smc", "smc"):
            low, high = cells[controller, 1.065, error], cells[controller, 1.265, error]
            for name in ("J1", "J2", "J3", "J4", "J5", "J6"):
                change = 100 * (high[name] / low[name] - 1)
                if (change >= 0.0) == (name not in ("J5", "J6")):
                    found.append(f"dK {error:+.0%}, {controller}: larger a changes {name} by {change:+.2f} %")
    return found


def is_near(row: Row) -> bool:
    """Tell whether a computed cell is within 15 % of the printed one."""
    return bool(abs(row["computed"] / row["printed"] - 1.0) <= TOLERANCE)


def far_cells(rows: list[Row]) -> list[str]:
    """Return the cells J1 to J4 and J7 to J10 that are more than 15 % from print."""
    return [
        f"{r['table']} {r['controller']} dK {r['stiffness_error']:+.0%} {r['criterion']}: "
        f"{r['computed']:.3f} for {r['printed']:.3f} ({r['computed'] / r['printed'] - 1:+.0%})"
        for r in rows
        if r["criterion"] in NEAR_PRINT and not is_near(r)
    ]


# ------------------------------------------------------------------------------------ as text


def thesis_text(rows: list[Row], fitted: list[str]) -> str:
    """Return both tables and the differences from the print; `fitted` names what was fitted to the print."""
    lines = []
    for number in ("2.1", "2.2"):
        lines += [f"Table {number}: printed | computed for dK = 0, +15 %, -15 %", *_table(rows, number), ""]
    lines += _against_lqg(rows)
    broken = broken_orderings(rows)
    lines.append(f"Orderings of the printed tables that do not hold: {len(broken) or 'none'}")
    lines += [f"  {line}" for line in broken]
    lines += _agreement(rows)
    lines.append("Fitted to these printed tables, so that agreement proves little: " + "; ".join(fitted))
    return "\n".join(lines)


def _table(rows: list[Row], number: str) -> list[str]:
    value = {(r["table"], r["controller"], r["stiffness_error"], r["criterion"]): r["computed"] for r in rows}
    columns = [c for c in PRINTED if c.table == number]
    lines = [" " * 16 + "".join(f"{c.title:^46}" for c in columns)]
    for name in NAMES:
        cells = []
        for c in columns:
            printed = " ".join(f"{v:6.4g}" for v in c.printed[name])
            own = " ".join(f"{value[number, c.controller, e, name]:6.4g}" for e in STIFFNESS_ERRORS)
            cells.append(f"{printed} | {own}")
        unit = UNITS.get(name)
        lines.append(f"{name + (f' ({unit})' if unit else ''):<16}" + "   ".join(cells))
    return lines


def _against_lqg(rows: list[Row]) -> list[str]:
    """Say whether filtered SMC beats LQG, printed and computed, by the number of criteria."""
    half = len(NAMES) / 2
    lines, ahead = [], {"printed": 0, "computed": 0}
    for error in STIFFNESS_ERRORS:
        wins = {which: wins_over_lqg(rows, error, which) for which in ahead}
        for which, n in wins.items():
            ahead[which] += n > half
        lines.append(f"  dK {error:+.0%}: {wins['printed']} printed, {wins['computed']} computed")
    return [
        f"Criteria, of {len(NAMES)}, in which filtered SMC (a = 1.065) is below LQG:",
        *lines,
        f"  filtered SMC is ahead of LQG in more than half of them at {ahead['printed']} of "
        f"{len(STIFFNESS_ERRORS)} stiffnesses in print, at {ahead['computed']} computed",
    ]


def _agreement(rows: list[Row]) -> list[str]:
    """Say how many cells are near the print: responses, then each criterion of effort."""

    def count(*names: str) -> str:
        chosen = [r for r in rows if r["criterion"] in names]
        return f"{sum(map(is_near, chosen))} of {len(chosen)}"

    effort = ", ".join(f"{n} {count(n)}" for n in NAMES if n not in NEAR_PRINT)
    far = far_cells(rows)
    return [
        f"Cells within {TOLERANCE:.0%} of print: {count(*NAMES)}; "
        f"J1 to J4, J7 to J10 {count(*NEAR_PRINT)}; {effort}",
        f"Cells J1 to J4, J7 to J10 farther from print: {len(far) or 'none'}",
        *(f"  {line}" for line in far),
    ]
