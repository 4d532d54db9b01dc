"""Power series about s = 0 with exact rational coefficients.

The list ``[a0, a1, a2, ...]`` stands for ``a0 - a1 s + a2 s^2 - ...``. With these signs, the coefficients of lags and
dead times are positive.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from pidalab._check import Array


def fractions(values: Iterable[Any]) -> list[Fraction]:
    """Return numbers as fractions."""
    return [Fraction(value) if isinstance(value, Fraction) else Fraction(float(value)) for value in values]


def floats(series: Sequence[Fraction]) -> Array:
    """Return fractions as floats. Raise ValueError if they overflow."""
    try:
        return np.array(series, dtype=float)
    except OverflowError:
        raise ValueError("areas or gains overflow; use a longer unit of time, or lower orders") from None


def product(first: Sequence[Fraction], second: Sequence[Fraction]) -> list[Fraction]:
    """Return the product of two series, truncated to the length of the shorter one."""
    size = min(len(first), len(second))
    return [sum((first[i] * second[k - i] for i in range(k + 1)), Fraction(0)) for k in range(size)]


def quotient(numerator: Sequence[Fraction], denominator: Sequence[Fraction]) -> list[Fraction]:
    """Return the quotient of two series, truncated to the shorter length. `denominator[0]` must not be 0."""
    result: list[Fraction] = []
    for k in range(min(len(numerator), len(denominator))):
        known = sum((denominator[k - i] * result[i] for i in range(k)), Fraction(0))
        result.append((numerator[k] - known) / denominator[0])
    return result


def polynomial(descending: Iterable[Any], count: int) -> list[Fraction]:
    """Return the first `count` coefficients of a polynomial that is given in descending powers of s."""
    ascending = [*fractions(descending)[::-1], *[Fraction(0)] * count]
    return [(-1) ** k * ascending[k] for k in range(count)]


def dead_time(delay: float, count: int) -> list[Fraction]:
    """Return the series of e^(-s delay), with the coefficients delay^k / k!."""
    result = [Fraction(1)]
    for k in range(1, count):
        result.append(result[-1] * Fraction(delay) / k)
    return result


def lagged(series: Sequence[Fraction], lag: float, order: int) -> list[Fraction]:
    """Divide a series by (lag s + 1)^order (eq. (8) of vrancic2021, applied `order` times)."""
    result = list(series)
    for _ in range(order):
        for k in range(1, len(result)):
            result[k] += Fraction(lag) * result[k - 1]
    return result


def solve(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction] | None:
    """Solve a square system exactly. Return None if the matrix is singular."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    size = len(rows)
    for i in range(size):
        pivot = next((r for r in range(i, size) if rows[r][i]), None)
        if pivot is None:
            return None
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in range(size):
            if r > i and rows[r][i]:
                rows[r] = [a - rows[r][i] * b for a, b in zip(rows[r], rows[i], strict=True)]
    solution: list[Fraction] = []
    for row in reversed(rows):
        known = row[size - len(solution) : size]
        solution.insert(
            0, row[size] - sum((a * x for a, x in zip(known, solution, strict=True)), Fraction(0))
        )
    return solution
