"""The sparse factorisation against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kernels.sparse_ldl import factor, plan, solve, symmetric_product


def grid_matrix(rows: int, columns: int, seed: int) -> np.ndarray:
    """Positive definite, with the pattern of a grid of unequal springs to the ground and between."""
    rng = np.random.default_rng(seed)
    n = rows * columns
    K = np.diag(rng.uniform(0.5, 2.0, n))
    for i in range(n):
        for j in ((i + 1) if (i + 1) % columns else n, i + columns):
            if j < n:
                k = rng.uniform(0.1, 5.0)
                K[[i, j], [i, j]] += k
                K[i, j] -= k
                K[j, i] -= k
    return K


def factored(K: np.ndarray, levels: int = 2):
    p = plan(K != 0)
    n, n_L = len(K), int(p.L_start[-1])
    L_row, L, D_inv = np.zeros(max(n_L, 1)), np.zeros((levels, max(n_L, 1))), np.zeros((levels, n))
    work = [np.zeros(n) for _ in range(4)]
    bad = factor(p.A_start, p.A_row, p.values(K), p.L_start, p.parent, 1, L_row, L, D_inv, *work)
    return p, L_row, L, D_inv, bad


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (6, 11)])
def test_solves_to_rounding(size):
    """Condition numbers below 100: 1e-13 relative is a few hundred roundings."""
    K = grid_matrix(*size, seed=size[1])
    p, L_row, L, D_inv, bad = factored(K)
    assert bad == 0
    x = np.random.default_rng(3).standard_normal(len(K))
    b = (K @ x)[p.order]
    solve(p.L_start, L_row, L, D_inv, 1, b)
    assert b == pytest.approx(x[p.order], rel=1e-13, abs=1e-13)


def test_product_is_that_of_the_whole_matrix():
    K = grid_matrix(4, 5, seed=1)
    p = plan(K != 0)
    x = np.arange(1.0, 21.0)
    y = np.full(20, 2.0)
    symmetric_product(p.A_start, p.A_row, p.values(K), x[p.order], y)
    assert y == pytest.approx(2.0 + (K @ x)[p.order], rel=1e-14)


def test_a_matrix_that_is_not_positive_definite_is_reported():
    K = grid_matrix(3, 4, seed=2)
    K[5, 5] = -1.0
    assert factored(K)[4] > 0


def test_the_order_keeps_the_factor_sparse():
    """An arrow in its worst order fills up completely; a fill-reducing order leaves n - 1 entries."""
    K = np.eye(50) * 60.0
    K[0, 1:] = K[1:, 0] = 1.0
    assert plan(K != 0).L_start[-1] == 49
