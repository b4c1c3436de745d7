"""Archives and model descriptions that must be refused, one test per class; and shared extraction."""

from __future__ import annotations

import gc
import os
import re
import stat
import struct
import threading
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

from cosim import FMU, FMUError, System, simulate
from cosim.fmi.file import archive
from fmus.export import export
from tests.cosim.fmi.probe import changed, description2, description3, probe
from tests.cosim.parts import Ramp

LIBRARY = f"binaries/{fmpy.platform}/probe{fmpy.sharedLibraryExtension}"
VERSIONS = ["2.0", "3.0"]


def write(path: Path, *, text: str | bytes | None = None, more=(), compression=zipfile.ZIP_STORED) -> Path:
    """Write an FMU 2.0 with another model description or more entries: name or ZipInfo, and content."""
    entries = [("modelDescription.xml", description2(False) if text is None else text), (LIBRARY, b"text")]
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", compression) as written:
        warnings.simplefilter("ignore")  # zipfile warns of duplicate names
        for name, content in [*entries, *more]:
            written.writestr(name, content)
    return path


def special(name: str, mode: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)
    entry.create_system, entry.external_attr = 3, mode << 16
    return entry


def refused(path: Path, words: str) -> None:
    with pytest.raises(FMUError, match=words) as caught:
        FMU(path)
    assert path.name in str(caught.value)


@pytest.fixture
def tmp(tmp_path, monkeypatch):
    """The folder in which FMUs are unpacked; at the end it is empty and the only one in its parent."""
    place = tmp_path / "outer" / "place"
    place.mkdir(parents=True)
    monkeypatch.setattr(archive.tempfile, "tempdir", str(place))
    yield place
    gc.collect()
    assert [p.name for p in (tmp_path / "outer").iterdir()] == ["place"]
    assert not list(place.iterdir())


# ------------------------------------------------------------------------- unpacking


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../evil", "leads out of the folder"),
        ("resources/../../evil", "leads out of the folder"),
        ("/etc/evil", "is not a path inside the FMU"),
        ("C:/evil", "is not a path inside the FMU"),
        ("C:evil", "is not a path inside the FMU"),
        ("resources\\..\\..\\evil", "is not a path inside the FMU"),
        ("x/" * 2000 + "y", "is a path of 4,001 characters, more than 1,024"),
        (special("resources/link", stat.S_IFLNK | 0o777), "is a link or a device"),
        (special("resources/pipe", stat.S_IFIFO | 0o666), "is a link or a device"),
        (special("resources/disk", stat.S_IFBLK | 0o666), "is a link or a device"),
    ],
    ids=lambda name: str(name)[:40],
)
def test_a_path_out_of_the_folder(tmp_path, tmp, name, words):
    refused(write(tmp_path / "slip.fmu", more=[(name, b"/etc/passwd")]), words)


@pytest.mark.parametrize("name", ["", "a\0b"])
def test_a_path_that_zipfile_does_not_write(tmp_path, tmp, name):
    """zipfile does not write such a name, so another name of the same length is patched."""
    content = write(tmp_path / "name.fmu", more=[("a!b", b"x")]).read_bytes()
    if name:
        content = content.replace(b"a!b", name.encode())
    else:  # a name of length 0, its three letters as extra field and data
        at = content.rfind(b"PK\x01\x02")
        content = content[: at + 28] + struct.pack("<HH", 0, 3) + content[at + 32 :]
    (tmp_path / "name.fmu").write_bytes(content)
    refused(tmp_path / "name.fmu", "is not a path inside the FMU")


def test_a_file_that_is_a_folder_too(tmp_path, tmp):
    refused(write(tmp_path / "a.fmu", more=[("x", b""), ("x/y", b"")]), "'x/y' cannot be unpacked")
    refused(write(tmp_path / "b.fmu", more=[("y" * 300, b"")]), "cannot be unpacked: File name too long")


def test_a_file_that_is_there_twice(tmp_path, tmp):
    refused(write(tmp_path / "a.fmu", more=[("x", b"1"), ("x", b"2")]), "'x' is in it twice, with different")
    assert FMU(write(tmp_path / "b.fmu", more=[("x", b"1"), ("x", b"1"), ("d/", b""), ("d/", b"")]))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_compression_that_fmi_does_not_have(tmp_path, tmp, method):
    """zipfile unpacks these in one piece of any size, which would be a thousandfold bomb in memory."""
    path = write(tmp_path / "method.fmu", compression=method)
    refused(path, f"compression method {method}; FMI has deflate")


