"""The archive of an .fmu file: a ZIP file from an untrusted source, checked before it is used.

    with Archive(Path("plant.fmu")) as archive:
        text = archive.read("modelDescription.xml")
        extraction = archive.extraction()          # extraction.folder, while the object exists

The directory of the archive is checked before a byte is unpacked, for paths that lead out of the
folder, links, two files of one name, encryption, compression methods outside FMI, and sizes that are
too large for an FMU. Files are unpacked from a stream, which stops at the size that the directory
declares and compares the checksum there; so declared sizes bound the actual ones, on the disk
and in memory.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import struct
import tempfile
import threading
import weakref
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from ...errors import FMUError

#: an FMU that carries a Python environment has some 50,000 files
MAX_ENTRIES = 200_000
#: bytes of the ZIP's directory for them: a header of 46, and a path of up to 200 with its extra fields
MAX_DIRECTORY = 300 * MAX_ENTRIES
#: bytes unpacked; the largest FMUs known carry a few GB of tables and meshes
MAX_UNPACKED = 32 * 2**30
#: bytes unpacked that are allowed at any ratio, because they do not fill a disk
HARMLESS = 256 * 2**20
#: unpacked over packed, above HARMLESS: tables of text reach 20, sparse matrices 100, a bomb of zeros 1000
MAX_RATIO = 250
#: bytes left free on the disk
RESERVE = 256 * 2**20
#: characters of a path; systems allow 4096 or fewer, and a thousand nested folders cannot be removed
MAX_PATH = 1024
#: bytes of an XML file; a million variables take some 300 MB
MAX_XML = 2**30

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 0x1
_Returned = TypeVar("_Returned")


class Archive:
    """An open .fmu or .ssp file whose entries are sound.

    The constructor raises FMUError if the file or an entry is not sound, and `read` and `extraction`
    raise it if an entry cannot be unpacked.
    """

    def __init__(self, path: Path, kind: str = "FMU") -> None:
        self.path = path
        #: "FMU" or "SSP", for messages
        self.kind = kind
        if not path.is_file():
            raise FMUError(f"there is no file {path}; give the path of an .{kind.lower()} file")
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise FMUError(f"{path} cannot be read: {error.strerror}") from error
        try:
            self._check_directory_size()
            try:
                self._zip = zipfile.ZipFile(self._file)
            except Exception as error:  # zipfile raises exceptions of many types for a broken archive
                raise FMUError(
                    f"{path} is not an {kind}: it is not a ZIP archive ({str(error)[:99]}); was it copied "
                    "completely?"
                ) from error
            self._entries = self._checked()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._zip.close()
        self._file.close()

    @property
    def names(self) -> list[str]:
        """The paths of the files."""
        return list(self._entries)

    def platforms(self) -> list[str]:
        """Return the names of the folders of binaries."""
        parts = (name.split("/") for name in self._entries)
        return sorted({p[1] for p in parts if p[0] == "binaries" and len(p) > 2})

    def read(self, name: str) -> bytes:
        """Return the contents of an XML file."""
        if name not in self._entries:
            places = [n for n in self._entries if n.endswith(f"/{name}")]
            where = (
                f"; it is in {places[0]}: pack the contents of that folder, not the folder" if places else ""
            )
            raise FMUError(f"{self.path} is not an {self.kind}: it has no {name} at its top{where}")
        entry = self._entries[name]
        if entry.file_size > MAX_XML:
            raise FMUError(f"{self.path}: {name} of {_size(entry.file_size)} is too large")
        return self._attempt(name, lambda: self._bounded(entry))

    def _bounded(self, entry: zipfile.ZipInfo) -> bytes:
        """Unpack an entry without inflating more than its declared size, whatever it contains."""
        with self._zip.open(entry) as stream:  # ZipFile.read inflates all before it cuts
            return stream.read(entry.file_size + 1)

    def extraction(self) -> Extraction:
        """Return the folder with all files unpacked; archives with the same contents share it."""
        self._file.seek(0)
        digest = hashlib.file_digest(self._file, "sha256").digest()
        with _lock:
            found = _extractions.get(digest)
            if found is None:
                found = _extractions[digest] = Extraction()
                try:
                    self._extract(found.folder)
                except BaseException:
                    found.remove()
                    del _extractions[digest]
                    raise
        return found

    def _extract(self, folder: Path) -> None:
        needed, free = sum(e.file_size for e in self._entries.values()), shutil.disk_usage(folder).free
        if needed + RESERVE > free:
            raise FMUError(
                f"{self.path} unpacks to {_size(needed)}, and {folder.parent} has {_size(free)} free; "
                "make room, or set TMPDIR to another disk"
            )
        for name, entry in self._entries.items():
            self._attempt(name, lambda entry=entry: self._zip.extract(entry, folder))  # type: ignore[misc]

    def _attempt(self, name: str, call: Callable[[], _Returned]) -> _Returned:
        try:
            return call()
        except Exception as error:  # zlib.error, BadZipFile, EOFError, OSError, struct.error, ...
            what = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise FMUError(
                f"{self.path}: {name!r} cannot be unpacked: {str(what)[:300]}; was it copied completely?"
            ) from error

    # -------------------------------------------------------------------------- checks

    def _check_directory_size(self) -> None:
        """Refuse a directory of too many entries before zipfile makes an object of each.

        Its size is at byte 12 of the end record, or at byte 40 of the ZIP64 record, which precedes it
        together with its locator (APPNOTE.TXT, 4.3.14 to 4.3.16). The search is that of zipfile.
        """
        length = self._file.seek(0, os.SEEK_END)
        self._file.seek(max(0, length - 66_000))  # the records, and a comment of 65,535 at most
        tail = self._file.read()
        plain = tail[-22:-18] == b"PK\x05\x06" and tail[-2:] == b"\0\0"
        at = len(tail) - 22 if plain else tail.rfind(b"PK\x05\x06")
        if at < 0 or len(tail) < at + 22:
            raise FMUError(
                f"{self.path} is not an {self.kind}: it is not a ZIP archive (it has no end); "
                "was it copied completely?"
            )
        (size,) = struct.unpack_from("<I", tail, at + 12)
        if at >= 76 and tail[at - 20 : at - 16] == b"PK\x06\x07":
            (size,) = struct.unpack_from("<Q", tail, at - 36)
        if size > MAX_DIRECTORY:
            raise FMUError(
                f"{self.path} has a directory of {_size(size)}, too many entries for an {self.kind} "
                f"(at most {MAX_ENTRIES:,}); check where it comes from"
            )

    def _checked(self) -> dict[str, zipfile.ZipInfo]:
        """Return the files by path; refuse entries that must not be unpacked."""
        entries = self._zip.infolist()
        if len(entries) > MAX_ENTRIES:
            raise FMUError(
                f"{self.path} has {len(entries):,} entries, too many for an {self.kind}; "
                "check where it comes from"
            )
        files: dict[str, zipfile.ZipInfo] = {}
        for entry in entries:
            fault = _fault(entry)
            if fault:
                raise FMUError(f"{self.path}: {entry.orig_filename[:200]!r} in it {fault}")
            if entry.is_dir():
                continue
            other = files.setdefault(entry.filename, entry)
            if (other.CRC, other.file_size) != (entry.CRC, entry.file_size):
                raise FMUError(
                    f"{self.path}: {entry.filename!r} is in it twice, with different contents; "
                    "pack it again from a clean folder"
                )
        total = sum(e.file_size for e in files.values())
        packed = max(self._file.seek(0, os.SEEK_END), 1)
        if total > MAX_UNPACKED or (total > HARMLESS and total > MAX_RATIO * packed):
            raise FMUError(
                f"{self.path} of {_size(packed)} unpacks to {_size(total)}, which is a ZIP bomb, "
                f"not an {self.kind}"
            )
        return files


def _fault(entry: zipfile.ZipInfo) -> str | None:
    """Return the fault of an entry of an archive, or None."""
    name = entry.orig_filename  # zipfile cuts `filename` at a NUL
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if not name or "\\" in name or "\0" in name or name.startswith("/") or ":" in name:
        return (
            "is not a path inside the FMU (empty, a slash at the start, a backslash, a colon, or NUL); "
            "pack it with forward slashes and relative paths"
        )
    if len(name) > MAX_PATH:
        return f"is a path of {len(name):,} characters, more than {MAX_PATH:,}; shorten it"
    if ".." in name.split("/"):
        return "leads out of the folder that it is unpacked to"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device, which an FMU must not have; pack the file that it points to"
    if entry.flag_bits & _ENCRYPTED:
        return "is encrypted; pack it without a password"
    if entry.compress_type not in _METHODS:
        return f"has compression method {entry.compress_type}; FMI has deflate (8) and none (0)"
    return None


def _size(n: int) -> str:
    value, unit = float(n), "bytes"
    for larger in ("kB", "MB", "GB", "TB"):
        if value < 1000.0:
            break
        value, unit = value / 1000.0, larger
    return f"{value:.3g} {unit}"


# ------------------------------------------------------------------------------ folders


class Extraction:
    """The folder of an unpacked FMU, which is removed together with this object."""

    def __init__(self) -> None:
        try:
            self.folder = Path(tempfile.mkdtemp(prefix="structcosim-"))
        except OSError as error:
            raise FMUError(f"an FMU cannot be unpacked: {error}; set TMPDIR to another folder") from error
        self.remove = weakref.finalize(self, _remove, str(self.folder), os.getpid())


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # a forked process shares the object, but does not own the folder
        shutil.rmtree(folder, ignore_errors=True)


_extractions: weakref.WeakValueDictionary[bytes, Extraction] = weakref.WeakValueDictionary()
_lock = threading.Lock()
