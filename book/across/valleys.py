"""A shelf and a valley: the best PIDA with a given filter time, walked down from slow filters."""

from __future__ import annotations

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pidalab
from pidalab.optimal.search import FINE, NEARLY, Search, feasible_starts, search_in
from pidalab.requirements import Requirements

MS, MKS = 1.4, 20.0
RUNGS = np.linspace(0.0, -4.7, 34)  # logarithms of filter times, in units of the problem
PROCESS = pidalab.lags(3, delay=1.0)


class Walk(NamedTuple):
    """Optima along a ladder of filter times."""

    filter_time: np.ndarray
    iae: np.ndarray
    acceleration: np.ndarray


def over_filter_time() -> Walk:
    """Walk down the ladder, each time from the optimum before; a rung where the limits were missed is left out."""
    search = search_in(PROCESS, 2, Requirements(ms=MS, mks=MKS))
    return walk(search, feasible_starts(search)[0], RUNGS)


def walk(search: Search, x: np.ndarray, rungs: np.ndarray) -> Walk:
    """One walk."""
    found = []
    for rung in rungs:
        start = x.copy()
        start[search.problem.gains] = rung
        value, reached, missed = search.descend(start, float(rung), effort=FINE)
        if missed <= NEARLY:
            x = reached
            gains, time = search.problem.controller(x)
            found.append((time, value * search.problem.time, gains[3]))
    return Walk(*np.array(found).T)


def figure(one: Walk) -> None:
    """IAE above, acceleration below."""
    _, (above, below) = plt.subplots(2, 1, figsize=(6.4, 4.6), sharex=True)
    above.plot(one.filter_time, one.iae, marker="o", markersize=3.5)
    below.plot(one.filter_time, one.acceleration, marker="o", markersize=3.5)
    above.set(xscale="log", ylabel="IAE (y × time)")
    below.set(xlabel="filter time (time)", ylabel="ka (u/y × time²)")
