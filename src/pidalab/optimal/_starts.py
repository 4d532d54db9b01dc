"""Where the search starts: controllers that stabilise, drawn from two families, and the way from there to the limits.

The first family are PI and PID controllers behind filters of several speeds. The second has all its zeros in one place
below a chosen crossover, as plants need that only a derivative or an acceleration stabilises.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.optimal._problem import WALL, CachedValueAndSlope, Problem
from pidalab.optimal._solver import Search

GAINS = (2.0, 1.2, 0.6, 0.3, 0.1, 0.03, 0.01, 0.003, 3e-4)  # proportional, in units of the process
INTEGRAL_SHARES = (0.5, 0.1, 0.02, 0.004)  # integral over proportional gain
DERIVATIVES = (0.0, 1.0, 5.0)  # over proportional gain
FILTERS = (-4.0, -2.0, 0.0)  # logarithms of filter times
CROSSOVERS = np.geomspace(0.02, 5.0, 9)  # of the second family, in units of the process
# crossover over the zeros, and corner of the filter over the crossover, of the second family
ZEROS_BELOW = (3.0, 8.0, 25.0)
FILTER_ABOVE = (5.0, 30.0, 200.0)
INSIDE = -1e-3  # share of the limits that an approach goes beyond keeping them
TRIED = 60  # candidates whose stability is looked at closely
STARTS, START_GAP = 6, np.log(4.0)  # starts at most, and how far they are apart
NEAREST = 4  # candidates from which the limits are approached


def at_once(search: Search, surely: bool = True) -> list[Array]:
    """Candidates that keep all limits and differ, the one with the least IAE first; surely stable, unless not asked."""
    constraints = search.constraints()
    kept = [x for x in _ranked(search) if search.missed(x, constraints) == 0]
    chosen: list[Array] = []
    for x in sorted(kept, key=lambda x: search.worth(x)[0]):
        differs = all(_apart(x, other, search.problem.gains) for other in chosen)
        if differs and (not surely or search.sound(x)):
            chosen.append(x)
        if len(chosen) == STARTS:
            break
    return chosen


def _apart(one: Array, other: Array, gains: int) -> bool:
    """Whether integral gain, largest action or filter differ by more than a factor."""
    differences = np.log([one[0] / other[0], one[:gains].max() / other[:gains].max()])
    return bool(max(np.abs(differences).max(), abs(one[gains] - other[gains])) > START_GAP)


def approached(search: Search) -> list[Array]:
    """A start that keeps all limits, from candidates that do not; the nearest of all is left in the search."""
    least = np.inf
    for start in islice(stabilising(search), NEAREST):
        x = relax(search, start)
        missed = search.missed(x)
        if missed < least and search.sound(x):
            search.nearest, least = x, missed
        if least == 0:
            return [x]
    return []


def stabilising(search: Search) -> Iterator[Array]:
    """Candidates that stabilise the process, those that keep the limits best first, and of equals the quickest."""
    return (x for x in _ranked(search)[:TRIED] if search.sound(x))


def _ranked(search: Search) -> list[Array]:
    """Candidates that turn as stable loops do, the nearest to the limits first, and of equals the quickest."""
    problem, constraints = search.problem, search.constraints()
    likely = (x for x in _candidates(problem, *search.bounds[problem.gains]) if not problem.unstable(x))
    ranked = [(search.missed(x, constraints), -x[0], x) for x in likely]
    ranked.sort(key=lambda entry: entry[:2])
    return [x for _, _, x in ranked]


def relax(search: Search, start: Array) -> Array:
    """Go from a start to where the limits are kept, or missed by least."""
    from scipy.optimize import minimize

    constraints = search.constraints()
    only_slack = np.append(np.zeros(start.size), 1.0)

    def slack(z: Array) -> tuple[float, Array]:
        astray = search.problem.unstable(z[:-1])
        return (WALL, np.zeros(z.size)) if astray else (float(z[-1]), only_slack)

    def with_slack(one: CachedValueAndSlope) -> dict[str, Any]:
        def slope(z: Array) -> Array:
            rows = np.atleast_2d(one.slope(z[:-1]))
            return np.hstack([rows, np.ones((rows.shape[0], 1))])

        return {"type": "ineq", "fun": lambda z: np.atleast_1d(one.value(z[:-1])) + z[-1], "jac": slope}

    with np.errstate(all="ignore"):
        found = minimize(
            slack, np.append(start, search.missed(start, constraints)), jac=True, method="SLSQP",
            bounds=[*search.bounds, (INSIDE, None)], constraints=[with_slack(one) for one in constraints],
            options={"maxiter": 80, "ftol": 1e-7},
        ).x[:-1]  # fmt: skip
        better = search.missed(found, constraints) < search.missed(start, constraints)
    return found if better else start


def _candidates(problem: Problem, fastest: float, slowest: float) -> Iterator[Array]:
    """Both families, each with every filter that is allowed."""
    for action, filters in _families(problem):
        for time in np.unique(np.clip(filters, fastest, slowest)):
            x = np.zeros(problem.size)
            x[: action.size], x[problem.gains] = action, time
            x[0] = max(x[0], 1e-6)
            yield x


def _families(problem: Problem) -> Iterator[tuple[Array, Any]]:
    """Some of the gains, and logarithms of filter times."""
    for gain, share, derivative in product(GAINS, INTEGRAL_SHARES, DERIVATIVES if problem.order else (0.0,)):
        yield np.array([gain * share, gain, derivative * gain])[: problem.gains], FILTERS
    for w, below, zeros in product(CROSSOVERS, ZEROS_BELOW, range(1, problem.gains)):
        action = np.poly(np.full(zeros, -w / below))[::-1]
        action = action / abs(np.polyval(action[::-1], 1j * w) * problem.process(1j * w / problem.time))
        yield action * (w * problem.gain), [-np.log(w * above) for above in FILTER_ABOVE]
