"""The process of an isolated FMU, seen from this process: a crash there becomes an error here.

    FMUInstance --addresses--> functions of FMI (functions.py, c/caller.c)   this process
                                  | shared memory (c/channel.h)
    the FMU's library <-------- c/host.c, isolated_host.py                   its process

The functions have the names and signatures of FMI, so that FMPy and the loop call them as
they call those of an FMU. A process serves one instance. It ends with its instance, or when this
process ends. The memory has no name, so that it is freed with the two processes. No wait has a
time limit, not even that for the start: it ends with an answer, with the process, or with Ctrl-C.
"""

from __future__ import annotations

import ctypes
import math
import mmap
import os
import signal
import subprocess
import sys
import tempfile
import uuid
import weakref
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...codegen.c_compiler import (
    LIBRARY_FLAGS,
    PLATFORMS,
    cached_library,
    complaint,
    fmi_headers,
    host,
    zig_cc,
)
from ...codegen.cache import cache_directory
from ...errors import CompilationError, FMUError
from ...loop.signals import RunSignals
from .functions import sources as generated_sources

_SOURCES = Path(__file__).parent / "c"
_HOST = Path(__file__).parent / "isolated_host.py"
_SIZE = 1 << 28  # bytes of shared memory; pages that are never touched cost nothing
_FAREWELL = 2.0  # s until the process is killed, in which the FMU's library may finish its work
_LOOK = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double, ctypes.c_double)
_EXCEPTIONS = {0xC0000005: "access violation", 0xC00000FD: "stack overflow"}  # of Windows


@lru_cache(maxsize=1)
def support_library() -> Path:
    """Return the path of the library with both ends of the channel; compile it if it is not cached.

    Raises CompilationError if it cannot be compiled, and on an unsupported platform.
    """
    if host() not in PLATFORMS:
        raise CompilationError(
            f"an FMU cannot be isolated on {host()}; omit isolated=True, or use one of {', '.join(PLATFORMS)}"
        )
    platform = PLATFORMS[host()]
    files = sorted([*_SOURCES.glob("*.[ch]"), *fmi_headers().glob("fmi[23]*.h")])
    texts = [*(p.read_text() for p in files), *generated_sources().values()]

    def build() -> bytes:
        with tempfile.TemporaryDirectory(dir=cache_directory()) as name:
            done, library = compile_support(Path(name))
            if done.returncode or not library.exists():
                raise CompilationError(
                    f"the library that isolates an FMU cannot be compiled: {complaint(done.stderr)}"
                )
            return library.read_bytes()

    return cached_library([platform.target, *LIBRARY_FLAGS, *texts], platform.suffix, build).resolve()


def compile_support(folder: Path, *flags: str) -> tuple[subprocess.CompletedProcess[str], Path]:
    """Compile the library in a folder; return the finished compiler process and the library's path."""
    platform = PLATFORMS[host()]
    for name, text in generated_sources().items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / f"isolation{platform.suffix}"
    paths = [f"-I{each}" for each in (folder, _SOURCES, fmi_headers())]
    sources = [*sorted(_SOURCES.glob("*.c")), folder / "functions.c"]
    target = ["-target", platform.target, *LIBRARY_FLAGS, *flags, *paths]
    return zig_cc([*target, *sources, "-o", library], folder), library


@lru_cache(maxsize=1)
def _support() -> Any:
    library = ctypes.CDLL(str(support_library()))
    pointer = ctypes.c_void_p
    library.function_name.restype = ctypes.c_char_p
    library.caller_open.restype = pointer
    library.caller_open.argtypes = (pointer, ctypes.c_size_t, _LOOK)
    library.caller_time.restype = ctypes.c_double
    library.caller_stop.restype = ctypes.c_bool
    for name in ("close", "time", "function", "await", "stop", "reason"):
        getattr(library, f"caller_{name}").argtypes = (pointer,)
    library.caller_reason.restype = ctypes.c_char_p
    return library


class Isolation:
    """The process of one instance of an FMU, with the FMU's library loaded.

    The next instance that FMPy makes in this thread through `support_library()` runs in it.
    Raises FMUError if the library cannot be loaded.
    """

    def __init__(self, name: str, library: Path, signals: RunSignals) -> None:
        self.name = name
        self.signals = signals
        #: how the process ended unexpectedly, or ""
        self.crash = ""
        #: whether calls are no longer possible: the process ended, or Ctrl-C came during a call
        self.is_gone = False
        self._support = _support()
        self._memory, handle, inherited = _shared_memory()
        command = [sys.executable, "-P", str(_HOST), handle, str(_SIZE), str(support_library()), str(library)]
        try:
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=inherited)
        finally:
            for file in inherited:
                os.close(file)
        self._end = weakref.finalize(self, _end, self._process)  # also for an instance that is not closed
        self._look = _LOOK(self._interrupted_or_ended)
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self._caller = self._support.caller_open(address, _SIZE, self._look)
        if self._support.caller_await(self._caller) != 0:
            reason = self.crash or self._support.caller_reason(self._caller).decode(errors="replace")
            self.close()
            self.raise_interrupted()
            raise FMUError(reason)

    def _interrupted_or_ended(self, _: int, t: float, h: float) -> int:
        """Return whether waiting for the process is over; called a few times a second."""
        try:
            if self.signals.interrupted:
                raise KeyboardInterrupt
            code = self._process.poll()
            if code is not None:
                self.crash = self._ending(code)
                self.is_gone = True
            return int(self.is_gone)
        except BaseException as exception:  # Ctrl-C, which cannot pass through C code
            self.is_gone = True
            self.signals.note(exception, self.name, t)
            return 1

    def _ending(self, code: int) -> str:
        if code < 0:
            number = signal.Signals(-code)
            how = f"crashed with {number.name} ({signal.strsignal(number)})"
        elif code in _EXCEPTIONS:
            how = f"crashed with {_EXCEPTIONS[code]} (0x{code:X})"
        else:
            how = f"ended its process with exit code {code}"
        function = self._support.function_name(self._support.caller_function(self._caller))
        time = self._support.caller_time(self._caller)
        where = f" in {function.decode()}" if function else " when its library was loaded"
        return f"{how}{where}" + ("" if math.isnan(time) else f" at t = {time:g} s")

    def raise_interrupted(self) -> None:
        """Raise KeyboardInterrupt if a call failed because of Ctrl-C."""
        if isinstance(self.signals.exception, KeyboardInterrupt):
            raise self.signals.exception

    def close(self) -> None:
        """End the process; its functions must not be called afterwards."""
        if self._support.caller_stop(self._caller):
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_FAREWELL)
        self._end()
        self._support.caller_close(self._caller)
        self._memory.close()


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


def _shared_memory() -> tuple[mmap.mmap, str, list[int]]:
    """Return the memory, its handle for the host, and the files that the host inherits."""
    if sys.platform == "win32":
        tag = f"structcosim-{uuid.uuid4()}"
        return mmap.mmap(-1, _SIZE, tagname=tag), tag, []
    if hasattr(os, "memfd_create"):
        file = os.memfd_create("structcosim")
    else:
        with tempfile.TemporaryFile(prefix="structcosim-") as nameless:
            file = os.dup(nameless.fileno())
    os.truncate(file, _SIZE)
    return mmap.mmap(file, _SIZE), str(file), [file]
