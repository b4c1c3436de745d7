"""The tall building: printed figures, orderings, criteria, and the force that the observer uses."""

from dataclasses import replace

import numpy as np
import pytest

from cosim import CosimError, Statistics, simulate
from scenarios.tall_building import plant
from scenarios.tall_building.control import LQG_WEIGHTS, PERIOD, SURFACE_WEIGHTS, reduced_model
from scenarios.tall_building.coupling import coupling_errors
from scenarios.tall_building.criteria import (
    NAMES,
    UNCONTROLLED,
    broken_limits,
    criteria,
    uncontrolled_figures,
)
from scenarios.tall_building.study import Study
from tests.benchmark_data import TOWER, needs_data


@pytest.mark.parametrize("data", [None, pytest.param(str(TOWER), marks=needs_data)])
def test_uncontrolled_response_is_the_printed_one(data: str | None) -> None:
    """The four figures within 3 %, to which the wind was calibrated; 900 s."""
    figures = uncontrolled_figures(plant.uncontrolled(data, None, plant.SEED, plant.DURATION).statistics)
    for name, printed in UNCONTROLLED.items():
        assert figures[name] == pytest.approx(printed, rel=0.03), name


def statistics(rms: object, peak: object) -> Statistics:
    return Statistics(
        -np.asarray(peak), np.asarray(peak) * 0.5, np.asarray(rms) * 0.0, np.asarray(rms), np.asarray(rms)
    )


def test_criteria_from_numbers_worked_out_by_hand() -> None:
    """Every floor has its own ratio, so a wrong floor in a mean or maximum changes the result."""
    x_o, a_o = np.arange(1.0, 10.0), np.arange(2.0, 11.0)
    ratio = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    reference = {"tower.x": statistics(x_o, 3.0 * x_o), "tower.a": statistics(a_o, 4.0 * a_o)}
    found = criteria(
        {
            "tower.x": statistics(ratio * x_o, ratio[::-1] * 3.0 * x_o),
            "tower.a": statistics(ratio * a_o, ratio * 4.0 * a_o),
            "tower.x_m": statistics(18.0, 54.0),
            "tower.u": statistics(3.0e4, 9.0e4),
            "power.p": statistics(5.0e3, 8.0e3),
        },
        reference,
    )
    wanted = {
        "J1": 0.8, "J2": np.mean(ratio[2:8]), "J3": 0.9, "J4": np.mean(ratio[2:9]), "J5": 2.0, "J6": 5.0,
        "J7": 0.8, "J8": np.mean(ratio[2:8]), "J9": 0.1,
        "J10": np.mean(ratio[::-1][2:9]), "J11": 2.0, "J12": 8.0,
        "sigma_u": 30.0, "sigma_xm": 1800.0, "max_u": 90.0, "max_xm": 5400.0,
    }  # fmt: skip
    assert found == pytest.approx(wanted, rel=1e-12)
    assert tuple(found) == NAMES


def test_streaming_criteria_are_those_of_recorded_signals() -> None:
    """RMS and peak of every sample against NumPy over the recording; summation order leaves 1e-10."""
    system = Study(controller="smc", duration=20.0).build()
    names = ["tower.x", "tower.a", "tower.x_m", "tower.u", "power.p"]
    result = simulate(system, step=PERIOD, stop=20.0, record=names)
    for name in names:
        signal = result[name]
        np.testing.assert_allclose(
            result.statistics[name].rms, np.sqrt(np.mean(signal**2, axis=0)), rtol=1e-10
        )
        np.testing.assert_allclose(result.statistics[name].peak, np.abs(signal).max(axis=0), rtol=0)


def test_the_schedule_gives_the_observer_the_force_of_the_last_step() -> None:
    """Asserted as text: u_last is read before the controller computes, from what was applied."""
    system = Study(controller="filtered-smc", duration=1.0).build()
    text = simulate(system, step=PERIOD, stop=0.01, record=[]).schedule
    assert "observer.u_last <- filter.y (one step late)" in text
    assert text.index("observer: step") < text.index("control: step")
    assert text.index("control: step") < text.index("tower.u <- filter.y")


