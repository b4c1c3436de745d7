"""The README's smallest script runs as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_smallest_script_runs(tmp_path):
    section = README.read_text().split("## The smallest script")[1]
    script = re.search(r"```python\n(.*?)```", section, re.S)[1]
    (tmp_path / "script.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    numbers, *schedule = done.stdout.splitlines()
    # braked by 0.8 N s/m, 2 kg started at 25 m/s from 14 m: 14 + 25 * 2 / 0.8 = 76.5 m without the weak
    # spring, which has pulled it back a little after 20 s
    position, peak = map(float, numbers.split())
    assert 60.0 < position < 76.5
    assert peak == 0.8 * 25.0
    assert schedule[0] == "sampled coupling"
