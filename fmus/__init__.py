"""Structural models, plants, elements and loads, and their export as FMUs."""
