"""Import of the tools that results are compared with: ecos (C++) and OpenSees.

Their wheels need a shared library that the loader does not find on a bare machine, although
another wheel contains it: `tbb` for ecospy, `openseespylinux` for openseespy. Loading that
file first, with its symbols visible to all, is enough; a library of the system works as well.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
from importlib.metadata import PackageNotFoundError, files
from types import ModuleType

from cosim import CosimError


def ecospy() -> ModuleType:
    """Import ecospy, the Python interface of ecos."""
    return _with_library("ecospy", "libtbb.so.12", "tbb", "pip install ecospy tbb")


def opensees() -> ModuleType:
    """Import openseespy.opensees, OpenSees as a module."""
    return _with_library("openseespy.opensees", "libblas.so.3", "openseespylinux", "pip install openseespy")


def _with_library(module: str, library: str, distribution: str, remedy: str) -> ModuleType:
    """Import a module after the library that it needs, taken from the files of a distribution."""
    try:
        if module not in sys.modules:
            for file in files(distribution) or []:
                if file.name == library:
                    ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)
    except (PackageNotFoundError, OSError):
        pass  # the system may have the library
    try:
        return importlib.import_module(module)
    except (ImportError, OSError, RuntimeError) as error:  # openseespy raises RuntimeError
        raise CosimError(f"{module} cannot be imported ({error}); install it with: {remedy}") from error
