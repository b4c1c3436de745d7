"""The tables of the tall building: rows of short runs, and every remark computed from known rows."""

import math

import pytest

from scenarios.tall_building.campaign import run_all
from scenarios.tall_building.criteria import NAMES
from scenarios.tall_building.plant import SEED
from scenarios.tall_building.study import Study
from scenarios.tall_building.table import Table
from scenarios.tall_building.thesis_tables import (
    PRINTED,
    STIFFNESS_ERRORS,
    broken_orderings,
    far_cells,
    thesis_rows,
    thesis_text,
    wins_over_lqg,
)
from scenarios.tall_building.variants import variant_text
from tests.benchmark_data import TOWER, needs_data


def test_printed_tables_agree_with_themselves() -> None:
    """J5 and J11 are the stroke over 10.137 and 32.30 cm; 0.4 %, three digits: finds a misread cell."""
    for column in PRINTED:
        for i in range(3):
            assert column.printed["sigma_xm"][i] / 10.137 == pytest.approx(column.printed["J5"][i], rel=4e-3)
            assert column.printed["max_xm"][i] / 32.30 == pytest.approx(column.printed["J11"][i], rel=4e-3)


def printed_rows() -> list[dict[str, object]]:
    """The rows of a run that reproduces the print."""
    return [
        {
            "table": c.table, "controller": c.controller, "a": c.a, "stiffness_error": e, "criterion": n,
            "printed": c.printed[n][i], "computed": c.printed[n][i],
        }
        for c in PRINTED for i, e in enumerate(STIFFNESS_ERRORS) for n in NAMES
    ]  # fmt: skip


def changed(factor: float, controller: str, a: float | None, criterion: str) -> list[dict[str, object]]:
    """The printed rows with one criterion of one controller multiplied, at all stiffnesses."""
    rows = printed_rows()
    for row in rows:
        if (row["controller"], row["a"], row["criterion"]) == (controller, a, criterion):
            row["computed"] = factor * row["printed"]
    return rows


def test_the_print_against_itself() -> None:
    """Filtered SMC is below LQG in 9, 2 and 11 criteria, counted by hand in the printed tables."""
    rows = printed_rows()
    assert [wins_over_lqg(rows, e) for e in STIFFNESS_ERRORS] == [9, 2, 11]
    assert far_cells(rows) == []
    text = thesis_text(rows, ["nothing"])
    assert "dK +0%: 9 printed, 9 computed" in text
    assert "at 2 of 3 stiffnesses in print, at 2 computed" in text
    assert "Cells within 15% of print: 288 of 288" in text
    assert text.endswith("proves little: nothing")


def test_a_worse_filtered_control_is_reported() -> None:
    """J3 of filtered SMC above LQG and unfiltered J12 below the filtered one."""
    rows = changed(1.1, "filtered-smc", 1.065, "J3")
    before = [wins_over_lqg(printed_rows(), e) for e in STIFFNESS_ERRORS]
    lost = [b - wins_over_lqg(rows, e) for b, e in zip(before, STIFFNESS_ERRORS, strict=True)]
    assert lost == [0, 0, 1]  # J3 of the print is below LQG's at -15 % only
    broken = broken_orderings(changed(1.3, "filtered-smc", 1.065, "J12"))
    assert [line for line in broken if "J12 of filtered SMC" in line] == [
        f"dK {e:+.0%}, a 1.065: J12 of filtered SMC is {change:.2f} % above unfiltered"
        for e, change in zip(STIFFNESS_ERRORS, (17.28, 27.81, 25.57), strict=True)
    ]
    assert far_cells(changed(1.2, "lqg", None, "J1"))[0] == "2.1 lqg dK +0% J1: 0.443 for 0.369 (+20%)"
    over = broken_orderings(changed(3.0, "smc", 1.265, "max_u"))
    assert "dK +0%, a 1.265, smc: max_u above 300" in over


