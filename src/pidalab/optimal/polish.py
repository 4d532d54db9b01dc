r"""Refine an optimum until its optimality conditions hold.

Near a flat minimum, rounding decides where a descent stops. Newton's method continues until the optimality conditions
hold: the Lagrangian is stationary, and each active limit holds with equality at the frequency of its peak. Second
derivatives are computed as differences of exact first derivatives. Each step solves a quadratic programme, whose
multipliers decide which limits are active (Nocedal and Wright, Numerical Optimization, 2006, ch. 18). The quadratic
programme is solved as a least-distance programme (Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.optimal.problem import MS, PEAKS, Scaled, numerator, weights, with_turns
from pidalab.optimal.search import FINE, NEARLY, SPARE, Search, is_surely_stable
from pidalab.robustness.axis import COMPLEMENTARY, DIFFERENCE
from pidalab.robustness.in_z import axis_of
from pidalab.robustness.margins import max_control_sensitivity, max_sensitivity

MAX_FINISHES = 12  # largest number of rounds of `finish`; each round adds frequencies of violated limits
VALLEY_GAP = 1e-2  # an optimum is dropped if its value exceeds (1 + this) * the value of a known optimum
# Estimated error, in scaled variables, of an optimum that was not refined by Newton's method.
UNPOLISHED = 1e-2
ALIKE = 0.01  # relative and absolute tolerance within which the unknowns of equal local optima agree
BACK = 0.97  # the gains are multiplied by this before a diverged descent is repeated
WORST_PLANTS = 2  # at most this number of plants is added to `search.active` in one round
# With a family of plants, the gains are multiplied by SHRINK at most SHRINKS times, until the loops are stable and no
# limit is violated by more than LARGEST_VIOLATION.
SHRINK, SHRINKS, LARGEST_VIOLATION = 0.85, 40, 0.5
# For each quantity that can be limited, a function that returns its supremum and the frequency of the supremum.
SUPREMA: dict[str, Callable[[Loop], tuple[float, float]]] = {
    "ms": max_sensitivity,
    "mks": max_control_sensitivity,
    "mt": lambda loop: axis_of(loop).peak(COMPLEMENTARY),
    "inverse_disk": lambda loop: axis_of(loop).peak(DIFFERENCE),
}
ROOM = 1e-9  # relative allowance for rounding at a limit
NEAR_LIMIT = 0.05  # a peak is near its limit if log(height / limit) > -NEAR_LIMIT
FREQUENCY_STEP = 1e-5  # relative step of the frequency in the difference quotient for the curvature of a peak
PEAK_STEPS = 8  # largest number of Newton steps to the top of a peak
# Largest and least step of the difference quotients for second derivatives, in scaled variables.
SPACING, LEAST_SPACING = 1e-4, 1e-6
# The iteration ends after MOST_NEWTON_STEPS steps, or after a step shorter than LAST_STEP. Its result is accepted if
# the last step is shorter than LARGEST_LAST_STEP.
MOST_NEWTON_STEPS, LAST_STEP, LARGEST_LAST_STEP = 25, 1e-9, 1e-4
SMALL_STEP = 1e-3  # see `polish`
# Largest radius of the trust region, length of a local step (see `polish`), and least radius of the trust region.
LARGEST_TRUST, LOCAL_STEP, LEAST_TRUST = 0.5, 0.1, 1e-6
LEAST_UNIT = 1e-9  # least scale factor of a gain
# Number of kinds of peaks in the loop with the process (see `Peaks`).
NOMINAL = len(PEAKS)


class Polished(NamedTuple):
    """Result of a refinement."""

    value: float  # IAE, divided by the unit of time of the problem
    x: Array
    step: float  # size of the last step in scaled variables, an estimate of the error
    w: Array  # frequencies of the peaks near their limits


class Peaks:
    """Heights of peaks, as smooth functions of the unknowns (see `pidalab.optimal.problem` for the heights).

    The kind of a peak is a number. Kinds below `NOMINAL` are indices of `PEAKS`: these peaks belong to the loop with
    the process. Each active plant of the family has one further kind, for the peaks of |S| with this plant.
    """

    def __init__(self, search: Search) -> None:
        self.problem = problem = search.problem
        limits, others = search.limits.peaks(ROOM), [search.family[k] for k in search.active]
        worst = [search.limits.ms_worst * (1 - ROOM)] * len(others)
        self.plants = [problem.process] * NOMINAL + others
        self.log_limits = np.log([*(limits.get(name, np.inf) for name in PEAKS), *worst])
        self.limited = [kind for kind, name in enumerate(PEAKS) if name in limits]
        fastest = math.exp(search.bounds[problem.gains][0])
        w = np.geomspace(1e-3, 30.0 / fastest, 700) / problem.time
        w = with_turns(w, problem.process.delay, 0.3 * np.arange(1.0, 400.0))
        self.w = np.unique(np.append(w, search.w))
        s = 1j * self.w
        self.at_grid = s, problem.process(s), problem._actions(s)
        self.others_at_grid = np.array([plant(s) for plant in others]).reshape(-1, s.size)

    def log_heights(self, x: Array) -> Array:
        """Return log(height / limit) at the frequencies of the grid, with one row for each kind."""
        s, plant, actions = self.at_grid
        controller = self.problem._controller(x, s, actions)[0]
        L = plant * controller
        back = np.log(np.abs(1 + L))
        heights = np.full((NOMINAL, s.size), -np.inf)
        for kind in self.limited:
            heights[kind] = np.log(np.abs(numerator(kind, controller, L))) - back - self.log_limits[kind]
        others = -np.log(np.abs(1 + self.others_at_grid * controller)) - self.log_limits[NOMINAL:, None]
        return np.vstack([heights, others])

    def _plant(self, s: Any, kinds: Array) -> tuple[Any, Any]:
        """Return P(s) and s P'(s)/P(s) for each peak, where P is the plant to which the peak belongs."""
        value, turn = np.empty(s.size, dtype=complex), np.empty(s.size, dtype=complex)
        owner = np.where(kinds < NOMINAL, 0, kinds)
        for kind in np.unique(owner):
            place, plant = owner == kind, self.plants[kind]
            here = s[place]
            value[place] = plant(here)
            by_num, by_den = (
                np.polyval(np.polyder(c), here) / np.polyval(c, here) for c in (plant.num, plant.den)
            )
            turn[place] = here * (by_num - by_den - plant.delay)
        return value, turn

    def near(self, x: Array) -> tuple[Any, Array]:
        """Return the kind of each peak near its limit, and the frequency of each peak on the grid."""
        heights = self.log_heights(x)
        inner = heights[:, 1:-1]
        kinds, i = np.nonzero((inner > heights[:, :-2]) & (inner >= heights[:, 2:]) & (inner > -NEAR_LIMIT))
        return kinds, self.w[i + 1]

    def bend(self, x: Array, kinds: Array, w: Array) -> Array:
        """Return the second derivative of log(height) with respect to log(frequency), for each peak."""
        above, below = (self._slope(x, kinds, w * math.exp(h)) for h in (FREQUENCY_STEP, -FREQUENCY_STEP))
        return np.asarray(np.minimum((above - below) / (2 * FREQUENCY_STEP), -1e-9))

    def refine(self, x: Array, kinds: Array, w: Array, bend: Array) -> Array:
        """Refine the frequencies of peaks by Newton's method on the slope."""
        log = np.log(w)
        for _ in range(PEAK_STEPS):
            move = np.clip(-self._slope(x, kinds, np.exp(log)) / bend, -0.02, 0.02)
            log = log + move
            if np.max(np.abs(move), initial=0.0) < 1e-12:
                break
        return np.asarray(np.exp(log))

    def _slope(self, x: Array, kinds: Array, w: Array) -> Array:
        """Return the derivative of log(height) with respect to log(frequency), for each peak."""
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
        """Return log(height / limit) of each peak, and its gradient with respect to the unknowns."""
        s = 1j * w
        controller, slopes = self.problem._controller(x, s, self.problem._actions(s))
        L = self._plant(s, kinds)[0] * controller
        above, a, _ = _parts(kinds, controller, L)
        heights = np.log(np.abs(above / (1 + L))) - self.log_limits[kinds]
        return heights, np.real(a / controller * slopes()).T


