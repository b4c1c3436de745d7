"""A running FMU."""
