"""A loop along the frequency axis: grid, crossovers and peaks, in array operations, for loops in s and in z.

The grid is logarithmic and denser around lightly damped roots. The magnitude of L is smooth on it, but the dead time
turns the phase without end. So its steps are divided further where the dead time turns the phase quickly *and* L, or
the peak that is sought, is large enough for it to matter. SciPy finds what lies between two points.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

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
ROUNDING = 1e-12  # imaginary part, relative to the modulus, that is rounding; and logarithm of |L|
TOUCHING = 0.1  # logarithm of |L| at an extremum, below which it may cross 0 between two points
DETOUR = 1.5  # factor by which the way of L between two points may be longer than the straight line
NO_HIGHER = 1e-11  # share by which a peak between two points must exceed the best to be sought
TINIEST = 1e-300  # smallest |L| that counts as other than 0
HUGE = 1e9  # |L| beyond which a jump of the phase is that at a pole on the axis
ONE_BY_ONE = 20  # crossovers or peaks up to which each is found alone
BRACKET_SHARE = 1e-8  # of the distance of two points, to which a peak between them is found
PIECE = 64.0  # points of a step that are passed over, or followed, together
FOLLOWED_TOGETHER = 60  # steps of the grid, those first in which a peak may be highest
TO_AN_END = 1e-7  # share by which a peak must exceed the limit at an end of the axis
ON_CONTOUR = 1e-9  # share of its terms below which the characteristic function has a zero on the contour
SENSITIVITY, COMPLEMENTARY, DIFFERENCE = 0, 1, 2  # kinds of peaks: of |S|, of |T|, of half of |S - T|
# distances of points from a lightly damped root, in units of its damping
NEAR_ROOT = np.outer([-1.0, 1.0], np.logspace(-2.0, 3.0, 40)).ravel()

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
    """Return the grid: all decades with roots, four more on both sides up to the end, and points near light damping."""
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
    close = (light.imag[:, None] + np.outer(width, NEAR_ROOT)).ravel()
    return np.unique(np.append(w, close[(close > low) & (close < high)]))


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
    """Return an upper bound of a smooth function between points: it exceeds them by as much as they differ."""
    low, high = np.fmin.reduce(neighbours), np.fmax.reduce(neighbours)
    return high * np.where(low > 0, high / low, 1.0)


def least_between(*neighbours: Any) -> Any:
    """Return a lower bound of a smooth function between points: it is below them by as much as they differ."""
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
    """Return where a function is least between the neighbours of some points, and its values there."""
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
        seen = np.isfinite(value) & (np.abs(value) >= ROUNDING)
        w, value = w[seen], value[seen]
        touched = [np.zeros(0)]
        for sign in (-1.0, 1.0):
            v = sign * value
            low = 1 + np.flatnonzero(
                (v[1:-1] <= v[:-2]) & (v[1:-1] < v[2:]) & (v[1:-1] > 0) & (v[1:-1] < TOUCHING)
            )
            where, least = lowest(partial(logarithm, sign=sign), w, low)
            touched.append(where)
            beyond = least < -ROUNDING
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
        seen = np.abs(product.imag) >= ROUNDING * np.abs(product)
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
    """Return a bound of a height between neighbours, from |L| and the weight there: infinite where |L| may be 1.

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
                order = np.argsort(np.where(followed, -np.inf, bound))[::-1][:FOLLOWED_TOGETHER]
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
        hills = 1 + np.flatnonzero(
            (heights[1:-1] >= around[1]) & (heights[1:-1] * (1 - ROUNDING) > around[0])
        )
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


# --- the axis of one loop ---------------------------------------------------------------------------------------------


class Samples(NamedTuple):
    """A loop at some frequencies: numerator and denominator of L."""

    w: Any
    num: Any
    den: Any


