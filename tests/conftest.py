"""For all tests: a generator of random numbers, and a header line about the benchmarks' data."""

import numpy as np
import pytest

from tests.benchmark_data import FOLDER


def pytest_report_header() -> str:
    if FOLDER is None:
        return "BENCHMARK_DATA is not set: the comparisons with the benchmarks' own data are left out"
    return f"benchmark data: {FOLDER}"


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator for one test, so that its numbers do not depend on the tests before it."""
    return np.random.default_rng(7)