def test_an_encrypted_archive(tmp_path, tmp):
    path = write(tmp_path / "secret.fmu")
    content = bytearray(path.read_bytes())
    for head, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = -1
        while (at := content.find(head, at + 1)) >= 0:
            content[at + flags] |= 1
    path.write_bytes(content)
    refused(path, "is encrypted; pack it without a password")


def test_an_archive_that_is_cut_off(tmp_path, tmp):
    """Wherever it is cut off, it is refused with an FMUError."""
    content = write(tmp_path / "whole.fmu").read_bytes()
    path = tmp_path / "cut.fmu"
    for length in [*range(0, len(content), 97), *range(len(content) - 30, len(content))]:
        path.write_bytes(content[:length])
        refused(path, "it is not a ZIP archive .* was it copied completely")


def test_a_damaged_file_in_the_archive(tmp_path, tmp):
    path = write(tmp_path / "crc.fmu", more=[("resources/table.txt", b"1 2 3 4")])
    path.write_bytes(path.read_bytes().replace(b"1 2 3 4", b"1 2 7 4"))
    refused(path, "'resources/table.txt' cannot be unpacked: Bad CRC-32")


# ------------------------------------------------------------------------------ bombs


def declare(path: Path, name: str, size: int) -> None:
    """Change the declared unpacked size of an entry, in the directory and in its header."""
    content = bytearray(path.read_bytes())
    for head, at_size, at_name in ((b"PK\x03\x04", 22, 30), (b"PK\x01\x02", 24, 46)):
        at = next(
            i for i in range(len(content))
            if content[i : i + 4] == head and content[i + at_name : i + at_name + len(name)] == name.encode()
        )  # fmt: skip
        struct.pack_into("<I", content, at + at_size, size)
    path.write_bytes(content)


def test_a_bomb_by_ratio(tmp_path, tmp, monkeypatch):
    """32 MB of zeros in 33 kB: refused by its declared size; below HARMLESS it is unpacked."""
    more = [("resources/zeros", bytes(2**25))]
    path = write(tmp_path / "bomb.fmu", more=more, compression=zipfile.ZIP_DEFLATED)
    assert FMU(path)
    monkeypatch.setattr(archive, "HARMLESS", 2**23)
    refused(path, r"unpacks to 33\.6 MB, which is a ZIP bomb")


def test_a_bomb_that_declares_little(tmp_path, tmp):
    """1 MB is declared as 10 bytes: only 10 are written, and the checksum reveals it."""
    path = write(tmp_path / "liar.fmu", more=[("zeros", bytes(2**20))], compression=zipfile.ZIP_DEFLATED)
    declare(path, "zeros", 10)
    refused(path, "'zeros' cannot be unpacked: Bad CRC-32")


def test_a_model_description_that_declares_little(tmp_path, tmp):
    """256 MB of blanks in 260 kB, declared as 100 bytes, are refused without being inflated."""
    path = write(tmp_path / "bomb.fmu", text=b" " * (256 << 20), compression=zipfile.ZIP_DEFLATED)
    declare(path, "modelDescription.xml", 100)
    tracemalloc.start()
    try:
        refused(path, "'modelDescription.xml' cannot be unpacked: Bad CRC-32")
        assert tracemalloc.get_traced_memory()[1] < 10 << 20  # the archive itself, and the imports of FMPy
    finally:
        tracemalloc.stop()


def test_a_bomb_of_overlapping_files(tmp_path, tmp):
    """Thousands of entries share the same 1 MB: 7 GB from 600 kB."""
    path = write(tmp_path / "overlap.fmu", more=[("zeros", bytes(2**20))], compression=zipfile.ZIP_DEFLATED)
    content = path.read_bytes()
    end = content.rfind(b"PK\x05\x06")
    first = content.find(b"PK\x01\x02")
    last = content.rfind(b"PK\x01\x02")
    copies = [content[last:end].replace(b"zeros", b"%05d" % i) for i in range(7000)]
    directory = content[first:end] + b"".join(copies)
    record = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 7003, 7003, len(directory), first, 0)
    path.write_bytes(content[:first] + directory + record)
    refused(path, r"unpacks to 7\.34 GB, which is a ZIP bomb")


