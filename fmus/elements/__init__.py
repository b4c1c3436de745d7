"""Nonlinear elements of structures: one file for each force law."""
