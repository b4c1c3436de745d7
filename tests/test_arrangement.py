"""How the tests are arranged: rooms that mirror the packages, modules that stand alone, no clock."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.readme import ROOT

TESTS = ROOT / "tests"
TREES = {
    str(file.relative_to(TESTS)): ast.parse(file.read_text(encoding="utf-8"))
    for file in sorted(TESTS.rglob("test_*.py"))
}
#: rooms that only the tests have
OWN_ROOMS = {Path("benchmarks")}
CLOCKS = {"perf_counter", "process_time", "seconds"}


def imported(tree: ast.AST) -> set[str]:
    """Return the dotted names that a module imports, at any depth of the code."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


def used(node: ast.AST) -> set[str]:
    """Return the names and attributes that a piece of code uses."""
    found = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return found | {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)}


def about_time(tree: ast.AST) -> list[int]:
    """Return the lines that assert something about a clock, or about a number computed from one."""
    timed = set(CLOCKS)
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and used(node.value) & timed:
            timed |= {n.id for target in node.targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return [n.lineno for n in ast.walk(tree) if isinstance(n, ast.Assert) and used(n.test) & timed]


def test_rooms_of_the_tests_are_rooms_of_the_packages() -> None:
    assert len(TREES) > 100
    rooms = {Path(name).parent for name in TREES} - OWN_ROOMS
    assert {room for room in rooms if not (ROOT / room).is_dir()} == set()


def test_a_test_module_imports_no_other() -> None:
    """Shared parts stand in files without `test_`, so that importing one does not collect its tests again."""
    names = {(module, name) for module, tree in TREES.items() for name in imported(tree)}
    own = {(module, name) for module, name in names if name.startswith("tests.")}
    assert own
    assert {(module, name) for module, name in own if ".test_" in name} == set()


def test_nothing_is_asserted_about_seconds() -> None:
    assert about_time(ast.parse("a = clock.perf_counter()\nb = a - 1\nassert x == 1\nassert b < 2")) == [4]
    assert {module: lines for module, tree in TREES.items() if (lines := about_time(tree))} == {}