def test_an_archive_of_too_many_entries(tmp_path, tmp, monkeypatch):
    """By count, and by the size of the directory before it is read."""
    path = write(tmp_path / "many.fmu", more=[(f"r/{i}", b"") for i in range(50)])
    monkeypatch.setattr(archive, "MAX_ENTRIES", 50)
    refused(path, "has 52 entries, too many for an FMU")
    monkeypatch.setattr(archive, "MAX_DIRECTORY", 1000)
    refused(path, "has a directory of .* too many entries for an FMU")
    large = zipfile.ZipFile(tmp_path / "large.fmu", "w")
    monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 10)  # so that it writes the ZIP64 records
    for i in range(50):
        large.writestr(f"r/{i}", b"")
    large.close()
    assert b"PK\x06\x06" in (tmp_path / "large.fmu").read_bytes()
    refused(tmp_path / "large.fmu", "has a directory of .* too many entries for an FMU")


def test_a_disk_that_is_too_small(tmp_path, tmp, monkeypatch):
    free = os.statvfs(tmp).f_bavail * os.statvfs(tmp).f_frsize
    monkeypatch.setattr(archive, "RESERVE", free + 2**40)
    refused(write(tmp_path / "plant.fmu"), "unpacks to .* free; make room, or set TMPDIR")


def test_an_fmu_with_large_resources_passes(tmp_path, tmp, monkeypatch):
    """A table packed five to one, above the size from which ratios count, as in real FMUs."""
    monkeypatch.setattr(archive, "HARMLESS", 2**23)
    block = np.random.default_rng(1).integers(0, 256, 2**18, dtype=np.uint8).tobytes() + bytes(2**20 - 2**18)
    path = write(
        tmp_path / "large.fmu", more=[("resources/table", 32 * block)], compression=zipfile.ZIP_DEFLATED
    )
    assert 3 < 2**25 / path.stat().st_size < 5
    assert (FMU(path).directory / "resources" / "table").stat().st_size == 2**25


# -------------------------------------------------------------------------------- XML

