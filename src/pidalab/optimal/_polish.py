r"""The last steps to an optimum: to the point that its own conditions fix.

A descent stops where its tolerance is met, and in a flat valley rounding decides where that is. From there Newton's
method goes on: limits that are reached become equations, each at the frequency of its own peak, and the Lagrangian is
made stationary, with second derivatives from differences of exact first ones. Each step is a quadratic programme, so
that limits join and leave by their multipliers (Nocedal and Wright, Numerical Optimization, 2006, ch. 18), solved as
a least-distance programme (Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.optimal._heights import HEIGHTS, MS, top, weights, with_turns
from pidalab.optimal._problem import Scaled
from pidalab.optimal._quadratic import convex, multipliers, solve_qp
from pidalab.optimal._solver import Search

ROOM = 1e-9  # share of a limit that is left, for rounding
NEAR_LIMIT = 0.05  # share of a limit within which a peak is looked at
FREQUENCY_STEP, PEAK_STEPS = 1e-5, 8  # of a frequency, for the bend of a peak; steps to its top
SPACING, LEAST_SPACING = 1e-4, 1e-6  # of the points that second derivatives come from, as a descent sees them
# of Newton at most; the last one, and the largest that is taken for one
MOST_NEWTON_STEPS, LAST_STEP, LARGEST_LAST_STEP = 25, 1e-9, 1e-4
SMALL_STEP = 1e-3  # step after which second derivatives stay as they are
# longest step; one that is near the end; shortest trust in one
LARGEST_TRUST, LOCAL_STEP, LEAST_TRUST = 0.5, 0.1, 1e-6
LEAST_UNIT = 1e-9  # unit of a gain
NOMINAL = len(HEIGHTS)  # kinds of peaks of the process itself: the first of those of other plants


class Polished(NamedTuple):
    """Where the last steps ended."""

    value: float  # IAE, in units of time of the problem
    x: Array
    step: float  # the last step, in the units of a descent: what is left open
    w: Array  # frequencies of the peaks that come near their limits


class Peaks:
    """Heights of peaks of the process and of |S| with other plants, as smooth functions of the unknowns.

    The kinds of peaks are numbers: those of `HEIGHTS` first, of which not all may be limited, then one for |S| with
    each other plant.
    """

    def __init__(self, search: Search) -> None:
        self.problem = problem = search.problem
        limits, others = search.limits.peaks(ROOM), [search.family[k] for k in search.active]
        worst = [search.limits.ms_worst * (1 - ROOM)] * len(others)
        self.plants = [problem.process] * NOMINAL + others
        self.tops = np.log([*(limits.get(name, np.inf) for name in HEIGHTS), *worst])
        self.limited = [kind for kind, name in enumerate(HEIGHTS) if name in limits]
        fastest = math.exp(search.bounds[problem.gains][0])
        w = np.geomspace(1e-3, 30.0 / fastest, 700) / problem.time
        w = with_turns(w, problem.process.delay, 0.3 * np.arange(1.0, 400.0))
        self.w = np.unique(np.append(w, search.w))
        s = 1j * self.w
        self.at_grid = s, problem.process(s), problem._actions(s)
        self.others_at_grid = np.array([plant(s) for plant in others]).reshape(-1, s.size)

    def heights(self, x: Array) -> Array:
        """Logarithms of all heights over their limits at the frequencies of the grid."""
        s, plant, actions = self.at_grid
        controller = self.problem._controller(x, s, actions)[0]
        L = plant * controller
        back = np.log(np.abs(1 + L))
        found = np.full((NOMINAL, s.size), -np.inf)
        for kind in self.limited:
            found[kind] = np.log(np.abs(top(kind, controller, L))) - back - self.tops[kind]
        others = -np.log(np.abs(1 + self.others_at_grid * controller)) - self.tops[NOMINAL:, None]
        return np.vstack([found, others])

    def _plant(self, s: Any, kinds: Array) -> tuple[Any, Any]:
        """The plant of each peak, and s P'/P."""
        value, turn = np.empty(s.size, dtype=complex), np.empty(s.size, dtype=complex)
        owner = np.where(kinds < NOMINAL, 0, kinds)
        for kind in np.unique(owner):
            at, plant = owner == kind, self.plants[kind]
            here = s[at]
            value[at] = plant(here)
            by_num, by_den = (
                np.polyval(np.polyder(c), here) / np.polyval(c, here) for c in (plant.num, plant.den)
            )
            turn[at] = here * (by_num - by_den - plant.delay)
        return value, turn

    def near(self, x: Array) -> tuple[Any, Array]:
        """Which peaks come near their limits: kinds and frequencies."""
        heights = self.heights(x)
        inner = heights[:, 1:-1]
        kinds, i = np.nonzero((inner > heights[:, :-2]) & (inner >= heights[:, 2:]) & (inner > -NEAR_LIMIT))
        return kinds, self.w[i + 1]

    def bend(self, x: Array, kinds: Array, w: Array) -> Array:
        """Second derivatives of the logarithms of heights by that of the frequency, at peaks."""
        above, below = (self._slope(x, kinds, w * math.exp(h)) for h in (FREQUENCY_STEP, -FREQUENCY_STEP))
        return np.asarray(np.minimum((above - below) / (2 * FREQUENCY_STEP), -1e-9))

    def refine(self, x: Array, kinds: Array, w: Array, bend: Array) -> Array:
        """Frequencies of peaks, from points of the grid beside them, where the slope is zero."""
        log = np.log(w)
        for _ in range(PEAK_STEPS):
            move = np.clip(-self._slope(x, kinds, np.exp(log)) / bend, -0.02, 0.02)
            log = log + move
            if np.max(np.abs(move), initial=0.0) < 1e-12:
                break
        return np.asarray(np.exp(log))

    def _slope(self, x: Array, kinds: Array, w: Array) -> Array:
        """Slope of the logarithm of a height by that of the frequency."""
        s = 1j * w
        gains, time = self.problem.controller(x)
        powers, order = np.arange(-1.0, gains.size - 1.0), gains.size - 1
        terms, lag = gains[:, None] * s ** powers[:, None], 1 / (1 + time * s)
        action = terms.sum(axis=0)
        by_controller = (powers @ terms) / action + order * (lag - 1)  # s C'/C
        plant, by_plant = self._plant(s, kinds)
        _, a, b = _parts(kinds, action, plant * action * lag**order)
        return np.asarray(np.real(a * by_controller + b * by_plant))

    def rows(self, x: Array, kinds: Any, w: Array) -> tuple[Array, Array]:
        """Heights of peaks, and their slopes by the unknowns."""
        s = 1j * w
        controller, slopes = self.problem._controller(x, s, self.problem._actions(s))
        L = self._plant(s, kinds)[0] * controller
        above, a, _ = _parts(kinds, controller, L)
        heights = np.log(np.abs(above / (1 + L))) - self.tops[kinds]
        return heights, np.real(a / controller * slopes()).T


