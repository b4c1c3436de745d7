"""The default building, against closed forms and against the benchmark's matrices."""

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la

from fmus.structures.structure import Structure, StructureError, modes_of
from scenarios.tall_building.building import (
    STORY_HEIGHTS,
    Damper,
    cantilever_stiffness,
    default_building,
    load_building,
    with_damper,
)
from tests.benchmark_data import TOWER, needs_data

BENCHMARK_FREQUENCIES = (0.15997, 0.76510, 1.99206, 3.78986, 6.39446)


def test_cantilever_bends_as_in_the_book() -> None:
    """P H^3 / 3 EI at the tip, P z^2 (3 H - z) / 6 EI below; a condition near 1e8 allows 1e-7."""
    heights, EI, force = np.array([3.0, 5.0, 4.0, 2.5]), 7.0e9, 3.0e4
    z, H = np.cumsum(heights), heights.sum()
    load = np.array([0.0, 0.0, 0.0, force])
    x = la.solve(cantilever_stiffness(heights, np.full(4, EI)), load)
    np.testing.assert_allclose(x, force * z**2 * (3 * H - z) / (6 * EI), rtol=1e-7)


def test_first_five_frequencies_and_damping() -> None:
    """0.5 % of the benchmark's frequencies, as the study asks; 1 % damping is exact up to round-off."""
    modes = modes_of(default_building())
    np.testing.assert_allclose(modes.frequency[:5], BENCHMARK_FREQUENCIES, rtol=5e-3)
    np.testing.assert_allclose(modes.ratio[:5], 0.01, rtol=1e-6)
    assert (np.diff(modes.ratio[5:]) > 0).all()
    assert STORY_HEIGHTS.sum() == pytest.approx(306.1, rel=1e-12)


@needs_data
def test_default_building_is_the_benchmark_where_it_matters() -> None:
    """MAC above 0.999 in three modes, modal masses within 1 %: the load's effect scales with them."""
    own, target = modes_of(default_building()), modes_of(load_building(str(TOWER)))
    np.testing.assert_allclose(own.frequency[:5], target.frequency[:5], rtol=5e-3)
    for i in range(3):
        a, b = own.shapes[:, i], target.shapes[:, i]
        assert (a @ b) ** 2 / ((a @ a) * (b @ b)) > 0.999
    np.testing.assert_allclose(own.shapes[-1, :3] ** 2, target.shapes[-1, :3] ** 2, rtol=0.01)


@needs_data
def test_benchmark_matrices_give_the_benchmark_frequencies() -> None:
    """To 1e-4, the known digits."""
    modes = modes_of(load_building(str(TOWER)))
    np.testing.assert_allclose(modes.frequency[:5], BENCHMARK_FREQUENCIES, rtol=1e-4)
    np.testing.assert_allclose(modes.ratio[:5], 0.01, rtol=1e-4)


def test_damper_rows_are_the_printed_ones_with_the_reaction() -> None:
    """Symmetric rows 76, 77 against (2.19) and the reaction on floor 76: a linear identity, so round-off."""
    building, d, s = default_building(), Damper(m=4.0e5, c=3.0e5, k=6.0e5), 1.15
    coupled = with_damper(building, d, s)
    rng = np.random.default_rng(3)
    x, v, a = rng.normal(size=(3, 77))
    u = 2.0e5
    wanted = building.M @ a[:76] + building.C @ v[:76] + s * building.K @ x[:76]
    residual = coupled.M @ a + coupled.C @ v + coupled.K @ x
    damper = d.m * (a[75] + a[76]) + d.c * v[76] + d.k * x[76]  # = u, (2.19)
    reaction = d.k * x[76] + d.c * v[76] - u
    # row 76: M x'' + C x' + K x = reaction, once the damper's equation holds
    residual[76] -= u
    floor = residual[75] - residual[76]
    scale = np.abs(wanted).max()
    np.testing.assert_allclose(residual[:75], wanted[:75], atol=1e-12 * scale)
    assert floor == pytest.approx(wanted[75] - reaction, abs=1e-12 * scale)
    assert residual[76] == pytest.approx(damper - u, rel=1e-12)


def test_invalid_matrices_are_refused_with_a_reason(tmp_path: Path) -> None:
    b = default_building()
    with pytest.raises(StructureError, match="C has shape"):
        Structure(b.M, b.C[:3, :3], b.K)
    with pytest.raises(StructureError, match="NaN"):
        Structure(b.M, b.C, np.full_like(b.K, np.nan))
    C = b.C.copy()
    C[75, 75] *= 50.0
    with pytest.raises(StructureError, match="couples modes"):
        modes_of(Structure(b.M, C, b.K))
    with pytest.raises(StructureError, match="not positive definite"):
        modes_of(Structure(b.M, b.C, b.K - 1e6 * b.M))
    with pytest.raises(StructureError, match="not a readable"):
        load_building(str(tmp_path / "nothing.npz"))
    np.savez(tmp_path / "half.npz", M=b.M)
    with pytest.raises(StructureError, match=r"no array \['C', 'K'\]"):
        load_building(str(tmp_path / "half.npz"))
