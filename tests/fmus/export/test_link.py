"""Libraries for five platforms, failures of linking, the cache, and reproducible files."""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import fmus.export.fmu
import fmus.export.link
from cosim import Block, CompilationError, Input, Output
from cosim.codegen.c_compiler import fmi_headers
from cosim.codegen.cache import cache_directory
from fmus.export import ExportError, export
from fmus.export.fmu import FMI_VERSIONS, write_archive
from fmus.export.link import build_model
from fmus.plants.oscillator import Oscillator
from tests.fmus.export.host import ERROR, OK, Accumulator, Host

ELF_MACHINE = {"x86_64": 62, "aarch64": 183}
MACH_CPU = {"x86_64": 0x01000007, "aarch64": 0x0100000C}


def binaries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {n.removeprefix("binaries/"): archive.read(n) for n in archive.namelist() if "binaries/" in n}


def elf(data: bytes) -> tuple[bytes, int]:
    return data[:4], struct.unpack_from("<H", data, 18)[0]


@pytest.mark.parametrize("architecture", ["x86_64", "aarch64"])
def test_linux(tmp_path: Path, architecture: str) -> None:
    found = binaries(export(Oscillator(), tmp_path / "o.fmu", platforms=[f"{architecture}-linux"]))
    assert elf(found["linux64/Oscillator.so"]) == (b"\x7fELF", ELF_MACHINE[architecture])


def test_both_linux_architectures(tmp_path: Path) -> None:
    """linux64 is x86_64, as in FMI 2.0; the other platform has its name of FMI 3.0."""
    found = binaries(export(Oscillator(), tmp_path / "o.fmu", platforms=["aarch64-linux", "x86_64-linux"]))
    assert {n: elf(data)[1] for n, data in found.items()} == {
        "linux64/Oscillator.so": ELF_MACHINE["x86_64"],
        "aarch64-linux/Oscillator.so": ELF_MACHINE["aarch64"],
    }


def test_macos_is_one_universal_library(tmp_path: Path) -> None:
    found = binaries(export(Oscillator(), tmp_path / "o.fmu", platforms=["x86_64-darwin", "aarch64-darwin"]))
    data = found.pop("darwin64/Oscillator.dylib")
    assert not found
    magic, count = struct.unpack_from(">2I", data)
    assert (magic, count) == (0xCAFEBABE, 2)
    cpus = set()
    for i in range(count):
        cpu, _, offset, size, alignment = struct.unpack_from(">5I", data, 8 + 20 * i)
        assert offset % (1 << alignment) == 0
        assert offset + size <= len(data)
        inner_magic, inner_cpu = struct.unpack_from("<2I", data, offset)
        assert (inner_magic, inner_cpu) == (0xFEEDFACF, cpu)
        cpus.add(cpu)
    assert cpus == set(MACH_CPU.values())


def test_macos_on_one_architecture(tmp_path: Path) -> None:
    data = binaries(export(Oscillator(), tmp_path / "o.fmu", platforms=["aarch64-darwin"]))
    assert struct.unpack_from("<2I", data["darwin64/Oscillator.dylib"]) == (0xFEEDFACF, MACH_CPU["aarch64"])


@pytest.mark.long  # the very first link for Windows builds its C library: more than a minute
@pytest.mark.parametrize(("version", "folder"), [("2.0", "win64"), ("3.0", "x86_64-windows")])
def test_windows(tmp_path: Path, version: str, folder: str) -> None:
    path = export(Oscillator(), tmp_path / "o.fmu", platforms=["x86_64-windows"], fmi_version=version)
    data = binaries(path)[f"{folder}/Oscillator.dll"]
    (place,) = struct.unpack_from("<I", data, 0x3C)
    assert data[:2] == b"MZ"
    assert data[place : place + 4] == b"PE\0\0"
    assert struct.unpack_from("<H", data, place + 4)[0] == 0x8664
    assert f"fmi{version[0]}DoStep".encode() in data
    assert b"kernel_advance" not in data