def _parts(kinds: Array, controller: Array, L: Array) -> Any:
    """Numerators over 1 + L, and both weights, of peaks, of which there are few; with other plants it is |S|."""
    own = (kind if kind < NOMINAL else MS for kind in kinds.tolist())
    each = zip(own, controller.tolist(), L.tolist(), strict=True)
    found = [(top(kind, c, l), *weights(kind, l)) for kind, c, l in each]
    return np.array(found, dtype=complex).reshape(-1, 3).T


class Lagrangian:
    """IAE and limits as a descent sees them, around one point."""

    def __init__(self, search: Search, x: Array) -> None:
        problem, self.search = search.problem, search
        self.seen = Scaled(x, problem.gains)
        small = (x > 0) & (x < self.seen.unit)
        small[[0, -1]] = False
        self.seen.unit[small] = np.maximum(x[small], LEAST_UNIT)
        low, high = np.transpose(search.bounds)
        self.low, self.high = self.seen(low), self.seen(high)
        self.peaks = Peaks(search)
        self.most = math.log((search.limits.noise_gain or 1.0) * (1 - ROOM))

    def end(self, z: Array) -> Array:
        """Unknowns themselves."""
        return np.clip(self.seen.back(z), *np.transpose(self.search.bounds))

    def value(self, z: Array) -> tuple[float, Any]:
        """Logarithm of the IAE, and the function of its slope."""
        x = self.seen.back(z)
        value, slope = self.search.fine(x)
        return math.log(value), lambda: self.seen.slopes(x, slope() / value)

    def margins(self, z: Array, kinds: Array, w: Array, noise: Any) -> tuple[Array, Array]:
        """What is left to peaks and noise, and slopes."""
        x = self.seen.back(z)
        heights, slopes = self.peaks.rows(x, kinds, w)
        left, by_x = -heights, -slopes
        if noise is not None:
            variance, slope = noise(x)
            left = np.append(left, self.most - 0.5 * math.log(variance))
            by_x = np.vstack([by_x, -0.5 * slope() / variance])
        return left, self.seen.slopes(x, by_x)

    def tops(self, z: Array) -> tuple[Array, Array]:
        """Peaks near their limits, refine."""
        x = self.seen.back(z)
        kinds, w = self.peaks.near(x)
        return kinds, self.peaks.refine(x, kinds, w, self.peaks.bend(x, kinds, w))

    def missed(self, z: Array) -> tuple[float, float]:
        """Value, and by how much limits are missed in all; infinite where the loop is unstable."""
        x = self.seen.back(z)
        if not np.all(np.isfinite(x)) or self.search.problem.unstable(x):
            return math.inf, math.inf
        left, _ = self.margins(z, *self.tops(z), self.search.exact_noise)
        return self.value(z)[0], float(np.maximum(-left, 0.0).sum())

    def hessian(self, z: Array, kinds: Array, w: Array, prices: Array, worth: Any, h: float) -> Array:
        """Second derivatives of the Lagrangian, peaks followed to where they lie; of noise as in a descent."""
        bend, found = self.peaks.bend(self.seen.back(z), kinds, w), np.empty((z.size, z.size))

        def slope(z: Array) -> Array:
            x = self.seen.back(z)
            value, by_x = worth(x)
            moved = self.peaks.refine(x, kinds, w, bend)
            by_limits = self.margins(z, kinds, moved, self.search.noise)[1]
            return np.asarray(self.seen.slopes(x, by_x() / value) - prices @ by_limits)

        for k, way in enumerate(h * np.eye(z.size)):
            found[k] = (slope(z + way) - slope(z - way)) / (2 * h)
        return 0.5 * (found + found.T)


