r"""A loop followed along the frequency axis, whether in s or in z: crossovers, peaks, and turns around -1.

The magnitude of L is smooth on a logarithmic grid that is denser around lightly damped roots. Its phase also turns by
the dead time, without end. So the steps of the grid are divided further where the dead time turns the phase quickly
*and* L, or the peak that is sought, is large enough for it to matter. What lies between two points is left to SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, elementwise, minimize_scalar

from pidalab._check import Array
from pidalab.search import succeeded

PER_DECADE = 120  # points of the logarithmic grid
MOST_POINTS = 2_000_000  # along the axis: more would fill the memory
# rad by which the dead time turns the phase between two points; the latter for crossovers
FINE, COARSE = 0.25, 1.0
LOUD = 0.5  # |L| above which the turns of the dead time are followed in any case
TURNED = 0.8  # largest turn of the characteristic function between two points, in rad
HALVINGS = 70  # of a step, at most, until it turns no more than that
ON_CONTOUR = 1e-9  # share of its terms below which the characteristic function has a zero on the contour
NEAR_AXIS = 0.5  # cosine of the angle to the positive axis below which the negative one may be crossed
REAL = 1e-12  # imaginary part, relative to the modulus, that is rounding; and logarithm of |L|
TOUCHING = 0.1  # logarithm of |L| at an extremum, below which it may cross 0 unseen
BENT = 1.5  # times that the way of L between two points may be longer than the straight line
NO_HIGHER = 1e-11  # share by which a peak between two points must exceed the best to be sought
SMALLEST = 1e-300  # |L| that is not 0
FEW = 20  # crossovers or peaks that are found one by one
CLOSE = 1e-8  # of the distance of two points, to which a peak between them is found
# distances of points from a lightly damped root, in units of its damping
BESIDE = np.outer([-1.0, 1.0], np.logspace(-2.0, 3.0, 40)).ravel()


class Seen(NamedTuple):
    """A loop at some frequencies: numerator and denominator of L."""

    w: Any
    num: Any
    den: Any

    @property
    def distance(self) -> Any:
        """Distance of L from -1."""
        return abs(1 + self.num / self.den)


def sensitivity(seen: Seen) -> Any:
    """Return |S|."""
    return abs(seen.den) / abs(seen.den + seen.num)


def complementary(seen: Seen) -> Any:
    """Return |T|."""
    return abs(seen.num) / abs(seen.den + seen.num)


@dataclass(frozen=True)
class Explorer:
    """A loop as a function of frequency, with the points at which it is looked at.

    Attributes
    ----------
    grid : ndarray
        Frequencies in rad per time unit, ascending.
    fraction : callable
        Numerator, dead time included, and denominator of L at s = jω or nearby; divided by what does not turn.
    delay : float
        Time by which the phase turns beside that of the roots; 0 if it does not.
    at_zero, at_end : float
        L at the ends of the axis, where it is real. At infinite frequency a dead time gives it every phase: the worst.
    end : float
        The last frequency: infinite, or half the sampling frequency.
    degree : int
        How many quarter turns the characteristic function makes along the axis if no pole is unstable.
    """

    grid: Array
    fraction: Callable[[Any], tuple[Any, Any]]
    delay: float
    at_zero: float
    at_end: float
    end: float = math.inf
    degree: int = 0

    def scaled(self, factor: float) -> Explorer:
        """Return the loop with so many times its gain, above 0."""

        def fraction(s: Any) -> tuple[Any, Any]:
            num, den = self.fraction(s)
            return factor * num, den

        return replace(self, fraction=fraction, at_zero=factor * self.at_zero, at_end=factor * self.at_end)

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies."""
        num, den = self.fraction(1j * w)
        return num / den

    def at(self, w: Any) -> Seen:
        """Evaluate the loop at frequencies."""
        return Seen(w, *self.fraction(1j * w))

    @cached_property
    def on_grid(self) -> Seen:
        """The loop at the points of the grid."""
        return self.at(self.grid)

    @cached_property
    def followed(self) -> Seen:
        """The loop at points that follow it wherever it is loud."""
        return self.at(self.follow(LOUD)) if self.delay else self.on_grid

    @cached_property
    def size(self) -> Array:
        """|L| on the grid."""
        with np.errstate(all="ignore"):
            return np.abs(self.on_grid.num) / np.abs(self.on_grid.den)

    def follow(self, loud: float, turn: float = FINE) -> Array:
        """Return points between which the dead time turns the phase by `turn` at most wherever \\|L\\| >= loud."""
        return self.points(self._steps(loud), turn)

    def _steps(self, loud: float) -> Any:
        """Return the steps of the grid in which |L| is so large."""
        return np.fmax(self.size[:-1], self.size[1:]) >= loud

    def points(self, steps: Any, turn: float = FINE) -> Array:
        """Divide some steps of the grid until the dead time turns the phase by `turn` at most."""
        w = self.grid
        if not self.delay:
            return w
        parts = np.where(steps, np.maximum(np.ceil(np.diff(w) * self.delay / turn), 1.0), 1.0)
        if not parts.sum() <= MOST_POINTS:
            raise ArithmeticError(
                f"the dead time turns the phase {parts.sum() * turn / (2 * np.pi):.2g} times while |L| is large: too "
                "often to follow; is the loop far from stable, or the sample much shorter than the dead time?"
            )
        parts = parts.astype(np.intp)
        within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        return np.append(np.repeat(w[:-1], parts) + within * np.repeat(np.diff(w) / parts, parts), w[-1])

    def gain_crossovers(self) -> Array:
        """All frequencies where |L| = 1, pairs included between which it only just passes 1."""

        def logarithm(w: Any, sign: float = 1.0) -> Any:
            return sign * np.log(abs(self.L(w)))

        with np.errstate(all="ignore"):
            value = np.log(self.size)
            # a gain of 1 all along has no crossover
            seen = np.isfinite(value) & (np.abs(value) >= REAL)
            w, value = self.grid[seen], value[seen]
            for sign in (-1.0, 1.0):
                v = sign * value
                low = 1 + np.flatnonzero(
                    (v[1:-1] <= v[:-2]) & (v[1:-1] < v[2:]) & (v[1:-1] > 0) & (v[1:-1] < TOUCHING)
                )
                at, least = lowest(partial(logarithm, sign=sign), w, low)
                beyond = least < -REAL
                w, value = np.append(w, at[beyond]), np.append(value, sign * least[beyond])
                order = np.argsort(w)
                w, value = w[order], value[order]
            return zeros(logarithm, w, value)

    def phase_crossovers(self, quietest: float) -> Array:
        """Frequencies below the end where L is real and negative; with dead time where |L| is at least `quietest`."""

        def imaginary(w: Any) -> Any:
            num, den = self.fraction(1j * w)
            return (num * den.conjugate()).imag

        w = self.follow(quietest, COARSE)
        _, num, den = self.at(w[w < self.end])
        with np.errstate(all="ignore"):
            product = num * np.conj(den)
            seen = np.abs(product.imag) >= REAL * np.abs(product)
            w, value, L = w[: seen.size][seen], product.imag[seen], (num / den)[seen]
            # where L lies near the positive axis on both sides, it crosses that one
            ahead = L.real > NEAR_AXIS * np.abs(L)
            # a dead time makes infinitely many of them, but not up to half a sampling frequency
            floor = quietest if self.delay and math.isinf(self.end) else SMALLEST
            loud = np.abs(L) >= floor
            found = zeros(imaginary, w, value, ~(ahead[:-1] & ahead[1:]) & (loud[:-1] | loud[1:]))
            L = self.L(found)
        # the phase also jumps at poles and zeros on the axis
        return found[(L.real < 0) & (np.abs(L) >= floor) & (np.abs(L) < 1e9)]

    def max_sensitivity(self) -> tuple[float, float]:
        """Supremum of |S| and where it lies."""
        return self.supremum(sensitivity, *(_size(1.0, 1 + L) for L in (self.at_zero, self.at_end)))

    def max_complementary(self) -> tuple[float, float]:
        """Supremum of |T| and where it lies."""
        ends = (_size(1.0, 1 + 1 / L) if L else 0.0 for L in (self.at_zero, self.at_end))
        return self.supremum(complementary, *ends)

    def supremum(self, height: Callable[[Seen], Any], at_zero: float, at_end: float) -> tuple[float, float]:
        """Peak and where it lies, perhaps at an end of the axis: the points only come close to it."""
        peak = self.peak(height)
        for value, w in ((at_zero, 0.0), (at_end, self.end)):
            if value >= peak[0] * (1 - 1e-7):
                return value, w
        return peak

    def peak(self, height: Callable[[Seen], Any]) -> tuple[float, float]:
        r"""Highest value along the axis, and where it lies, of a function of the form \|N/(1 + L)\|.

        Parameters
        ----------
        height : callable
            The function of frequencies and of the loop there; its N must be smooth on the grid.

        Returns
        -------
        peak, frequency : float
        """
        with np.errstate(all="ignore"):
            seen, values = self.followed, height(self.followed)
            if self.delay:
                # where 1 + L cannot be small enough for a higher value, the turns need not be followed
                best = np.nanmax(values) * (1 + NO_HIGHER)
                numerator = height(self.on_grid) * self.on_grid.distance
                bound = most_between(numerator[:-1], numerator[1:]) / (
                    1 - np.fmax(self.size[:-1], self.size[1:])
                )
                loud, further = self._steps(LOUD), ~((bound <= best) & (bound > 0))
                if np.any(further & ~loud):
                    seen = self.at(self.points(loud | further))
                    values = height(seen)
            best = np.nanmax(values) * (1 + NO_HIGHER)
            around = np.fmin(values[:-2], values[2:]), np.fmax(values[:-2], values[2:])
            # a difference of rounding makes no hill
            hills = 1 + np.flatnonzero((values[1:-1] >= around[1]) & (values[1:-1] * (1 - REAL) > around[0]))
            # beside a point L comes no closer to -1 than its way to the next one allows
            way, distance = np.abs(np.diff(seen.num / seen.den)), seen.distance
            closest = distance[hills] - BENT * np.fmax(way[hills - 1], way[hills])
            bound = most_between(*((values * distance)[hills + k] for k in (-1, 0, 1))) / closest
            hills = hills[~((bound <= best) & (closest > 0))]
            at, least = lowest(lambda w: -height(self.at(w)), seen.w, hills)
        first = int(np.nanargmax(values))
        candidates = zip([values[first], *-least], [seen.w[first], *at], strict=True)
        top, where = max(candidates, key=lambda one: float(one[0]))
        return float(top), float(where)

    def encirclements(self, lean: float, aside: float) -> int | None:
        """Count zeros of the characteristic function right of s = jω - lean ω - aside; None if one is on this line.

        In z the line is a circle or spiral, outside of which they are counted.
        """

        def characteristic(w: Any) -> Any:
            num, den = self.fraction(1j * w - (lean * w + aside))
            value = den + num
            return np.where(np.abs(value) > ON_CONTOUR * (np.abs(den) + np.abs(num)), value, np.nan)

        w = self.follow(LOUD, COARSE)
        if math.isinf(self.end):
            w = np.append(0.0, w)
        with np.errstate(all="ignore"):
            f = characteristic(w)
            first, last = f[0], f[-1]
            total, a, b, fa, fb = 0.0, w[:-1], w[1:], f[:-1], f[1:]
            for _ in range(HALVINGS):
                turn = np.angle(fb * np.conj(fa))
                if np.any(np.isnan(turn)):
                    return None
                wide = np.abs(turn) > TURNED
                total += float(turn[~wide].sum())
                if not wide.any():
                    break
                a, b, fa, fb = a[wide], b[wide], fa[wide], fb[wide]
                middle = 0.5 * (a + b)
                fm = characteristic(middle)
                a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
                fa, fb = np.concatenate([fa, fm]), np.concatenate([fm, fb])
            else:
                return None
        # at its ends it is real, but for the quarter turns of its powers of s
        limit = last.real if math.isfinite(self.end) else (1 + self.at_end) * 1j ** (self.degree % 4)
        total += float(np.angle(first / first.real)) - float(np.angle(last / limit))
        count = 0.5 * self.degree - total / np.pi
        return round(count) if abs(count - round(count)) < 0.2 else None


