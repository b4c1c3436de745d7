"""Structural models: frames, OpenSees models."""