def test_export_repeats_byte_for_byte_and_compiles_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second export finds the library in the cache."""
    first = export(Oscillator(), tmp_path / "1.fmu").read_bytes()
    monkeypatch.setattr(fmus.export.link, "zig_cc", lambda *_: pytest.fail("compiles again"))
    second = export(Oscillator(), tmp_path / "2.fmu").read_bytes()
    assert hashlib.sha256(first).digest() == hashlib.sha256(second).digest()


def test_another_parameter_is_another_fmu(tmp_path: Path, host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    other = export(Oscillator(m=2.0), tmp_path / "2.fmu")
    assert Host(other, h.library).guid != h.guid


def test_no_path_of_this_machine_is_inside(tmp_path: Path) -> None:
    (library,) = binaries(export(Oscillator(), tmp_path / "o.fmu")).values()
    for path in (Path(fmus.export.link.__file__).parent, Path.home(), cache_directory()):
        assert str(path).encode() not in library


def test_a_missing_compiler_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda n, *a: None if n == "ziglang" else find(n, *a))
    with pytest.raises(CompilationError, match="pip install ziglang"):
        export(Oscillator(), tmp_path / "o.fmu")


def test_what_the_compiler_says_reaches_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmus.export.link, "_table", lambda *_: "this is no C\n")
    with pytest.raises(ExportError, match=r"Oscillator cannot be linked for .*: .*error"):
        export(Oscillator(), tmp_path / "o.fmu")


@pytest.mark.parametrize("version", FMI_VERSIONS)
def test_the_front_end_compiles_without_a_warning(tmp_path: Path, version: str) -> None:
    plant = Accumulator(m=2, n=3)
    model = build_model(plant, "Accumulator", version, "")
    (tmp_path / "model.c").write_text(fmus.export.link._unit(model))
    (tmp_path / "start.bin").write_bytes(model.start)
    flags = [flag for flag in fmus.export.link._FLAGS if flag not in ("-s", "-shared")]
    flags += [f"-I{fmi_headers()}", f"-I{fmus.export.link._FRONT_END}", f"--embed-dir={tmp_path}"]
    command = [sys.executable, "-m", "ziglang", "cc", *flags, "-Wshadow", "-Werror", "-c", "model.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_threads_may_write_one_archive(tmp_path: Path) -> None:
    """Each writes its own file and renames it, so a reader sees a complete archive."""
    path, files = tmp_path / "one.fmu", {"modelDescription.xml": b"x" * 100_000}
    with ThreadPoolExecutor(8) as pool:
        for done in [pool.submit(write_archive, path, files) for _ in range(64)]:
            done.result()
    with zipfile.ZipFile(path) as archive:
        assert archive.read("modelDescription.xml") == files["modelDescription.xml"]
    assert list(tmp_path.iterdir()) == [path]


class Gate(Block):
    """Fails when u is above 5"""

    u = Input()
    y = Output()

    def step(self, t: float, h: float) -> None:
        self.y = self.u


GATE = """
define i32 @kernel_step(ptr %r, double %t, double %h) {
  %u = load double, ptr %r
  %open = fcmp ogt double %u, 5.0
  %code = select i1 %open, i32 7, i32 0
  ret i32 %code
}
"""


def test_a_kernel_that_gives_up_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmus.export.fmu, "lower", lambda participant: GATE)
    path = export(Gate(), tmp_path / "gate.fmu")
    library = tmp_path / "Gate.so"
    library.write_bytes(next(iter(binaries(path).values())))
    h = Host(path, ctypes.CDLL(str(library)))
    h.setup()
    h.log.clear()
    assert h.set(("u", 6.0)) == OK
    assert h.step(0.0, 0.5) == ERROR
    assert h.log == [
        (ERROR, "logStatusError", "fmi2DoStep: the model failed in the step from t = 0 (code 7)")
    ]
    h.free()
