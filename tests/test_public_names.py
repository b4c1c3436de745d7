"""Public names: studies, controllers and READMEs import from public rooms only, as a user does."""

from __future__ import annotations

import ast
import re

import pytest

import cosim
from tests.readme import ROOT

#: what studies and controllers may import of cosim, and by which names README does
PUBLIC = {"cosim", "cosim.blocks", "cosim.functions"}


def imported(text: str) -> set[str]:
    """Return the modules of cosim that a text imports from, at any depth of the code."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.partition(".")[0] == "cosim"}


def test_studies_and_controllers_import_from_public_rooms():
    files = [f for room in ("scenarios", "controllers") for f in (ROOT / room).rglob("*.py")]
    assert len(files) > 20
    private = {
        (str(file.relative_to(ROOT)), name)
        for file in files
        for name in imported(file.read_text(encoding="utf-8")) - PUBLIC
    }
    assert private == set()


@pytest.mark.parametrize("folder", ["", "cosim", "fmus", "controllers", "scenarios"])
def test_documents_import_from_public_rooms(folder):
    scripts = re.findall(
        r"```python\n(.*?)```", (ROOT / folder / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert scripts
    for script in scripts:
        assert imported(script) <= PUBLIC


def test_every_public_error_and_warning_is_exported():
    from cosim import errors, result
    from cosim.ssp import format as ssp_format

    defined = {
        name
        for module in (errors, result, ssp_format)
        for name, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, BaseException)
        and value.__module__ == module.__name__
    }
    assert len(defined) > 10
    assert defined <= set(cosim.__all__)
