"""Structural plants, and the way from a participant to an .fmu file."""
