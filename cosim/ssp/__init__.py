"""Systems from SSP files, versions 1.0 and 2.0; `fmus.packaging.ssp` writes them."""

from .reader import read_package, read_ssp

__all__ = ["read_package", "read_ssp"]
