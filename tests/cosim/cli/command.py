"""The command line, called in the process of the tests."""

from __future__ import annotations

from cosim.cli.app import main


def call(*arguments: object) -> int | str:
    """Run a command; return its exit code."""
    try:
        main([str(a) for a in arguments])
    except SystemExit as end:
        return end.code or 0
    return 0
