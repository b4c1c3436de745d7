"""The processes of the machine, for tests that start some."""

from __future__ import annotations

from pathlib import Path


def children(parent: int) -> set[int]:
    """Return the children of a process, zombies included."""
    found = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        if int(fields[1]) == parent:
            found.add(int(entry.parent.name))
    return found