@dataclass(frozen=True, eq=False)
class Axis(ABC):
    """A loop as a function of frequency, with the grid on which it is followed.

    `pidalab.robustness.in_s.AxisInS` is a continuous loop, `pidalab.robustness.in_z.AxisInZ` a sampled one.

    Attributes
    ----------
    grid : ndarray
        Frequencies in rad per time unit, ascending.
    delay : float
        Time by which the phase turns in addition to that of the roots; 0 if it does not.
    at_zero, at_end : float
        L at the ends of the axis, where it is real. At infinite frequency a dead time gives it every phase: the worst.
    end : float
        The last frequency: infinite, or half the sampling frequency.
    """

    grid: Array
    delay: float
    at_zero: float
    at_end: float
    end: float = math.inf

    @abstractmethod
    def at(self, w: Any) -> Samples:
        """Evaluate the loop at frequencies."""

    @abstractmethod
    def encirclements(self, slope: float, shift: float) -> int | None:
        """Count the zeros of the characteristic function right of s = jω - slope ω - shift; None if one is on it."""

    @abstractmethod
    def highest(self, kind: int, least: float) -> tuple[float, float]:
        """Return the highest peak of a kind that exceeds `least`, and where it lies; else `least`, at NaN."""

    @abstractmethod
    def _phase_crossings(self, samples: Samples, quietest: float, every: bool) -> Array:
        """Frequencies where L is real and negative, followed where |L| is at least `quietest`, or everywhere."""

    @cached_property
    def on_grid(self) -> Samples:
        """The loop at the points of the grid."""
        return self.at(self.grid)

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies."""
        _, num, den = self.at(w)
        return num / den

    @cached_property
    def size(self) -> Array:
        """|L| on the grid."""
        with np.errstate(all="ignore"):
            return np.abs(self.on_grid.num) / np.abs(self.on_grid.den)

    def follow(self, loud: float) -> Array:
        """Return points between which the dead time turns the phase little wherever \\|L\\| >= loud."""
        return self.points(np.fmax(self.size[:-1], self.size[1:]) >= loud)

    def points(self, steps: Any, turn: float = FINE_STEP) -> Array:
        """Divide some steps of the grid until the dead time turns the phase by `turn` at most."""
        return divided(self.grid, steps, self.delay, turn)

    @cached_property
    def gain_crossovers(self) -> Array:
        """All frequencies where |L| = 1, pairs included between which it only just passes 1."""
        return gain_crossings(lambda w: self.at(w)[1:], *self.on_grid)[0]

    def phase_crossovers(self, quietest: float) -> Array:
        """Frequencies below the end where L is real and negative; with dead time where |L| is at least `quietest`."""
        samples = Samples(*(part[self.grid < self.end] for part in self.on_grid))
        # a dead time makes infinitely many of them, but not up to half a sampling frequency
        crossovers = self._phase_crossings(samples, quietest, not self.delay or math.isfinite(self.end))
        if np.isnan(crossovers).any():
            raise too_many(COARSE_STEP)
        return crossovers

    def peak(self, kind: int) -> tuple[float, float]:
        """Return the supremum of |S|, |T| or half of |S - T|, and where it lies."""
        ends = (_height_at_an_end(kind, L) for L in (self.at_zero, self.at_end))
        return self.supremum(partial(self.highest, kind), *ends)

    def supremum(
        self, highest: Callable[[float], tuple[float, float]], at_zero: float, at_end: float
    ) -> tuple[float, float]:
        """Return the larger of a highest peak and the limits at both ends of the axis, and where it lies."""
        end = max(at_zero, at_end)
        peak, where = highest(end / (1 - TO_AN_END))
        if math.isnan(peak):
            raise too_many(FINE_STEP)
        if math.isnan(where):  # nothing is higher than the limit at an end
            return end, 0.0 if at_zero >= end * (1 - TO_AN_END) else self.end
        return peak, where


def whole(count: float) -> int | None:
    """Return a number of poles, which is whole but for rounding; None if it is not."""
    return round(count) if math.isfinite(count) and abs(count - round(count)) < 0.2 else None


def _height_at_an_end(kind: int, L: float) -> float:
    """Return a height where L is real, or infinite: at an end of the axis."""
    num, den = (1.0, 0.0) if math.isinf(L) else (L, 1.0)
    return float(height(kind, num, den)) if den + num else math.inf
