"""State-space realisations of rational functions, and their response to held and delayed inputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.roots import roots

# A dead time that differs from a multiple of the sample time h by less than ALIGNED * h counts as the multiple.
ALIGNED = 1e-9
# Poles are sorted by modulus. If the ratio of successive moduli exceeds this factor, a new partial fraction begins.
APART = 10.0
# A partial fraction with at most this number of poles is in companion form.
FEW_STATES = 12


class StateSpace(NamedTuple):
    """Realisation x' = A x + b w, y = c x + d w of a system with input w and output y."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    d: float


class Part(NamedTuple):
    """Partial fraction with poles of similar modulus: x' = A x + b w, y = c x."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    poles: Any  # (n,), sorted by modulus


def parallel(*fractions: tuple[Array, Array]) -> tuple[tuple[Part, ...], float]:
    """Split a product of rational functions into partial fractions (see `Part`) and a direct feedthrough."""
    return _parallel(*(np.ascontiguousarray(x, dtype=float).tobytes() for pair in fractions for x in pair))


@lru_cache(maxsize=256)
def _parallel(*raw: bytes) -> tuple[tuple[Part, ...], float]:
    num: Any = np.ones(1)
    lead, poles = 1.0, []
    for own_num, own_den in zip(raw[::2], raw[1::2], strict=True):
        den = np.frombuffer(own_den)
        num, lead = np.convolve(num, np.frombuffer(own_num)), lead * float(den[0])
        if den.size == 2:
            poles.append(complex(-den[1] / den[0]))
        elif den.size > 2:  # compute the poles for each function separately, which is more accurate
            poles += roots(den).tolist()
    groups: list[list[complex]] = []
    for p in sorted(poles, key=abs):
        if groups and abs(p) <= APART * abs(groups[-1][-1]):
            groups[-1].append(p)
        else:
            groups.append([p])
    parts = tuple(
        _part(num, lead, own, [p for one in groups if one is not own for p in one]) for own in groups
    )
    return parts, float(num[0] / lead) if num.size == len(poles) + 1 else 0.0


def _part(num: Array, lead: float, own: list[complex], others: list[complex]) -> Part:
    """Realise the partial fraction with the poles `own`. Time is scaled by the largest modulus of these poles."""
    n, unit = len(own), abs(own[-1]) or 1.0
    numerator: Any
    scaled = num * unit ** np.arange(len(num) - 1.0, -1.0, -1.0)
    if n <= FEW_STATES:
        # A companion form in powers of x = s/unit keeps the digits of the static gain even if a filter time is far
        # below the sample time.
        q = monic([p / unit for p in own])
        M = np.eye(n, k=-1)
        M[:, -1] = [-c for c in q]
        numerator = np.array(_divided(scaled.tolist(), q, [p / unit for p in others])) * unit ** -len(others)
    else:
        M = _chain(np.array(own) / unit)
        numerator = np.zeros(n, complex)
        for coefficient in scaled:
            numerator = M @ numerator
            numerator[0] += coefficient
        for p in others:
            numerator = np.linalg.solve(unit * M - p * np.eye(n), numerator)
    return Part(unit * M, numerator.real * unit ** (1.0 - n) / lead, np.eye(1, n, n - 1)[0], np.array(own))


def monic(poles: list[complex]) -> list[float]:
    """Return the coefficients of the monic polynomial with these poles, lowest power first, without the leading 1."""
    q: list[complex] = []
    for p in poles:
        q = [low - p * high for low, high in zip([0.0, *q], [*q, 1.0], strict=True)]
    return [c.real for c in q]


def _divided(num: list[float], q: list[float], poles: list[complex]) -> list[complex]:
    """Divide num by the product of x - p over all `poles`, modulo q (see `monic`).

    `num` is in descending powers, and the result in ascending powers.
    """
    v: list[complex] = [0.0] * len(q)
    for coefficient in num:
        top = v[-1]
        v = [low - c * top for low, c in zip([coefficient, *v[:-1]], q, strict=True)]
    for p in poles:
        # Solve (x - p) w = v + top * q for the polynomial w and the number top. Start from the highest power if
        # |p| <= 1, and otherwise from the lowest power, so that rounding errors do not grow.
        above, below = 0j, 1 + 0j
        for numerator, denominator in zip(v[::-1], q[::-1], strict=True):
            above, below = above * p + numerator, below * p + denominator
        top = -above / below
        remainder = [c + top * d for c, d in zip(v, q, strict=True)]
        w = [top]
        if abs(p) <= 1.0:
            for c in remainder[:0:-1]:
                w.append(c + p * w[-1])
            v = w[::-1]
        else:
            last = 0j
            v = []
            for c in remainder[:-1]:
                last = (last - c) / p
                v.append(last)
            v.append(top)
    return v


def _chain(poles: Any) -> Array:
    """Return the matrix of multiplication by x, modulo the polynomial of the poles.

    The matrix acts on the coefficients of 1, x - p_1, (x - p_1)(x - p_2), .... If p_i and p_{i+1} are a complex pair, a
    polynomial whose last factor would be x - p_i has the factor x - Re p_i instead. In powers of x, polynomials of high
    degree would lose digits.
    """
    M = np.diag(poles.real) + np.eye(poles.size, k=-1)
    for i in np.flatnonzero(poles.imag > 0):
        M[i, i + 1] = -(poles[i].imag ** 2)
    return M


def numerator(part: Part) -> Any:
    """Return the numerator of a part in descending powers. The denominator is the monic polynomial of its poles."""
    # The numerator is a sum of polynomials with the coefficients b[i]. `now` is the polynomial that belongs to b[i],
    # and `before` the polynomial that belongs to b[i - 1].
    before, now, total = np.zeros(1), np.ones(1), np.zeros(1)
    for i in range(part.b.size):
        total = np.polyadd(total, part.b[i] * now)
        if i + 1 < part.b.size:
            after = np.convolve(now, [1.0, -part.A[i, i]])
            if i:
                after = np.polysub(after, part.A[i - 1, i] * before)
            before, now = now, after / part.A[i + 1, i]
    return total * np.prod(np.diag(part.A, -1))


def _side_by_side(parts: Sequence[Part], moves: Sequence[tuple[Array, Array]], direct: float) -> StateSpace:
    """Assemble parts in parallel, given the state matrix and input vector of each part."""
    A = np.zeros((sum(part.b.size for part in parts),) * 2)
    at = 0
    for block, _ in moves:
        A[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    b, c = (np.concatenate([np.zeros(0), *x]) for x in ([b for _, b in moves], [part.c for part in parts]))
    return StateSpace(A, b, c, direct)


def realise(num: Array, den: Array) -> StateSpace:
    """Realise a proper rational function."""
    parts, direct = parallel((num, den))
    return _side_by_side(parts, [(part.A, part.b) for part in parts], direct)


def discretise(num: Array, den: Array, h: float) -> StateSpace:
    """Discretise a proper rational function for an input that is held for a time h."""
    parts, direct = parallel((num, den))
    return _side_by_side(parts, [held(part.A, part.b, h) for part in parts], direct)


class Piece(NamedTuple):
    """Section of a sample interval in which a held and delayed input is constant."""

    time: float
    lag_samples: int  # the input from this many samples ago acts
    offset: float  # time for which this input acted before the piece begins


def pieces(delay: float, h: float) -> list[Piece]:
    """Return the one or two pieces of a sample interval. In the first of two pieces the older input acts."""
    samples = delay / h
    samples_passed = math.floor(samples + ALIGNED)
    part = h * (samples - samples_passed)
    if part < h * ALIGNED:
        return [Piece(h, samples_passed, 0.0)]
    return [Piece(part, samples_passed + 1, h - part), Piece(h - part, samples_passed, 0.0)]


def held(A: Array, b: Array, duration: float) -> tuple[Array, Array]:
    """Return (phi, gamma) with x(t + duration) = phi x(t) + gamma w for a held input w."""
    from scipy.linalg import expm, matrix_balance

    n = b.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = A, b
    # Rows of a fast and a slow pole differ by powers of ten. Without balancing, small rows would lose digits.
    balanced, (scale, _) = matrix_balance(augmented, permute=False, separate=True)
    transition = expm(balanced * duration) * scale[:, None] / scale
    phi, gamma = transition[:n, :n], transition[:n, n]
    if n and np.min(np.abs(np.linalg.eigvals(A))) * duration > 1.0:
        # Every time constant is shorter than the duration, so the static gain dominates. The form below keeps the
        # digits of the gain.
        gamma = np.linalg.solve(A, phi @ b - b)
    return phi, gamma