def _parts(kinds: Array, controller: Array, L: Array) -> Any:
    """Return for each peak the numerator t of its height |t/(1 + L)|, and the weights a and b of `weights`."""
    kind_of_each = (kind if kind < NOMINAL else MS for kind in kinds.tolist())
    each = zip(kind_of_each, controller.tolist(), L.tolist(), strict=True)
    values = [(numerator(kind, c, l), *weights(kind, l)) for kind, c, l in each]
    return np.array(values, dtype=complex).reshape(-1, 3).T


class Lagrangian:
    """IAE and limits near one point, as functions of scaled variables."""

    def __init__(self, search: Search, x: Array) -> None:
        problem, self.search = search.problem, search
        self.scaled = Scaled(x, problem.gains)
        small = (x > 0) & (x < self.scaled.unit)
        small[[0, -1]] = False
        self.scaled.unit[small] = np.maximum(x[small], LEAST_UNIT)
        low, high = np.transpose(search.bounds)
        self.low, self.high = self.scaled(low), self.scaled(high)
        self.peaks = Peaks(search)
        self.most = math.log((search.limits.noise_gain or 1.0) * (1 - ROOM))

    def end(self, z: Array) -> Array:
        """Convert scaled variables to unknowns within their bounds."""
        return np.clip(self.scaled.back(z), *np.transpose(self.search.bounds))

    def value(self, z: Array) -> tuple[float, Any]:
        """Return the logarithm of the IAE, and a function that returns its gradient."""
        x = self.scaled.back(z)
        value, slope = self.search.fine(x)
        return math.log(value), lambda: self.scaled.slopes(x, slope() / value)

    def margins(self, z: Array, kinds: Array, w: Array, noise: Any) -> tuple[Array, Array]:
        """Return the slack of each limit on peaks and noise, and the gradient of each slack."""
        x = self.scaled.back(z)
        heights, slopes = self.peaks.rows(x, kinds, w)
        slack, by_x = -heights, -slopes
        if noise is not None:
            variance, slope = noise(x)
            slack = np.append(slack, self.most - 0.5 * math.log(variance))
            by_x = np.vstack([by_x, -0.5 * slope() / variance])
        return slack, self.scaled.slopes(x, by_x)

    def refined_peaks(self, z: Array) -> tuple[Array, Array]:
        """Return the kind of each peak near its limit, and the exact frequency of each peak."""
        x = self.scaled.back(z)
        kinds, w = self.peaks.near(x)
        return kinds, self.peaks.refine(x, kinds, w, self.peaks.bend(x, kinds, w))

    def violation(self, z: Array) -> tuple[float, float]:
        """Return log IAE and the sum of all violations, or two infinities if the loop is unstable."""
        x = self.scaled.back(z)
        if not np.all(np.isfinite(x)) or self.search.problem.unstable(x):
            return math.inf, math.inf
        slack, _ = self.margins(z, *self.refined_peaks(z), self.search.exact_noise)
        return self.value(z)[0], float(np.maximum(-slack, 0.0).sum())

    def hessian(self, z: Array, kinds: Array, w: Array, multipliers: Array, iae_of: Any, h: float) -> Array:
        """Return the second derivatives of the Lagrangian as difference quotients of step h.

        The frequencies of the peaks are refined at each point of the difference quotients.
        """
        bend, second = self.peaks.bend(self.scaled.back(z), kinds, w), np.empty((z.size, z.size))

        def slope(z: Array) -> Array:
            x = self.scaled.back(z)
            value, by_x = iae_of(x)
            moved = self.peaks.refine(x, kinds, w, bend)
            by_limits = self.margins(z, kinds, moved, self.search.noise)[1]
            return np.asarray(self.scaled.slopes(x, by_x() / value) - multipliers @ by_limits)

        for k, way in enumerate(h * np.eye(z.size)):
            second[k] = (slope(z + way) - slope(z - way)) / (2 * h)
        return 0.5 * (second + second.T)


