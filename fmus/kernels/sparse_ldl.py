"""Sparse L D L^T of a symmetric positive definite matrix with a fixed pattern.

    P A P^T = L D L^T,   L unit lower triangular

The ordering P and the pattern of L are found once in Python (`plan`). `factor` and `solve`
are plain loops on arrays of the caller, so they run inside a kernel. A is stored by the
columns of its upper triangle (diagonal included), already permuted. A frame of 430 degrees
of freedom has about 1,000 entries in L: a solution is then an order of magnitude cheaper
than with a dense inverse.

Source: T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM 2006, chapter 4 (the
up-looking factorisation), DOI 10.1137/1.9780898718881.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from cosim import Array


@dataclass(frozen=True)
class Plan:
    """Ordering and patterns; index arrays are float64, the only type of a storage."""

    order: NDArray[np.intp]  # order[i] = original index of permuted index i
    A_start: Array  # (n + 1) start of each column of the upper triangle
    A_row: Array  # row of each entry
    L_start: Array  # (n + 1) start of each column of L without its diagonal
    parent: Array  # (n) elimination tree, -1 at a root

    def values(self, A: Array) -> Array:
        """Return the entries of a matrix in the stored order."""
        permuted = np.asarray(A, float)[np.ix_(self.order, self.order)]
        start = self.A_start.astype(int)
        column = np.repeat(np.arange(len(self.order)), np.diff(start))
        entries: Array = permuted[self.A_row.astype(int), column]
        return entries


def plan(pattern: Array) -> Plan:
    """Return a fill-reducing order and the patterns of a symmetric matrix with these non-zero entries."""
    n = len(pattern)
    filled = np.asarray(pattern, bool) | np.eye(n, dtype=bool)
    dominant = csc_matrix(filled.astype(float) + n * np.eye(n))
    symmetric = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    factors = splu(dominant, permc_spec="MMD_AT_PLUS_A", options=symmetric)
    order = np.argsort(factors.perm_c)
    upper = csc_matrix(np.triu(filled[np.ix_(order, order)]).astype(float))
    upper.sort_indices()
    parent, counts = _elimination_tree(upper)
    start = np.concatenate(([0], np.cumsum(counts)))
    return Plan(
        order=order,
        A_start=upper.indptr.astype(float),
        A_row=upper.indices.astype(float),
        L_start=start.astype(float),
        parent=parent.astype(float),
    )


def _elimination_tree(upper: csc_matrix) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return the parent of each column, and the number of entries in each column of L."""
    n = upper.shape[0]
    parent = np.full(n, -1)
    counts = np.zeros(n, int)
    visited = np.full(n, -1)
    for j in range(n):
        visited[j] = j
        for i in upper.indices[upper.indptr[j] : upper.indptr[j + 1]]:
            while visited[i] != j:
                if parent[i] < 0:
                    parent[i] = j
                counts[i] += 1
                visited[i] = j
                i = parent[i]
    return parent, counts


def factor(
    A_start: Array,
    A_row: Array,
    A: Array,
    L_start: Array,
    parent: Array,
    level: int,
    L_row: Array,
    L: Array,
    D_inv: Array,
    row: Array,
    mark: Array,
    path: Array,
    fill: Array,
) -> int:
    """Factor A into row `level` of L and D_inv; return 0, or 1 + the pivot that is not positive.

    L_row (nnz) receives the rows of L, the same at every level. row, mark, path and
    fill (n each) are work space.
    """
    n = D_inv.shape[1]
    for j in range(n):
        mark[j] = -1.0
        row[j] = 0.0
        fill[j] = L_start[j]
    for j in range(n):
        # scatter column j; the path up the tree is the pattern of row j of L
        mark[j] = j
        top = n
        D = 0.0
        for p in range(int(A_start[j]), int(A_start[j + 1])):
            i = int(A_row[p])
            if i == j:
                D = A[p]
                continue
            row[i] = A[p]
            length = 0
            while mark[i] != j:
                path[length] = i
                length += 1
                mark[i] = j
                i = int(parent[i])
            while length > 0:
                length -= 1
                top -= 1
                path[top] = path[length]
        for t in range(top, n):
            i = int(path[t])
            y = row[i]
            row[i] = 0.0
            last = int(fill[i])
            for p in range(int(L_start[i]), last):
                row[int(L_row[p])] -= L[level, p] * y
            l_ji = y * D_inv[level, i]
            D -= l_ji * y
            L_row[last] = j
            L[level, last] = l_ji
            fill[i] += 1.0
        if not D > 0.0:
            return 1 + j
        D_inv[level, j] = 1.0 / D
    return 0


def solve(L_start: Array, L_row: Array, L: Array, D_inv: Array, level: int, b: Array) -> None:
    """Overwrite b with A^-1 b."""
    n = b.shape[0]
    for j in range(n):
        y = b[j]
        if y != 0.0:
            for p in range(int(L_start[j]), int(L_start[j + 1])):
                b[int(L_row[p])] -= L[level, p] * y
    for j in range(n - 1, -1, -1):
        y = b[j] * D_inv[level, j]
        for p in range(int(L_start[j]), int(L_start[j + 1])):
            y -= L[level, p] * b[int(L_row[p])]
        b[j] = y


def symmetric_product(A_start: Array, A_row: Array, A: Array, x: Array, y: Array) -> None:
    """Add A x to y, from the stored upper triangle."""
    for j in range(x.shape[0]):
        total = 0.0
        for p in range(int(A_start[j]), int(A_start[j + 1])):
            i = int(A_row[p])
            total += A[p] * x[i]
            if i != j:
                y[i] += A[p] * x[j]
        y[j] += total
