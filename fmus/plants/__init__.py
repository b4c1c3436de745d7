"""Structural plants: blocks of equations that are exported as FMUs."""
