"""The structural model: its shapes, its named degrees of freedom, and its errors."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.structures.structure import Freedoms, Structure, StructureError

ONE = np.eye(2)


def test_rows_and_columns_that_are_not_given_are_empty_and_single_ones_become_two_dimensional():
    s = Structure([[2.0, 0.0], [0.0, 3.0]], ONE, ONE, influence=[1.0, 0.5], displacements=[0.0, 1.0])
    assert s.dof == 2
    assert (s.influence.shape, s.displacements.shape) == ((2, 1), (1, 2))
    assert (s.actuators.shape, s.accelerations.shape) == ((0, 2), (0, 2))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"M": [1.0, 2.0]}, r"M has shape \(2,\).*np.diag"),
        ({"C": np.eye(3)}, r"C has shape \(3, 3\)"),
        ({"K": [[1.0, np.nan], [0.0, 1.0]]}, "K contains NaN"),
        ({"influence": np.ones((3, 1))}, r"influence has shape \(3, 1\); it must be \(2, directions\)"),
        ({"actuators": np.ones(3)}, r"actuators has shape \(3,\); it must be \(rows, 2\)"),
    ],
)
def test_matrices_that_do_not_fit_are_refused(given, message):
    with pytest.raises(StructureError, match=message):
        Structure(**{"M": ONE, "C": ONE, "K": ONE, **given})


def test_named_freedoms_give_rows_and_rigid_motion():
    """Node 7 is fixed in y: it has no number, and a row leaves it out."""
    freedoms = Freedoms({(3, "x"): 0, (3, "y"): 1, (7, "x"): 2})
    assert freedoms.row({(7, "x"): 1.0, (3, "x"): -1.0, (7, "y"): 5.0}).tolist() == [-1.0, 0.0, 1.0]
    assert freedoms.rigid_motion(("y", "x")).tolist() == [[0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]