def test_limits_and_orderings_in_a_short_run() -> None:
    """The first 120 s at nominal stiffness: control lowers the response, filtering lowers force and power."""
    found = {}
    for controller in ("passive", "lqg", "smc", "filtered-smc"):
        study = Study(controller=controller, duration=120.0, record=False)  # type: ignore[arg-type]
        found[controller] = study.run().criteria()
    assert found["passive"]["max_u"] == 0.0
    for controller in ("lqg", "smc", "filtered-smc"):
        assert found[controller]["J1"] < 0.9 * found["passive"]["J1"]
        assert not broken_limits(found[controller])
    for name in ("J6", "J12", "max_u"):
        assert found["filtered-smc"][name] < found["smc"][name]


def test_ideal_blocks_switched_on_change_nothing_much() -> None:
    """Saturation that is never reached changes nothing at all; 24 bits change the eighth digit only."""
    base = Study(duration=30.0, record=False)
    plain = base.run().criteria()
    limited = replace(base, saturation=True).run().criteria()
    fine = replace(base, bits=24).run().criteria()
    assert limited == plain
    assert fine == pytest.approx(plain, rel=1e-4)


def test_damper_as_a_plant_of_its_own_couples_to_first_order_or_iterated_to_second() -> None:
    """Held motion and force: half the step, half the error; iterated, a quarter. Order to 0.2 over 20 s."""
    rows = coupling_errors(None, None, 1, 20.0, (0.02, 0.01))
    last = {row["coupling"]: row for row in rows[2:]}
    assert last["sampled"]["order"] == pytest.approx(1.0, abs=0.2)
    assert last["iterated"]["order"] == pytest.approx(2.0, abs=0.2)
    assert last["iterated"]["x76"] < 5e-3 * last["sampled"]["x76"] < 5e-3 * 0.02


def test_bad_options_are_refused_with_a_remedy() -> None:
    with pytest.raises(CosimError, match="floor 76 is measured"):
        Study(floors=(50, 75)).build()
    with pytest.raises(CosimError, match="outside its bounds"):
        Study(stiffness_error=-1.5).build()


def test_model_keeps_the_five_modes_and_the_damper() -> None:
    """Frequencies of the 12-state model: five of the building and the damper's, tuned to the first."""
    model = reduced_model(plant.building())
    frequencies = np.sort(np.abs(np.linalg.eigvals(model.A)) / (2 * np.pi))[::2]
    np.testing.assert_allclose(frequencies, [0.159, 0.161, 0.765, 1.99, 3.79, 6.38], rtol=0.02)


def test_weights_are_of_the_states_that_they_name() -> None:
    """x' Q x written out for random states: accelerations from x'' = A x, and the term in brackets."""
    model = reduced_model(plant.building())
    x = np.random.default_rng(5).normal(size=12)
    x_76, x_m, v_76, v_m = x[4], x[5], x[10], x[11]
    accelerations = (model.A @ x)[[8, 9, 10]]  # of floors 46, 60, 76: the rates of their velocities
    for w in (LQG_WEIGHTS, SURFACE_WEIGHTS):
        cost = w.a * np.sum(accelerations**2) + w.x * x_76**2 + w.v * v_76**2 + w.m * x_m**2 + w.s * v_m**2
        if w.follow is not None:
            c_x, c_v, c_m = w.follow
            cost += (v_m - c_x * x_76 - c_v * v_76 - c_m * x_m) ** 2
        assert x @ w.matrix(model) @ x == pytest.approx(cost, rel=1e-10)  # order of summation


def test_figures_have_labels_with_units_and_show_what_they_say() -> None:
    study = Study(duration=20.0, profile=True)
    result = study.run()
    found = study.figures(result)
    assert set(found) == {"wind", "response", "profile"}
    for figure in found.values():
        for axes in figure.axes:
            assert any("(" in text for text in (axes.get_xlabel(), axes.get_ylabel()))
    x, _, force = found["response"].axes
    assert x.lines[1].get_ydata() == pytest.approx(100 * result["tower.x"][:, 7])  # floor 75, cm
    assert force.lines[0].get_ydata() == pytest.approx(result["tower.u"] / 1e3)
    assert len(found["profile"].axes[0].lines) == 3  # none, LQG, this controller
    metrics = study.metrics(result)
    # the record has every 100th sample, the statistics have all of them
    assert metrics["max_u"][0] >= np.abs(result["tower.u"]).max() / 1e3
    assert metrics["max_u"][1] == "kN"
    assert metrics["uncontrolled sigma_a75"][1] == "cm/s^2"
