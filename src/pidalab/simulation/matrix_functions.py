"""Fractions in s of the matrix of a loop: what a far faster block makes of a signal in the long run."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg.lapack import zgetrf, zgetrs

from pidalab._check import Array
from pidalab.statespace import Part, monic, numerator

AGES = 8  # of the states that such a block reads: each older one comes through its filter once more


def without_slow_parts(
    slow: tuple[Part, ...], first: tuple[Array, Array], second: tuple[Array, Array], fast: tuple[Part, ...]
) -> tuple[Any, Any]:
    """Return numerator and poles of two fractions in series without their slow parts.

    The division by the slow poles runs from the highest power down, where the fast terms are: no small difference is
    formed.
    """
    num = np.convolve(first[0], second[0]) / (first[1][0] * second[1][0])
    poles = np.concatenate([part.poles for part in fast])
    taken: Any = np.zeros(1)
    under: Any = np.ones(1)
    for part in slow:
        own = np.array([1.0, *monic(part.poles.tolist())[::-1]])
        taken = np.polyadd(np.convolve(taken, own), np.convolve(numerator(part), under))
        under = np.convolve(under, own)
    fast_den = np.array([1.0, *monic(poles.tolist())[::-1]])
    rest = [0.0] * (fast_den.size - 1 + under.size - num.size)
    rest += num.tolist()
    shared = np.convolve(taken, fast_den).tolist()
    for i in range(-len(shared), 0):
        rest[i] -= shared[i]
    quotient = []
    for i in range(fast_den.size):
        quotient.append(rest[i])
        for j, coefficient in enumerate(under.tolist()):
            rest[i + j] -= quotient[i] * coefficient
    return np.array(quotient), poles


def times_function(row: Array, matrix: Array, num: Array, poles: Any) -> Array:
    """Return row @ H(matrix) for a fraction H, by Horner's rule and by its poles one by one."""
    value = np.zeros(row.size, dtype=complex)
    for coefficient in num:
        value = value @ matrix + coefficient * row
    for pole in poles:
        value = np.linalg.solve(matrix.T - pole * np.eye(row.size), value)
    return value.real


def times_ring_function(
    row: Array,
    direct: Array,
    delayed: tuple[Array, Array, Array, Array],
    num: Array,
    poles: Any,
    dead_time: bool,
) -> Array:
    r"""Return (row + direct W) H(A(z)) for a fraction H, age by age: what a far faster block makes of a signal.

    As `times_function`, for the matrix :math:`\mathcal A(z) = A + B (1 - z D)^{-1} z C_v` of the loop with its past.
    """
    A, B, Cv, D = delayed
    if not dead_time:
        W = np.linalg.solve(np.eye(len(D)) - D, Cv)
        return times_function(row + direct @ W, A + B @ W, num, poles)[None]
    signal = np.vstack([row, _delayed_row(direct, Cv, D)])
    value = np.zeros(signal.shape, dtype=complex)
    for coefficient in num:
        late = np.zeros(len(D), dtype=complex)
        for age in range(AGES):
            now = value[age].copy()
            value[age] = now @ A + late @ Cv + coefficient * signal[age]
            late = late @ D + now @ B
    for pole in poles:
        factors, pivots, _ = zgetrf(A.T - pole * np.eye(len(A)))
        late = np.zeros(len(D), dtype=complex)
        for age in range(AGES):
            value[age] = zgetrs(factors, pivots, value[age] - late @ Cv)[0]
            late = late @ D + value[age] @ B
    return value.real


def _delayed_row(direct: Array, Cv: Array, D: Array) -> Array:
    """Return what direct W reads of x(t - delay), x(t - 2 delay), ..."""
    read = []
    for _ in range(AGES - 1):
        read.append(direct @ Cv)
        direct = direct @ D
    return np.array(read)
