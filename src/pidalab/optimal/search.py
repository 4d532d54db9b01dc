"""Minimise the IAE under limits by local searches (descents), and choose their starts, for `pidalab.optimal`.

The starts are chosen from two families of candidates. The first family consists of PI and PID controllers with several
filter times. The second family is for plants that cannot be stabilised without derivative or acceleration. Each of its
controllers has one or more equal zeros below a chosen crossover frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.optimal.problem import (
    BARRIER,
    CachedValueAndSlope,
    Problem,
    SampledNoise,
    Scaled,
    Slope,
    unit_of_time,
    with_turns,
)
from pidalab.process import Process
from pidalab.requirements import Requirements
from pidalab.robustness.poles import is_stable

FINE_SAMPLES = 8192  # number of samples of the response for the final IAE
# Grid of the logarithms of filter times, in units of time of the problem: largest value, smallest value, and number of
# values.
SLOWEST_ON_GRID, FASTEST_ON_GRID, GRID_SIZE = 1.0, -5.0, 13
# Smallest and largest logarithm of a filter time, in units of time of the problem.
FASTEST, SLOWEST = -7.0, 3.0
LARGEST_GAIN = 1e6  # in the units of gain of the problem
SEARCH_HORIZON = 80.0  # horizon of a response, in units of time of the problem
VIOLATION_PRICE = 30.0  # penalty of a violation when starts are compared
# The search lowers each limit by this relative amount, since a peak may lie between two frequencies.
SPARE = 2e-5
# Frequencies around a peak, divided by the frequency of the peak.
AROUND = np.array([0.94, 0.98, 1.0, 1.02, 1.06])
# With `nearly`, `look_at` ignores a peak if a frequency of the grid differs from the peak by at most this fraction.
BETWEEN = 0.01
NEARLY = 1e-4  # allowed violation of a limit during the search
ROUGH, FINE = (25, 1e-5), (60, 1e-8)  # (iterations, tolerance) of intermediate and final descents
# A descent is long if it lowers log IAE by more than LONG_DESCENT. Then another descent follows, up to AGAIN in all.
AGAIN, LONG_DESCENT = 4, 0.2
FINER = 12  # (frequencies for the final noise gain) / (frequencies for the noise gain of the search)


class Search:
    """Problem whose limits are checked at a set of frequencies. The search adds frequencies around peaks."""

    nearest: Array | None = None  # controller with the least violation, found by `approached`
    # Plants of positive gain. The loop with each of them must have an Ms of at most `limits.ms_worst`.
    family: tuple[Process, ...] = ()

    def __init__(self, problem: Problem, limits: Requirements) -> None:
        self.problem, self.limits = problem, limits
        self.active: list[int] = []  # indices of the plants of the family that the descents consider
        time = problem.time
        # The grid is dense around the crossover. `with_turns` adds frequencies at equal steps of the phase of the dead
        # time.
        far = np.geomspace(10.0, 2.0 / np.exp(FASTEST_ON_GRID), 16)[1:]
        w = np.concatenate([np.geomspace(0.01, 0.15, 8), np.geomspace(0.16, 10.0, 42), far]) / time
        self.w = with_turns(w, problem.process.delay, np.arange(3.0, 40.0, 0.7))
        self.iae = problem.iae(SEARCH_HORIZON * time)
        self.fine = problem.iae(SEARCH_HORIZON * time, FINE_SAMPLES)
        h = limits.sample_time
        self.noise = self.exact_noise = None
        if limits.noise_gain is not None and h is not None:
            self.noise, self.exact_noise = (SampledNoise(problem, h, density) for density in (1, FINER))
        fastest = FASTEST if h is None else max(FASTEST, float(np.log(h / time)))
        # Limit on the noise gain in descents. It is lowered if `true_noise` is too high.
        self.aim = limits.noise_gain or 0.0
        filters = (fastest, max(SLOWEST, fastest + 2.0))
        self.filter_times = np.linspace(
            max(SLOWEST_ON_GRID, fastest + 1.0), max(FASTEST_ON_GRID, fastest), GRID_SIZE
        )
        self.bounds = [(1e-6, LARGEST_GAIN)] + [(0.0, LARGEST_GAIN)] * (problem.order + 1) + [filters]

    def sound(self, x: Array) -> bool:
        """Return True if the loop is stable. With a limit on the noise gain, the sampled loop must also be stable."""
        return is_surely_stable(self.loop(x)) and np.isfinite(self.true_noise(x))

    def near(self, x: Array, first: Array, filter_time: float) -> Array:
        """Return the best start at another filter time, given by its logarithm.

        Three kinds of starts are compared: the first start, the last optimum x, and x with less derivative action.
        """
        count, constraints = self.problem.gains, self.constraints()
        best, least = first, np.inf
        # Each unknown is multiplied by a power of `share`. For the gain of a derivative, the exponent is the order of
        # this derivative. For all other unknowns, the exponent is 0.
        powers = np.clip(np.arange(x.size) - 1.0, 0.0, None) * (np.arange(x.size) < count)
        for start in (first.copy(), *(x * share**powers for share in (1.0, 0.6, 0.3, 0.1))):
            start[count] = filter_time
            value = self.log_iae(start)[0] + np.log1p(VIOLATION_PRICE * self.violation(start, constraints))
            if value < least:
                best, least = start, value
        return best

    def log_iae(self, x: Array) -> tuple[float, Slope]:
        """Return log IAE and a function that returns its gradient. For an unstable loop return `BARRIER`."""
        if self.problem.unstable(x):
            return BARRIER, lambda: np.zeros(x.size)
        value, slope = self.iae(x)
        return float(np.log(value)), lambda: slope() / value

    def violation(self, x: Array, constraints: list[CachedValueAndSlope] | None = None) -> float:
        """Return the largest violation of a limit at the frequencies of the search, or 0 if no limit is violated."""
        return max(0.0, -min(float(np.min(each.value(x))) for each in constraints or self.constraints()))

    def constraints(self) -> list[CachedValueAndSlope]:
        """Return functions that compute the slack of all limits at `self.w`. A violation is a negative slack."""
        worst = {"ms": self.limits.ms_worst * (1 - SPARE)}
        functions = [self.problem.slack(self.w, self.limits.peaks(SPARE))]
        functions += [self.problem.slack(self.w, worst, self.family[k]) for k in self.active]
        if self.noise is not None:
            noise, most = self.noise, self.aim

            def margin(x: Array) -> tuple[float, Slope]:
                variance, slope = noise(x)
                deviation = np.sqrt(variance)
                return 1 - deviation / most, lambda: -slope() / (2 * deviation * most)

            functions.append(margin)
        return [CachedValueAndSlope(function) for function in functions]

    def descend(
        self,
        start: Array,
        filter_time: float | None = None,
        highest: float = LARGEST_GAIN,
        effort: tuple[int, float] = ROUGH,
    ) -> tuple[float, Array, float]:
        """Run sequential quadratic programming. Return the IAE, the unknowns and the largest violation.

        If the logarithm `filter_time` is given, the filter time is fixed. `highest` is the upper bound of the gain of
        the highest derivative. A failed descent returns an infinite IAE and an infinite violation.
        """
        from scipy.optimize import minimize

        bounds, x = list(self.bounds), start.copy()
        index = self.problem.gains
        if filter_time is not None:
            x[index], bounds[index] = filter_time, (filter_time, filter_time)
        x[index - 1], bounds[index - 1] = min(x[index - 1], highest), (0.0, highest)
        low, high = np.transpose(bounds)
        constraints, value = self.constraints(), self.log_iae(x)[0]
        with np.errstate(all="ignore"):
            for _ in range(AGAIN):
                scaled = Scaled(x, index)
                value_of, slope_of = scaled.functions(CachedValueAndSlope(self.log_iae))
                limits = (
                    dict(zip(("fun", "jac"), scaled.functions(each), strict=True)) for each in constraints
                )
                solution = minimize(
                    value_of, scaled(x), method="SLSQP", jac=slope_of,
                    bounds=list(zip(scaled(low), scaled(high), strict=True)),
                    constraints=[{"type": "ineq", **limit} for limit in limits],
                    options=dict(zip(("maxiter", "ftol"), effort, strict=True)),
                )  # fmt: skip
                end = np.clip(scaled.back(solution.x), low, high)
                before, value = value, float(solution.fun)
                violation = self.violation(end, constraints)
                # A long descent may end too early, because its estimate of the curvature comes partly from points far
                # from the end. So start another descent at the end.
                if not (np.isfinite(violation) and violation <= NEARLY and value < before - LONG_DESCENT):
                    break
                x = end
        ok = value < BARRIER and np.isfinite(violation)
        return (float(np.exp(value)), end, violation) if ok else (np.inf, start, np.inf)

    def loop(self, x: Array) -> Loop:
        """Return the loop whose controller has the unknowns x."""
        gains, time = self.problem.controller(x)
        return Loop(self.problem.process, HighOrderPID(gains.tolist(), time, self.problem.order + 1))

    def look_at(self, peak: float, nearly: bool = False) -> None:
        """Add frequencies around a peak. With `nearly`, add them only if no existing frequency is near the peak."""
        if 0 < peak < np.inf and not (nearly and np.min(np.abs(self.w - peak)) <= BETWEEN * peak):
            self.w = np.append(self.w, peak * AROUND)

    def see(self, k: int, peak: float) -> None:
        """Make plant k of the family active. If the plant is already active, add frequencies around its peak."""
        if k in self.active:
            self.look_at(peak)
        else:
            self.active.append(k)

    def true_noise(self, x: Array) -> float:
        """Return the noise gain of the sampled loop, 0 without a limit on noise, or infinity for an unstable loop."""
        return 0.0 if self.exact_noise is None else self.exact_noise.gain(x)


def is_surely_stable(loop: Loop) -> bool:
    """Return True if a loop is stable. Return False if its poles cannot be counted."""
    try:
        return is_stable(loop)
    except ArithmeticError:
        return False


def search_in(process: Process, order: int, limits: Requirements, factor: float = 1.0) -> Search:
    """Return a search whose unit of time is `factor` times the unit of time of the process.

    Parameters
    ----------
    process : Process
        Process with positive gain.
    order : int
        Highest derivative.
    limits : Requirements
        Requirements of the design.
    factor : float, optional
        Factor of the unit of time.

    Returns
    -------
    Search

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.optimal.search import search_in
    >>> from pidalab.requirements import Requirements
    >>> search_in(pidalab.lags(3, delay=1.0), 1, Requirements(ms=1.6)).problem.gains
    3
    """
    unit = factor * unit_of_time(process, limits)
    return Search(Problem(process, order, (abs(complex(process(1j / unit))), unit)), limits)


# --- starts -----------------------------------------------------------------------------------------------------------


# First family, in units of the problem: kp, ki/kp, kd/kp, and the logarithm of the filter time.
GAINS = (2.0, 1.2, 0.6, 0.3, 0.1, 0.03, 0.01, 0.003, 3e-4)
INTEGRAL_SHARES = (0.5, 0.1, 0.02, 0.004)
DERIVATIVES = (0.0, 1.0, 5.0)
FILTERS = (-4.0, -2.0, 0.0)
# Second family: crossover frequency w_c; w_c / (frequency of the zeros); (corner frequency of the filter) / w_c.
CROSSOVERS = np.geomspace(0.02, 5.0, 9)
ZEROS_BELOW = (3.0, 8.0, 25.0)
FILTER_ABOVE = (5.0, 30.0, 200.0)
# `relax` reduces the largest violation to this value, but not further. A violation of -1e-3 is a slack of 1e-3, so all
# limits then hold with a small margin.
INSIDE = -1e-3
TRIED = 60  # number of candidates whose stability is checked
# Largest number of starts, and least distance between two starts (see `_apart`).
STARTS, START_GAP = 6, np.log(4.0)
NEAREST = 4  # `approached` tries to move this number of candidates until they keep all limits


def feasible_starts(search: Search) -> list[Array]:
    """Return clearly different, stable candidates that keep all limits, in the order of rising IAE."""
    constraints = search.constraints()
    kept = [x for x in _ranked(search) if search.violation(x, constraints) == 0]
    chosen: list[Array] = []
    for x in sorted(kept, key=lambda x: search.iae(x)[0]):
        differs = all(_apart(x, other, search.problem.gains) for other in chosen)
        if differs and search.sound(x):
            chosen.append(x)
        if len(chosen) == STARTS:
            break
    return chosen


def _apart(first: Array, other: Array, gains: int) -> bool:
    """Return True if integral gain, largest gain or filter time of two candidates differ by a factor above 4."""
    differences = np.log([first[0] / other[0], first[:gains].max() / other[:gains].max()])
    return bool(max(np.abs(differences).max(), abs(first[gains] - other[gains])) > START_GAP)


def approached(search: Search) -> list[Array]:
    """Return a list with one start that keeps all limits, found from candidates that violate limits.

    The list is empty if no such start is found. Store the controller with the least violation in `search.nearest`.
    """
    least = np.inf
    for start in islice(stabilising(search), NEAREST):
        x = relax(search, start)
        violation = search.violation(x)
        if violation < least and search.sound(x):
            search.nearest, least = x, violation
        if least == 0:
            return [x]
    return []


def stabilising(search: Search) -> Iterator[Array]:
    """Yield candidates that stabilise the process, in the order of `_ranked`."""
    return (x for x in _ranked(search)[:TRIED] if search.sound(x))


def _ranked(search: Search) -> list[Array]:
    """Return the candidates whose loops appear to be stable, judged on a grid of frequencies.

    The candidates are sorted by rising violation of the limits, then by falling ki.
    """
    problem, constraints = search.problem, search.constraints()
    likely = (x for x in _candidates(problem, *search.bounds[problem.gains]) if not problem.unstable(x))
    ranked = [(search.violation(x, constraints), -x[0], x) for x in likely]
    ranked.sort(key=lambda entry: entry[:2])
    return [x for _, _, x in ranked]


def relax(search: Search, start: Array) -> Array:
    """Move a start until it keeps the limits, or violates the limits as little as possible."""
    from scipy.optimize import minimize

    constraints = search.constraints()
    only_slack = np.append(np.zeros(start.size), 1.0)

    def slack(z: Array) -> tuple[float, Array]:
        unstable = search.problem.unstable(z[:-1])
        return (BARRIER, np.zeros(z.size)) if unstable else (float(z[-1]), only_slack)

    def with_slack(each: CachedValueAndSlope) -> dict[str, Any]:
        def slope(z: Array) -> Array:
            rows = np.atleast_2d(each.slope(z[:-1]))
            return np.hstack([rows, np.ones((rows.shape[0], 1))])

        return {"type": "ineq", "fun": lambda z: np.atleast_1d(each.value(z[:-1])) + z[-1], "jac": slope}

    with np.errstate(all="ignore"):
        end = minimize(
            slack, np.append(start, search.violation(start, constraints)), jac=True, method="SLSQP",
            bounds=[*search.bounds, (INSIDE, None)], constraints=[with_slack(each) for each in constraints],
            options={"maxiter": 80, "ftol": 1e-7},
        ).x[:-1]  # fmt: skip
        better = search.violation(end, constraints) < search.violation(start, constraints)
    return end if better else start


def _candidates(problem: Problem, fastest: float, slowest: float) -> Iterator[Array]:
    """Yield the candidates of both families with each of their filter times, clipped to the allowed range."""
    for action, filters in _families(problem):
        for time in np.unique(np.clip(filters, fastest, slowest)):
            x = np.zeros(problem.size)
            x[: action.size], x[problem.gains] = action, time
            x[0] = max(x[0], 1e-6)
            yield x


def _families(problem: Problem) -> Iterator[tuple[Array, Any]]:
    """Yield the gains and the logarithms of the filter times of both families."""
    for gain, share, derivative in product(GAINS, INTEGRAL_SHARES, DERIVATIVES if problem.order else (0.0,)):
        yield np.array([gain * share, gain, derivative * gain])[: problem.gains], FILTERS
    for w, below, zeros in product(CROSSOVERS, ZEROS_BELOW, range(1, problem.gains)):
        action = np.poly(np.full(zeros, -w / below))[::-1]
        action = action / abs(np.polyval(action[::-1], 1j * w) * problem.process(1j * w / problem.time))
        yield action * (w * problem.gain), [-np.log(w * above) for above in FILTER_ABOVE]