BOMB = "".join(f'<!ENTITY {b} "{10 * f"&{a};"}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True))


@pytest.mark.parametrize(
    ("doctype", "use"),
    [
        ("<!DOCTYPE fmiModelDescription>", "probe"),
        (f'<!DOCTYPE fmiModelDescription [<!ENTITY a "aaaaaaaaaa">{BOMB}]>', "&i;"),
        (f'<!DOCTYPE fmiModelDescription [<!ENTITY a "{"a" * 100_000}">]>', 5000 * "&a;"),
        ('<!DOCTYPE fmiModelDescription SYSTEM "file:///etc/passwd">', "probe"),
        ('<!DOCTYPE fmiModelDescription [<!ENTITY e SYSTEM "file:///etc/passwd">]>', "probe"),
        ('<!DOCTYPE fmiModelDescription [<!ENTITY % e SYSTEM "file:///etc/passwd"> %e;]>', "probe"),
    ],
    ids=["plain", "exponential", "quadratic", "external DTD", "external entity", "parameter entity"],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities(tmp_path, tmp, doctype, use, encoding):
    text = description2(False).replace('modelName="probe"', f'modelName="{use}"')
    text = text.replace("<fmiModel", doctype + "<fmiModel", 1).replace("UTF-8", encoding)
    path = write(tmp_path / "entities.fmu", text=text.encode(encoding))
    refused(path, "has a DOCTYPE, which FMI does not use|modelDescription.xml is broken: .*entit")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace("<ModelVar", "<a>" * 100_000 + "<ModelVar"), "is broken: .*depth"),
        (lambda t: t.replace('"probe"', '"\xff"').encode("latin-1"), "is broken: .*(UTF-8|encod)"),
        (lambda t: t.replace("UTF-8", "EBCDIC-99"), "is broken: .*encoding"),
        (lambda t: t[: len(t) // 2], "is broken"),
        (lambda t: "", "is broken"),
        (lambda t: "<html/>", "must describe an FMU, and its root is 'html'"),
        (lambda t: t.replace('"2.0"', '"1.0"', 2), "FMI version 1.0; FMI 2.0 and 3.0 are supported"),
        (lambda t: t.replace(' valueReference="3"', ""), "'valueReference' is required but missing"),
        (lambda t: t.replace('Reference="3"', 'Reference="1"').replace("<Integer start", "<Real start"),
         "inputs r_in and i_in have the same value reference 1"),
        (lambda t: t.replace('name="i_in"', 'name="r_in"'), "name \"r_in\" .* is not unique"),
        (lambda t: t.replace('index="2"', 'index="0"'), "by its number, which must be from 1 to"),
        (lambda t: t.replace('index="2"', 'index="99"'), "FMPy cannot interpret it .IndexError"),
        (lambda t: t.replace('dependencies="1"', 'dependencies="0"'), "refers to a variable by its number"),
        (lambda t: t.replace('fier="probe"', 'fier="../../probe"'), "is a path; it must be the name"),
        (lambda t: t.replace('fier="probe"', 'fier="prob"'), r"has no library binaries/.*/prob\."),
        (lambda t: t.replace('"0.5" unit="N"', '"0.5" displayUnit="kN"'), "cannot interpret it .KeyError"),
        (lambda t: t.replace('"0.5" unit="N"', '"0.5" unit="kN"'), "unit \"kN\" .* is not defined"),
    ],
)  # fmt: skip
def test_a_model_description_that_is_wrong(tmp_path, tmp, change, words):
    text = description2(False)
    assert change(text) != text
    refused(write(tmp_path / "wrong.fmu", text=change(text)), words)


def test_value_references_of_fmi3_are_unique(tmp_path):
    text = description3(False).replace('name="i_in" valueReference="3"', 'name="i_in" valueReference="1"')
    refused(write(tmp_path / "twice.fmu", text=text), 'has the same value reference as variable "r_in"')


def test_an_array_that_exceeds_any_memory(tmp_path):
    """A dimension of 10^12, in the description and as start value of the structural parameter."""
    text = description3(False).replace(
        '<Dimension valueReference="40"/>', '<Dimension start="1000000000000"/>'
    )
    refused_with = r"variable v_(in|out) of shape \(1000000000000,\) has more than 10,000,000 values"
    with pytest.raises(FMUError, match=refused_with):
        FMU(
            write(
                tmp_path / "a.fmu",
                text=text,
                more=[(LIBRARY.replace(fmpy.platform, fmpy.platform_tuple), b"")],
            )
        )
    with pytest.raises(FMUError, match=refused_with):
        FMU(probe(tmp_path / "b.fmu", "3.0"), start={"n": 10**12})


def test_white_space_in_lists_is_free(tmp_path):
    """XML allows any white space, FMPy single blanks only."""
    text = description2(False).replace('dependencies="1"', 'dependencies=" 1&#9;  3 "')
    fmu = FMU(write(tmp_path / "white.fmu", text=text))
    assert fmu.feedthrough()["r_out"] == {"r_in", "i_in"}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["a[1]", "a[2]"], ["a"]),
        (["a[1]", "a[1,2]"], ["a[1,2]", "a[1]"]),
        (["a[1,1]", "a[1]"], ["a[1,1]", "a[1]"]),
        (["a[1]", "a[2,1]"], ["a[1]", "a[2,1]"]),
        (["a[1]", "a[01]"], ["a[01]", "a[1]"]),
        ([f"a[{'9' * 5000}]", "b"], [f"a[{'9' * 5000}]", "b"]),
        (["a[999999999]", "a[1]"], ["a[1]", "a[999999999]"]),
    ],
)
def test_names_that_look_like_elements(tmp_path, names, expected):
    """Only the elements of one whole array are joined, not names of several ranks or duplicate indices."""
    text = description2(False)
    for old, new in zip(["x", "der(x)"], names, strict=True):
        text = text.replace(f'name="{old}"', f'name="{new}"')
    fmu = FMU(write(tmp_path / "names.fmu", text=text))
    assert sorted(n for n in fmu.output_ports if n[0] in "ab" and n != "b_out") == expected


# ------------------------------------------------------------------------------ binaries


