"""The code blocks of controllers/README.md run unchanged."""

from __future__ import annotations

from tests.readme import ROOT, code_blocks, run

DESIGN, LAW, LAW_TEST = code_blocks(ROOT / "controllers" / "README.md")


def test_the_design_gives_a_law_and_an_observer(tmp_path) -> None:
    assert run(DESIGN, tmp_path)[-1] == "(1, 4) (4, 1)"


def test_a_control_law_is_one_file_and_its_test(tmp_path) -> None:
    run(f"{LAW}\n{LAW_TEST}\ntest_the_force_is_a_power_of_s()\n", tmp_path)
