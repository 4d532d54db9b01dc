"""What a block makes of a signal of another speed, for `pidalab.simulation.realisation`: a row over slow states."""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled
from pidalab.simulation.chains import without_slow


@compiled
def _solve(matrix, right):
    """Solve matrix @ x = right in place, by elimination with row exchange; returns right."""
    n = right.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            if factor != 0:
                for j in range(k + 1, n):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return right


@compiled
def past_of(num, lead, poles, slow, A, b, row, old):
    """What the direct part and the fast partial fractions make of a slow signal: row @ H(old)."""
    m = row.size
    out = np.zeros(m)
    if slow == poles.size:
        if num.size == poles.size + 1:
            for i in range(m):
                out[i] = row[i] * (num[0] / lead)
        return out
    value = np.zeros(m, dtype=np.complex128)
    after = np.zeros(m, dtype=np.complex128)
    for coefficient in without_slow(num, lead, poles, slow, A, b):
        for j in range(m):
            after[j] = coefficient * row[j]
            for i in range(m):
                after[j] += value[i] * old[i, j]
        value, after = after, value
    matrix = np.zeros((m, m), dtype=np.complex128)
    for k in range(slow, poles.size):
        for i in range(m):
            for j in range(m):
                matrix[j, i] = old[i, j]
            matrix[i, i] -= poles[k]
        _solve(matrix, value)
    for i in range(m):
        out[i] = value[i].real / lead
    return out


@compiled
def decoupling(poles, A, b, row, old):
    """X of A X - X old = -b row, for one chain: its states less X times the old ones run on their own."""
    n, m = b.size, row.size
    X = np.zeros((n, m))
    i = 0
    while i < n:
        width = 1 if poles[i].imag == 0.0 else 2
        # link after link, since each is driven by the one before
        matrix, right = np.zeros((width * m, width * m)), np.zeros(width * m)
        for r in range(width):
            for j in range(m):
                right[r * m + j] = -b[i + r] * row[j]
                if r == 0 and i > 0:
                    right[j] -= A[i, i - 1] * X[i - 1, j]
                for q in range(width):
                    matrix[r * m + j, q * m + j] += A[i + r, i + q]
                for k in range(m):
                    matrix[r * m + j, r * m + k] -= old[k, j]
        _solve(matrix, right)
        for r in range(width):
            for j in range(m):
                X[i + r, j] = right[r * m + j]
        i += width
    return X
