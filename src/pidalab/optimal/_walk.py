"""The walk along the ladder of filter times, the descents from its best rungs, and a last check from random starts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.optimal._finish import VALLEY_GAP, finish
from pidalab.optimal._polish import Polished
from pidalab.optimal._solver import LARGEST_GAIN, NEARLY, Search

VALLEY_REACH = 2.0  # factor by which the values of two valleys differ at most
BEST = 3  # searches that are brought to the end
SAME_END = 1e-4  # share by which values of descents differ that may have the same end
# standard deviations of the logarithms of the gains and of the filter time, for the random starts of the last descents
SHAKES = ((0.3, 0.5), (0.8, 1.5)) * 20


class SearchResult(NamedTuple):
    """Result of a search."""

    best: Polished
    # the least value, and what other descents ended with up to VALLEY_REACH times it, in units of time of the problem
    valleys: tuple[float, ...]


def search(one: Search, starts: list[Array], bar: Any) -> SearchResult | None:
    """Find the best unknowns from starts that keep all limits; None where no descent ends well."""
    first = starts[0]
    x, rungs = first, []
    down, up = one.rungs, one.rungs[::-1]
    # down, up, and down once more without the highest derivative: the valley of the order below
    for ladder, highest in ((down, LARGEST_GAIN), (up, LARGEST_GAIN), (down, 0.0)):
        for time in ladder:
            value, found, missed = one.descend(one.near(x, first, float(time)), float(time), highest)
            if missed <= NEARLY:
                x = found
                rungs.append((value, found))
            bar.update()
    # the filter time set free: from every rung and the other starts, then to the end from the best
    free = []
    for start in [*(x for _, x in _distinct(rungs, len(rungs))), *starts[1:]]:
        value, found, missed = one.descend(start)
        if missed <= NEARLY:
            free.append((value, found))
        bar.update()
    finished: list[Polished] = []
    for ends in (free, rungs):
        for _, start in _distinct(ends, BEST):
            end = finish(one, start, finished)
            finished += [] if end is None else [end]
        if finished:
            break
    else:
        return None
    best = min(finished, key=lambda end: end.value)
    # a last check: descents from random starts around the best
    shaken = [one.descend(start) for start in _shaken(one, best.x)]
    kept = [end for end in shaken if end[2] <= NEARLY]
    value, start, _ = min(kept, default=(np.inf, x, 0.0), key=lambda end: end[0])
    if value < one.worth(best.x)[0] * (1 + SAME_END):
        last = finish(one, start, [best])
        if last is not None and last.value < best.value:
            best = last
    return SearchResult(best, _valleys([best.value, *(other for other, _ in free)]))


def _shaken(one: Search, x: Array) -> Iterator[Array]:
    """Places around a controller, the same at each run; those whose loop is unstable are left out."""
    rng, at = np.random.default_rng(0), one.problem.gains
    for gains, filter_time in SHAKES:
        start = x.copy()
        start[:at] *= np.exp(rng.normal(0.0, gains, at))
        start[at] = np.clip(x[at] + rng.normal(0.0, filter_time), *one.bounds[at])
        if not one.problem.unstable(start):
            yield start


def _valleys(values: list[float]) -> tuple[float, ...]:
    """Values that differ, each the least of those next to it."""
    chosen: list[float] = []
    for value in sorted(values):
        if not chosen or chosen[-1] * (1 + VALLEY_GAP) < value < VALLEY_REACH * chosen[0]:
            chosen.append(value)
    return tuple(chosen)


def _distinct(rungs: list[tuple[float, Array]], most: int) -> list[tuple[float, Array]]:
    """The best rungs that are not the same point."""
    chosen: list[tuple[float, Array]] = []
    for rung in sorted(rungs, key=lambda pair: pair[0]):
        if all(np.max(np.abs(rung[1] - other[1])) > 1e-3 for other in chosen):
            chosen.append(rung)
        if len(chosen) == most:
            break
    return chosen