@pytest.mark.parametrize("version", VERSIONS)
def test_a_binary_that_is_no_library(tmp_path, version):
    sound = probe(tmp_path / "sound.fmu", version)
    with zipfile.ZipFile(sound) as read:
        whole = read.read(read.namelist()[1])
    wrong = {
        b"": "cannot be loaded",
        b"#!/bin/sh\necho no library\n": "cannot be loaded",
        **{whole[:n]: "cannot be loaded|is truncated at" for n in (4, 63, 64, 200, 700, 4096)},
    }
    for content, words in wrong.items():
        path = changed(
            tmp_path / "plant.fmu", sound, lambda name, old, new=content: new if "binaries" in name else old
        )
        with pytest.raises(FMUError, match=words):
            simulate(System({"plant": FMU(path)}), step=0.1, stop=0.1)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_guid_that_is_not_that_of_the_binary(tmp_path, version):
    """The FMU refuses the instance, and the error has the reason from its log."""
    attribute = b"guid" if version == "2.0" else b"instantiationToken"
    pattern, other = attribute + b'="[^"]*"', attribute + b'="{another}"'
    path = changed(
        tmp_path / "plant.fmu",
        export(Ramp(), tmp_path / "sound.fmu", fmi_version=version),
        lambda name, old: re.sub(pattern, other, old) if name == "modelDescription.xml" else old,
    )
    with pytest.raises(FMUError, match=r"plant \(plant.fmu\) failed to instantiate.*\n.*another"):
        simulate(System({"plant": FMU(path)}), step=0.1, stop=0.1)


@pytest.mark.parametrize("version", VERSIONS)
def test_binaries_for_another_platform(tmp_path, version):
    path = tmp_path / "win.fmu"
    with zipfile.ZipFile(path, "w") as written:
        written.writestr("modelDescription.xml", (description2 if version == "2.0" else description3)(False))
        written.writestr("binaries/win64/probe.dll", b"MZ")
    refused(path, r"has no binary for \S+ \(available: win64\)")


# ---------------------------------------------------------------------- shared extraction


def test_fmus_of_one_file_share_a_folder_while_there_is_one(tmp_path, tmp):
    path = probe(tmp_path / "plant.fmu", "2.0")
    (tmp_path / "copy.fmu").write_bytes(path.read_bytes())
    fmus = [FMU(path), FMU(path, start={"r_in": 2.0}), FMU(tmp_path / "copy.fmu")]
    folder = fmus[0].directory
    assert [f.directory for f in fmus] == [folder] * 3
    system = System({"a": FMU(path), "b": FMU(path, start={"r_in": 2.0})})
    del fmus
    gc.collect()
    assert folder.is_dir()
    result = simulate(system, step=0.25, stop=1.0, record=["a.r_out", "b.r_out"])
    assert (result["a.r_out"][-1], result["b.r_out"][-1]) == (1.0, 4.0)
    del system
    gc.collect()
    assert not folder.exists()
    assert FMU(path).directory != folder


def test_a_file_that_changes_is_another_fmu(tmp_path, tmp):
    """The file has the same size and, in whole seconds, the same time of change."""
    path = write(tmp_path / "plant.fmu", more=[("resources/x", b"1")])
    first, times = FMU(path), path.stat()
    write(path, more=[("resources/x", b"2")])
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    second = FMU(path)
    assert [(f.directory / "resources" / "x").read_text() for f in (first, second)] == ["1", "2"]


def test_threads_share_it(tmp_path, tmp):
    path = write(tmp_path / "plant.fmu", more=[(f"resources/{i}", bytes(9000)) for i in range(200)])
    fmus: list[FMU] = []
    threads = [threading.Thread(target=lambda: fmus.append(FMU(path))) for _ in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(fmus) == 8
    assert len({f.directory for f in fmus}) == 1
    assert all((f.directory / "resources" / "199").stat().st_size == 9000 for f in fmus)


def test_a_forked_process_leaves_the_folder(tmp_path, tmp):
    fmu = FMU(write(tmp_path / "plant.fmu"))
    folder = fmu.directory
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # forking with several threads
        child = os.fork()
    if child == 0:
        del fmu
        gc.collect()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert folder.is_dir()
