"""Reading of printed.csv, the numbers that the thesis prints, in the folder of each study."""

from __future__ import annotations

import csv
from pathlib import Path


def read_printed(folder: Path) -> list[dict[str, str]]:
    """Return the rows of printed.csv in a folder, cells by the name of their column."""
    with (folder / "printed.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def number(cell: str) -> float | None:
    """Return a cell as a number; None for a cell that is empty or cannot be read in the scan."""
    return float(cell) if cell else None
