"""The shared library in an FMU: its path, and whether it is complete."""

from __future__ import annotations

import struct
from pathlib import Path

from ...errors import FMUError

_SUFFIXES = {"win": ".dll", "dar": ".dylib"}


def library_name(platform: str, identifier: str) -> str:
    """Return the path of the library in the archive, such as binaries/linux64/plant.so."""
    system = platform.rpartition("-")[2][:3]
    return f"binaries/{platform}/{identifier}{_SUFFIXES.get(system, '.so')}"


def check_library(path: Path) -> None:
    """Raise FMUError for a truncated ELF library, which would end this process with SIGBUS.

    The loader itself refuses other files that are not libraries. The fields of a program header of
    64-bit little-endian ELF are type, flags, offset, virtual and physical address, size in the file.
    """
    try:
        with path.open("rb") as file:
            head = file.read(64)
            if head[:6] != b"\x7fELF\x02\x01" or len(head) < 64:
                return
            (offset,), (size, count) = struct.unpack_from("<Q", head, 32), struct.unpack_from("<HH", head, 54)
            file.seek(min(offset, path.stat().st_size))
            table = file.read(size * count)
    except OSError as error:
        raise FMUError(f"{path.name} cannot be read: {error.strerror}") from error
    length = path.stat().st_size
    whole = size == 56 and len(table) == size * count
    for i in range(count if whole else 0):
        at, _, _, in_file = struct.unpack_from("<4Q", table, size * i + 8)
        whole = whole and at + in_file <= length
    if not whole:
        raise FMUError(f"{path.name} is truncated at {length:,} bytes; build or copy the FMU again")