def polish(search: Search, x: Array) -> Polished | None:
    """Refine an approximate optimum until its conditions hold. Return None if Newton's method does not converge.

    Notes
    -----
    The state is a point z in scaled variables, with `value` (log IAE) and `violation` (the sum of all violations) at z.
    Each step solves the quadratic programme of sequential quadratic programming within a trust region.

    * Far from the end, a step is accepted only if it does not raise value + penalty * violation. The penalty is at
      least twice the largest multiplier.
    * A step is near the end if it is shorter than both `LOCAL_STEP` and half of the preceding step. Such a step is
      accepted if the loop stays stable. The iteration ends when a step is shorter than `LAST_STEP`.
    * Second derivatives are computed again (`stale`) if the last step is longer than `SMALL_STEP` or longer than a
      tenth of the step before it.
    * Second derivatives are computed from the response with few samples (`search.iae`), until a step is longer than 0.3
      times the preceding step. From then on the response with many samples (`search.fine`) is used.
    """
    lagrangian = Lagrangian(search, x)
    z = np.clip(lagrangian.scaled(x), lagrangian.low, lagrangian.high)
    trust, penalty, stale = LARGEST_TRUST, 0.0, True
    before, iae_of, spacing = math.inf, search.iae, SPACING
    value, violation = lagrangian.violation(z)
    eye, hessian = np.eye(z.size), np.zeros(0)
    for _ in range(MOST_NEWTON_STEPS):
        kinds, w = lagrangian.refined_peaks(z)
        slack, slopes = lagrangian.margins(z, kinds, w, search.exact_noise)
        slope = lagrangian.value(z)[1]()
        rows = np.vstack([slopes, eye, -eye])
        slack = np.concatenate([slack, z - lagrangian.low, lagrangian.high - z])
        limits = slack.size - 2 * z.size
        if stale:
            multipliers = estimate_multipliers(slope, rows, slack)
            hessian = convex(
                lagrangian.hessian(z, kinds, w, multipliers[:limits], iae_of, spacing), rows[multipliers > 0]
            )
        while True:
            solution = solve_qp(hessian, slope, rows, slack, trust)
            if solution is None:
                return None
            step, multipliers = solution
            length = float(np.max(np.abs(step)))
            penalty = max(penalty, 2 * float(np.max(multipliers[:limits], initial=0.0)))
            there, by = lagrangian.violation(z + step)
            # A full step may violate a curved limit slightly. So near the end only the length of the step counts.
            is_near = length < min(LOCAL_STEP, 0.5 * before) and there < math.inf
            if is_near or there + penalty * by <= value + penalty * violation:
                break
            # Shrink the trust region even if rounding made the step longer than its radius.
            trust = 0.3 * min(trust, length)
            if trust < LEAST_TRUST:
                return None
        z, value, violation = np.clip(z + step, lagrangian.low, lagrangian.high), there, by
        trust = max(trust, min(LARGEST_TRUST, 3 * length))
        if length < LAST_STEP:
            break
        stale = length > SMALL_STEP or length > 0.1 * before
        if length > 0.3 * before:
            iae_of, spacing = search.fine, min(SPACING, max(0.1 * length, LEAST_SPACING))
        before = length
    return Polished(math.exp(value), lagrangian.end(z), length, w) if length < LARGEST_LAST_STEP else None


