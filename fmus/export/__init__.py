"""From a participant to an FMU: `export` writes a file, `as_fmu` writes one to the cache and loads it."""

from .cached import as_fmu
from .description import DefaultExperiment
from .fmu import export
from .link import ExportError

__all__ = ["DefaultExperiment", "ExportError", "as_fmu", "export"]
