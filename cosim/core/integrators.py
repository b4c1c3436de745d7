"""The default methods of `advance`: ode4 in substeps, and the exact linear hold.

These are functions for kernels, as in cosim/functions.py, that run another kernel of the same
participant and work in its declared working memory (participant.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..functions import assign, expm, fill, transposed_matvec, transposed_matvec_add


def calls_kernel(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Mark a function as a call of the kernel `name` of its first argument, which the compiler inserts."""

    def mark(function: Callable[..., None]) -> Callable[..., None]:
        function.kernel = name  # type: ignore[attr-defined]
        return function

    return mark


@calls_kernel("derivatives")
def derivatives_of(self: Any, t: float) -> None:
    """Run the derivatives kernel of a Continuous from another of its kernels."""
    self.derivatives(t)


def integrate_ode4(self: Any, t: float, h: float) -> None:
    """Advance the states of a Continuous by h with the classical Runge-Kutta method, inputs held."""
    substeps = 1
    if self.max_step < h:
        substeps = math.ceil(h / self.max_step - 1e-9)
    x, dx = self.state_vector, self.derivative_vector
    start, total = self.integrator_work[0], self.integrator_work[1]
    n = x.shape[0]
    dt = h / substeps
    for k in range(substeps):
        tk = t + k * dt
        derivatives_of(self, tk)
        for i in range(n):
            start[i] = x[i]
            total[i] = dx[i]
            x[i] = start[i] + 0.5 * dt * dx[i]
        derivatives_of(self, tk + 0.5 * dt)
        for i in range(n):
            total[i] += 2.0 * dx[i]
            x[i] = start[i] + 0.5 * dt * dx[i]
        derivatives_of(self, tk + 0.5 * dt)
        for i in range(n):
            total[i] += 2.0 * dx[i]
            x[i] = start[i] + dt * dx[i]
        derivatives_of(self, tk + dt)
        for i in range(n):
            x[i] = start[i] + dt / 6.0 * (total[i] + dx[i])


def linear_hold(self: Any, t: float, h: float) -> None:
    """Advance the states of a LinearContinuous by h exactly, inputs held."""
    x, u = self.state_vector, self.input_vector
    m = u.shape[0]
    if h != self.hold_step:
        linear_hold_matrices(self, t, h)
    assign(x, self.hold_x)
    assign(u, self.hold_u)
    self.hold_u[m] = 1.0
    transposed_matvec(self.hold_A, self.hold_x, x)
    transposed_matvec_add(self.hold_B, self.hold_u, x)


def linear_hold_matrices(self: Any, t: float, h: float) -> None:
    """Read A, B and c off the derivatives and compute the matrices of `linear_hold` for the step h."""
    x, u, dx = self.state_vector, self.input_vector, self.derivative_vector
    n, m = x.shape[0], u.shape[0]
    assign(x, self.hold_x)
    assign(u, self.hold_u)
    fill(x, 0.0)
    fill(u, 0.0)
    M = self.hold_work[0]
    size = n + m + 1
    for i in range(size):
        for j in range(size):
            M[i, j] = 0.0
    derivatives_of(self, t)
    for i in range(n):
        M[i, n + m] = dx[i]  # c
    for j in range(n):
        x[j] = 1.0
        derivatives_of(self, t)
        x[j] = 0.0
        for i in range(n):
            M[i, j] = dx[i] - M[i, n + m]  # A
    for j in range(m):
        u[j] = 1.0
        derivatives_of(self, t)
        u[j] = 0.0
        for i in range(n):
            M[i, n + j] = dx[i] - M[i, n + m]  # B
    for i in range(n):
        for j in range(size):
            M[i, j] *= h
    expm(self.hold_work)
    for i in range(n):
        for j in range(n):
            self.hold_A[j, i] = M[i, j]
        for j in range(m + 1):
            self.hold_B[j, i] = M[i, n + j]
    assign(self.hold_x, x)
    for j in range(m):
        u[j] = self.hold_u[j]
    self.hold_step = h
