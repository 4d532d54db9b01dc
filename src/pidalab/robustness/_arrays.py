"""Crossovers and peaks of a loop along the frequency axis, in array operations: for z, and without numba.

The grid, logarithmic and denser around lightly damped roots, is that of all loops. The magnitude of L is smooth on it,
but the dead time turns the phase without end. So its steps are divided further where the dead time turns the phase
quickly *and* L, or the peak that is sought, is large enough for it to matter. What lies between two points is left to
SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq, elementwise, minimize_scalar

from pidalab._check import Array
from pidalab.roots import succeeded

PER_DECADE = 120  # points of the logarithmic grid
MOST_POINTS = 2_000_000  # along the axis: more would fill the memory
# rad by which the dead time turns the phase between two points; the latter for crossovers
FINE_STEP, COARSE_STEP = 0.25, 1.0
# cosine of the angle to the positive axis below which the negative one may be crossed
NEAR_POSITIVE_AXIS = 0.5
REAL = 1e-12  # imaginary part, relative to the modulus, that is rounding; and logarithm of |L|
TOUCHING = 0.1  # logarithm of |L| at an extremum, below which it may cross 0 unseen
DETOUR = 1.5  # times that the way of L between two points may be longer than the straight line
NO_HIGHER = 1e-11  # share by which a peak between two points must exceed the best to be sought
TINIEST = 1e-300  # |L| that is not 0
HUGE = 1e9  # |L| beyond which a jump of the phase is that at a pole on the axis
ONE_BY_ONE = 20  # crossovers or peaks that are found one by one
BRACKET_SHARE = 1e-8  # of the distance of two points, to which a peak between them is found
PIECE = 64.0  # points of a step that are passed over, or followed, together
FOLLOWED_AT_ONCE = 60  # steps of the grid, those first in which a peak may be highest
# what has a peak
SENSITIVITY, COMPLEMENTARY, DIFFERENCE = 0, 1, 2
# distances of points from a lightly damped root, in units of its damping
BESIDE = np.outer([-1.0, 1.0], np.logspace(-2.0, 3.0, 40)).ravel()

At = Callable[[Any], tuple[Any, Any]]  # numerator and denominator of L at frequencies


class TooManyTurns(ArithmeticError):
    """The dead time turns the phase too often to be followed point by point."""


def too_many(turn: float, points: float = MOST_POINTS) -> TooManyTurns:
    """Return the error for so many points at which the dead time turns the phase by `turn`."""
    return TooManyTurns(
        f"the dead time turns the phase {points * turn / (2 * np.pi):.2g} times where it matters: too often to follow; "
        "is the loop far from stable, or the sample much shorter than the dead time?"
    )


def frequencies(roots: Any, delay: float, end: float = math.inf) -> Array:
    """Every decade in which something happens, four more on both sides up to the end, and what is narrower."""
    speeds = [speed for speed in np.abs(roots).tolist() if speed > 0] + ([1 / delay] if delay else [])
    low, high = min(speeds, default=1.0), max(speeds, default=1.0)
    low, high = 1e-4 * min(low, end), min(1e4 * high, end)
    count = int(PER_DECADE * math.log10(high / low)) + 1
    w = np.exp(np.arange(count) * ((math.log(high) - math.log(low)) / (count - 1)) + math.log(low))
    w[0], w[-1] = low, high
    light = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.2 * np.abs(roots))]
    if not light.size:
        return w
    width = np.maximum(np.abs(light.real), 1e-9 * np.abs(light))
    close = (light.imag[:, None] + np.outer(width, BESIDE)).ravel()
    return np.unique(np.append(w, close[(close > low) & (close < high)]))


def fraction(s: Any, of: Any) -> tuple[Any, Any]:
    """Numerator and denominator of L, factor by factor over |s| plus a speed: their products stay in range."""
    gain, zeros, poles, speeds, delay = of
    size, num, den = abs(s), gain * np.exp(-s * delay), 1.0 + 0.0 * s
    for i, (pole, speed) in enumerate(zip(poles.tolist(), speeds.tolist(), strict=True)):
        scale = 1.0 / (size + speed)
        den = den * ((s - pole) * scale)
        num = num * ((s - complex(zeros[i])) * scale if i < zeros.size else scale)
    return num, den


def divided(w: Array, steps: Any, delay: float, turn: float = FINE_STEP) -> Array:
    """Divide some steps between frequencies until the dead time turns the phase by `turn` at most."""
    if not delay:
        return w
    parts = np.where(steps, np.maximum(np.ceil(np.diff(w) * delay / turn), 1.0), 1.0)
    if not parts.sum() <= MOST_POINTS:
        raise too_many(turn, parts.sum())
    parts = parts.astype(np.intp)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(np.repeat(w[:-1], parts) + within * np.repeat(np.diff(w) / parts, parts), w[-1])


def most_between(*neighbours: Any) -> Any:
    """Largest value of a smooth function between points: as much more as it changes from point to point."""
    low, high = np.fmin.reduce(neighbours), np.fmax.reduce(neighbours)
    return high * np.where(low > 0, high / low, 1.0)


def least_between(*neighbours: Any) -> Any:
    """Smallest value of a smooth function between points: as much less as it changes from point to point."""
    low, high = np.fmin.reduce(neighbours), np.fmax.reduce(neighbours)
    return low * np.where(high > 0, low / high, 1.0)


def zeros(function: Callable[[Any], Any], w: Array, values: Array, allowed: Any = True) -> Array:
    """Zeros of a function between points of allowed steps at which its values have different signs."""
    i = np.flatnonzero((values[:-1] * values[1:] < 0) & allowed)
    if i.size > ONE_BY_ONE:
        many = elementwise.find_root(function, (w[i], w[i + 1]))
        if not np.all(many.success):
            raise ArithmeticError(f"{np.sum(~many.success)} of {i.size} crossovers were not found")
        return np.asarray(many.x)
    brackets = zip(w[i].tolist(), w[i + 1].tolist(), strict=True)
    return np.array([brentq(function, a, b, xtol=1e-15 * b, rtol=1e-14) for a, b in brackets])


def lowest(function: Callable[[Any], Any], w: Array, i: Any) -> tuple[Array, Array]:
    """Where a function is least between the neighbours of some points, and its values there."""
    below, at, above = w[i - 1] - w[i], w[i], w[i + 1] - w[i]
    away, least, rest = np.zeros(i.size), np.zeros(i.size), np.arange(i.size)
    if i.size > ONE_BY_ONE:
        many = elementwise.find_minimum(lambda x, own: function(own + x), (below, away, above), args=(at,))
        away, least, rest = many.x, many.f_x, np.flatnonzero(~many.success)
    for k in rest:
        found = minimize_scalar(
            lambda x, own=float(at[k]): function(own + x),
            bounds=(below[k], above[k]),
            method="bounded",
            options={"xatol": BRACKET_SHARE * (above[k] - below[k])},
        )
        away[k], least[k] = succeeded(found, "a peak").x, found.fun
    return at + away, least


def gain_crossings(at: At, w: Array, num: Any, den: Any) -> tuple[Array, Array]:
    """Frequencies where |L| = 1, ascending, and the extrema beside 1 between which no two points lie."""

    def logarithm(w: Any, sign: float = 1.0) -> Any:
        num, den = at(w)
        return sign * np.log(abs(num / den))

    with np.errstate(all="ignore"):
        value = np.log(np.abs(num) / np.abs(den))
        # a gain of 1 all along has no crossover
        seen = np.isfinite(value) & (np.abs(value) >= REAL)
        w, value = w[seen], value[seen]
        touched = [np.zeros(0)]
        for sign in (-1.0, 1.0):
            v = sign * value
            low = 1 + np.flatnonzero(
                (v[1:-1] <= v[:-2]) & (v[1:-1] < v[2:]) & (v[1:-1] > 0) & (v[1:-1] < TOUCHING)
            )
            where, least = lowest(partial(logarithm, sign=sign), w, low)
            touched.append(where)
            beyond = least < -REAL
            w, value = np.append(w, where[beyond]), np.append(value, sign * least[beyond])
            order = np.argsort(w)
            w, value = w[order], value[order]
        return zeros(logarithm, w, value), np.concatenate(touched)


def phase_crossings(at: At, w: Array, num: Any, den: Any, floor: float, every: bool, delay: float) -> Array:
    """Frequencies where L is real and negative; followed, and kept, where |L| is at least `floor`, or everywhere."""

    def imaginary(w: Any) -> Any:
        num, den = at(w)
        return (num * den.conjugate()).imag

    with np.errstate(all="ignore"):
        if delay:
            size = np.abs(num) / np.abs(den)
            w = divided(w, np.fmax(size[:-1], size[1:]) >= floor, delay, COARSE_STEP)
            num, den = at(w)
        product = num * np.conj(den)
        seen = np.abs(product.imag) >= REAL * np.abs(product)
        w, value, L = w[seen], product.imag[seen], (num / den)[seen]
        # where L lies near the positive axis on both sides, it crosses that one
        ahead = L.real > NEAR_POSITIVE_AXIS * np.abs(L)
        floor = TINIEST if every else floor
        loud = np.abs(L) >= floor
        found = zeros(imaginary, w, value, ~(ahead[:-1] & ahead[1:]) & (loud[:-1] | loud[1:]))
        num, den = at(found)
        L = num / den
    # the phase also jumps at poles and zeros on the axis
    return found[(L.real < 0) & (np.abs(L) >= floor) & (np.abs(L) < HUGE)]


def height(kind: int, num: Any, den: Any) -> Any:
    """Return |S|, |T| or half of |S - T|."""
    if kind == SENSITIVITY:
        return abs(den) / abs(den + num)
    if kind == COMPLEMENTARY:
        return abs(num) / abs(den + num)
    return 0.5 * abs(den - num) / abs(den + num)


def _bound(kind: int, size: Array, weight: Any) -> Array:
    """What a height does not exceed between neighbours, from |L| and the weight there: infinite where |L| may be 1.

    Between two points |1 + L| is at least the distance of |L| from 1, whatever the dead time turns.
    """
    numerator = (1.0 + 0.0 * size, size, 0.5 * (1 + size))[kind] * weight
    pairs = size[:-1], size[1:]
    apart = np.fmax(least_between(*pairs) - 1, 1 - most_between(*pairs))
    return np.where(apart > 0, most_between(numerator[:-1], numerator[1:]) / apart, np.inf)


def highest(
    kind: int, at: At, weight: Any, w: Array, num: Any, den: Any, delay: float, probes: Array, least: float
) -> Any:
    """Highest peak of |S|, |T| or half of |S - T|, times the modulus of `weight`, and where it lies.

    The weight is a smooth function of frequency. At the probes one is looked for first: a high peak that is known
    saves others from being followed. Where nothing exceeds `least`, it is that, at NaN.
    """

    def values(w: Any, num: Any, den: Any) -> Any:
        return height(kind, num, den) * weight(w)

    with np.errstate(all="ignore"):
        size, heights = np.abs(num) / np.abs(den), values(w, num, den)
        known, place = -math.inf, 0.0
        if probes.size:
            top = probes[int(np.argmax(values(probes, *at(probes))))]
            near = top + np.array([-FINE_STEP, 0.0, FINE_STEP]) / delay
            (place,), (known,) = lowest(lambda w: -values(w, *at(w)), near, np.array([1]))
            known = -known
        best = max(least, known, float(np.nanmax(heights)))
        if delay:
            # long steps are taken in pieces, of which few may hold a peak
            w = divided(w, _bound(kind, size, weight(w)) > best, delay, PIECE * FINE_STEP)
            num, den = at(w)
            heights = values(w, num, den)
            bound = _bound(kind, np.abs(num) / np.abs(den), weight(w))
            grid, followed = w, np.diff(w) * delay <= FINE_STEP
            while not np.all(followed):
                order = np.argsort(np.where(followed, -np.inf, bound))[::-1][:FOLLOWED_AT_ONCE]
                steps = np.zeros(followed.size, dtype=bool)
                steps[order] = ~(bound[order] <= best * (1 + NO_HIGHER)) & ~followed[order]
                if not steps.any():
                    break
                followed |= steps
                w = divided(grid, followed, delay)
                num, den = at(w)
                heights = values(w, num, den)
                best = max(best, float(np.nanmax(heights)))
        best = max(least, known, float(np.nanmax(heights))) * (1 + NO_HIGHER)
        around = np.fmin(heights[:-2], heights[2:]), np.fmax(heights[:-2], heights[2:])
        # a difference of rounding makes no hill
        hills = 1 + np.flatnonzero((heights[1:-1] >= around[1]) & (heights[1:-1] * (1 - REAL) > around[0]))
        # beside a point L comes no closer to -1 than its way to the next one allows
        L = num / den
        way, distance = np.abs(np.diff(L)), np.abs(1 + L)
        closest = distance[hills] - DETOUR * np.fmax(way[hills - 1], way[hills])
        bound = most_between(*((heights * distance)[hills + k] for k in (-1, 0, 1))) / closest
        hills = hills[~((bound <= best) & (closest > 0))]
        tops, top = lowest(lambda w: -values(w, *at(w)), w, hills)
    first = int(np.nanargmax(heights))
    candidates = zip([least, known, heights[first], *-top], [math.nan, place, w[first], *tops], strict=True)
    return max(((float(h), float(x)) for h, x in candidates), key=lambda pair: pair[0])