# --- quadratic programmes ---------------------------------------------------------------------------------------------


FLATTEST = 1e-9  # least curvature in any direction


def estimate_multipliers(slope: Array, rows: Array, slack: Array) -> Array:
    """Return non-negative multipliers of the active limits, fitted to the gradient by least squares."""
    from scipy.optimize import nnls

    multipliers = np.zeros(slack.size)
    reached = slack < 1e-3
    if reached.any():
        multipliers[reached] = nnls(rows[reached].T, slope)[0]
    return multipliers


def convex(hessian: Array, reached: Array) -> Array:
    """Make a matrix of second derivatives positive definite.

    Curvatures in directions along the active limits are replaced by their absolute values. In the other directions,
    curvature is added until the whole matrix is positive definite.
    """
    if reached.size:
        _, sizes, turned = np.linalg.svd(reached)
        free = turned[int(np.sum(sizes > 1e-9 * sizes[0])) :].T
    else:
        free = np.eye(len(hessian))
    values, vectors = np.linalg.eigh(free.T @ hessian @ free)
    along = free @ vectors
    wanted = np.maximum(np.abs(values), FLATTEST)
    hessian = hessian + (along * (wanted - values)) @ along.T
    heavy = max(1e-3, float(np.abs(hessian).max(initial=0.0)))
    off = np.eye(len(hessian)) - free @ free.T
    for factor in 10.0 ** np.arange(0, 8):
        out = np.asarray(hessian + factor * heavy * off)
        if np.linalg.eigvalsh(out)[0] > 0:
            return out
    return out


