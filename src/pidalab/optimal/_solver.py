"""The search behind `pidalab.optimal`: down and up a ladder of filter times, then from the best rungs to the bottom.

A PIDA near the PID, with hardly any acceleration, and a true PIDA with a slower filter can each be the best there is
nearby; on some plants the first is a valley of its own, on others a shelf above the second. Along a ladder of filter
times, each start being the optimum of the rung before, both are walked through: from above, from below, and once more
without the highest derivative, which keeps to the first. Descents from around the best found so far come last.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pidalab._check import Array
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.optimal._heights import with_turns
from pidalab.optimal._noise import SampledNoise
from pidalab.optimal._problem import WALL, CachedValueAndSlope, Problem, Scaled, Slope
from pidalab.process import Process
from pidalab.requirements import Requirements
from pidalab.robustness.poles import is_stable

FINE_SAMPLES = 8192  # of the response whose IAE is made least
TOP, BOTTOM, RUNGS = 1.0, -5.0, 13  # of the ladder: logarithms of filter times, in units of the process
FASTEST, SLOWEST = -7.0, 3.0  # logarithms of filter times that are allowed
LARGEST_GAIN = 1e6  # gain, in units of the process, that is allowed
SEARCH_HORIZON = 80.0  # of a response, in units of the process
MISSED = 30.0  # price of a missed limit where starts are compared
SPARE = 2e-5  # share of a limit that is kept free, for peaks that lie between the frequencies looked at
AROUND = np.array([0.94, 0.98, 1.0, 1.02, 1.06])  # a peak
BETWEEN = 0.01  # share of a frequency within which another stands for it
NEARLY = 1e-4  # share by which a limit may be missed on the way
ROUGH, FINE = (25, 1e-5), (60, 1e-8)  # iterations and tolerance of a descent: on the way, and to the bottom
# descents one after the other at most; gain after which one is long, a logarithm
AGAIN, LONG_DESCENT = 4, 0.2
FINER = 12  # as many frequencies where the sampled noise is judged as where it is searched


class Search:
    """One problem and its limits, at frequencies that grow in number as peaks are found between them."""

    nearest: Array | None = None  # what comes nearest to limits that nothing keeps
    family: tuple[Process, ...] = ()  # plants, upright, that keep ms_worst at the end

    def __init__(self, problem: Problem, limits: Requirements, spare: float = SPARE) -> None:
        self.problem, self.limits, self.spare = problem, limits, spare
        self.active: list[int] = []  # plants of the family that the descents see
        time = problem.time
        # dense where the loop crosses over, and fine enough for the turns of the dead time
        far = np.geomspace(10.0, 2.0 / np.exp(BOTTOM), 16)[1:]
        w = np.concatenate([np.geomspace(0.01, 0.15, 8), np.geomspace(0.16, 10.0, 42), far]) / time
        self.w = with_turns(w, problem.process.delay, np.arange(3.0, 40.0, 0.7))
        self.worth = problem.worth(SEARCH_HORIZON * time)
        self.fine = problem.worth(SEARCH_HORIZON * time, FINE_SAMPLES)
        # sampled noise has a size only behind a filter that is not faster than the sample
        h = limits.sample_time
        self.noise = self.exact_noise = None
        if limits.noise_gain is not None and h is not None:
            self.noise, self.exact_noise = (SampledNoise(problem, h, density) for density in (1, FINER))
        fastest = FASTEST if h is None else max(FASTEST, float(np.log(h / time)))
        self.aim = limits.noise_gain or 0.0  # for the quadrature of the noise
        filters = (fastest, max(SLOWEST, fastest + 2.0))
        self.rungs = np.linspace(max(TOP, fastest + 1.0), max(BOTTOM, fastest), RUNGS)
        self.bounds = [(1e-6, LARGEST_GAIN)] + [(0.0, LARGEST_GAIN)] * (problem.order + 1) + [filters]

    def sound(self, x: Array) -> bool:
        """Whether the loop is stable, with a sampled controller too where that matters."""
        return settles(self.loop(x)) and np.isfinite(self.true_noise(x))

    def near(self, x: Array, first: Array, filter_time: float) -> Array:
        """The best start at another filter time: the last optimum, perhaps with less derivative, or the first one."""
        at, constraints = self.problem.gains, self.constraints()
        best, least = first, np.inf
        powers = np.clip(np.arange(x.size) - 1.0, 0.0, None) * (np.arange(x.size) < at)  # of derivatives
        for start in (first.copy(), *(x * share**powers for share in (1.0, 0.6, 0.3, 0.1))):
            start[at] = filter_time
            value = self.log_iae(start)[0] + np.log1p(MISSED * self.missed(start, constraints))
            if value < least:
                best, least = start, value
        return best

    def log_iae(self, x: Array) -> tuple[float, Slope]:
        """Logarithm of the IAE and the function of its gradient; a wall where a step has left the stable loops."""
        if self.problem.unstable(x):
            return WALL, lambda: np.zeros(x.size)
        value, slope = self.worth(x)
        return float(np.log(value)), lambda: slope() / value

    def missed(self, x: Array, constraints: list[CachedValueAndSlope] | None = None) -> float:
        """By how much the limit is missed that is missed most."""
        return max(0.0, -min(float(np.min(one.value(x))) for one in constraints or self.constraints()))

    def constraints(self) -> list[CachedValueAndSlope]:
        """What is left to every limit, not negative where it is kept, for the frequencies looked at so far."""
        worst = {"ms": self.limits.ms_worst * (1 - self.spare)}
        found = [self.problem.limits(self.w, self.limits.peaks(self.spare))]
        found += [self.problem.limits(self.w, worst, self.family[k]) for k in self.active]
        if self.noise is not None:
            noise, most = self.noise, self.aim

            def margin(x: Array) -> tuple[float, Slope]:
                variance, slope = noise(x)
                deviation = np.sqrt(variance)
                return 1 - deviation / most, lambda: -slope() / (2 * deviation * most)

            found.append(margin)
        return [CachedValueAndSlope(one) for one in found]

    def descend(
        self,
        start: Array,
        filter_time: float | None = None,
        highest: float = LARGEST_GAIN,
        effort: tuple[int, float] = ROUGH,
    ) -> tuple[float, Array, float]:
        """Sequential quadratic programming from a start: value, unknowns, and by how much a limit is missed.

        The filter time may be held, and the gain of the highest derivative bounded.
        """
        from scipy.optimize import minimize

        bounds, x = list(self.bounds), start.copy()
        at = self.problem.gains
        if filter_time is not None:
            x[at], bounds[at] = filter_time, (filter_time, filter_time)
        x[at - 1], bounds[at - 1] = min(x[at - 1], highest), (0.0, highest)
        low, high = np.transpose(bounds)
        constraints, value = self.constraints(), self.log_iae(x)[0]
        with np.errstate(all="ignore"):
            for _ in range(AGAIN):
                scaled = Scaled(x, at)
                value_of, slope_of = scaled.functions(CachedValueAndSlope(self.log_iae))
                limits = (
                    dict(zip(("fun", "jac"), scaled.functions(one), strict=True)) for one in constraints
                )
                found = minimize(
                    value_of, scaled(x), method="SLSQP", jac=slope_of,
                    bounds=list(zip(scaled(low), scaled(high), strict=True)),
                    constraints=[{"type": "ineq", **limit} for limit in limits],
                    options=dict(zip(("maxiter", "ftol"), effort, strict=True)),
                )  # fmt: skip
                end = np.clip(scaled.back(found.x), low, high)
                before, value = value, float(found.fun)
                missed = self.missed(end, constraints)
                # a long way may have ended early: what was learnt of the curvature at its start is of no use at its end
                if not (np.isfinite(missed) and missed <= NEARLY and value < before - LONG_DESCENT):
                    break
                x = end
        ok = value < WALL and np.isfinite(missed)
        return (float(np.exp(value)), end, missed) if ok else (np.inf, start, np.inf)

    def loop(self, x: Array) -> Loop:
        """Close the loop of a vector of unknowns."""
        gains, time = self.problem.controller(x)
        return Loop(self.problem.process, HighOrderPID(gains.tolist(), time, self.problem.order + 1))

    def look_at(self, peak: float, nearly: bool = False) -> None:
        """Take frequencies around a peak in; unless, where a near one serves, there is one."""
        if 0 < peak < np.inf and not (nearly and np.min(np.abs(self.w - peak)) <= BETWEEN * peak):
            self.w = np.append(self.w, peak * AROUND)

    def aim_below(self, noise: float) -> None:
        """Aim at less noise by as much as there is too much of it."""
        assert self.limits.noise_gain is not None
        self.aim *= self.limits.noise_gain / noise * (1 - self.spare)

    def guard(self, family: Sequence[Process]) -> None:
        """Keep the limit of Ms with other plants, too, from now on."""
        self.family = tuple(family)

    def see(self, k: int, peak: float) -> None:
        """Let the descents see a plant of the family, or where its peak lies if they do already."""
        if k in self.active:
            self.look_at(peak)
        else:
            self.active.append(k)

    def true_noise(self, x: Array) -> float:
        """Noise gain of the sampled loop, 0 where it does not matter, infinite where that loop is unstable."""
        return 0.0 if self.exact_noise is None else self.exact_noise.gain(x)


def settles(loop: Loop) -> bool:
    """Whether a loop is stable; one whose poles cannot be counted is of no use."""
    try:
        return is_stable(loop)
    except ArithmeticError:
        return False
