"""State-space form of a rational function, and what an input makes of it that is held, and delayed."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm, matrix_balance

from pidalab._check import Array
from pidalab.roots import roots

ALIGNED = (
    1e-9  # share of a sample by which a dead time may miss a multiple and still be taken as one: rounding
)
GAP = 10.0  # poles whose speeds differ by more than this factor go to different blocks


class StateSpace(NamedTuple):
    """Realisation x' = A x + b w, y = c x + d w."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    d: float


def _parallel(
    num: Array, den: Array
) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...], float]:
    """Split a proper rational function into parallel blocks (all A, b, c) by speed of the poles, and a direct part."""
    poles = roots(den)
    speeds = np.abs(poles)
    group = np.searchsorted([np.sqrt(a * b) for a, b in pairwise(speeds) if b > GAP * a], speeds)
    parts = [
        _fraction(num, den[0], poles[group == g], poles[group != g]) for g in range(max(group, default=0) + 1)
    ]
    A, b, c = zip(*parts, strict=True)
    return A, b, c, float(num[0] / den[0]) if len(num) == len(den) else 0.0


def _fraction(num: Array, lead: float, own: Array, others: Array) -> tuple[Array, Array, Array]:
    """Realise the partial fraction over some poles as (A, b, c), in companion form in their own unit of time.

    Over powers of s the static gain keeps its digits, also behind a filter much faster than a sample.
    """
    n = own.size
    unit = np.max(np.abs(own), initial=0.0) or 1.0
    M = np.eye(n, k=-1)  # multiplication by x = s/unit, modulo the denominator
    M[:, -1:] = -np.atleast_1d(np.poly(own / unit)).real[:0:-1, None]
    numerator = np.zeros(n, dtype=complex)  # ascending powers of x
    for coefficient in num * unit ** np.arange(len(num) - 1.0, -1.0, -1.0):
        numerator = M @ numerator
        numerator[:1] += coefficient
    for p in others:
        numerator = np.linalg.solve(unit * M - p * np.eye(n), numerator)
    return unit * M, numerator.real * unit ** (1.0 - n) / lead, np.eye(1, n, n - 1)[0]


def realise(num: Array, den: Array) -> StateSpace:
    """Realise a proper rational function."""
    A, b, c, direct = _parallel(num, den)
    return StateSpace(block_diag(*A), np.concatenate(b), np.concatenate(c), direct)


def discretise(num: Array, den: Array, h: float) -> StateSpace:
    """Discretise a proper rational function for an input that is held for h at a time."""
    A, b, c, direct = _parallel(num, den)
    phi, gamma = zip(*(held(*block, h) for block in zip(A, b, strict=True)), strict=True)
    return StateSpace(block_diag(*phi), np.concatenate(gamma), np.concatenate(c), direct)


class Piece(NamedTuple):
    """A part of a sample interval in which a held, delayed input is constant."""

    time: float
    ago: int  # how many samples ago the input was set
    since: float  # how long after a pulse it begins


def pieces(delay: float, h: float) -> list[Piece]:
    """Return the one or two pieces of a sample: until the odd part of the dead time is over, an older input acts."""
    samples = delay / h
    whole = math.floor(samples + ALIGNED)
    part = h * (samples - whole)
    if part < h * ALIGNED:
        return [Piece(h, whole, 0.0)]
    return [Piece(part, whole + 1, h - part), Piece(h - part, whole, 0.0)]


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
