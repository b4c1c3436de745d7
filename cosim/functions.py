"""Functions for kernels: no allocation, no Python runtime, results in the caller's memory.

They are plain Python, so that a kernel in a debugger runs the same code. A kernel may also
call any other function that keeps to the subset of Python that Numba compiles.
"""

from __future__ import annotations

import math

from .arrays import Array


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
    """y = A' x; A (n, m). Several times faster than `matvec` from about 20 rows on."""
    fill(y, 0.0)
    transposed_matvec_add(A, x, y)


def transposed_matvec_add(A: Array, x: Array, y: Array) -> None:
    """y = y + A' x; A (n, m)."""
    for j in range(A.shape[0]):
        xj = x[j]
        for i in range(A.shape[1]):
            y[i] += A[j, i] * xj


def matmul(A: Array, B: Array, C: Array) -> None:
    """C = A B; C must not share memory with A or B."""
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


def balance(A: Array, d: Array) -> None:
    """A <- D^-1 A D with rows and columns of similar size, D = diag(d) of powers of two (Osborne 1960)."""
    n = A.shape[0]
    fill(d, 1.0)
    for _ in range(10):
        for i in range(n):
            column, row = 0.0, 0.0
            for j in range(n):
                if j != i:
                    column += abs(A[j, i])
                    row += abs(A[i, j])
            factor = 1.0
            if column > 0.0 and row > 0.0:
                while column * factor * factor < 0.5 * row:
                    factor *= 2.0
                while column * factor * factor > 2.0 * row:
                    factor *= 0.5
            d[i] *= factor
            for j in range(n):
                A[i, j] /= factor
                A[j, i] *= factor


def expm(work: Array) -> None:
    """work[0] = e^work[0], by balancing, scaling, the Taylor polynomial of degree 18, and squaring.

    work (4, n, n): the matrix, and three matrices of working memory. Scaled to a norm of
    1, the remainder is below 1/19! = 8e-18. The code calls `matmul` in one place only,
    because each call costs a second of compilation.
    """
    n = work.shape[1]
    A, S, W, d = work[0], work[1], work[2], work[3, 0]
    balance(A, d)
    largest = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += abs(A[i, j])
            S[i, j] = 0.0
        S[i, i] = 1.0
        largest = max(largest, total)
    squarings, scale = 0, 1.0
    while largest * scale > 1.0:
        scale *= 0.5
        squarings += 1
    for k in range(18 + squarings):
        matmul(work[0 if k < 18 else 1], S, W)
        factor = scale / (18 - k) if k < 18 else 1.0
        for i in range(n):
            for j in range(n):
                S[i, j] = W[i, j] * factor
            if k < 18:
                S[i, i] += 1.0
    for i in range(n):
        for j in range(n):
            A[i, j] = S[i, j] * (d[i] / d[j])
