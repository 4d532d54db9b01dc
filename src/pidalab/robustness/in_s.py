"""Evaluate a continuous loop along the frequency axis, from its poles and zeros."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop, open_loop, require_well_posed
from pidalab.process import static_gain
from pidalab.robustness.axis import (
    COARSE_STEP,
    ON_CONTOUR,
    ROUNDING,
    Axis,
    Samples,
    frequencies,
    gain_crossings,
    round_to_count,
)
from pidalab.roots import roots

# If the dead time turns the phase by more than this angle in rad, rounding errors are a noticeable part of a turn. Then
# the computed number of poles is rounded, even if it is not close to a whole number.
UNCERTAIN_TURNS = 1e12
FAR_PER_DECADE = 12  # grid points per decade, far from all corner frequencies
CLEAR = 10.0  # the grid is extended until |L| is above this value or below its inverse


class LoopFactors(NamedTuple):
    """L(s) = gain * prod(s - zeros) / prod(s - poles) * e^(-s delay).

    `speeds` holds the modulus of each pole, and a positive number for a pole at 0.
    """

    gain: float
    zeros: Any
    poles: Any
    speeds: Any
    delay: float

    def fraction(self, s: Any) -> tuple[Any, Any]:
        """Evaluate numerator and denominator of L, both divided by prod(|s| + speeds) to prevent overflow."""
        flat, few = np.ravel(s), self.zeros.size
        with np.errstate(all="ignore"):
            scale = 1.0 / (np.abs(flat) + self.speeds[:, None])
            num = np.multiply.reduce((flat - self.zeros[:, None]) * scale[:few])
            num *= self.gain * np.exp(-flat * self.delay) * np.multiply.reduce(scale[few:])
            den = np.multiply.reduce((flat - self.poles[:, None]) * scale)
        return num.reshape(np.shape(s)), den.reshape(np.shape(s))

    def modulus(self, w: Any) -> Any:
        """Evaluate |L| at frequencies."""
        num, den = self.fraction(1j * w)
        return abs(num / den)


def factors_of(loop: Loop, *names: str) -> LoopFactors:
    """Factor some blocks of a loop, without dead time. Common factors are not cancelled.

    Raises
    ------
    ValueError
        If the gain overflows, or if roots cannot be found.
    """
    open_loop(loop)  # raises an error for a sampled loop
    gain, zeros, poles = 1.0, [], []
    for name in names:
        num, den = loop.blocks[name]
        gain *= float(num[0]) / float(den[0])
        zeros.append(roots(num))
        poles.append(roots(den))
    if not math.isfinite(gain):
        raise ValueError("the gain of the loop overflows (about 1e308)")
    return from_roots(gain, np.concatenate(zeros), np.concatenate(poles))


def loop_factors(loop: Loop) -> LoopFactors:
    """Factor a whole loop, including its dead time."""
    factors = factors_of(loop, "process", "controller", "output_filter")
    return factors._replace(delay=float(loop.process.delay))


def from_roots(gain: float, zeros: Any, poles: Any, delay: float = 0.0) -> LoopFactors:
    """Assemble the factors of a loop."""
    speeds = np.abs(poles)
    moving = [speed for speed in speeds.tolist() if speed > 0]
    speeds[speeds == 0] = min(moving) if moving else 1 / delay if delay else 1.0
    return LoopFactors(gain, zeros.astype(complex), poles.astype(complex), speeds, delay)


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisInS(Axis):
    """Continuous loop along the imaginary axis.

    Attributes
    ----------
    factors : LoopFactors
        Factors of the loop.
    """

    factors: LoopFactors

    def scaled(self, factor: float) -> AxisInS:
        """Return the loop with its gain multiplied by a factor above 0."""
        return replace(
            self,
            at_zero=factor * self.at_zero,
            at_end=factor * self.at_end,
            factors=self.factors._replace(gain=factor * self.factors.gain),
            on_grid=self.on_grid._replace(num=factor * self.on_grid.num),
        )

    def at(self, w: Any) -> Samples:
        return Samples(w, *self.factors.fraction(1j * np.asarray(w)))

    def encirclements(self, contour_slope: float, contour_shift: float) -> int | None:
        r"""Count zeros of the characteristic function f right of a contour. Return None if a zero lies on the contour.

        Notes
        -----
        With L = N/D, f = D (1 + L) = N (1 + 1/L). If \|L\| < 1 between two gain crossovers, 1 + L stays right of the
        imaginary axis there, so its principal angle does not jump. Between these crossovers the change of angle(f) is
        the change of angle(D) plus the change of angle(1 + L). If \|L\| > 1 between two gain crossovers, the same holds
        with N and 1 + 1/L in place of D and 1 + L. Along a straight line, the angle of each factor s - root changes by
        less than half a turn, and the angle of e^(-s delay) changes by -delay times the change of ω. So the values at
        the gain crossovers suffice.
        """
        factors, w = self.factors, self.grid
        direction = 1j - contour_slope
        if contour_slope == contour_shift == 0.0:
            (_, num, den), (edges, touched) = self.on_grid, self.gain_crossings
        else:

            def at(w: Any) -> Samples:
                return Samples(w, *factors.fraction(direction * w - contour_shift))

            _, num, den = samples = at(w)
            edges, touched = gain_crossings(at, samples)
        with np.errstate(all="ignore"):
            level = np.log(np.abs(num) / np.abs(den))
            flat = np.abs(level) <= ON_CONTOUR
            # If a pole of L lies on the contour, D is 0 there. So f = N + D is 0 if N is 0 too.
            off = np.abs(factors.poles.real + contour_slope * factors.poles.imag + contour_shift)
            poles = np.abs(factors.poles[off <= ON_CONTOUR * np.abs(factors.poles)].imag)
            points = np.concatenate([[0.0], edges, touched, w[flat], poles])
            n, d = factors.fraction(direction * points - contour_shift)
            if np.any(~(np.abs(n + d) > ON_CONTOUR * (np.abs(n) + np.abs(d)))):
                return None
            if np.any(flat) and self._may_pass_unseen(flat, num / den):
                return None
            levels = level[np.abs(level) >= ROUNDING]
            loud = (np.arange(edges.size + 1) % 2 == 1) ^ bool(levels.size and levels[0] > 0)
            total = 0.0
            # Where |L| = 1, the angle of 1 + L is half the angle of L.
            half = np.concatenate([[0.0], 0.5 * np.angle(n / d)[1 : edges.size + 1], [0.0]])
            for active, zeros, sign in ((~loud, factors.poles, 1.0), (loud, factors.zeros, -1.0)):
                k = np.flatnonzero(active)
                start = direction * np.append(0.0, edges)[k] - contour_shift
                stop = np.append(direction * edges - contour_shift, np.nan)[k]
                # At the infinite end of the contour, s - root has the direction of the contour for all roots.
                reach = np.where(np.isnan(stop.real)[:, None], direction, stop[:, None] - zeros[None, :])
                total += float(np.angle(reach * np.conj(start[:, None] - zeros[None, :])).sum())
                total += sign * float((half[k + 1] - half[k]).sum())
            if factors.delay:
                k = np.flatnonzero(loud)
                turned = np.append(edges, np.inf)[k] - np.append(0.0, edges)[k]
                total -= factors.delay * float(turned.sum())
        count = 0.5 * factors.poles.size - total / np.pi
        if factors.delay * edges.max(initial=0.0) > UNCERTAIN_TURNS and math.isfinite(count) and count > 0.5:
            return round(count)
        return round_to_count(count)

    def _may_pass_unseen(self, flat: Any, L: Any) -> bool:
        """Return True if L may pass through -1 between two neighbouring points with |L| = 1."""
        pairs = flat[:-1] & flat[1:]
        negative = (L.real[:-1] < 0) & (L.real[1:] < 0) & (L.imag[:-1] * L.imag[1:] <= 0)
        return bool(np.any(pairs & (negative | (np.diff(self.grid) * self.delay > COARSE_STEP))))


@lru_cache(maxsize=64)
def axis_in_s(loop: Loop) -> AxisInS:
    """Return a continuous loop as an `AxisInS`. The last results are cached.

    Raises
    ------
    ValueError
        If the loop is ill-posed.
    """
    require_well_posed(loop)
    return unit_axis(loop)


def unit_axis(loop: Loop) -> AxisInS:
    """Return a continuous loop as an `AxisInS`. An ill-posed loop is accepted, because the caller scales its gain."""
    return from_factors(loop_factors(loop), static_gain(*open_loop(loop)))


def from_factors(factors: LoopFactors, at_zero: float = math.nan) -> AxisInS:
    """Return the `AxisInS` of a continuous loop from its factors."""
    at_infinity = factors.gain if factors.zeros.size == factors.poles.size else 0.0
    w = frequencies(np.concatenate([factors.zeros, factors.poles]), factors.delay)
    num, den = factors.fraction(1j * w)
    more = _towards_far_crossovers(factors, w, num, den)
    if more:
        w = np.concatenate([more[0], w, more[1]])
        num, den = factors.fraction(1j * w)
    return AxisInS(
        grid=w,
        delay=factors.delay,
        at_zero=at_zero,
        at_end=-abs(at_infinity) if factors.delay else at_infinity,
        factors=factors,
        on_grid=Samples(w, num, den),
    )


def _towards_far_crossovers(factors: LoopFactors, w: Array, num: Any, den: Any) -> list[Array]:
    """Return two arrays of frequencies, below and above the grid, up to the estimated far crossings of |L| = 1.

    Beyond the grid |L| is nearly a power of w. Return an empty list if the grid is wide enough.
    """
    at_zero = factors.poles.tolist().count(0) - factors.zeros.tolist().count(0)
    at_infinity = factors.poles.size - factors.zeros.size
    parts = []
    for side, k, power in ((-1, 0, at_zero), (1, -1, at_infinity)):
        end, part, size = float(w[k]), np.zeros(0), abs(complex(num[k])) / (abs(complex(den[k])) or math.nan)
        beyond = CLEAR if side * power < 0 else 1 / CLEAR
        if power and size > 0 and (size < beyond) == (beyond > 1):
            far = math.exp(math.log(end) + math.log(size / beyond) / power)
            if 0 < far < math.inf:
                count = 2 + int(FAR_PER_DECADE * abs(math.log10(far / end)))
                part = np.geomspace(end, far, count)[1:][::side]
        parts.append(part)
    return parts if any(part.size for part in parts) else []
