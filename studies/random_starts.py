"""`pidalab.optimal.load` beside its own descent from forty places drawn at random.

`optimal_check` asks whether another method finds more on twenty plants; this one whether other starts do, on problems
drawn at random: a plant of `processes` or of `frontier`, an order, a limit of robustness and one of the noise. A start
has each gain anywhere within one to five powers of e around the design, in three of ten cases without one of the
derivatives, and a filter time within four; one that misses a limit is brought to where all are kept first. Forty starts
whose loop is stable descend; what ends below the design is brought to the bottom and counted where all limits hold.

Each problem is a row of book/data/random_starts.csv, known by its number, which seeds it; what is there is not done
again. ``python studies/random_starts.py 200 --workers 2``: about two seconds for a problem on a quiet core.
"""

from __future__ import annotations

import argparse
import math
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np
from frontier import PLANTS
from own_units import resume

import pidalab
from pidalab import Process, noise_scale
from pidalab.comparison.judging import one_line
from pidalab.comparison.plants import batch
from pidalab.optimal.parts import (
    NEARLY,
    SAME_IAE,
    UNITS_TRIED,
    Search,
    finish,
    relax,
    search_in,
)
from pidalab.requirements import Requirements

COLUMNS = (
    "problem",
    "plant",
    "order",
    "ms_limit",
    "noise_limit",
    "iae",
    "iae_others",
    "ratio",
    "starts",
    "reason",
)
ORDERS, ROBUST, NOISE = (1, 2, 2, 3), (1.2, 1.4, 1.4, 2.0), (0.08, 2.0)  # noise in ultimate gains
STARTS, DRAWN = 40, 800  # stable ones, and drawn at most
REACH = (1.0, 2.5, 5.0)  # powers of e around each gain
FILTER = 4.0  # and around the filter time
WITHOUT = 0.3  # share of the starts without one of the derivatives
BELOW = 0.9995  # share of the design's IAE under which an end is brought to the bottom


def drawn(number: int) -> tuple[np.random.Generator, str, Process, int, float, float]:
    """The problem of a number, and what its starts are drawn with."""
    plants = {case.name: case.process for case in batch()} | PLANTS
    rng = np.random.default_rng(number)
    name = sorted(plants)[rng.integers(len(plants))]
    order, ms = int(rng.choice(ORDERS)), float(rng.choice(ROBUST))
    noise = float(np.exp(rng.uniform(*np.log(NOISE))))
    return rng, name, plants[name], order, ms, noise


def beside(number: int) -> list[dict[str, Any]]:
    """The row of a problem."""
    rng, name, process, order, ms, noise = drawn(number)
    own = noise_scale(process)
    limits = Requirements(ms=ms, noise_gain=noise * own.gain, sample_time=own.sample_time)
    row: dict[str, Any] = {
        "problem": number,
        "plant": name,
        "order": order,
        "ms_limit": ms,
        "noise_limit": noise,
    }
    try:
        design = pidalab.optimal.load(
            process, order, ms=ms, noise_gain=noise * own.gain, sample_time=own.sample_time
        )
    except (ValueError, ArithmeticError) as refusal:
        return [row | {"reason": one_line(refusal)}]
    search, at = found_in(process, order, limits, design)
    ends = list(descents(rng, search, at, design.iae / search.problem.time))
    scale = own.gain / own.period
    others = min(ends) * search.problem.time
    row |= {"iae": design.iae * scale, "iae_others": others * scale, "ratio": others / design.iae}
    return [row | {"starts": len(ends)}]


def found_in(process: Process, order: int, limits: Requirements, design: Any) -> tuple[Search, np.ndarray]:
    """The search in the unit of time that sees all of the response of a design, and its unknowns there."""
    for factor in UNITS_TRIED:
        search = search_in(process, order, limits, factor)
        problem, unit = search.problem, search.problem.time
        gains = np.array(design.controller.coefficients) / problem.units
        at = np.append(gains, math.log(design.controller.filter_time / unit))
        if abs(math.exp(search.log_iae(at)[0]) * unit / design.iae - 1) < SAME_IAE:
            return search, at
    raise ArithmeticError("no unit of time gives the IAE of the design")


def descents(rng: np.random.Generator, search: Search, at: np.ndarray, iae: float) -> Any:
    """What each start ends with, infinite where it keeps no limits; `iae` is the design's, in units of the problem."""
    gains = np.log(np.maximum(at[:-1], 1e-6 * at[:-1].max()))
    stable = 0
    for _ in range(DRAWN):
        start = np.append(
            np.exp(gains + rng.uniform(-1, 1, gains.size) * rng.choice(REACH)),
            np.clip(at[-1] + rng.uniform(-FILTER, FILTER), *search.bounds[gains.size]),
        )
        if rng.random() < WITHOUT:
            start[2 + rng.integers(search.problem.order) : -1] = 0.0
        if search.problem.unstable(start):
            continue
        yield ended(search, start, iae)
        stable += 1
        if stable == STARTS:
            return


def ended(search: Search, start: np.ndarray, iae: float) -> float:
    """IAE where a start's descent ends, at the bottom where it might be below the design."""
    if search.missed(start) > 0:
        start = relax(search, start)
    if search.missed(start) > NEARLY:
        return math.inf
    value, end, missed = search.descend(start)
    if missed > NEARLY:
        return math.inf
    if value >= BELOW * iae:
        return value
    finished = finish(search, end)
    return math.inf if finished is None else finished.value


def main(problems: int, workers: int | None) -> None:
    """Go on with the table."""
    resume(
        "random_starts.csv", COLUMNS, ((number,) for number in range(problems)), COLUMNS[:1], beside, workers
    )


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("problems", nargs="?", type=int, default=200)
    arguments.add_argument("--workers", type=int)
    np.seterr(all="ignore")
    main(**vars(arguments.parse_args()))
