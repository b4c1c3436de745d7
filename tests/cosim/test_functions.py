"""Functions for kernels against numpy and scipy, as Python and compiled."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Block, Local, Output, Parameter, System, functions, simulate
from cosim.functions import clip, dot, expm, matvec, norm, sign, solve, transposed_matvec


@given(seed=st.integers(0, 2**31), m=st.integers(1, 5), n=st.integers(1, 5), p=st.integers(1, 4))
def test_products_equal_numpys(seed, m, n, p):
    """Sums of at most 5 products: a few roundings of the sum of magnitudes."""
    random = np.random.default_rng(seed)
    A, B, x, y, z = (random.normal(size=s) for s in ((m, n), (n, p), n, m, n))
    close = {"rel": 1e-13, "abs": 1e-13}
    out = np.empty(m)
    functions.matvec(A, x, out)
    assert out == pytest.approx(A @ x, **close)
    added = y.copy()
    functions.matvec_add(A, x, added)
    assert added == pytest.approx(y + A @ x, **close)
    turned = np.empty(n)
    functions.transposed_matvec(A, y, turned)
    assert turned == pytest.approx(A.T @ y, **close)
    summed = z.copy()
    functions.transposed_matvec_add(A, y, summed)
    assert summed == pytest.approx(z + A.T @ y, **close)
    C = np.empty((m, p))
    functions.matmul(A, B, C)
    assert pytest.approx(A @ B, **close) == C
    assert functions.dot(x, z) == pytest.approx(x @ z, **close)
    assert functions.norm(x) == pytest.approx(np.linalg.norm(x), **close)


@given(seed=st.integers(0, 2**31), n=st.integers(1, 6), m=st.integers(1, 3))
def test_solve_equals_numpys(seed, n, m):
    """Partial pivoting is backward stable: the error is the condition number times a few roundings."""
    random = np.random.default_rng(seed)
    A, B = random.normal(size=(n, n)), random.normal(size=(n, m))
    A[0, 0] = 0.0 if n > 1 else 1.0  # needs a pivot
    X = B.copy()
    functions.solve(A.copy(), X)
    bound = 1e-14 * np.linalg.cond(A) * np.abs(X).max()
    assert np.abs(X - np.linalg.solve(A, B)).max() <= bound


@settings(max_examples=50)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 5), size=st.sampled_from([0.0, 1e-6, 0.3, 4.0]))
def test_expm_equals_scipys(seed, n, size):
    """4 needs scaling and squaring; above it SciPy's own error grows to 1e-12 and more."""
    A = np.random.default_rng(seed).normal(size=(n, n))
    A *= size / max(np.abs(A).sum(axis=0).max(), 1e-300)
    work = np.full((4, n, n), np.nan)
    work[0] = A
    functions.expm(work)
    wanted = scipy.linalg.expm(A)
    assert np.abs(work[0] - wanted).max() <= 1e-12 * np.abs(wanted).max()


def test_expm_of_a_stiff_oscillator_is_its_closed_form():
    """x'' + 2 zeta w x' + w^2 x = 0 over w h = 50: rows that differ by w^2 = 10^6, seven squarings.

    Each squaring may double a relative error of 1e-16 in the balanced matrix, 2e-14 in all.
    """
    w, zeta, h = 1000.0, 0.01, 0.05
    work = np.zeros((4, 2, 2))
    work[0] = np.array([[0.0, 1.0], [-w * w, -2.0 * zeta * w]]) * h
    functions.expm(work)
    d = w * np.sqrt(1.0 - zeta**2)
    c, s, decay = np.cos(d * h), np.sin(d * h), np.exp(-zeta * w * h)
    wanted = decay * np.array([[c + zeta * w / d * s, s / d], [-w * w / d * s, c - zeta * w / d * s]])
    scale = np.array([[1.0, 1.0 / w], [w, 1.0]])  # the scale of the entries
    assert (np.abs(work[0] - wanted) / scale).max() <= 2e-14


def test_scalars():
    assert [functions.sign(x) for x in (-2.0, 0.0, -0.0, 3.0)] == [-1.0, 0.0, 0.0, 1.0]
    assert [functions.clip(x, -1.0, 2.0) for x in (-3.0, 0.5, 7.0)] == [-1.0, 0.5, 2.0]


class Compiled(Block):
    """All functions in one kernel."""

    A = Parameter(shape=("m", "n"))
    E = Parameter(shape=("n", "n"))
    b = Parameter(shape="n")
    product = Output(shape="m")
    turned = Output(shape="n")
    exponential = Output(shape=("n", "n"))
    solved = Output(shape="n")
    number = Output()
    work = Local(0.0, shape=(4, "n", "n"))
    square = Local(0.0, shape=("n", "n"))
    right = Local(0.0, shape=("n", 1))

    def step(self, t, h):
        functions_of(self.A, self.b, self.product, self.turned)
        n = self.b.shape[0]
        for i in range(n):
            self.right[i, 0] = self.b[i]
            for j in range(n):
                self.work[0, i, j] = self.E[i, j]
                self.square[i, j] = self.E[i, j]
        expm(self.work)
        solve(self.square, self.right)
        for i in range(n):
            self.solved[i] = self.right[i, 0]
            for j in range(n):
                self.exponential[i, j] = self.work[0, i, j]
        self.number = norm(self.product) + dot(self.b, self.b) + clip(sign(-3.0), -0.5, 0.5)


def functions_of(A, b, product, turned):
    matvec(A, b, product)
    transposed_matvec(A, product, turned)


@pytest.mark.parametrize("jit", [True, False])
def test_compiled_functions_equal_numpys(jit):
    random = np.random.default_rng(8)
    A, E, b = random.normal(size=(2, 3)), random.normal(size=(3, 3)), random.normal(size=3)
    block = Compiled(A=A, E=E, b=b)
    result = simulate(System({"f": block}), step=1.0, stop=1.0, jit=jit)
    wanted = {
        "product": A @ b,
        "turned": A.T @ A @ b,
        "exponential": scipy.linalg.expm(E).ravel(),
        "solved": np.linalg.solve(E, b),
        "number": np.linalg.norm(A @ b) + b @ b - 0.5,
    }
    for name, values in wanted.items():
        assert result[f"f.{name}"][0] == pytest.approx(values, rel=1e-12), name  # cond(E) is some 10
