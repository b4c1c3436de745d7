"""The command line: `cosim list`, `run`, `table`, `export`, `inspect`, `doctor`."""
