"""The printed tables 2.1 and 2.2 by the sums of their rows, so that no digit changes unseen."""

from __future__ import annotations

import pytest

from scenarios.tall_building.thesis_tables import PRINTED

#: over six columns and three stiffnesses, added when the tables were read
SUMS = {
    "J1": 6.612, "J2": 7.468, "J3": 10.578, "J4": 10.613, "J5": 42.214, "J6": 246.075,
    "J7": 7.543, "J8": 8.434, "J9": 12.523, "J10": 12.668, "J11": 43.141, "J12": 1583.368,
    "sigma_u": 696.87, "sigma_xm": 427.955, "max_u": 2576.53, "max_xm": 1393.4,
}  # fmt: skip


def test_sums_of_the_printed_cells() -> None:
    """Decimals add up exactly but for 1e-12; half of the last printed digit would show."""
    found = {name: sum(sum(column.printed[name]) for column in PRINTED) for name in SUMS}
    assert found == pytest.approx(SUMS, abs=1e-6)
