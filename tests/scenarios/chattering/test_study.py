"""Chapter 4 against the numbers that were found to lie behind its print (both couplings)."""

import math
import re

import numpy as np
import pytest

from cosim import schedule, simulate
from scenarios.chattering.study import RECORDED, Study
from scenarios.chattering.table import PRINTED, Table, norm_before_first_switch

# (case, gain, coupling) -> (norm of u, mean of sgn s). A switching controller amplifies
# round-off, but over these 4001 samples the norms depend on it below the last digit
# given, so the bound is half of that digit.
NORMS = {
    (1, "constant", "continuous"): 6325.35,
    (1, "constant", "sampled"): 6325.35,
    (1, "algorithm-1", "continuous"): 672.35,
    (1, "algorithm-1", "sampled"): 695.53,
    (2, "constant", "continuous"): 6324.56,
    (2, "constant", "sampled"): 6324.56,
    (2, "algorithm-1", "continuous"): 765.27,
    (2, "algorithm-1", "sampled"): 837.52,
    (3, "constant", "continuous"): 18976.04,
    (4, "constant", "continuous"): 18976.04,
    (5, "constant", "continuous"): 18976.04,
    (5, "algorithm-2", "continuous"): 2491.19,
    (5, "algorithm-2", "sampled"): 2902.41,
    (6, "constant", "continuous"): 9486.83,
}
MEANS = {
    (1, "constant", "continuous"): (-0.00275, 5e-6),
    (1, "constant", "sampled"): (0.00625, 5e-6),
    (1, "algorithm-1", "continuous"): (-0.1022, 5e-5),
    (1, "algorithm-1", "sampled"): (-0.0717, 5e-5),
    (2, "constant", "continuous"): (-0.00750, 5e-6),
    (2, "constant", "sampled"): (0.0065, 5e-5),
    (2, "algorithm-1", "continuous"): (-0.0685, 5e-5),
    (2, "algorithm-1", "sampled"): (-0.0430, 5e-5),
}


@pytest.fixture(scope="module")
def rows():
    return {(r["case"], r["gain"], r["coupling"]): r for r in Table(comparison=False).rows()}


@pytest.mark.parametrize("key", NORMS)
def test_norm_of_u(rows, key):
    # 0.006 is half of the last digit of the norms, and a little for the rounding of that digit
    assert rows[key]["norm_u"] == pytest.approx(NORMS[key], abs=0.006)


@pytest.mark.parametrize("key", MEANS)
def test_mean_of_sgn_s(rows, key):
    mean, half_digit = MEANS[key]
    assert rows[key]["mean_sgn"] == pytest.approx(mean, abs=half_digit * 1.01)


def test_el_centro_needs_the_effort_that_the_thesis_prints(rows):
    # which processing of the record, and whether in g or m/s^2, moves the norm within 904.5 to 906.5
    assert 904.5 < rows[4, "algorithm-2", "continuous"]["norm_u"] < 906.5
    # held over a step the record's scale matters at 0.15: 1040.5 with numbers in g
    assert rows[4, "algorithm-2", "sampled"]["norm_u"] == pytest.approx(1040.5, abs=0.05)


def test_case_3_prints_153_and_the_first_switch_alone_costs_800(rows):
    """With u = -150 and nothing else, s = 39 - 125 t - 75 t^2 is 0 at t = 0.27 s, and 150 sqrt 28 = 794.

    3 %: M grows by 2 % until then, and noise may move the switch by a sample. The whole norm is 904 to
    911 over ten seeds of the noise, so that 1 % holds for any of them.
    """
    row = rows[3, "algorithm-2", "continuous"]
    assert row["printed_norm_u"] == 153.0
    found = re.search(
        r"153 is not reproduced: the norm is (\d+) before u first changes its sign", row["note"]
    )
    assert float(found[1]) == pytest.approx(800.0, rel=0.03)
    assert row["norm_u"] == pytest.approx(907.0, rel=0.01)


def test_effort_before_the_first_switch():
    assert norm_before_first_switch(np.array([3.0, 4.0, -1.0, 7.0, -2.0])) == 5.0
    assert norm_before_first_switch(np.array([3.0, 4.0])) == 5.0