def polish(search: Search, x: Array) -> Polished | None:
    """Go from near an optimum to where its conditions are met; None where Newton's method does not come to rest."""
    one = Lagrangian(search, x)
    z, trust, price, stale = np.clip(one.seen(x), one.low, one.high), LARGEST_TRUST, 0.0, True
    before, worth, apart = math.inf, search.worth, SPACING
    value, missed = one.missed(z)
    eye, hessian = np.eye(z.size), np.zeros(0)
    for _ in range(MOST_NEWTON_STEPS):
        kinds, w = one.tops(z)
        left, slopes = one.margins(z, kinds, w, search.exact_noise)
        slope = one.value(z)[1]()
        rows = np.vstack([slopes, eye, -eye])
        left = np.concatenate([left, z - one.low, one.high - z])
        limits = left.size - 2 * z.size
        if stale:  # else the second derivatives of the last step serve
            prices = multipliers(slope, rows, left)
            hessian = convex(one.hessian(z, kinds, w, prices[:limits], worth, apart), rows[prices > 0])
        while True:
            found = solve_qp(hessian, slope, rows, left, trust)
            if found is None:
                return None
            step, prices = found
            length = float(np.max(np.abs(step)))
            price = max(price, 2 * float(np.max(prices[:limits], initial=0.0)))
            there, by = one.missed(z + step)
            # near the end steps that shrink count for more than values: a full one may miss curved limits by a little
            near = length < min(LOCAL_STEP, 0.5 * before) and there < math.inf
            if near or there + price * by <= value + price * missed:
                break
            # it shrinks, also where rounding let the step pass it
            trust = 0.3 * min(trust, length)
            if trust < LEAST_TRUST:
                return None
        z, value, missed = np.clip(z + step, one.low, one.high), there, by
        trust = max(trust, min(LARGEST_TRUST, 3 * length))
        if length < LAST_STEP:
            break
        stale = length > SMALL_STEP or length > 0.1 * before
        if length > 0.3 * before:
            worth, apart = search.fine, min(SPACING, max(0.1 * length, LEAST_SPACING))  # a closer look
        before = length
    return Polished(math.exp(value), one.end(z), length, w) if length < LARGEST_LAST_STEP else None