def _size(num: float, den: float) -> float:
    return abs(num / den) if den else math.inf


def most_between(*neighbours: Any) -> Any:
    """Largest value of a smooth function between points: as much more as it changes from point to point."""
    low, high = np.fmin.reduce(neighbours), np.fmax.reduce(neighbours)
    return high * np.where(low > 0, high / low, 1.0)


def frequencies(roots: Any, delay: float, end: float = math.inf) -> Array:
    """Every decade in which something happens, four more on both sides up to the end, and what is narrower."""
    speeds = np.abs(roots)
    speeds = np.append(speeds[speeds > 0], [1 / delay] if delay else [])
    low, high = (speeds.min(), speeds.max()) if speeds.size else (1.0, 1.0)
    low, high = 1e-4 * min(low, end), min(1e4 * high, end)
    light = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.2 * np.abs(roots))]
    width = np.maximum(np.abs(light.real), 1e-9 * np.abs(light))
    close = (light.imag[:, None] + np.outer(width, BESIDE)).ravel()
    w = np.geomspace(low, high, int(PER_DECADE * math.log10(high / low)) + 1)
    return np.unique(np.append(w, close[(close > low) & (close < high)]))


def zeros(function: Callable[[Any], Any], w: Array, values: Array, allowed: Any = True) -> Array:
    """Zeros of a function between points of allowed steps at which its values have different signs."""
    i = np.flatnonzero((values[:-1] * values[1:] < 0) & allowed)
    if i.size > FEW:
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
    if i.size > FEW:
        many = elementwise.find_minimum(lambda x, own: function(own + x), (below, away, above), args=(at,))
        away, least, rest = many.x, many.f_x, np.flatnonzero(~many.success)
    for k in rest:
        found = minimize_scalar(
            lambda x, own=float(at[k]): function(own + x),
            bounds=(below[k], above[k]),
            method="bounded",
            options={"xatol": CLOSE * (above[k] - below[k])},
        )
        away[k], least[k] = succeeded(found, "a peak").x, found.fun
    return at + away, least
