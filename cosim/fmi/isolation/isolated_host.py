"""The host of an isolated FMU: the process that loads its library and makes the calls.

    python isolated_host.py MEMORY SIZE SUPPORT LIBRARY

The calls come through shared memory. The host uses the standard library alone, so that it starts
within hundredths of a second; it is run as a file because the package would load NumPy.
isolation.py starts and ends it.
"""

import ctypes
import mmap
import os
import signal
import sys
import threading
from contextlib import chdir
from pathlib import Path


def end_with_parent() -> None:
    """End this process when the other end of standard input closes, because the parent has ended."""
    lifeline = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)  # the standard input of the FMU
    os.close(nothing)

    def wait() -> None:
        os.read(lifeline, 1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def main(handle: str, size: int, support_path: str, library: Path) -> None:
    """Serve one instance of an FMU."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both processes; the parent handles it
    end_with_parent()
    if sys.platform == "win32":
        memory = mmap.mmap(-1, size, tagname=handle)
    else:
        memory = mmap.mmap(int(handle), size)
    address = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    support = ctypes.CDLL(support_path)
    support.function_name.restype = ctypes.c_char_p
    support.host_ready.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p)
    try:
        with chdir(library.parent):  # as FMPy does
            fmu = ctypes.CDLL(str(library))
    except OSError as error:
        support.host_ready(address, size, str(error).encode())
        return
    names = iter(lambda: support.function_name(len(addresses)), None)
    addresses: list[int | None] = []
    for name in names:
        function = getattr(fmu, name.decode(), None)
        addresses.append(ctypes.cast(function, ctypes.c_void_p).value if function else None)
    support.host_ready(address, size, None)
    support.host_serve((ctypes.c_void_p * len(addresses))(*addresses))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3], Path(sys.argv[4]))
