"""The README's scripts run as they stand there."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def script_after(words: str) -> str:
    return re.search(r"```python\n(.*?)```", README.read_text().split(words)[1], re.S)[1]


def run(script: str, folder: Path) -> list[str]:
    (folder / "script.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_smallest_script_runs(tmp_path):
    numbers, *schedule = run(script_after("## The smallest script"), tmp_path)
    # braked by 0.8 N s/m, 2 kg started at 25 m/s from 14 m: 14 + 25 * 2 / 0.8 = 76.5 m without the weak
    # spring, which has pulled it back a little after 20 s
    position, peak = map(float, numbers.split())
    assert 60.0 < position < 76.5
    assert peak == 0.8 * 25.0
    assert schedule[0] == "sampled coupling"


def test_the_script_that_branches_a_run_runs(tmp_path):
    """After the smallest script, with its system: the branch repeats what the restored run did."""
    script = script_after("## The smallest script") + script_after("A run can be carried on")
    lines = run(script + "print((strong['plant.x'] == again['plant.x']).all(), len(again.time))", tmp_path)
    assert lines[-1] == "True 501"
