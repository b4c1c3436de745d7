"""Isolation: an FMU in a process of its own."""
