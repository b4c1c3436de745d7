"""From a participant to an .fmu file: `export` writes one, `as_fmu` writes it to the cache and loads it."""

from .cached import as_fmu
from .description import DefaultExperiment
from .fmu import export
from .link import ExportError

__all__ = ["DefaultExperiment", "ExportError", "as_fmu", "export"]