def test_rows_and_text_of_the_thesis_tables() -> None:
    """Two seconds of every column; the text has every criterion, and names what was fitted."""
    rows = thesis_rows(Study(duration=2.0, record=False, plant="python"), workers=1)
    assert len(rows) == 6 * 3 * 16
    assert all(math.isfinite(row["computed"]) for row in rows)
    own = {(r["controller"], r["a"], r["stiffness_error"]): r for r in rows if r["criterion"] == "J9"}
    alone = Study(
        controller="lqg", stiffness_error=0.15, duration=2.0, record=False
    )  # as an FMU: the same bits
    assert own["lqg", None, 0.15]["computed"] == alone.run().criteria()["J9"]
    text = Table().text(rows)
    assert "filtered-smc, a = 1.065" in text
    assert sum(line.startswith("max_xm (cm)") for line in text.splitlines()) == 2
    assert f"seed {SEED}, the nearest to the print" in text
    assert f"seed {SEED}" not in Table(seed=1).text(rows)
    assert "parameters of the wind" not in Table(wind="w.csv").text(rows)


@pytest.mark.parametrize("study", ["realism", "beyond"])
def test_rows_and_text_of_the_variants(study: str) -> None:
    table = Table(study=study, duration=1.0, workers=1, plant="python")  # type: ignore[arg-type]
    rows = table.rows()
    assert len(rows) == 10 * 16
    text = table.text(rows)
    assert text.splitlines()[-1].startswith("The largest change is against")
    assert "Of 10 cases" in text


def test_broken_limits_and_unstable_cases_are_reported() -> None:
    """Cases with known criteria: one within all limits, one outside two of them, one that diverged."""
    fine = dict.fromkeys(NAMES, 1.0)
    cases = {"fine": fine, "wild": fine | {"max_u": 301.0, "max_xm": 96.0}, "lost": dict.fromkeys(NAMES)}
    rows = [
        {"study": "beyond", "case": case, "criterion": n, "computed": v}
        for case, values in cases.items() for n, v in values.items()
    ]  # fmt: skip
    lines = variant_text(rows).splitlines()
    assert lines[1].endswith("1")  # no remark
    assert lines[2].endswith("max_u +30000.0%; max_u above 300 kN; max_xm above 95 cm")
    assert lines[3].endswith("unstable")
    assert lines[4] == "Of 3 cases, 1 are unstable (lost), and 1 break a hardware limit (wild)."


def test_table_of_the_coupling(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows are those of coupling.py, whose numbers test_study.py checks; one line for each."""
    rows = [
        {"step": 0.02, "coupling": "sampled", "x76": 1.6e-3, "x_m": 2e-3, "order": None},
        {"step": 0.01, "coupling": "sampled", "x76": 0.8e-3, "x_m": 1e-3, "order": 1.0},
    ]
    asked = []
    monkeypatch.setattr("scenarios.tall_building.table.coupling_errors", lambda *a: asked.append(a) or rows)
    table = Table(study="coupling", seed=3, duration=2.0)
    lines = table.text(table.rows()).splitlines()
    assert asked == [(None, None, 3, 2.0)]
    assert [line.split() for line in lines[1:3]] == [
        ["20", "sampled", "1.600e-03", "2.000e-03"],
        ["10", "sampled", "8.000e-04", "1.000e-03", "1.00"],
    ]


def test_a_run_that_diverges_has_no_criteria() -> None:
    """Unfiltered SMC with an actuator of 20 ms is unstable."""
    assert run_all([Study(controller="smc", actuator=0.02, duration=60.0, record=False)], workers=1) == [None]


@pytest.mark.long
@pytest.mark.parametrize("data", [None, pytest.param(str(TOWER), marks=needs_data)])
def test_tables_keep_the_printed_orderings(data: str | None) -> None:
    """Tables 2.1 and 2.2 whole: what filtering does, what a does to J1 to J4, and the hardware limits.

    That a raises J5 and J6 is not reproduced (the change is below 2 %), and is left out here.
    """
    rows = Table(data=data).rows()
    assert len(rows) == 6 * 3 * 16
    broken = [
        line for line in broken_orderings(rows) if "changes J5" not in line and "changes J6" not in line
    ]
    assert not broken
