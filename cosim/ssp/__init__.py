"""Systems as files: SSP 1.0 and 2.0 in; fmus/ssp.py writes them."""

from .reader import read_package, read_ssp

__all__ = ["read_package", "read_ssp"]
