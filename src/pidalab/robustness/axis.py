"""Find crossovers and peaks along the frequency axis, for continuous and sampled loops.

The frequency grid is logarithmic, and denser around lightly damped roots. The magnitude of the loop transfer function L
is smooth between grid points, but the dead time turns the phase without bound. A grid step is therefore divided further
if the dead time turns the phase quickly within the step *and* the step may contain a phase crossover or peak. A phase
crossover is sought only in steps in which the magnitude of L is large enough. A peak is sought only in steps in which
an upper bound of the sensitivity function exceeds the highest value found so far.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array

PER_DECADE = 120  # grid points per decade
MOST_POINTS = 2_000_000  # largest number of points; more would exhaust the memory
# Largest angle in rad by which the dead time turns the phase between two points: FINE_STEP for peaks, COARSE_STEP for
# phase crossovers.
FINE_STEP, COARSE_STEP = 0.25, 1.0
# L does not cross the negative axis in a step if cos(angle of L) is above this value at both ends of the step.
NEAR_POSITIVE_AXIS = 0.5
# A value of log |L|, a relative imaginary part or a relative difference counts as 0 if its modulus is below this value.
ROUNDING = 1e-12
TOUCHING = 0.1  # an extremum of log |L| on the grid is refined if its modulus is less than this value
DETOUR = 1.5  # assumed upper bound of (length of the path of L between two points) / |L2 - L1|
NO_HIGHER = 1e-11  # a peak is sought only where the bound exceeds (1 + this) * the highest value so far
TINIEST = 1e-300  # a smaller |L| counts as 0
HUGE = 1e9  # where |L| is above this, a jump of the phase is due to a pole on the axis
MOST_STEPS = 60  # largest number of steps of a refinement
# The refinement of a crossover ends when step / (width of the first bracket) is at most this. The relative error is
# then about the square of this number.
SAME_CROSSING = 1e-8
# The refinement of a peak ends when step / (width of the first bracket) is at most SAME_PEAK. The step of finite
# differences is DIFFERENCE_STEP times the distance of the middle point to its nearer neighbour.
SAME_PEAK, DIFFERENCE_STEP = 1e-6, 1e-3
# A long grid step is first divided into pieces. A piece that is divided further gets about this number of points.
PIECE = 64.0
FOLLOWED_TOGETHER = 60  # largest number of pieces that are divided at once
# Where frequency times dead time is above this angle in rad, the dead time turns the phase noticeably in one grid step.
QUICK = 12.0
# Before the search on the grid, peaks are sought around at most this number of gain crossovers.
MOST_PROBED = 20
TO_AN_END = 1e-7  # a peak counts only if it exceeds (1 + this) * the limits at both ends of the axis
# The characteristic function N + D of L = N/D counts as 0 if its modulus is at most this number times |N| + |D|.
ON_CONTOUR = 1e-9
SENSITIVITY, COMPLEMENTARY, DIFFERENCE = 0, 1, 2  # kinds of peaks: |S|, |T|, half of |S - T|
# (distances of grid points from a lightly damped root) / (modulus of the real part of the root)
NEAR_ROOT = np.outer([-1.0, 1.0], np.logspace(-2.0, 3.0, 40)).ravel()


class TooManyTurns(ArithmeticError):
    """Raised if the dead time turns the phase so often that the grid would have too many points."""


class Samples(NamedTuple):
    """Numerator and denominator of L at some frequencies."""

    w: Any
    num: Any
    den: Any


def frequencies(roots: Any, delay: float, end: float = math.inf) -> Array:
    """Return a frequency grid for some roots.

    The grid extends from 1e-4 times the smallest modulus of the roots to 1e4 times the largest, but not beyond `end`.
    The inverse of the dead time counts as a root.
    """
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
    """Divide the selected steps of a grid until the dead time turns the phase by at most `turn` in each step."""
    parts = np.where(steps, np.maximum(np.ceil(np.diff(w) * delay / turn), 1.0), 1.0)
    points = float(parts.sum())
    if not points <= MOST_POINTS:
        raise TooManyTurns(
            f"the dead time turns the phase {points * turn / (2 * np.pi):.2g} times in the range to be searched, which "
            "is too often. Is the loop far from stable, or the sample time much shorter than the dead time?"
        )
    if points < w.size:  # no step has to be divided
        return w
    parts = parts.astype(np.intp)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(np.repeat(w[:-1], parts) + within * np.repeat(np.diff(w) / parts, parts), w[-1])


def most_between(*neighbours: Any) -> Any:
    """Return an upper bound of a smooth positive function between neighbouring points: maximum^2 / minimum."""
    low, high = np.fmin.reduce(neighbours), np.fmax.reduce(neighbours)
    return high * np.where(low > 0, high / low, 1.0)


def zeros(function: Callable[[Any], Any], w: Array, values: Array, allowed: Any = True) -> Array:
    """Return one zero of a function in each allowed step in which the sign of the function changes.

    Notes
    -----
    Ridders' method is applied to all zeros at once. Invariant: the function has different signs at the ends `low` and
    `high` of each bracket, and either end may be the larger frequency. Each iteration at least halves the bracket, and
    near a simple zero it doubles the number of correct digits. If the function is exactly 0 at the new estimate
    `place`, both ends of the bracket are moved to `place`.
    """
    i = np.flatnonzero((values[:-1] * values[1:] < 0) & allowed)
    low, high, at_low, at_high, place = w[i], w[i + 1], values[i], values[i + 1], w[i]
    tolerance = SAME_CROSSING * (high - low)
    for _ in range(MOST_STEPS if i.size else 0):
        middle = 0.5 * (low + high)
        at_middle = function(middle)
        with np.errstate(invalid="ignore"):
            share = np.sign(at_low) * at_middle / np.sqrt(at_middle**2 - at_low * at_high)
        last, place = place, middle + (middle - low) * np.where(at_middle == 0, 0.0, share)
        here = function(place)
        inner, lower, exact = at_middle * here < 0, at_low * here < 0, here == 0
        high, at_high = (
            np.where(inner, a, np.where(lower | exact, b, c))
            for a, b, c in ((middle, place, high), (at_middle, here, at_high))
        )
        low, at_low = (np.where(inner | exact | ~lower, b, c) for b, c in ((place, low), (here, at_low)))
        if np.all(np.abs(place - last) <= tolerance):
            break
    if not np.isfinite(place).all():
        raise ArithmeticError(f"{np.sum(~np.isfinite(place))} of {i.size} crossovers were not found")
    return place


def lowest(function: Callable[[Any], Any], w: Array, i: Any) -> tuple[Array, Array]:
    """Return place and value of the minimum of a function between w[i - 1] and w[i + 1], for each index i.

    Notes
    -----
    Newton's method on the slope is applied to all minima at once. Invariant: each iterate stays between `low`, where
    the function falls, and `high`, where it rises. Slope and curvature are computed from differences with long steps,
    because the values lose many digits near a lightly damped pole. The returned value is the minimum of the parabola
    through the last three values.
    """
    low, place, high = w[i - 1], w[i], w[i + 1]
    wide, apart = high - low, DIFFERENCE_STEP * np.fmin(place - low, high - place)
    three = np.multiply.outer([-1.0, 0.0, 1.0], apart)
    least = np.zeros(i.size)
    for _ in range(MOST_STEPS if i.size else 0):
        before, least, after = function(place + three)
        slope, bend = after - before, after - 2 * least + before
        low, high = np.where(slope < 0, place, low), np.where(slope < 0, high, place)
        with np.errstate(divide="ignore", invalid="ignore"):  # the function may be constant
            last, place = place, place - 0.5 * apart * slope / bend
        newton = (bend > 0) & (low <= place) & (place <= high)
        place = np.where(newton, place, 0.5 * (low + high))
        if np.all(np.abs(place - last) <= SAME_PEAK * wide):
            return place, least - np.where(newton, slope**2 / (8 * np.where(newton, bend, 1.0)), 0.0)
    return place, least


def gain_crossings(at: Callable[[Any], Samples], samples: Samples) -> tuple[Array, Array]:
    """Return the frequencies where |L| = 1, ascending, and the frequencies of extrema at which |L| is near 1."""

    def logarithm(w: Any, sign: float = 1.0) -> Any:
        _, num, den = at(w)
        return sign * np.log(abs(num / den))

    with np.errstate(all="ignore"):
        w, value = samples.w, np.log(np.abs(samples.num) / np.abs(samples.den))
        # Drop points at which |L| differs from 1 only by rounding. So a gain of 1 everywhere gives no crossover.
        clear = np.isfinite(value) & (np.abs(value) >= ROUNDING)
        w, value = w[clear], value[clear]
        touched = [np.zeros(0)]
        for sign in (-1.0, 1.0):
            v = sign * value
            low = 1 + np.flatnonzero(
                (v[1:-1] <= v[:-2]) & (v[1:-1] < v[2:]) & (v[1:-1] > 0) & (v[1:-1] < TOUCHING)
            )
            if low.size:
                where, least = lowest(partial(logarithm, sign=sign), w, low)
                touched.append(where)
                beyond = least < -ROUNDING
                places = np.searchsorted(w, where[beyond])
                w, value = np.insert(w, places, where[beyond]), np.insert(value, places, sign * least[beyond])
        return zeros(logarithm, w, value), np.concatenate(touched)


def height(kind: int, num: Any, den: Any) -> Any:
    """Return |S|, |T| or half of |S - T|."""
    if kind == SENSITIVITY:
        return abs(den) / abs(den + num)
    if kind == COMPLEMENTARY:
        return abs(num) / abs(den + num)
    return 0.5 * abs(den - num) / abs(den + num)


def bound(kind: int, size: Array, weight: Any = 1.0) -> Array:
    """Return an upper bound of weight * height between neighbouring points, from |L| and the weight at the points.

    For any phase of the dead time, |1 + L| is at least | |L| - 1 |. The bound is infinite where |L| may be 1.
    """
    numerator = (1.0 + 0.0 * size, size, 0.5 * (1 + size))[kind] * weight
    below, above = np.fmin(size[:-1], size[1:]), np.fmax(size[:-1], size[1:])
    # As in `most_between`, |L| is assumed to stay between minimum^2 / maximum and maximum^2 / minimum.
    apart = np.fmax(below * np.where(above > 0, below / above, 1.0) - 1, 1 - most_between(below, above))
    return np.where(apart > 0, most_between(numerator[:-1], numerator[1:]) / apart, np.inf)


@dataclass(frozen=True, eq=False)
class Axis(ABC):
    """Loop as a function of frequency, with a grid of frequencies.

    Attributes
    ----------
    grid : ndarray
        Frequencies in rad per time unit, ascending.
    on_grid : Samples
        The loop at the frequencies of the grid.
    delay : float
        Dead time, or 0 if there is none. For a sampled loop, the sample time is added.
    at_zero, at_end : float
        L at both ends of the axis, where L is real or infinite. With dead time, L has no limit at infinite frequency,
        and `at_end` is the limit of -\\|L\\|, the worst case.
    end : float
        Upper end of the axis: infinity for a continuous loop, half the sampling frequency for a sampled loop.
    """

    grid: Array
    on_grid: Samples
    delay: float
    at_zero: float
    at_end: float
    end: float = math.inf

    @abstractmethod
    def at(self, w: Any) -> Samples:
        """Evaluate the loop at frequencies, of any shape."""

    @abstractmethod
    def encirclements(self, contour_slope: float, contour_shift: float) -> int | None:
        """Count zeros of the characteristic function right of a contour. Return None if a zero lies on the contour.

        The contour is s = jω - contour_slope * ω - contour_shift.
        """

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies."""
        _, num, den = self.at(w)
        return num / den

    @cached_property
    def size(self) -> Array:
        """Return |L| on the grid."""
        with np.errstate(all="ignore"):
            return np.abs(self.on_grid.num) / np.abs(self.on_grid.den)

    def follow(self, loud: float) -> Array:
        """Divide each step of the grid with \\|L\\| >= loud at one end or both, and return the grid."""
        return self.points(np.fmax(self.size[:-1], self.size[1:]) >= loud)

    def points(self, steps: Any, turn: float = FINE_STEP) -> Array:
        """Return the grid, with the selected steps divided."""
        return divided(self.grid, steps, self.delay, turn)

    @cached_property
    def gain_crossings(self) -> tuple[Array, Array]:
        """Return the result of the function `gain_crossings`."""
        return gain_crossings(self.at, self.on_grid)

    @property
    def gain_crossovers(self) -> Array:
        """Return all frequencies where |L| = 1, including close pairs."""
        return self.gain_crossings[0]

    def phase_crossovers(self, quietest: float) -> Array:
        """Return the frequencies where L is real and negative.

        A continuous loop with dead time has infinitely many of these frequencies, so only those with |L| >= `quietest`
        are returned.
        """

        def angle(w: Any) -> Any:
            _, num, den = self.at(w)
            return np.angle(-num * np.conj(den))

        grid, size = self.grid[self.grid < self.end], self.size[self.grid < self.end]
        floor = quietest if self.delay and math.isinf(self.end) else TINIEST
        with np.errstate(all="ignore"):
            loud_steps = np.fmax(size[:-1], size[1:]) >= quietest
            w, num, den = self.at(divided(grid, loud_steps, self.delay, COARSE_STEP))
            product = num * np.conj(den)
            clear = np.abs(product.imag) >= ROUNDING * np.abs(product)
            w, product, size = w[clear], product[clear], (np.abs(num) / np.abs(den))[clear]
            # If L is near the positive axis at both ends of a step, L can cross only this axis within the step.
            ahead, loud = product.real > NEAR_POSITIVE_AXIS * np.abs(product), size >= floor
            allowed = ~(ahead[:-1] & ahead[1:]) & (loud[:-1] | loud[1:])
            crossovers = zeros(angle, w, np.angle(-product), allowed)
            L = self.L(crossovers)
        # The phase also jumps at poles and zeros on the axis, which are not crossovers.
        return crossovers[(L.real < 0) & (np.abs(L) >= floor) & (np.abs(L) < HUGE)]

    def peak(self, kind: int) -> tuple[float, float]:
        """Return the supremum of |S|, |T| or |S - T|/2, and its frequency."""
        at_zero, at_end = (_height_at_an_end(kind, L) for L in (self.at_zero, self.at_end))
        return self.supremum(kind, at_zero, at_end)

    def supremum(
        self, kind: int, at_zero: float, at_end: float, weight: Callable[[Any], Any] | None = None
    ) -> tuple[float, float]:
        """Return the supremum of weight * height, including limits at the ends of the axis, and its frequency."""
        end = max(at_zero, at_end)
        peak, where = self.highest(kind, end / (1 - TO_AN_END), weight)
        if math.isnan(where):  # no peak is higher than the limits at the ends
            return end, 0.0 if at_zero >= end * (1 - TO_AN_END) else self.end
        return peak, where

    @cached_property
    def _probes(self) -> Array:
        """Return frequencies near the last gain crossovers, where the dead time turns L quickly and L comes near -1."""
        if not self.delay or not (self.size[self.grid.searchsorted(QUICK / self.delay) :] >= 1).any():
            return np.zeros(0)
        edges = self.gain_crossovers
        edges = edges[edges > QUICK / self.delay][-MOST_PROBED:]
        return (edges[:, None] + np.arange(-np.pi, np.pi, FINE_STEP) / self.delay).ravel()

    def highest(
        self, kind: int, least: float, weight: Callable[[Any], Any] | None = None
    ) -> tuple[float, float]:
        """Return the highest peak of weight * height and its frequency, for the height |S|, |T| or |S - T|/2.

        Parameters
        ----------
        kind : int
            `SENSITIVITY`, `COMPLEMENTARY` or `DIFFERENCE`.
        least : float
            Value that a peak must exceed. If no peak exceeds `least`, return `least` and the frequency NaN.
        weight : callable, optional
            A smooth positive function of frequency.

        Notes
        -----
        `best` is the highest value so far, and `most` is an upper bound of the values within each step of the grid.
        Only steps whose bound exceeds `best` are divided, in the order of falling bounds. A local maximum on the grid
        is refined only if the bound around it exceeds `best`. So no peak above the result is missed. The values at
        `_probes` are computed first, because a high `best` saves work.
        """

        def values(samples: Samples) -> Any:
            heights = height(kind, samples.num, samples.den)
            return heights if weight is None else heights * weight(samples.w)

        def depths(w: Any) -> Any:
            # Near a peak, height^-2 is almost a parabola in frequency, even if the loop is almost unstable.
            return values(self.at(w)) ** -2.0

        def limits(samples: Samples) -> Array:
            size = self.size if samples is self.on_grid else np.abs(samples.num) / np.abs(samples.den)
            return bound(kind, size, 1.0 if weight is None else weight(samples.w))

        with np.errstate(all="ignore"):
            samples, heights = self.on_grid, values(self.on_grid)
            most, best, where = limits(samples), *max((least, math.nan), _top(samples.w, heights))
            if self._probes.size:
                probe = self._probes[np.argmin(depths(self._probes))]
                around = probe + np.array([-FINE_STEP, 0.0, FINE_STEP]) / self.delay
                place, depth = lowest(depths, around, np.array([1]))
                best, where = max((best, where), (float(depth[0] ** -0.5), float(place[0])))
            # Long steps are first divided into pieces, since only few pieces can contain a peak.
            pieces = divided(samples.w, most > best, self.delay, PIECE * FINE_STEP)
            if pieces is not samples.w:
                samples = self.at(pieces)
                heights, most = values(samples), limits(samples)
            turning = np.diff(pieces) * self.delay > FINE_STEP
            followed = np.zeros(pieces.size - 1, dtype=bool)
            promise = most
            while (more := turning & ~followed & ~(promise <= best * (1 + NO_HIGHER))).any():
                first = np.argsort(np.where(more, promise, -np.inf))[::-1][:FOLLOWED_TOGETHER]
                followed[first[more[first]]] = True
                samples = self.at(divided(pieces, followed, self.delay))
                heights, most = values(samples), limits(samples)
                best, where = max((best, where), _top(samples.w, heights))
            inner, before, after = heights[1:-1], heights[:-2], heights[2:]
            # A difference due to rounding does not count as a local maximum.
            hills = 1 + np.flatnonzero(
                (inner >= np.fmax(before, after))
                & (inner * (1 - ROUNDING) > np.fmin(before, after))
                & ~(np.fmax(most[:-1], most[1:]) <= best * (1 + NO_HIGHER))
            )
            # From a point to its neighbour, |1 + L| decreases by at most the length of the path of L between them.
            three = hills + np.array([[-1], [0], [1]])
            L = samples.num[three] / samples.den[three]
            distance = np.abs(1 + L)
            closest = distance[1] - DETOUR * np.fmax(*np.abs(np.diff(L, axis=0)))
            most = most_between(*(heights[three] * distance)) / closest
            hills = hills[~((most <= best * (1 + NO_HIGHER)) & (closest > 0))]
            places, depth = lowest(depths, samples.w, hills)
        return max([(best, where), *zip((depth**-0.5).tolist(), places.tolist(), strict=True)])


def _top(w: Array, heights: Array) -> tuple[float, float]:
    i = int(np.argmax(np.fmax(heights, -1.0)))  # a pole on the axis gives NaN, which is ignored
    return float(heights[i]), float(w[i])


def round_to_count(number: float) -> int | None:
    """Round a number of poles to a whole number. Return None if the number is not close to a whole number."""
    return round(number) if math.isfinite(number) and abs(number - round(number)) < 0.2 else None


def _height_at_an_end(kind: int, L: float) -> float:
    """Return the height at an end of the axis, where L is real or infinite."""
    num, den = (1.0, 0.0) if math.isinf(L) else (L, 1.0)
    return float(height(kind, num, den)) if den + num else math.inf
