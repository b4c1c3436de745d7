"""Ground motions: reading, scaling, resampling."""

from .ground_motion import GroundMotion, el_centro, read_at2, read_columns

__all__ = ["GroundMotion", "el_centro", "read_at2", "read_columns"]
