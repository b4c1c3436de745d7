"""The highway bridge's study: criteria by definition, short runs of all controllers, table 3.1."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Result, SimulationError
from scenarios.highway_bridge import control, study
from scenarios.highway_bridge.bridge import EI, M_Y, SEGMENT
from scenarios.highway_bridge.criteria import NAMES, WEIGHT, criteria, response
from scenarios.highway_bridge.earthquakes import NAMES as RECORDS
from scenarios.highway_bridge.printed import printed
from tests.benchmark_data import BRIDGE, needs_data


def made_up(scale):
    """A response of known peaks: 2 columns of 1 segment, 8 ends; end 2 yields when scale is 1."""
    n, dt = 401, 0.01
    t = np.arange(n) * dt
    wave = np.sin(2 * np.pi * t)[:, None]
    force = np.hstack(
        [wave * np.ones(16), wave * M_Y * scale * np.array([0.2, 0.9, 1.2, 0.4, 0.1, 0.3, 0.2, 0.2])]
    )
    plastic = np.zeros_like(force)
    plastic[t >= 0.25, 18] = 0.001 * scale  # at the first peak, where the moment is 1.2 M_Y scale
    signals = {
        "y": 0.3 * scale * wave * [1.0, 0.5], "a": scale * wave * [4.0, 5.0, 9.0, 9.0, 9.0, 9.0],
        "deformation": scale * np.hstack([wave * np.linspace(0.1, 0.2, 16), wave * np.ones(8)]),
        "force": force, "plastic": plastic, "u": 1e6 * scale * wave * np.linspace(0.0, 1.0, 16),
        "stroke": scale * wave * np.linspace(0.1, 0.2, 16),
        "stroke_rate": scale * wave * np.linspace(1.0, 2.0, 16),
    }  # fmt: skip
    return Result(t, {f"bridge.{k}": v for k, v in signals.items()}, {})


def test_criteria_follow_their_definitions():
    """Sampled sines with known amplitudes: peaks are exact, sums are formed in closed form (1e-12)."""
    without = response(made_up(1.0), 4.01)
    found = criteria(made_up(0.5), without, 4.01, 16, 32, None)
    assert list(found) == list(NAMES)
    assert without.peak["shear"] == pytest.approx(1.6 * M_Y / SEGMENT)  # 1.2 + 0.4, ends 3 and 4
    assert without.peak["acceleration"] == pytest.approx(5.0)  # midspan only, not the deck's ends
    assert without.yielded == 1
    assert without.peak["curvature"] == pytest.approx(1.2 * M_Y / EI + 0.001)
    assert without.bearing_resultant == pytest.approx(np.hypot(0.2, 0.2 - 0.1 / 15))
    for name in ("J1", "J2", "J3", "J4", "J5", "J6", "J9", "J10", "J11", "J12", "J13", "J14"):
        assert found[name] == pytest.approx(0.5, rel=1e-12), name
    assert found["J7"] == 0.0
    assert found["J8"] == 0.0
    assert found["J15"] == pytest.approx(0.5e6 / WEIGHT)
    assert found["J16"] == pytest.approx(0.1 / without.bearing_resultant)
    power = (0.25 * 1e6 * np.linspace(0.0, 1.0, 16) * np.linspace(1.0, 2.0, 16)).sum()
    assert found["J17"] == pytest.approx(power / (2.0 * WEIGHT))
    assert found["J18"] == pytest.approx(power * 0.01 / (without.bearing_resultant * WEIGHT))
    assert (found["J19"], found["J20"], found["J21"]) == (16.0, 32.0, None)


def test_norm_is_over_the_record():
    """sqrt(sum x^2 dt / T): a sine over whole periods has amplitude/sqrt 2; what follows T is left out."""
    assert response(made_up(1.0), 4.0).norm["midspan"] == pytest.approx(0.3 / np.sqrt(2.0), rel=1e-12)
    assert response(made_up(1.0), 2.0).norm["midspan"] == pytest.approx(0.3 / np.sqrt(2.0), rel=1e-12)


def test_printed_table():
    assert printed("scwnn", "J16", "chi-chi") == 0.5789
    assert printed("lqg", "J3", "turkey") == 0.746
    assert printed("scwnn", "J8", "turkey") is None  # not legible
    assert printed("passive", "J1", "kobe") is None


@pytest.mark.parametrize("controller", ["passive", "lqg", "scwnn", "scwnn-searched", "scwnn-six-sensors"])
def test_controllers_reduce_what_bearings_do(controller):
    """First 8 s of El Centro: at most 0.8 of the bearings' displacement without control (found: 0.41
    to 0.55), within 1000 kN, and the energy balance closes to 1e-4."""
    options = {"record": "el-centro", "duration": 8.0, "compare": False}
    without = study.metrics(study.run(controller="none", **options))
    result = study.run(controller=controller, **options)
    found = study.metrics(result)
    assert found["peak bearing"][0] < 0.8 * without["peak bearing"][0]
    assert found["peak force"][0] <= 1e6
    assert found["energy balance, gap over input"][0] < 1e-4


def test_runs_repeat_and_noise_follows_the_seed():
    options = {"record": "el-centro", "duration": 3.0, "compare": False}
    first, again, other = (study.run(seed=seed, **options)["bridge.y"] for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_figures():
    result = study.run(record="el-centro", duration=3.0)
    found = study.figures(result)
    assert {"figure-3.7-second-sensor", "figure-3.8-seventh-sensor", "figure-3.9-nodes", "hysteresis"} <= set(
        found
    )
    assert len(found["figure-3.7-second-sensor"].axes[0].lines) == 3


def test_searched_parameters_are_from_the_declared_space_and_three_records():
    assert len(control.SEARCH_RECORDS) == 3
    assert set(control.SEARCH_RECORDS) < set(RECORDS)
    assert control.SEARCHED.keys() == control.SEARCH_SPACE.keys()
    for name, value in control.SEARCHED.items():
        low, high = control.SEARCH_SPACE[name]
        assert low <= value <= high


def test_a_step_that_does_not_converge_is_told_with_element_time_and_residual():
    """A tolerance below rounding cannot be met once a bearing yields."""
    system = study.build(record="el-centro", controller="passive")
    bridge = system.participants["bridge"]
    bridge.tolerance, bridge.most_iterations = 1e-18, 1.0
    with pytest.raises(
        SimulationError, match=r"bridge: element \d+ did not converge .* t = \d+\.\d+ s, residual"
    ):
        study._simulate(system, "passive", 5.0, None)


@pytest.mark.long
@needs_data
def test_table_of_the_full_model():
    """The network is below 1 in at least 80 % of the cells of displacement, moment and bearing that the
    thesis prints below 1 (found: 47 of 48), and every legible cell is computed."""
    rows = study.table(data=BRIDGE, controllers=("lqg", "scwnn"))
    assert len(rows) == 6 * 2 * 21
    for row in rows:
        assert row["computed"] is not None or row["criterion"] == "J21"
    cells = [
        r
        for r in rows
        if r["controller"] == "scwnn" and r["criterion"] in study.CLAIMED and r["printed"] < 1.0
    ]
    assert sum(r["computed"] < 1.0 for r in cells) >= 0.8 * len(cells)


@pytest.mark.long
def test_table_of_the_reduced_bridge_with_records_at_hand():
    """Without the user's records, cells of records that no package ships are null."""
    rows = study.table(controllers=("scwnn",))
    for row in rows:
        if row["record"] == "n-palm-springs":
            assert row["computed"] is None
    text = study.table_text(rows)
    assert "n-palm-springs: record not at hand" in text
    assert "el-centro: Array 9" in text