def test_notes_name_misprints_and_spread(rows):
    """6335 is 0.15 % off 100 sqrt 4001; case 6 is run with M = 150; noise is stated with its spread."""
    assert "misprint of 6325 = 100 sqrt 4001" in rows[1, "constant", "sampled"]["note"]
    assert "9487 = 150 sqrt 4000, so M = 150 here" in rows[6, "constant", "continuous"]["note"]
    low, high = map(
        float, re.search(r"(\d+) to (\d+) over 10", rows[6, "algorithm-2", "continuous"]["note"]).groups()
    )
    assert low < 2623.0 < high
    assert [key for key, row in rows.items() if "print" in row["note"] or "not repr" in row["note"]] == [
        (case, gain, coupling)
        for case, gain in ((1, "constant"), (3, "algorithm-2"), (6, "constant"))
        for coupling in ("sampled", "continuous")
    ]


def test_text_of_the_table(rows):
    """One line for each case and gain law, with the print and both couplings."""
    lines = Table().text(list(rows.values())).splitlines()
    assert len(lines) == 2 + len(PRINTED)
    assert lines[5].split() == [
        "2", "algorithm-1", "|", "765", "765.27", "837.52", "|", "0.0745", "-0.06848", "-0.04299"
    ]  # fmt: skip


def test_noise_and_earthquake_reach_the_plant():
    """Case 3: standard normal, so mean and variance of 4001 numbers are within 4 standard errors of 0 and 1.
    Case 4: the record's peak of 0.211 g, in g by default and in m/s^2 on request."""
    system = Study(case=3).build()
    noise = simulate(system, step=0.01, stop=40.0, record=["noise.y", "total.y"])
    assert noise["total.y"].mean() == pytest.approx(0.0, abs=4 / math.sqrt(4001))
    assert noise["total.y"].var() == pytest.approx(1.0, abs=4 * math.sqrt(2 / 4001))
    for unit, peak in (("g", 0.2107), ("m/s^2", 0.2107 * 9.80665)):
        result = simulate(Study(case=4, ground_unit=unit).build(), step=0.01, stop=40.0, record=["total.y"])
        assert np.abs(result["total.y"]).max() == pytest.approx(peak, rel=1e-3)  # four digits are known


def test_metrics_are_those_of_the_signals():
    result = Study(case=1, gain="algorithm-1").run()
    metrics = Study(case=1, gain="algorithm-1").metrics(result)
    u = result["control.u"]
    assert metrics["norm(u)"][0] == pytest.approx(np.linalg.norm(u), rel=1e-12)  # summation order
    assert metrics["changes of sign of u"][0] == np.count_nonzero(np.diff(np.sign(u[u != 0.0])))
    assert metrics["final M"] == (result["control.M"][-1], "N")


def test_rows_have_the_keys_of_the_json_table(rows):
    keys = {"case", "gain", "coupling", "norm_u", "mean_sgn", "printed_norm_u", "printed_mean_sgn"}
    assert all(keys <= row.keys() for row in rows.values())
    assert len(rows) == 6 * 2 * 2


@pytest.mark.parametrize("coupling", ["continuous", "sampled"])
def test_fmu_and_python_plant_give_the_same_run_bit_for_bit(coupling):
    # the same LLVM IR runs in both; a switching controller would show any difference
    fmu = Study(case=6, coupling=coupling, plant="fmu").run()
    python = Study(case=6, coupling=coupling, plant="python").run()
    for name in RECORDED:
        assert (fmu[name] == python[name]).all(), name


def test_schedule_of_case_2_with_sampled_coupling():
    text = schedule(Study(case=2).build(), step=0.01)
    assert text == (
        "sampled coupling\n"
        "at t_k:\n"
        "  plant: outputs (FMU)\n"
        "  surface.x1 <- plant.x\n"
        "  surface.x2 <- plant.v\n"
        "  surface: step\n"
        "  control.s <- sensor.y\n"
        "  control: step\n"
        "to t_k+1:\n"
        "  plant.u <- control.u\n"
        "  sensor.u <- surface.s\n"
        "  plant: step (FMU)\n"
        "  sensor: advance"
    )


def test_every_figure_has_labels_with_units():
    study = Study(case=1)
    figures = study.figures(study.run())
    assert set(figures) == {
        "phase_plane",
        "phase_plane_close_up",
        "displacement",
        "control_force",
        "control_force_close_up",
        "gain",
    }
    for figure in figures.values():
        (axes,) = figure.axes
        assert "(" in axes.get_xlabel()
        assert "(" in axes.get_ylabel()
