"""The list of mutants holds: each text stands once in its file, and each is killed by its test."""

from __future__ import annotations

import pytest

from tests.mutants import MUTANTS, ROOT, Mutant, killed


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda m: m.name)
def test_a_mutant_can_be_made(mutant: Mutant) -> None:
    """Code that was rewritten needs its mutant rewritten, too, in tests/mutants.py."""
    assert (ROOT / mutant.path).read_text().count(mutant.text) == 1
    assert mutant.replacement != mutant.text
    path, _, name = mutant.test.partition("::")
    assert f"def {name}" in (ROOT / path).read_text()


@pytest.mark.long
def test_no_mutant_survives() -> None:
    assert [m.name for m, dead in killed(MUTANTS) if not dead] == []
