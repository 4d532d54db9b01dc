"""A loop followed along the frequency axis, whether in s or in z: crossovers, peaks, and turns around -1."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.robustness import _arrays
from pidalab.robustness._arrays import COARSE_STEP, FINE_STEP, divided, height, most_between

LARGEST_TURN = 0.8  # largest turn of the characteristic function between two points, in rad
HALVINGS = 70  # of a step, at most, until it turns no more than that
ON_CONTOUR = 1e-9  # share of its terms below which the characteristic function has a zero on the contour
TO_AN_END = 1e-7  # share by which a peak must exceed what is approached at an end of the axis


class Seen(NamedTuple):
    """A loop at some frequencies: numerator and denominator of L."""

    w: Any
    num: Any
    den: Any


class LoopFactors(NamedTuple):
    """L(s) = gain * prod(s - zeros) / prod(s - poles) * e^(-s delay), as the scans take it.

    The speeds, one for each pole and above 0, keep the products of factors within the range of numbers.
    """

    gain: float
    zeros: Any
    poles: Any
    speeds: Any
    delay: float


NOTHING = np.zeros(0, dtype=complex)
UNWEIGHTED = LoopFactors(1.0, NOTHING, NOTHING, np.zeros(0), 0.0)


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
    """

    grid: Array
    fraction: Callable[[Any], tuple[Any, Any]]
    delay: float
    at_zero: float
    at_end: float
    end: float = math.inf

    def scaled(self, factor: float) -> Explorer:
        """Return the loop with its gain times a factor above 0."""

        def fraction(s: Any) -> tuple[Any, Any]:
            num, den = self.fraction(s)
            return factor * num, den

        return replace(self, fraction=fraction, at_zero=factor * self.at_zero, at_end=factor * self.at_end)

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies."""
        num, den = self._at(w)
        return num / den

    def at(self, w: Any) -> Seen:
        """Evaluate the loop at frequencies."""
        return Seen(w, *self._at(w))

    def _at(self, w: Any) -> tuple[Any, Any]:
        return self.fraction(1j * w)

    @cached_property
    def on_grid(self) -> Seen:
        """The loop at the points of the grid."""
        return self.at(self.grid)

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
        return _arrays.gain_crossings(self._at, *self.on_grid)[0]

    def phase_crossovers(self, quietest: float) -> Array:
        """Frequencies below the end where L is real and negative; with dead time where |L| is at least `quietest`."""
        w, num, den = (part[self.grid < self.end] for part in self.on_grid)
        # a dead time makes infinitely many of them, but not up to half a sampling frequency
        found = self._phase_crossings(w, num, den, quietest, not self.delay or math.isfinite(self.end))
        if np.isnan(found).any():
            raise _arrays.too_many(COARSE_STEP)
        return found

    def _phase_crossings(self, w: Array, num: Any, den: Any, quietest: float, every: bool) -> Array:
        return _arrays.phase_crossings(self._at, w, num, den, quietest, every, self.delay)

    def peak(self, kind: int) -> tuple[float, float]:
        """Supremum of |S|, |T| or half of |S - T| (`SENSITIVITY`, `COMPLEMENTARY`, `DIFFERENCE`), and where it lies."""
        return self.supremum(kind, _height_of(kind, self.at_zero), _height_of(kind, self.at_end))

    def supremum(
        self, kind: int, at_zero: float, at_end: float, weight: LoopFactors = UNWEIGHTED
    ) -> tuple[float, float]:
        """Peak, times the modulus of a weight, and where it lies; its limits at the ends of the axis are given."""
        end = max(at_zero, at_end)
        peak, where = self._highest(kind, end / (1 - TO_AN_END), weight)
        if math.isnan(peak):
            raise _arrays.too_many(FINE_STEP)
        if math.isnan(where):  # nothing is higher than what is approached at an end
            return end, 0.0 if at_zero >= end * (1 - TO_AN_END) else self.end
        return peak, where

    def _highest(self, kind: int, least: float, weight: LoopFactors) -> tuple[float, float]:
        """Highest point of a function of L along the axis, and where it lies."""

        own, nowhere = self.on_grid, np.zeros(0)
        return _arrays.highest(kind, self._at, lambda w: 1.0 + 0.0 * w, *own, self.delay, nowhere, least)

    def encirclements(self, lean: float, aside: float) -> int | None:
        """Count zeros of the characteristic function outside of the circle or spiral z = e^(s h).

        There s is jω - lean ω - aside. None if one is on this line.
        """

        def characteristic(w: Any) -> Any:
            num, den = self.fraction(1j * w - (lean * w + aside))
            value = den + num
            return np.where(np.abs(value) > ON_CONTOUR * (np.abs(den) + np.abs(num)), value, np.nan)

        w = self.grid
        with np.errstate(all="ignore"):
            num, den = self.fraction(1j * w - (lean * w + aside))
            f = characteristic(w)
            first, last = f[0], f[-1]
            if np.any(np.isnan(f)):
                return None
            # where |L| stays below 1 the function turns as den does; where it stays above, as num
            L, size = num / den, np.abs(num) / np.abs(den)
            quiet, loud = (
                most_between(*pair) < 1 for pair in ((size[:-1], size[1:]), (1 / size[:-1], 1 / size[1:]))
            )
            turned = num * np.exp(1j * w * self.delay)
            by_den, by_num = (np.angle(part[1:] * np.conj(part[:-1])) for part in (den, turned))
            known = (quiet & (np.abs(by_den) <= LARGEST_TURN)) | (loud & (np.abs(by_num) <= LARGEST_TURN))
            in_quiet = by_den + np.diff(np.angle(1 + L))
            in_loud = by_num - np.diff(w) * self.delay + np.diff(np.angle(1 + 1 / L))
            total = float(np.where(quiet, in_quiet, in_loud)[known].sum())
            w = self.points(~known, COARSE_STEP)
            inside = ~known[np.searchsorted(self.grid, w[1:]) - 1]
            f = characteristic(w)
            a, b, fa, fb = w[:-1][inside], w[1:][inside], f[:-1][inside], f[1:][inside]
            for _ in range(HALVINGS):
                turn = np.angle(fb * np.conj(fa))
                if np.any(np.isnan(turn)):
                    return None
                wide = np.abs(turn) > LARGEST_TURN
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
        # it is real at both ends
        total += float(np.angle(first / first.real)) - float(np.angle(last / last.real))
        return whole(-total / np.pi)


def whole(count: float) -> int | None:
    """Return a number of poles that is whole but for rounding."""
    return round(count) if math.isfinite(count) and abs(count - round(count)) < 0.2 else None


def _height_of(kind: int, L: float) -> float:
    """Return a height where L is real, or infinite: at an end of the axis."""
    num, den = (1.0, 0.0) if math.isinf(L) else (L, 1.0)
    return float(height(kind, num, den)) if den + num else math.inf
