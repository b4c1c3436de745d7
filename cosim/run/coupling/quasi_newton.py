"""Newton's method for w = g(w), its Jacobian kept from solve to solve and updated by Broyden.

    r(w) = g(w) - w,   J dw = -r,   J <- J + (r_new) dw^T / (dw^T dw)

g is a communication step that is repeated with other coupling values, so evaluations are
expensive and n is small: J is built by differences once, and rebuilt only when it no longer
leads to convergence.

C. G. Broyden, A class of methods for solving nonlinear simultaneous equations,
Math. Comp. 19 (1965) 577-593, doi:10.1090/S0025-5718-1965-0198670-6.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Array

_REBUILD = 6  # evaluations with a kept Jacobian before it is built again
_LIMIT = 30  # evaluations, not counting those that build the Jacobian
_DIFFERENCE = 1e-6  # of the scale of a value, or of 1 while the scale is zero


class NoConvergence(Exception):
    """The residual did not fall below the tolerance; `residual` is relative, one per value."""

    def __init__(self, residual: Array) -> None:
        super().__init__(f"relative residual {np.max(residual):.3g}")
        self.residual = residual


class QuasiNewton:
    """Solves w = g(w) for n values, repeatedly for a g that changes little.

    tolerance
        |g(w) - w| of every value, over its largest magnitude, now and in the solutions so far
    """

    def __init__(self, n: int, tolerance: float) -> None:
        self.tolerance = tolerance
        #: dr/dw; NaN before it is built
        self.jacobian: Array = np.full((n, n), np.nan)
        #: the largest magnitude of every value in the solutions so far
        self.scale: Array = np.zeros(n)
        #: evaluations so far: the cost of solving
        self.evaluations = np.zeros(1)

    def arrays(self) -> list[Array]:
        """Return the memory that a later solve depends on."""
        return [self.jacobian, self.scale, self.evaluations]

    def solve(self, g: Callable[[Array], Array], guess: Array) -> Array:
        """Return w with w = g(w), from a guess; g is evaluated there last. Raises NoConvergence."""
        w = guess.copy()
        r = self._residual(g, w)
        built = False
        for count in range(_LIMIT):
            scale = np.maximum(self.scale, np.abs(w + r))
            error = np.abs(r) / np.where(scale > 0.0, scale, 1.0)
            if (error <= self.tolerance).all():
                break
            if np.isnan(self.jacobian).any() or (count == _REBUILD and not built):
                self._build(g, w, r, scale)
                built = True
            dw = self._direction(r)
            w = w + dw
            r_new = self._residual(g, w)
            if (np.abs(dw) <= 4e-16 * np.abs(w)).all():  # as close as float64 can resolve
                break
            # r + J dw = 0 if J is exact, so r_new is the error of J dw
            self.jacobian += np.outer(r_new, dw) / (dw @ dw)
            r = r_new
        else:
            raise NoConvergence(error)
        np.maximum(self.scale, np.abs(w), out=self.scale)
        return w

    def _residual(self, g: Callable[[Array], Array], w: Array) -> Array:
        value = g(w)
        self.evaluations += 1
        return value - w

    def _direction(self, r: Array) -> Array:
        try:
            return np.asarray(np.linalg.solve(self.jacobian, -r))
        except np.linalg.LinAlgError:
            return np.asarray(np.linalg.lstsq(self.jacobian, -r, rcond=None)[0])

    def _build(self, g: Callable[[Array], Array], w: Array, r: Array, scale: Array) -> None:
        for j in range(len(w)):
            moved = w.copy()
            moved[j] += _DIFFERENCE * (scale[j] or 1.0)
            self.jacobian[:, j] = (g(moved) - moved - r) / (moved[j] - w[j])
            self.evaluations += 1
