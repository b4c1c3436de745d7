"""One file a coupling algorithm."""
