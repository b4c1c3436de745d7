"""The list of mutants is valid: each text occurs once in its file, and its test kills the mutant."""

from __future__ import annotations

import pytest

from tests.mutants import MUTANTS, ROOT, Mutant, killed


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda m: m.name)
def test_a_mutant_can_be_made(mutant: Mutant) -> None:
    """When code is rewritten, its mutant in tests/mutants.py must be rewritten too."""
    assert (ROOT / mutant.path).read_text().count(mutant.text) == 1
    assert mutant.replacement != mutant.text
    path, _, name = mutant.test.partition("::")
    assert f"def {name}" in (ROOT / path).read_text()


@pytest.mark.long
def test_no_mutant_survives() -> None:
    assert [m.name for m, dead in killed(MUTANTS) if not dead] == []