def solve_qp(
    hessian: Array, slope: Array, rows: Array, slack: Array, trust: float
) -> tuple[Array, Array] | None:
    """Return the step that minimises a quadratic function, and the multipliers of the limits.

    The step satisfies rows @ step >= -slack, and no element of the step exceeds `trust` in size. Return None if no
    such step exists.
    """
    from scipy.optimize import nnls

    size = slope.size
    rows = np.vstack([rows, np.eye(size), -np.eye(size)])
    slack = np.concatenate([slack, np.full(2 * size, trust)])
    root = np.linalg.cholesky(hessian)  # hessian = root root^T
    best = np.asarray(-np.linalg.solve(hessian, slope), dtype=float)
    turned = np.linalg.solve(root, rows.T)  # limits as columns, in coordinates with identity Hessian
    wanted = -slack - rows @ best
    if np.all(wanted <= 0):
        return best, np.zeros(slack.size - 2 * size)
    scale = np.linalg.norm(turned, axis=0)
    system = np.vstack([turned / scale, wanted / scale])
    target = np.append(np.zeros(size), 1.0)
    weights, _ = nnls(system, target)
    residual = system @ weights - target
    if -residual[-1] < 1e-13:
        return None
    multipliers = weights / scale / -residual[-1]
    step = np.asarray(best + np.linalg.solve(root.T, turned @ multipliers), dtype=float)
    return step, multipliers[: slack.size - 2 * size]


# --- refinement -------------------------------------------------------------------------------------------------------


def finish(search: Search, x: Array, known: Sequence[Polished] = ()) -> Polished | None:
    """Refine and verify an optimum: descend, polish, and add frequencies until the limits hold at all frequencies.

    Return None if this fails, if the optimum is already known, or if it is clearly worse than a known optimum.
    """
    for _ in range(MAX_FINISHES):
        value, unknowns, violation = search.descend(x, effort=FINE)
        if violation > NEARLY or not search.sound(unknowns):
            # The descent diverged, so repeat it with smaller gains.
            x = np.append(BACK * x[: search.problem.gains], x[-1])
            continue
        if any(
            value > other.value * (1 + VALLEY_GAP) or np.allclose(unknowns, other.x, ALIKE, ALIKE)
            for other in known
        ):
            return None
        x, end = unknowns, polish(search, unknowns)
        if end is None:
            end = Polished(search.fine(x)[0], x, UNPOLISHED, np.zeros(0))
        for peak in end.w:  # the next descents use these frequencies
            search.look_at(peak, nearly=True)
        if search.sound(end.x) and _keeps(search, end.x, search.true_noise(end.x)):
            if _safe(search, end.x):
                return end
            x = _shrunk(search, x)
    return None


def _safe(search: Search, x: Array) -> bool:
    """Return True if Ms is at most `ms_worst` with each plant of the family. Otherwise add the worst plants."""
    loop, peaks = search.loop(x), []
    for k, plant in enumerate(search.family):
        other = Loop(plant, loop.controller)
        ms, frequency = max_sensitivity(other)
        peaks.append((ms if is_surely_stable(other) else np.inf, frequency, k))
    worst = sorted(peaks, reverse=True)[:WORST_PLANTS]
    over = [entry for entry in worst if entry[0] > search.limits.ms_worst]
    for _, frequency, k in over:
        search.see(k, frequency)
    return not over


def _shrunk(search: Search, x: Array) -> Array:
    """Reduce the gains until the loop is stable with all active plants of the family, and the violation is small."""
    x, gains = x.copy(), search.problem.gains
    for _ in range(SHRINKS):
        loops = (Loop(search.family[k], search.loop(x).controller) for k in search.active)
        if search.violation(x) <= LARGEST_VIOLATION and all(is_surely_stable(loop) for loop in loops):
            break
        x[:gains] *= SHRINK
        x[0] *= SHRINK**0.5
    return x


def _keeps(search: Search, x: Array, noise: float) -> bool:
    """Return True if all limits hold. Otherwise add the frequencies of violated peaks and tighten `search.aim`."""
    loop, kept = search.loop(x), True
    for name, most in search.limits.peaks(0.0).items():
        height, frequency = SUPREMA[name](loop)
        if height > most:
            kept = False
            search.look_at(frequency)
    if search.limits.noise_gain is not None and noise > search.limits.noise_gain:
        kept = False
        search.aim *= search.limits.noise_gain / noise * (1 - SPARE)
    return kept
