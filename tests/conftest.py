"""For all tests: one line that says where the comparison with the benchmark's data is left out."""

from tests.benchmark_data import FOLDER


def pytest_report_header() -> str:
    if FOLDER is None:
        return "BENCHMARK_DATA is not set: the comparisons with the benchmarks' own data are left out"
    return f"benchmark data: {FOLDER}"
