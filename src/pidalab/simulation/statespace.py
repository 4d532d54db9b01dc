"""State-space form of a rational function, and what a held input makes of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm, matrix_balance

from pidalab._check import Array
from pidalab.simulation.realisation import partial_fractions


class StateSpace(NamedTuple):
    """Realisation x' = A x + b w, y = c x + d w."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    d: float


def _parallel(num: Array, den: Array) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...], float]:
    """Split a proper rational function into parallel blocks (all A, b, c) by speed of the poles, and a direct part."""
    parts, direct = partial_fractions(num, den)
    A, b, c = zip(*parts, strict=True)
    return A, b, c, direct


def realise(num: Array, den: Array) -> StateSpace:
    """Realise a proper rational function."""
    A, b, c, direct = _parallel(num, den)
    return StateSpace(block_diag(*A), np.concatenate(b), np.concatenate(c), direct)


def discretise(num: Array, den: Array, h: float) -> StateSpace:
    """Discretise a proper rational function for an input that is held for h at a time."""
    A, b, c, direct = _parallel(num, den)
    phi, gamma = zip(*(held(*block, h) for block in zip(A, b, strict=True)), strict=True)
    return StateSpace(block_diag(*phi), np.concatenate(gamma), np.concatenate(c), direct)


def held(A: Array, b: Array, duration: float) -> tuple[Array, Array]:
    """Return (phi, gamma) with x(t + duration) = phi x(t) + gamma w for an input w that is held."""
    n = b.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = A, b
    balanced, (scale, _) = matrix_balance(augmented, permute=False, separate=True)
    transition = expm(balanced * duration) * scale[:, None] / scale
    phi, gamma = transition[:n, :n], transition[:n, n]
    if n and np.min(np.abs(np.linalg.eigvals(A))) * duration > 1.0:
        # Of a fast filter only the static gain is left after a while, and this form of it keeps its digits.
        gamma = np.linalg.solve(A, phi @ b - b)
    return phi, gamma
