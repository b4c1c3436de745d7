"""Layers point one way: scenarios -> controllers, fmus -> cosim; the command line is the outermost."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAY_IMPORT = {
    "cosim": {"cosim"},
    "fmus": {"fmus", "cosim"},
    "controllers": {"controllers", "cosim"},
    "scenarios": {"scenarios", "controllers", "fmus", "cosim"},
}
#: the command line; it may import the other packages, inside its functions
OUTERMOST = {"cosim/app.py", "cosim/scenario.py", "cosim/inspection.py", "cosim/run_directory.py"}


def imported(path: Path, top_level_only: bool) -> set[str]:
    tree = ast.parse(path.read_text())
    nodes = tree.body if top_level_only else ast.walk(tree)
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module or "")
        elif isinstance(node, ast.ImportFrom):
            package = path.relative_to(ROOT).with_suffix("").parts[: -node.level]
            found.add(".".join(package) or "beyond the top")
    return {name.partition(".")[0] for name in found}


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_point_inwards(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        lazily = path.relative_to(ROOT).as_posix() in OUTERMOST
        used = imported(path, top_level_only=lazily) & {*MAY_IMPORT, "tests", "beyond the top"}
        assert used <= MAY_IMPORT[package], path.relative_to(ROOT)
