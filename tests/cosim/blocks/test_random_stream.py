"""MRG32k3a in float64 against the published recurrence in Python's integers, and its statistics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import DeclarationError, System, simulate
from cosim.blocks import MeasurementNoise, WhiteNoise
from cosim.blocks.random_stream import SEED_JUMP, STREAM_JUMP, multiply_add, remainder, seed_streams, uniform

M = (2**32 - 209, 2**32 - 22853)
A = (
    [[0, 1, 0], [0, 0, 1], [-810728, 1403580, 0]],
    [[0, 1, 0], [0, 0, 1], [-1370589, 0, 527612]],
)


def product(X, Y, m):
    return [
        [sum(a * b for a, b in zip(row, column, strict=True)) % m for column in zip(*Y, strict=True)]
        for row in X
    ]


def power(X, n, m):
    result = [[int(i == j) for j in range(3)] for i in range(3)]
    while n:
        if n & 1:
            result = product(result, X, m)
        X, n = product(X, X, m), n >> 1
    return result


def exact_state(ahead):
    """The state `ahead` numbers after 12345, ..., by integers."""
    return [
        sum(row[j] * 12345 for j in range(3)) % m
        for X, m in zip(A, M, strict=True)
        for row in power(X, ahead, m)
    ]


def exact_uniforms(state, n):
    p, q = list(state[:3]), list(state[3:])
    found = []
    for _ in range(n):
        p.append((1403580 * p[-2] - 810728 * p[-3]) % M[0])
        q.append((527612 * q[-1] - 1370589 * q[-3]) % M[1])
        z = (p[-1] - q[-1]) % M[0]
        found.append((z or M[0]) * 2.328306549295727688e-10)
    return found


def streams_of(seed, n):
    streams, work = np.zeros((n, 6)), np.zeros((3, 3, 3))
    seed_streams(float(seed), streams, work)
    return streams


def test_first_numbers_are_the_published_ones():
    """The first five numbers of the package RngStreams, to the ten printed digits."""
    state = np.full(6, 12345.0)
    printed = [0.1270111220, 0.3185275654, 0.3091860156, 0.8258468629, 0.2216299158]
    assert np.allclose([uniform(state) for _ in printed], printed, rtol=0, atol=5e-11)


def test_recurrence_is_exact():
    """Equal, not close: float64 holds every product below 2^53 exactly."""
    state = streams_of(1, 1)[0]
    assert [uniform(state) for _ in range(20_000)] == exact_uniforms(exact_state(2**127), 20_000)


@pytest.mark.parametrize("part", [0, 1])
def test_jump_matrices(part):
    assert SEED_JUMP[part].tolist() == power(A[part], 2**127, M[part])
    assert STREAM_JUMP[part].tolist() == power(A[part], 2**76, M[part])


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 41, 123_456_789, 2**53 - 1])
def test_a_seed_is_a_stream_and_an_element_a_substream(seed):
    found = streams_of(seed, 3)
    for i in range(3):
        assert found[i].tolist() == exact_state(seed * 2**127 + i * 2**76)


whole = st.integers(0, 2**32 - 1)


@given(whole, whole, whole, st.sampled_from(M))
def test_multiply_add_is_exact(a, b, c, m):
    assert multiply_add(float(a), float(b), float(c), float(m)) == (a * b + c) % m


@given(st.integers(-(2**53) + 2**32, 2**53 - 2**32), st.sampled_from(M))
def test_remainder_is_exact(v, m):
    assert remainder(float(v), float(m)) == v % m


@given(st.integers(-(2**21) + 2, 2**21 - 2), st.sampled_from([-1, 0, 1]), st.sampled_from(M))
def test_remainder_next_to_a_multiple(k, off, m):
    """Where a rounded quotient would cross a whole number first."""
    assert remainder(float(k * m + off), float(m)) == (k * m + off) % m


def test_a_uniform_number_is_never_zero():
    """p = q, once in 2^32 numbers: m1 stands for 0, so that the logarithm is finite."""
    assert uniform(np.zeros(6)) == float(M[0]) * 2.328306549295727688e-10


N = 200_000


@pytest.fixture(scope="module")
def numbers():
    noise = WhiteNoise(sample_period=0.5, seed=11, n=3)
    return simulate(System({"w": noise}), step=0.5, stop=0.5 * (N - 1), record=["w.y"])["w.y"]


def test_mean_and_variance(numbers):
    """Five standard deviations of the estimates: 1/sqrt(N) of the mean, sqrt(2/N) of the variance."""
    assert np.abs(numbers.mean(axis=0)).max() < 5 / np.sqrt(N)
    assert np.abs(numbers.var(axis=0) - 1.0).max() < 5 * np.sqrt(2 / N)


def test_distribution_is_normal(numbers):
    """Kolmogorov and Smirnov: sqrt(N) D exceeds 2.3 once in 20,000 samples of a true normal."""
    from scipy.stats import kstest

    for i in range(3):
        assert np.sqrt(N) * kstest(numbers[:, i], "norm").statistic < 2.3


def test_white_and_independent(numbers):
    """A correlation of N independent pairs has standard deviation 1/sqrt(N); five of them."""
    for lag in (1, 2, 3, 10):
        for i in range(3):
            for j in range(3):
                assert abs(np.mean(numbers[lag:, i] * numbers[:-lag, j])) < 5 / np.sqrt(N - lag)
    correlation = np.corrcoef(numbers.T) - np.eye(3)
    assert np.abs(correlation).max() < 5 / np.sqrt(N)


def run(step, stop, **values):
    noise = WhiteNoise(sample_period=0.02, **values)
    return simulate(System({"w": noise}), step=step, stop=stop, record=["w.y"])["w.y"]


def test_noise_belongs_to_its_sample_period_not_to_the_step():
    coarse, fine = run(0.02, 0.2, seed=3), run(0.005, 0.2, seed=3)
    assert np.array_equal(fine[::4], coarse)
    assert np.array_equal(fine, np.repeat(coarse, 4, axis=0)[: len(fine)])  # held in between
    assert (np.diff(coarse, axis=0) != 0).all()


def test_noise_is_the_same_under_stage_coupling():
    noise = System({"w": WhiteNoise(sample_period=0.02, seed=3)})
    stage = simulate(noise, step=0.02, stop=0.2, record=["w.y"], coupling="continuous")["w.y"]
    assert np.array_equal(stage, run(0.02, 0.2, seed=3))


def test_elements_do_not_depend_on_how_many_there_are():
    assert np.array_equal(np.ravel(run(0.02, 0.2, seed=3, n=1)), run(0.02, 0.2, seed=3, n=4)[:, 0])


def test_seeds_differ_and_repeat():
    assert np.array_equal(run(0.02, 0.2, seed=3), run(0.02, 0.2, seed=3))
    assert not np.isin(run(0.02, 0.2, seed=3), run(0.02, 0.2, seed=4)).any()


def test_measurement_noise_is_signal_plus_white_noise():
    """The same seed draws the same numbers; sums of two floats are rounded once, so they are equal."""
    from cosim.blocks import function_source

    system = System(
        {
            "f": function_source(lambda t: 3.0 * t),
            "m": MeasurementNoise(0.1, sample_period=0.02, seed=3, n=1),
        },
        [("f.y", "m.u")],
    )
    result = simulate(system, step=0.02, stop=0.2, record=["m.y", "f.y"])
    expected = np.ravel(result["f.y"]) + 0.1 * np.ravel(run(0.02, 0.2, seed=3))
    assert np.array_equal(np.ravel(result["m.y"]), expected)


@pytest.mark.parametrize("seed", [-1, 1.5, float("nan"), "one"])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(DeclarationError, match="seed"):
        WhiteNoise(sample_period=0.01, seed=seed)
