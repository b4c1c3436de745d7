"""The cache of compiled code: a folder of files by name, each with its hash beside it.

An entry is verified whenever it is used. A damaged one, whatever damaged it (a full disk, a
machine that stopped, another program), is made again; it never reaches the loop.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from platformdirs import user_cache_path

from ..errors import CosimError


def cache_directory() -> Path:
    """Return the folder for compiled code; the environment variable STRUCTCOSIM_CACHE moves it.

    Raises CosimError if it cannot be made, or belongs to another user, whose code would be run.
    """
    chosen = os.environ.get("STRUCTCOSIM_CACHE")
    path = Path(chosen) if chosen else user_cache_path("structcosim", appauthor=False)
    remedy = "name a writable folder in the environment variable STRUCTCOSIM_CACHE"
    try:
        path.mkdir(parents=True, exist_ok=True)
        owner = path.stat().st_uid
    except OSError as error:
        raise CosimError(f"compiled code cannot be stored in {path}: {error.strerror}; {remedy}") from error
    if hasattr(os, "getuid") and owner not in (0, os.getuid()):
        raise CosimError(f"the cache of compiled code {path} belongs to another user; {remedy} of yours")
    return path


def cached(name: str, make: Callable[[], bytes]) -> Path:
    """Return a file of the cache; make its content if it is missing or damaged."""
    return _entry(name, make)[0]


def cached_bytes(name: str, make: Callable[[], bytes]) -> bytes:
    """Return the content of a file of the cache; make it if it is missing or damaged."""
    return _entry(name, make)[1]


def _entry(name: str, make: Callable[[], bytes]) -> tuple[Path, bytes]:
    path = cache_directory() / name
    data = _intact(path)
    if data is None:
        data = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, data)
        _write(_hash_file(path), _hash(data))
    return path, data


def _hash_file(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _hash(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest().encode()


def _intact(path: Path) -> bytes | None:
    """Return the content of an entry, None if it is missing or damaged."""
    try:
        data = path.read_bytes()
        return data if _hash_file(path).read_bytes() == _hash(data) else None
    except OSError:
        return None


def _write(path: Path, data: bytes) -> None:
    """Write a file so that another process, and a machine that stops, sees the whole file or none."""
    handle, temporary = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise CosimError(f"compiled code cannot be stored in {path.parent}: {error.strerror}") from error
        raise
