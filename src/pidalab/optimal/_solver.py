"""The search behind `pidalab.optimal`: down and up a ladder of filter times, then from the best rungs to the bottom.

For third-order plants a PIDA has two valleys: one near the PID, with hardly any acceleration and a fast filter, and a
true PIDA with a slower one. Along a ladder of filter times, each start being the optimum of the rung before, both are
walked through, from above and from below.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.optimal._problem import Problem
from pidalab.robustness.control import max_control_sensitivity
from pidalab.robustness.margins import max_sensitivity
from pidalab.robustness.poles import is_stable

RUNGS = np.linspace(1.0, -5.0, 13)  # logarithms of filter times, in units of the process
FASTEST, SLOWEST = -7.0, 3.0  # logarithms of filter times that are allowed
LARGEST = 1e6  # gain, in units of the process, that is allowed
HORIZON = 80.0  # of a response, in units of the process
MISSED = 30.0  # price of a missed limit where starts are compared
WALL = 1e9  # in place of the IAE of an unstable loop
SPARE = 2e-5  # share of a limit that is kept free, for peaks that lie between the frequencies looked at
AROUND = np.array([0.94, 0.98, 1.0, 1.02, 1.06])  # a peak
KEPT = 1e-6  # share by which a limit may be missed between two rounds
ROUNDS = 12  # of the last search, each with the worst frequency of the one before
BEST, TRIED = 3, 12  # searches that are brought to the end, and tried at most


class Limits(NamedTuple):
    """What a design has to keep."""

    ms: float
    mks: float | None
    noise_gain: float | None
    sample_time: float | None


class Search:
    """One problem and its limits, at frequencies that grow in number as peaks are found between them."""

    def __init__(self, problem: Problem, limits: Limits) -> None:
        self.problem, self.limits = problem, limits
        time = problem.time
        # dense where the loop crosses over, and fine enough for the turns of the dead time
        delay = problem.process.delay
        turns = np.arange(3.0, 40.0, 0.7) / delay if delay else np.zeros(0)
        far = np.geomspace(10.0, 2.0 / np.exp(RUNGS[-1]), 16)[1:]
        self.w = np.sort(
            np.concatenate([np.geomspace(0.01, 0.15, 8), np.geomspace(0.16, 10.0, 42), far]) / time
        )
        self.w = np.sort(np.append(self.w, turns[turns < self.w[-1]]))
        self.worth = problem.worth(HORIZON * time)
        self.noise = (
            problem.noise(limits.sample_time)
            if limits.noise_gain is not None and limits.sample_time
            else None
        )
        self.aim = limits.noise_gain or 0.0  # for the continuous stand-in of the sampled loop
        self.bounds = [(1e-6, LARGEST)] + [(0.0, LARGEST)] * (problem.order + 1) + [(FASTEST, SLOWEST)]
        if problem.test == "setpoint":
            self.bounds += [(0.0, 1.0), (-9.0, 5.0)]

    def start(self) -> Array | None:
        """The quickest of a few PI or PID controllers that keep all limits; None if none does."""
        constraints = self._constraints()
        gains, shares = (2.0, 1.2, 0.6, 0.3, 0.1, 0.03, 0.01, 0.003, 3e-4), (0.5, 0.1, 0.02, 0.004)
        pairs = sorted(((gain * share, gain) for gain in gains for share in shares), reverse=True)
        for derivative in (0.0, 1.0, 5.0) if self.problem.order else (0.0,):
            for integral, proportional in pairs:
                for time in (-4.0, -2.0, 0.0):
                    x = np.zeros(self.problem.size)
                    x[: self.problem.gains][:3] = (integral, proportional, derivative * proportional)[
                        : self.problem.gains
                    ]
                    x[self.problem.gains] = time
                    if self.problem.test == "setpoint":
                        x[-2] = 1.0
                    if all(np.min(one["fun"](x)) >= 0 for one in constraints) and _stable(self.loop(x)):
                        self.turns = self.problem.turns(x)
                        return x
        return None

    def near(self, x: Array, first: Array, filter_time: float) -> Array:
        """The best start at another filter time: the last optimum, perhaps with less derivative, or the first one."""
        at, constraints = self.problem.gains, self._constraints()
        best, least = first, np.inf
        for start in (first, *(x * _damping(x.size, at, share) for share in (1.0, 0.6, 0.3, 0.1))):
            start = start.copy()
            start[at] = filter_time
            missed = max(0.0, -min(float(np.min(one["fun"](start))) for one in constraints))
            value = self._worth(start)[0] * (1 + MISSED * missed)
            if value < least:
                best, least = start, value
        return best

    def _worth(self, x: Array) -> tuple[float, Array]:
        """IAE and gradient; a wall where a step has left the stable loops."""
        if abs(self.problem.turns(x) - self.turns) > np.pi:
            return WALL, np.zeros(x.size)
        return self.worth(x)

    def _constraints(self) -> list[dict[str, Any]]:
        mks = None if self.limits.mks is None else self.limits.mks * (1 - SPARE)
        left = _Last(self.problem.limits(self.w, self.limits.ms * (1 - SPARE), mks))
        found = [{"type": "ineq", "fun": left.value, "jac": left.slope}]
        if self.noise is not None:
            noise, most = self.noise, self.aim**2

            def margin(x: Array) -> tuple[float, Array]:
                variance, slope = noise(x)
                return 1 - variance / most, -slope / most

            spare = _Last(margin)
            found.append({"type": "ineq", "fun": spare.value, "jac": spare.slope})
        return found

    def descend(self, start: Array, filter_time: float | None = None) -> tuple[float, Array, float]:
        """Sequential quadratic programming from a start: value, unknowns, and by how much a limit is missed."""
        from scipy.optimize import minimize

        bounds, x = list(self.bounds), start.copy()
        at = self.problem.gains
        if filter_time is not None:
            x[at], bounds[at] = filter_time, (filter_time, filter_time)
        constraints = self._constraints()
        with np.errstate(all="ignore"):
            found = minimize(
                self._worth, x, jac=True, method="SLSQP", bounds=bounds, constraints=constraints,
                options={"maxiter": 60, "ftol": 1e-8},
            )  # fmt: skip
            missed = max(0.0, -min(float(np.min(one["fun"](found.x))) for one in constraints))
        value = float(found.fun)
        return (value, found.x, missed) if value < WALL and np.isfinite(missed) else (np.inf, start, np.inf)

    def _with(self, peak: float) -> Array:
        """The frequencies, and those around a peak between them."""
        return np.append(self.w, peak * AROUND) if 0 < peak < np.inf else self.w

    def loop(self, x: Array) -> Loop:
        """Close the loop of a vector of unknowns, without prefilter."""
        from pidalab.controllers import HighOrderPID

        gains, time = self.problem.controller(x)
        return Loop(self.problem.process, HighOrderPID(gains.tolist(), time, self.problem.order + 1))

    def finish(self, x: Array) -> tuple[float, Array] | None:
        """Descend with a free filter time; take in the worst frequencies until the limits hold at all of them."""
        for _ in range(ROUNDS):
            value, found, missed = self.descend(x)
            if missed > KEPT or not _stable(self.loop(found)):
                x = x * _slack(
                    x.size, self.problem.gains
                )  # the descent went astray: again, from a little below
                continue
            x = found
            if self._keeps(x):
                return value, x
        return None

    def _keeps(self, x: Array) -> bool:
        """Whether all limits hold; where not, look there from now on."""
        loop, limits = self.loop(x), self.limits
        ms, at = max_sensitivity(loop)
        kept = ms <= limits.ms
        if not kept:
            self.w = self._with(at)
        if limits.mks is not None:
            mks, at = max_control_sensitivity(loop)
            if mks > limits.mks:
                kept, self.w = False, self._with(at)
        if limits.noise_gain is not None and limits.sample_time is not None and self.noise is not None:
            from pidalab.simulation.noise import noise_gain

            true, stand_in = noise_gain(loop, limits.sample_time), float(np.sqrt(self.noise(x)[0]))
            spent = stand_in > self.aim * (1 - KEPT)
            if true > limits.noise_gain or (spent and true < limits.noise_gain * (1 - 1e-3)):
                kept, self.aim = False, stand_in / true * limits.noise_gain * (1 - 1e-4)
        return kept


def _slack(size: int, gains: int) -> Array:
    """Factors that take all gains back a little."""
    out = np.ones(size)
    out[:gains] = 0.97
    return out


def _damping(size: int, gains: int, share: float) -> Array:
    """Factors that take back the derivatives, the higher the more."""
    out = np.ones(size)
    out[1:gains] = share ** np.arange(gains - 1.0)
    return out


def _stable(loop: Loop) -> bool:
    """Whether a loop is stable; one that turns too often to be followed is of no use."""
    try:
        return is_stable(loop)
    except ArithmeticError:
        return False


class _Last:
    """A function that gives value and slope at once, for those who ask for one after the other."""

    def __init__(self, both: Any) -> None:
        self.both, self.x = both, np.zeros(0)

    def _at(self, x: Array) -> tuple[Any, Any]:
        if not np.array_equal(x, self.x):
            self.x, self.last = x.copy(), self.both(x)
        return self.last

    def value(self, x: Array) -> Any:
        """Value at x."""
        return self._at(x)[0]

    def slope(self, x: Array) -> Any:
        """Slope at x."""
        return self._at(x)[1]


def search(problem: Problem, limits: Limits, bar: Any) -> tuple[float, Array] | None:
    """Find the best unknowns, or None where nothing keeps the limits."""
    one = Search(problem, limits)
    rungs: list[tuple[float, Array]] = []
    x = one.start()
    if x is None:
        return None
    first = x
    for time in [*RUNGS, *RUNGS[::-1]]:
        value, found, missed = one.descend(one.near(x, first, float(time)), float(time))
        if missed <= KEPT:
            x = found
            rungs.append((value, found))
        bar.update()
    # the filter time set free: from every rung, then to the end from the best
    free = []
    for _, start in _distinct(rungs, len(rungs)):
        value, found, missed = one.descend(start)
        if missed <= KEPT:
            free.append((value, found))
        bar.update()
    finished: list[tuple[float, Array]] = []
    for _, start in _distinct(free + rungs, TRIED):
        last = one.finish(start)
        finished += [] if last is None else [last]
        if len(finished) == BEST:
            break
    return min(finished, key=lambda pair: pair[0], default=None)


def _distinct(rungs: list[tuple[float, Array]], most: int) -> list[tuple[float, Array]]:
    """The best rungs that are not the same point."""
    chosen: list[tuple[float, Array]] = []
    for rung in sorted(rungs, key=lambda pair: pair[0]):
        if all(np.max(np.abs(rung[1] - other[1])) > 1e-3 for other in chosen):
            chosen.append(rung)
        if len(chosen) == most:
            break
    return chosen
