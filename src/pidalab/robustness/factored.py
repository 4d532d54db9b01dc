"""A continuous loop along the frequency axis by its factors, whose derivatives are known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.robustness import _arrays, _scan, _summits
from pidalab.robustness._arrays import COARSE_STEP, FINE_STEP
from pidalab.robustness.peaks_and_crossovers import (
    NOTHING,
    ON_CONTOUR,
    UNWEIGHTED,
    Explorer,
    LoopFactors,
    Seen,
    whole,
)

# rad that a dead time turns the phase by, of which rounding leaves no more than whole turns
UNCERTAIN_TURNS = 1e12
QUICK = 12.0  # rad that a dead time turns the phase by, from where on it does so within a step of the grid
MOST_PROBED = 20  # gain crossovers around which a peak is looked for first


@dataclass(frozen=True)
class FactoredExplorer(Explorer):
    """A continuous loop by its factors, whose derivatives are known: see `pidalab.robustness._scan`.

    Attributes
    ----------
    of : LoopFactors
        The loop.
    on_grid : Seen
        Its values at the points of the grid.
    """

    of: LoopFactors = field(default=UNWEIGHTED)
    on_grid: Seen = field(default=Seen(NOTHING, NOTHING, NOTHING))

    def scaled(self, factor: float) -> Explorer:
        """Return the loop with its gain times a factor above 0."""
        of, seen = self.of._replace(gain=factor * self.of.gain), self.on_grid
        return replace(
            self,
            fraction=lambda s: _arrays.fraction(s, of),
            at_zero=factor * self.at_zero,
            at_end=factor * self.at_end,
            of=of,
            on_grid=seen._replace(num=factor * seen.num),
        )

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies."""
        num, den = _scan.along(np.atleast_1d(np.asarray(w, dtype=float)), 0.0, 0.0, tuple(self.of))
        return np.reshape(num / den, np.shape(w))

    @cached_property
    def gain_crossovers(self) -> Array:
        """All frequencies where |L| = 1, pairs included between which it only just passes 1."""
        return self._on_axis[0]

    @cached_property
    def _on_axis(self) -> tuple[Array, Array]:
        """Gain crossovers, and extrema of |L| beside 1."""
        return _scan.gain_crossings(*self.on_grid, 0.0, 0.0, tuple(self.of))

    def _phase_crossings(self, w: Array, num: Any, den: Any, quietest: float, every: bool) -> Array:
        return _scan.phase_crossings(w, num, den, quietest, every, tuple(self.of))

    def _highest(self, kind: int, least: float, weight: LoopFactors) -> tuple[float, float]:
        return _summits.highest(
            kind, *self.on_grid, self._probes, float(least), tuple(weight), tuple(self.of)
        )

    @cached_property
    def _probes(self) -> Array:
        """Frequencies of one turn around gain crossovers where the dead time turns quickly: L comes near -1 there."""
        quick = self.grid.searchsorted(QUICK / self.delay) if self.delay else self.grid.size
        if not (np.abs(self.on_grid.num[quick:]) >= np.abs(self.on_grid.den[quick:])).any():
            return np.zeros(0)
        edges = self.gain_crossovers
        edges = edges[edges > QUICK / self.delay][-MOST_PROBED:]
        return (edges[:, None] + np.arange(-np.pi, np.pi, FINE_STEP) / self.delay).ravel()

    def encirclements(self, lean: float, aside: float) -> int | None:
        r"""Count zeros of the characteristic function f right of s = jω - lean ω - aside; None if one is on this line.

        With L = N/D the function is D (1 + L), or N (1 + 1/L). Where \|L\| < 1, 1 + L stays right of the imaginary
        axis, and f turns as D does, but for the difference of that angle at the ends; where \|L\| > 1 it turns as N
        does in the same way. Factors turn along a straight line by less than half a turn each, and a dead time by its
        product with the frequency. So only the gain crossovers need to be known, and nobody has to follow the turns of
        a dead time in between, however many.
        """
        of, w = self.of, self.grid
        if lean == aside == 0.0:
            (_, num, den), (edges, touched) = self.on_grid, self._on_axis
        else:
            num, den = _scan.along(w, lean, aside, tuple(of))
            edges, touched = _scan.gain_crossings(w, num, den, lean, aside, tuple(of))
        with np.errstate(all="ignore"):
            level = np.log(np.abs(num) / np.abs(den))
            flat = np.abs(level) <= ON_CONTOUR
            # a pole of L there is one of the loop if a zero, or the gain 0, cancels it
            beside = np.abs(of.poles.real + lean * of.poles.imag + aside) <= ON_CONTOUR * np.abs(of.poles)
            poles = np.abs(of.poles[beside].imag)
            at = np.concatenate([[0.0], edges, touched, w[flat], poles])
            n, d = _arrays.fraction((1j - lean) * at - aside, tuple(of))
            if np.any(~(np.abs(n + d) > ON_CONTOUR * (np.abs(n) + np.abs(d)))):
                return None
            if np.any(flat) and self._passes_unseen(flat, num / den):
                return None
            seen = level[np.abs(level) >= _arrays.REAL]
            loud = (np.arange(edges.size + 1) % 2 == 1) ^ bool(seen.size and seen[0] > 0)
            total = 0.0
            # of the angle of L: that of 1 + L where |L| = 1
            half = np.concatenate([[0.0], 0.5 * np.angle(n / d)[1 : edges.size + 1], [0.0]])
            for active, roots, sign in ((~loud, of.poles, 1.0), (loud, of.zeros, -1.0)):
                k = np.flatnonzero(active)
                start = (1j - lean) * np.append(0.0, edges)[k] - aside
                stop = np.append((1j - lean) * edges - aside, np.nan)[k]
                # far out all roots lie in one place
                reach = np.where(np.isnan(stop.real)[:, None], 1j - lean, stop[:, None] - roots[None, :])
                total += float(np.angle(reach * np.conj(start[:, None] - roots[None, :])).sum())
                total += sign * float((half[k + 1] - half[k]).sum())
            if of.delay:
                k = np.flatnonzero(loud)
                total -= of.delay * float((np.append(edges, np.inf)[k] - np.append(0.0, edges)[k]).sum())
        count = 0.5 * of.poles.size - total / np.pi
        if of.delay * edges.max(initial=0.0) > UNCERTAIN_TURNS and math.isfinite(count) and count > 0.5:
            return round(count)
        return whole(count)

    def _passes_unseen(self, flat: Any, L: Any) -> bool:
        """Whether L may pass -1 between two points at both of which its modulus is 1."""
        pairs = flat[:-1] & flat[1:]
        left = (L.real[:-1] < 0) & (L.real[1:] < 0) & (L.imag[:-1] * L.imag[1:] <= 0)
        return bool(np.any(pairs & (left | (np.diff(self.grid) * self.delay > COARSE_STEP))))
