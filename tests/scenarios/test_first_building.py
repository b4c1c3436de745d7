"""The file that a user copies: it is short, its model is right, and its controller works."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.plants.shear_building import ShearBuilding
from scenarios import first_building
from scenarios.first_building import DAMPING, MASS, STIFFNESS, Study, design_model


def test_the_file_is_short() -> None:
    assert len(Path(first_building.__file__).read_text(encoding="utf-8").splitlines()) < 80


def test_the_model_for_design_is_the_building() -> None:
    """Poles of the model: the five frequencies of the chain of springs, all with 2 % damping (1e-6, round-off
    of eigenvalues; the chain's matrix is written element by element here)."""
    n = len(MASS)
    K = np.zeros((n, n))
    for story, k in enumerate(STIFFNESS):
        row = np.zeros(n)
        row[story] = 1.0
        if story:
            row[story - 1] = -1.0
        K += k * np.outer(row, row)
    omega = np.sqrt(np.linalg.eigvalsh(K / MASS[0]))
    poles = np.linalg.eigvals(design_model(ShearBuilding.build(MASS, STIFFNESS, DAMPING)).A)
    assert np.sort(np.abs(poles))[::2] == pytest.approx(omega, rel=1e-6)
    assert -poles.real / np.abs(poles) == pytest.approx(np.full(2 * n, DAMPING), rel=1e-6)


def test_control_reduces_the_response_within_its_limit() -> None:
    """Found: 0.41 of the drift and 0.49 of the acceleration, with peaks of the force at its limit of 50 kN;
    a lower limit helps less."""
    study = Study()
    result = study.run()
    metrics = study.metrics(result)
    assert metrics["drift over uncontrolled"][0] < 0.5
    assert metrics["acceleration over uncontrolled"][0] < 0.6
    assert result.statistics["actuator.y"].peak == study.limit
    weak = replace(study, limit=20e3)
    assert weak.metrics(weak.run())["drift over uncontrolled"][0] > metrics["drift over uncontrolled"][0]


def test_the_figure_shows_both_runs() -> None:
    study = Study()
    result = study.run()
    (axes,) = study.figures(result)["roof"].axes
    assert axes.lines[1].get_ydata() == pytest.approx(1e3 * result["building.x"][:, -1])
    assert np.abs(axes.lines[0].get_ydata()).max() > np.abs(axes.lines[1].get_ydata()).max()
    assert "(mm)" in axes.get_ylabel()
