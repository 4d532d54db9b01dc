"""The linear system of the magnitude optimum: solved exactly, and how far its solution can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import toeplitz

from pidalab import _check
from pidalab._check import Array
from pidalab.areas import MeasuredAreas, exact, power_series as series
from pidalab.process import Process

MOST_DERIVATIVES = 16  # order m: rounding the areas leaves nothing of more gains
LOST = 1e-3  # relative error that rounding the areas may make in a gain


def areas_of(model: Process | MeasuredAreas | ArrayLike, m: int) -> list[Fraction]:
    """Return the 2m + 4 areas that order m needs, as fractions, or raise."""
    need = 2 * _check.integer("m", m, at_least=0, at_most=MOST_DERIVATIVES) + 4
    if isinstance(model, Process):
        found = exact(model, need)
    elif isinstance(getattr(model, "process", None), Process):  # its numbers would pass for areas
        raise TypeError(f"model must be a Process or areas, found {type(model).__name__}; pass its .process")
    else:
        values = model.values if isinstance(model, MeasuredAreas) else model
        found = series.fractions(_check.vector("model", values))
    if len(found) < need:
        raise ValueError(f"model must have at least 2m + 4 = {need} areas for m = {m}, found {len(found)}")
    if not found[0]:
        raise ValueError(
            "model must have a static gain A_0 other than 0, or integral action has nothing to act on"
        )
    return found[:need]


def time_scale(areas: Sequence[Fraction]) -> float:
    """Return the longest of the times |A_k/A_0|^(1/k), k = 1, 2, 3: of lags and dead time A_1/A_0.

    A zero can cancel A_1 or A_2, as in (2s + 1)/(s + 1)^2, but not all of them, unless the process has no dynamics.
    """
    return max(abs(float(area / areas[0])) ** (1 / k) for k, area in enumerate(areas[1:4], start=1)) or 1.0


def _row(areas: Sequence[Fraction], r: int, size: int) -> list[Fraction]:
    """Return row r of M, eq. (15)."""
    return [(-1) ** (c + 1) * areas[2 * r + 1 - c] if c <= 2 * r + 1 else Fraction(0) for c in range(size)]


def solved(areas: Sequence[Fraction], m: int) -> list[Fraction]:
    """Solve M K = C, eqs. (15) to (17), for areas with the filter, or raise."""
    size = m + 2
    matrix = [_row(areas, r, size) for r in range(size)]
    result = series.solve(matrix, [Fraction(-1, 2), *[Fraction(0)] * (size - 1)])
    if result is None:
        raise ValueError(
            f"the areas leave the gains for m = {m} undetermined (singular matrix): a controller of this order can "
            "cancel all poles of process and filter, and the more gain the better; take a lower m or a higher n"
        )
    return result


def sensitivity(areas: Sequence[Fraction], gains: Sequence[Fraction], steps: Sequence[Fraction]) -> Array:
    """Relative change of each gain by a step of each area, shape (m + 2, 2m + 4); inf where it is lost."""
    size = len(gains)
    scale = [gain if gain else Fraction(1) for gain in gains]
    scaled = [[value * s for value, s in zip(_row(areas, r, size), scale, strict=True)] for r in range(size)]
    largest = [max(map(abs, row)) for row in scaled]
    matrix = np.array([[float(x / top) for x in row] for row, top in zip(scaled, largest, strict=True)])
    moved = np.zeros((size, len(areas)))  # of each condition, by the step of each area
    for r in range(size):
        for c in range(min(size, 2 * r + 2)):
            k = 2 * r + 1 - c
            moved[r, k] += float((-1) ** (c + 1) * gains[c] * steps[k] / largest[r])
    try:
        return -np.linalg.solve(matrix, moved)
    except np.linalg.LinAlgError:
        return np.full(moved.shape, np.inf)


def require_digits(areas: Sequence[Fraction], gains: Sequence[Fraction]) -> None:
    """Raise if rounding the areas to double precision, each on its own, would spoil a gain."""
    m, whole = len(gains) - 2, np.abs(sensitivity(areas, gains, areas))
    error = float(np.max(whole.sum(axis=1))) * np.finfo(float).eps / 2
    if not error < LOST:
        raise ValueError(
            f"the areas leave the gains for m = {m} ill-conditioned: rounding them in the 16th digit may change a gain "
            f"by {100 * error:.2g} %, and {100 * LOST:g} % is allowed; take a lower m or a higher n"
        )


def measured_uncertainty(
    areas: Sequence[Fraction], gains: Sequence[Fraction], model: MeasuredAreas, filter_time: float, n: int
) -> Array:
    """Relative standard uncertainty of each gain from that of measured areas, which the filter mixes; first order."""
    size = len(areas)
    change = sensitivity(areas, gains, [Fraction(1)] * size)
    unit = series.lagged([Fraction(1), *[Fraction(0)] * (size - 1)], filter_time, n)
    step = change @ np.tril(toeplitz(np.array(unit, dtype=float)))
    return np.sqrt(np.einsum("ij,jk,ik->i", step, model.covariance[:size, :size], step))
