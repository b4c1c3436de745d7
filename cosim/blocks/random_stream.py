"""Random numbers for kernels: L'Ecuyer's combined generator MRG32k3a and its streams.

    p_k = (1403580 p_{k-2} - 810728 p_{k-3}) mod m1,   m1 = 2^32 - 209
    q_k = (527612 q_{k-1} - 1370589 q_{k-3}) mod m2,   m2 = 2^32 - 22853
    U_k = ((p_k - q_k) mod m1) / (m1 + 1), with m1 in place of a remainder of 0; 0 < U_k < 1

Every product is below 2^53, so float64 arithmetic is exact, and an interpreted, compiled or
exported kernel gives the same bits (P. L'Ecuyer, "Good parameters and implementations for
combined multiple recursive random number generators", Operations Research 47, 1999, 159-164,
doi:10.1287/opre.47.1.159).

The generator starts at the state (12345, ..., 12345). Seed number `seed` begins 2^127 `seed`
numbers later, and stream i of a seed 2^76 i numbers after that, as the streams and substreams
of P. L'Ecuyer, R. Simard, E. J. Chen and W. D. Kelton, "An object-oriented random-number package
with many long streams and substreams", Operations Research 50, 2002, 1073-1075,
doi:10.1287/opre.50.6.1073.358. Two seeds, and two streams of a seed, never share a number in
any run that can be finished.

Normal numbers follow from two uniform numbers each (Box and Muller):

    N = sqrt(-2 ln U_1) cos(2 pi U_2)
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array

M1 = 4294967087.0
M2 = 4294944443.0
MODULI = np.array([M1, M2])
#: for m1 and m2: the matrix that carries the state on by one number
_STEP = np.array(
    [[[0, 1, 0], [0, 0, 1], [-810728, 1403580, 0]], [[0, 1, 0], [0, 0, 1], [-1370589, 0, 527612]]],
    dtype=object,
)


def _jump(doublings: int) -> Array:
    """Return, for m1 and m2, the matrix that carries the state on by 2^doublings numbers; (2, 3, 3)."""
    A = _STEP
    for _ in range(doublings):
        A = A @ A % np.array([int(M1), int(M2)], dtype=object)[:, None, None]
    return A.astype(np.float64)


SEED_JUMP, STREAM_JUMP = _jump(127), _jump(76)


def remainder(v: float, m: float) -> float:
    """Return v mod m in [0, m), exact for whole numbers |v| < 2^53 - 2^32.

    The quotient is a whole number or at least 1/m > 2^-32 away from one; below 2^21 it
    is rounded by at most 2^-33, so never across a whole number.
    """
    return v - math.floor(v / m) * m


def multiply_add(a: float, b: float, c: float, m: float) -> float:
    """Return (a b + c) mod m, exact for whole numbers in [0, 2^32): a in two parts of 17 bits."""
    high = math.floor(a / 131072.0)
    low = a - high * 131072.0
    return remainder(remainder(high * b, m) * 131072.0 + low * b + c, m)


def advance_state(work: Array, x: Array, m: float) -> None:
    """x = A x mod m, A = work[0]; x (3,), work (3, 3, 3)."""
    for i in range(3):
        work[2, 0, i] = x[i]
    for i in range(3):
        total = 0.0
        for j in range(3):
            total = multiply_add(work[0, i, j], work[2, 0, j], total, m)
        x[i] = total


def advance_state_by_power(work: Array, power: float, x: Array, m: float) -> None:
    """x = A^power x mod m by repeated squaring of A = work[0]."""
    while power >= 1.0:
        half = math.floor(power / 2.0) * 1.0
        if power - 2.0 * half == 1.0:
            advance_state(work, x, m)
        power = half
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total = multiply_add(work[0, i, k], work[0, k, j], total, m)
                work[1, i, j] = total
        for i in range(3):
            for j in range(3):
                work[0, i, j] = work[1, i, j]


def seed_streams(seed: float, streams: Array, work: Array) -> None:
    """Place every row of streams (n, 6) at the start of its stream; work (3, 3, 3).

    Loops stand in place of `assign`, because each further function and kind of array costs a
    third of a second of compilation.
    """
    for part in range(2):
        first = 3 * part
        for i in range(3):
            streams[0, first + i] = 12345.0
            for j in range(3):
                work[0, i, j] = SEED_JUMP[part, i, j]
        advance_state_by_power(work, seed, streams[0, first : first + 3], MODULI[part])
        for i in range(3):
            for j in range(3):
                work[0, i, j] = STREAM_JUMP[part, i, j]
        for i in range(1, streams.shape[0]):
            for j in range(3):
                streams[i, first + j] = streams[i - 1, first + j]
            advance_state(work, streams[i, first : first + 3], MODULI[part])


def uniform(state: Array) -> float:
    """Return the next number of a stream, in (0, 1); state (6,) is p_{k-3..k-1}, q_{k-3..k-1}."""
    p = remainder(1403580.0 * state[1] - 810728.0 * state[0], M1)
    state[0], state[1], state[2] = state[1], state[2], p
    q = remainder(527612.0 * state[5] - 1370589.0 * state[3], M2)
    state[3], state[4], state[5] = state[4], state[5], q
    difference = p - q
    if difference <= 0.0:
        difference += M1
    return difference * 2.328306549295727688e-10  # 1 / (m1 + 1)


def normal(state: Array) -> float:
    """Return the next standard normal number of a stream."""
    radius = math.sqrt(-2.0 * math.log(uniform(state)))
    return radius * math.cos(2.0 * math.pi * uniform(state))
