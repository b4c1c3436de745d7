"""The numbers of the tower's control, by their effects: weights, force, filter."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from cosim import simulate
from scenarios.tall_building.building import with_damper
from scenarios.tall_building.control import KEPT, PERIOD, Weights, reduced_model
from scenarios.tall_building.plant import building as tower_building
from scenarios.tall_building.study import Study

WEIGHED = (46, 60, 76)


def test_weight_of_accelerations_is_on_floors_46_60_76() -> None:
    """In a mode of the whole building at its largest displacement, floors have the acceleration -omega^2 phi.

    The 12-state model keeps the building's first five modes and the damper's; 1e-4 is what
    damping changes in the undamped shapes.
    """
    building = tower_building()
    coupled = with_damper(building)
    omega2, shapes = la.eigh(coupled.K, coupled.M)
    Q = Weights(a=1.0, x=0.0, v=0.0, m=0.0, s=0.0).matrix(reduced_model(building))
    for i in range(6):
        state = np.concatenate([shapes[[*(f - 1 for f in KEPT), building.dof], i], np.zeros(6)])
        accelerations = omega2[i] * shapes[[f - 1 for f in WEIGHED], i]
        assert state @ Q @ state == pytest.approx(accelerations @ accelerations, rel=1e-4)


def test_lqg_uses_the_force_that_its_weight_allows() -> None:
    """RMS of the force in the first 30 s, as designed: 40.0 kN; twice the weight R takes 0.8 % off it."""
    result = simulate(
        Study(controller="lqg").build(), step=PERIOD, stop=30.0, record=[], statistics=["tower.u"]
    )
    assert result.statistics["tower.u"].rms == pytest.approx(39.974e3, rel=0.004)


def test_filter_has_its_time_constant() -> None:
    """u_f moves by 1 - exp(-h / tau) of its distance from the held force; tau = 0.1 s from the signals."""
    system = Study(controller="filtered-smc").build()
    result = simulate(system, step=PERIOD, stop=2.0, record=["control.u", "filter.y"])
    force, filtered = result["control.u"], result["filter.y"]
    gap, change = force[:-1] - filtered[:-1], np.diff(filtered)
    share = (gap @ change) / (gap @ gap)
    assert -PERIOD / np.log1p(-share) == pytest.approx(0.1, rel=1e-6)
