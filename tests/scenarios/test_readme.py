"""The READMEs of the scenarios are true: their code runs, and their tables are those that are computed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import scenarios
from cosim.cli.app import main
from scenarios.chattering.table import Table as Chattering
from scenarios.highway_bridge.table import Table as HighwayBridge
from scenarios.highway_bridge.table import means_text
from tests.benchmark_data import BRIDGE, needs_data

FOLDER = Path(next(iter(scenarios.__path__)))


def blocks(name: str, language: str) -> list[str]:
    """The code blocks of a README in one language ("" for none)."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.S | re.M)


def test_the_worked_example_and_its_test_run(tmp_path: Path) -> None:
    """The study is saved as mine.py; its test passes, and so does the command that the text names."""
    study, test = blocks("README.md", "python")
    (tmp_path / "mine.py").write_text(study)
    (tmp_path / "test_mine.py").write_text(test)
    for command in (
        ["-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py"],
        ["-c", "from cosim.cli.app import main; main(['run', 'mine.py', '--b', '0.8'])"],
    ):
        done = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert "final speed" in done.stdout
    assert (tmp_path / "out" / "mine" / "metrics.json").is_file()


@pytest.mark.parametrize(
    "name", ["README.md", *(f"{n}/README.md" for n in ("tall_building", "highway_bridge"))]
)
def test_the_commands_exist(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every option of a command in a README is in its help; mine.py is the worked example."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(blocks("README.md", "python")[0])
    commands = [
        line.split()[1:] for text in blocks(name, "") for line in text.splitlines() if "cosim " in line[:6]
    ]
    assert commands
    for command, *words in commands:
        if command in ("run", "table"):
            main([command, words[0], "--help"])
            shown = capsys.readouterr().out
            for word in words:
                assert not word.startswith("--") or word in shown, (command, words)
        elif command == "export":
            main([command, *words])
            assert Path(words[-1]).is_file()


def test_the_table_of_chapter_4() -> None:
    """The README quotes the command's output; a changed digit is a changed result."""
    table = Chattering(comparison=False)
    (quoted,) = blocks("chattering/README.md", "text")
    assert quoted.strip() == table.text(table.rows()).strip()


@pytest.mark.long
@needs_data
def test_the_means_of_chapter_3() -> None:
    (quoted,) = blocks("highway_bridge/README.md", "text")
    assert quoted.strip().splitlines() == means_text(HighwayBridge(data=BRIDGE).rows())
