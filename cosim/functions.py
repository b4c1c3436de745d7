"""Functions for kernels: no allocation, no Python runtime, results in memory of the caller.

Plain Python, so a kernel that is debugged interpreted runs the very same code. Any
function of a user's own that keeps to Numba's subset may be called from a kernel too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .variables import Array


def sign(x: float) -> float:
    """Return -1, 0 or 1."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return 0.0


def clip(x: float, low: float, high: float) -> float:
    """Return x limited to [low, high]."""
    return min(max(x, low), high)


def fill(x: Array, value: float) -> None:
    """x = value, for a vector."""
    for i in range(x.shape[0]):
        x[i] = value


def assign(x: Array, y: Array) -> None:
    """y = x, for vectors."""
    for i in range(x.shape[0]):
        y[i] = x[i]


def dot(x: Array, y: Array) -> float:
    """Return x' y."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * y[i]
    return total


def norm(x: Array) -> float:
    """Return the Euclidean norm of a vector."""
    return math.sqrt(dot(x, x))


def matvec(A: Array, x: Array, y: Array) -> None:
    """y = A x; A (m, n)."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        y[i] = total


def matvec_add(A: Array, x: Array, y: Array) -> None:
    """y = y + A x; A (m, n)."""
    for i in range(A.shape[0]):
        total = y[i]
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        y[i] = total


def transposed_matvec(A: Array, x: Array, y: Array) -> None:
    """y = A' x; A (n, m). From about 20 rows on several times faster than `matvec`."""
    fill(y, 0.0)
    transposed_matvec_add(A, x, y)


def transposed_matvec_add(A: Array, x: Array, y: Array) -> None:
    """y = y + A' x; A (n, m)."""
    for j in range(A.shape[0]):
        xj = x[j]
        for i in range(A.shape[1]):
            y[i] += A[j, i] * xj


def matmul(A: Array, B: Array, C: Array) -> None:
    """C = A B; C is none of A, B."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            C[i, j] = 0.0
        for k in range(A.shape[1]):
            a = A[i, k]
            for j in range(B.shape[1]):
                C[i, j] += a * B[k, j]


def solve(A: Array, B: Array) -> None:
    """Solve A X = B by Gaussian elimination with partial pivoting; X is left in B, A is overwritten.

    A (n, n), B (n, m). A singular A leaves infinities or NaN in B.
    """
    n = A.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(B.shape[1]):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(B.shape[1]):
                    B[i, j] -= factor * B[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(B.shape[1]):
            total = B[k, j]
            for i in range(k + 1, n):
                total -= A[k, i] * B[i, j]
            B[k, j] = total / A[k, k]


def expm(work: Array) -> None:
    """work[0] = e^work[0], by scaling, the [13/13] Pade approximant and squaring (Higham 2005).

    work (7, n, n): the matrix, and six matrices of working memory.
    """
    n = work.shape[1]
    A, A2, A4, A6, U, V, W = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    largest = 0.0
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += abs(A[i, j])
        largest = max(largest, total)
    squarings = 0
    while largest > 5.371920351148152:  # theta_13: the approximant is exact to double precision below it
        largest *= 0.5
        squarings += 1
    scale = 0.5**squarings
    for i in range(n):
        for j in range(n):
            A[i, j] *= scale
    matmul(A, A, A2)
    matmul(A2, A2, A4)
    matmul(A2, A4, A6)
    for i in range(n):
        for j in range(n):
            W[i, j] = A6[i, j] + 16380.0 * A4[i, j] + 40840800.0 * A2[i, j]
    matmul(A6, W, V)
    for i in range(n):
        for j in range(n):
            V[i, j] += 33522128640.0 * A6[i, j] + 10559470521600.0 * A4[i, j] + 1187353796428800.0 * A2[i, j]
        V[i, i] += 32382376266240000.0
    matmul(A, V, U)
    for i in range(n):
        for j in range(n):
            W[i, j] = 182.0 * A6[i, j] + 960960.0 * A4[i, j] + 1323241920.0 * A2[i, j]
    matmul(A6, W, V)
    for i in range(n):
        for j in range(n):
            V[i, j] += (
                670442572800.0 * A6[i, j] + 129060195264000.0 * A4[i, j] + 7771770303897600.0 * A2[i, j]
            )
        V[i, i] += 64764752532480000.0
    for i in range(n):
        for j in range(n):
            W[i, j] = V[i, j] - U[i, j]
            A[i, j] = V[i, j] + U[i, j]
    solve(W, A)
    for _ in range(squarings):
        matmul(A, A, W)
        for i in range(n):
            for j in range(n):
                A[i, j] = W[i, j]


def calls_kernel(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Mark a function that stands for the kernel `name` of its first argument; the compiler calls that."""

    def mark(function: Callable[..., None]) -> Callable[..., None]:
        function.kernel = name  # type: ignore[attr-defined]
        return function

    return mark


@calls_kernel("derivatives")
def derivatives_of(self: Any, t: float) -> None:
    """Run the derivatives kernel of a Continuous, from within another of its kernels."""
    self.derivatives(t)


def integrate_ode4(self: Any, t: float, h: float) -> None:
    """Carry the states of a Continuous over h by the classical Runge-Kutta method, inputs held."""
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
    """Carry the states of a LinearContinuous over h exactly, inputs held."""
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
    """Read A, B and c off the derivatives and compute what `linear_hold` needs for the step h."""
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
