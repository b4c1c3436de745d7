"""Scenarios import as a user would: from public rooms only."""

from __future__ import annotations

import ast
from pathlib import Path

import scenarios

FOLDER = Path(next(iter(scenarios.__path__)))
PUBLIC = {"cosim", "cosim.blocks", "cosim.functions"}


def imported(path: Path) -> set[str]:
    """The absolute names of the modules that a file imports, those inside functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module or "")
    return found


def test_scenarios_import_public_rooms_only() -> None:
    files = list(FOLDER.rglob("*.py"))
    assert len(files) > 20
    for path in files:
        inner = {name for name in imported(path) if name.split(".")[0] == "cosim"} - PUBLIC
        assert not inner, f"{path.relative_to(FOLDER)} imports {inner}"
