"""Newton's method for w = g(w), its Jacobian kept from solve to solve and updated by Broyden.

    r(w) = g(w) - w,   J dw = -r,   J <- J + (r_new) dw^T / (dw^T dw)

g is a communication step that is repeated with other coupling values, so evaluations are
dear and n is small: J is built by differences once, and again only where the kept one has
become bad. C. G. Broyden, Math. Comp. 19 (1965) 577-593.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.variables import Array

_REBUILD = 6  # evaluations with a kept Jacobian before it is built anew
_LIMIT = 30  # evaluations in all, without those that build the Jacobian
_DIFFERENCE = 1e-6  # of the scale of a value; of 1 where nothing is known of it


class NoConvergence(Exception):
    """The residual did not come below the tolerance; `residual` is relative, by value."""

    def __init__(self, residual: Array) -> None:
        super().__init__(f"relative residual {np.max(residual):.3g}")
        self.residual = residual


class QuasiNewton:
    """Solves w = g(w) for n values, again and again for a g that changes little.

    tolerance
        |g(w) - w| of every value over the largest magnitude that it has or had as a solution
    """

    def __init__(self, n: int, tolerance: float) -> None:
        self.tolerance = tolerance
        #: dr/dw; not a number where it is not known yet
        self.jacobian: Array = np.full((n, n), np.nan)
        #: the largest magnitude of every value in the solutions so far
        self.scale: Array = np.zeros(n)
        #: evaluations so far: what solving costs
        self.evaluations = np.zeros(1)

    def arrays(self) -> list[Array]:
        """Return the memory that a later solve depends on."""
        return [self.jacobian, self.scale, self.evaluations]

    def solve(self, g: Callable[[Array], Array], guess: Array) -> Array:
        """Return w with w = g(w), from a guess; the last evaluation of g is at it. Raises NoConvergence."""
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
            if (np.abs(dw) <= 4e-16 * np.abs(w)).all():  # as near as numbers come
                break
            # r + J dw = 0 as far as J is right
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
