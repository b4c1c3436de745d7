"""Numerical kernels of the plants: time integration, factorisation, modal updates."""
