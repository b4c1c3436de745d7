"""Systems as files: SSP packages and FMU containers."""
