"""The scripts of README.md and cosim/README.md run unchanged."""

from __future__ import annotations

import re

import pytest

from tests.readme import ROOT, code_blocks, run


def test_the_building_of_the_readme(tmp_path):
    """The brace lowers the drift; without it the force is zero. The schedule marks the FMU."""
    (script,) = code_blocks(ROOT / "README.md")
    free, braced, *schedule = run(script, tmp_path)
    drift = [float(line.partition("drift ")[2].partition(" mm")[0]) for line in (free, braced)]
    assert free.endswith("force 0 kN")
    assert 0.7 * drift[0] < drift[1] < 0.9 * drift[0]
    assert schedule[0] == "sampled coupling"
    assert "  building: step (FMU)" in schedule


def test_the_branch_of_a_run_repeats_it(tmp_path):
    """The second script of cosim/README.md uses the class of the first one."""
    oscillator, branch = code_blocks(ROOT / "cosim" / "README.md")
    assert run(f"{oscillator}\n{branch}", tmp_path)[-1] == "True"


def test_the_readme_fits_a_page():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.parametrize("document", sorted(p for p in ROOT.rglob("README.md") if ".venv" not in p.parts))
def test_links_lead_somewhere(document):
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", document.read_text(encoding="utf-8"))
    assert [link for link in links if "://" not in link and not (document.parent / link).exists()] == []
