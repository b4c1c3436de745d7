"""The code blocks of a README, and how to run one in a process of its own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def code_blocks(readme: Path) -> list[str]:
    """Return the Python blocks of a README, in their order."""
    return re.findall(r"```python\n(.*?)```", readme.read_text(), re.S)


def run(script: str, folder: Path) -> list[str]:
    """Run a script in a folder; return the lines that it prints."""
    (folder / "script.py").write_text(script)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
