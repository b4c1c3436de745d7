"""The code blocks of fmus/README.md run unchanged."""

from __future__ import annotations

import math

from tests.readme import ROOT, code_blocks, run

BUILDING, LAW, LAW_TEST, PLANT, EXPORT = code_blocks(ROOT / "fmus" / "README.md")


def test_the_base_isolated_building_moves_at_its_base(tmp_path) -> None:
    """The bearing yields (10 mm), dissipates, and takes most of the motion of the roof."""
    base, roof, lost = run(BUILDING, tmp_path)[-1].replace("[", "").replace("]", "").split()
    assert 0.01 < float(base) < float(roof) < 1.2 * float(base)
    assert float(lost) > 1e3


def test_an_element_law_is_one_file_and_its_test(tmp_path) -> None:
    """The law is imported from its file, which stands beside the script as if in fmus/elements."""
    (tmp_path / "hardening.py").write_text(LAW)
    beside = 'import fmus.elements\n\nfmus.elements.__path__.append(".")\n'
    run(f"{beside}{LAW_TEST}\ntest_the_hardening_spring()\n", tmp_path)


def test_a_plant_becomes_an_fmu_and_runs(tmp_path) -> None:
    """Free motion phi = 0.1 cos(sqrt(g/l) t); the step is exact, so to rounding (1e-12)."""
    phi = run(f"{PLANT}\n{EXPORT}", tmp_path)[-1]
    assert abs(float(phi) - 0.1 * math.cos(math.sqrt(9.81 / 2.0))) < 1e-12
