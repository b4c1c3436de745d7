"""Entries of the cache that were damaged are made again: they neither crash nor change a result."""

from __future__ import annotations

import os

import pytest

from cosim import CosimError, System, simulate
from cosim.codegen.cache import cache_directory, cached
from fmus.export import as_fmu
from fmus.plants.oscillator import Oscillator


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("STRUCTCOSIM_CACHE", str(tmp_path))
    return tmp_path


def changed_digit(data: bytes) -> bytes:
    """Change one digit of the content: IR with it compiles, and computes something else."""
    place = max(data.rfind(digit) for digit in (b"1", b"2", b"3"))
    return data[:place] + b"7" + data[place + 1 :]


DAMAGE = {
    "empty": lambda data: b"",
    "half": lambda data: data[: len(data) // 2],
    "zeros": lambda data: bytes(len(data)),
    "digit": changed_digit,
}


def trajectory(plant) -> list[float]:
    return list(simulate(System({"plant": plant}), step=0.01, stop=0.1)["plant.x"])


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_kernel_is_compiled_again(cache, damage):
    first = trajectory(Oscillator())
    (entry,) = cache.glob("kernels/*.ll")
    entry.write_bytes(damage(entry.read_bytes()))
    assert trajectory(Oscillator()) == first


def test_a_damaged_fmu_is_exported_again(cache):
    """Half a library is a bus error when it is loaded."""
    first = trajectory(as_fmu(Oscillator()))
    (entry,) = cache.glob("fmus/*/*.fmu")
    entry.write_bytes(entry.read_bytes()[:2000])
    assert trajectory(as_fmu(Oscillator())) == first


def test_an_entry_without_its_hash_is_made_again(cache):
    """The process ended between the two files: the content cannot be trusted."""
    path = cached("a/b", lambda: b"one")
    path.with_name("b.sha256").unlink()
    assert cached("a/b", lambda: b"two").read_bytes() == b"two"
    assert cached("a/b", lambda: b"three").read_bytes() == b"two"


def test_a_cache_of_another_user_is_refused(cache, monkeypatch):
    """Code from it would be run."""
    os.chown(cache, 12345, -1) if os.getuid() == 0 else monkeypatch.setattr(os, "getuid", lambda: -1)
    with pytest.raises(CosimError, match="belongs to another user"):
        cache_directory()


def test_a_cache_that_cannot_be_written_says_so(cache, monkeypatch):
    (cache / "file").write_text("")
    monkeypatch.setenv("STRUCTCOSIM_CACHE", str(cache / "file" / "cache"))
    with pytest.raises(CosimError, match="environment variable STRUCTCOSIM_CACHE"):
        cache_directory()


def test_a_full_disk_is_an_error_with_the_folder(cache, monkeypatch):
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CosimError, match=r"cannot be stored in .*a: No space left on device"):
        cached("a/b", lambda: b"one")
    assert list((cache / "a").iterdir()) == []
