"""The benchmarks' own data, for comparison, in the folder that BENCHMARK_DATA names.

The data is not part of the project: `tall_building/mck.npz`, and the files in `highway_bridge/`.
Without the variable, tests that need them are skipped.
"""

import os
from pathlib import Path

import pytest

_NAMED = os.environ.get("BENCHMARK_DATA")
#: None where BENCHMARK_DATA is not set
FOLDER = Path(_NAMED).resolve() if _NAMED else None
TOWER = FOLDER / "tall_building" / "mck.npz" if FOLDER else None
BRIDGE = FOLDER / "highway_bridge" if FOLDER else None

needs_data = pytest.mark.skipif(
    FOLDER is None, reason="BENCHMARK_DATA names no folder with the benchmark's files"
)
