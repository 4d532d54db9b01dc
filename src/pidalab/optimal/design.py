"""Search for the controller with the least IAE."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.optimal.polish import SUPREMA, VALLEY_GAP, Polished, finish
from pidalab.optimal.problem import Problem, unit_of_time
from pidalab.optimal.search import (
    FASTEST,
    LARGEST_GAIN,
    NEARLY,
    Search,
    approached,
    feasible_starts,
    search_in,
    stabilising,
)
from pidalab.process import Process, require_no_zero_at_origin, sign_of_gain
from pidalab.relative_noise import noise_scale
from pidalab.requirements import Requirements
from pidalab.robustness.margins import max_sensitivity
from pidalab.rules import Design
from pidalab.simulation.exact import load_response, simulate_until_settled

HIGHEST_ORDER = 4
ACTIVE = 1e-3  # a limit is active if the relative distance to it is below this
NEGLIGIBLE_ACTION = 1e-6  # an action is dropped if it is below this number times the largest action
# The unit of time is multiplied by these factors in turn, until the horizon of the search is long enough. A low noise
# limit needs large factors.
UNITS_TRIED = (1.0, 8.0, 64.0, 512.0)
SLOWEST_SAMPLING = 100.0  # largest allowed sample time, divided by the `unit_of_time` of the process
# The search computes the IAE over a horizon that is proportional to the unit of time. The horizon is too short if
# the simulated IAE exceeds the IAE of the search by at least this fraction of the simulated IAE.
SAME_IAE = 0.02
VALLEY_REACH = 2.0  # local optima are reported if their IAE is below this number times the best IAE
BEST = 3  # largest number of descents whose results are refined
SAME_END = 1e-4  # a result from random starts is refined if its IAE is below (1 + this) * the best IAE
# Each of the last descents starts from a random change of the best controller. Each pair belongs to one start. Its
# values are the standard deviations of the changes of log(gain) and of log(filter time).
SHAKES = ((0.3, 0.5), (0.8, 1.5)) * 20


class SearchResult(NamedTuple):
    """Result of a search."""

    best: Polished
    # IAE of each local optimum below VALLEY_REACH times the least IAE, in rising order. Each IAE is divided by the unit
    # of time of the problem.
    valleys: tuple[float, ...]


def load(
    process: Process,
    order: int,
    *,
    ms: float = 1.6,
    mks: float | None = None,
    mt: float | None = None,
    disk: float | None = None,
    noise_gain: float | None = None,
    sample_time: float | None = None,
    family: Sequence[Process] = (),
    ms_worst: float = 2.0,
    start: Design | None = None,
) -> Design:
    r"""Return the controller with the least IAE for a step of the load at the process input.

    A limit that is None does not apply.

    Parameters
    ----------
    process : Process
        The plant, with exact dead time. An unstable plant must be stabilisable.
    order : int
        Highest derivative m. 0 is PI, 1 is PID, 2 is PIDA, and at most 4 is allowed. The filter has order m + 1.
    ms : float, optional
        Largest allowed maximum sensitivity, above 1.
    mks : float, optional
        Largest allowed gain from measurement noise to control signal at any frequency, in units of u per unit of y.
    mt : float, optional
        Largest allowed maximum of the complementary sensitivity \|T\|, above 1.
    disk : float, optional
        Smallest allowed disk margin of `pidalab.margins`, between 0 and 2. A disk margin of 2/(2M - 1) implies Ms <= M
        and Mt <= M.
    noise_gain : float, optional
        Largest allowed `pidalab.noise_gain`, in units of u per unit of y. To limit the relative noise gain, multiply
        the relative limit by the ``gain`` of `pidalab.noise_scale`.
    sample_time : float, optional
        Sample time of the noise, only with `noise_gain`. By default the sample time of `pidalab.noise_scale`, which is
        a hundredth of the ultimate period. The filter time is at least the sample time.
    family : sequence of Process, optional
        Other plants, with gains of the same sign. With each of these plants, Ms must be at most `ms_worst`. The IAE
        is computed only with `process`.
    ms_worst : float, optional
        Largest allowed maximum sensitivity with each plant of the family, above 1.
    start : Design, optional
        A design of this function for the same process and order. The search starts from this design. Other
        starts are used only if it then finds no controller for the process alone.

    Returns
    -------
    Design
        Design with a `HighOrderPID`, whose gains are negative for a process with negative gain. Its `info` contains

        - ``iae``, ``ms`` and ``mks``;
        - ``noise_gain``, ``mt``, ``disk`` and ``ms_worst``, if they were limited;
        - ``active``, the names of the active limits ("sample_time" if the filter time equals the sample time);
        - ``edge``, the variables at the edge of the search range. Without a limit on noise the
          filter time is at its lower edge, since a shorter filter time would reduce the IAE;
        - ``valleys``, the IAE of different local optima. The first value is the IAE of the design. The other values are
          at most twice as large and are accurate to two digits. If the design was found from `start`, there is only the
          first value;
        - ``digits``, the number of digits of gains, filter time and IAE that are the same on every processor.

    Raises
    ------
    TypeError, ValueError
        If arguments are out of range, or if no controller of this order was found that keeps the limits with the
        process and with the whole family. In particular, `mks` must be above 1/\|P(0)\|, which is \|C S\| at zero
        frequency for any controller with integral action.

    Notes
    -----
    The search is deterministic and has many starts, but it does not prove a global optimum. Its result satisfies the
    conditions of a local optimum: the active limits hold with equality, and the Lagrangian is stationary.

    With a family, the search first finds the optimum for the process alone. Then it adds the worst plants and continues
    from this optimum, until Ms is at most `ms_worst` with every plant.

    Examples
    --------
    Acceleration lowers the IAE if the limit on noise permits it:

    >>> import pidalab
    >>> process = pidalab.lags(3, delay=1.0)
    >>> pid, pida = (pidalab.optimal.load(process, order, ms=1.4, mks=20.0) for order in (1, 2))
    >>> print(f"{pid.iae:.2f} {pida.iae:.2f} {pida.active}")
    3.41 2.65 ('ms', 'mks')

    Robustness to a longer dead time costs a part of this improvement:

    >>> late = pidalab.lags(3, delay=1.5)
    >>> safe = pidalab.optimal.load(process, 2, ms=1.4, mks=20.0, family=[late], ms_worst=1.6, start=pida)
    >>> pidalab.margins(safe.loop(late)).ms <= 1.6 < pidalab.margins(pida.loop(late)).ms, safe.iae > pida.iae
    (True, True)
    """
    requirements = Requirements(
        ms=ms, mks=mks, mt=mt, disk=disk, noise_gain=noise_gain, sample_time=sample_time,
        family=tuple(family), ms_worst=ms_worst,
    )  # fmt: skip
    return least_iae(process, order, requirements, start)


def least_iae(
    process: Process, order: int, requirements: Requirements, start: Design | None = None
) -> Design:
    """Return the same controller as `load`, for limits that are given as a `Requirements`.

    Parameters
    ----------
    process : Process
        As for `load`.
    order : int
        As for `load`.
    requirements : Requirements
        Limits of the design.
    start : Design, optional
        As for `load`.

    Returns
    -------
    Design
        As from `load`.

    Raises
    ------
    TypeError, ValueError
        As for `load`.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.requirements import Requirements
    >>> pida = pidalab.optimal.least_iae(pidalab.lags(3, delay=1.0), 2, Requirements(ms=1.4, mks=20.0))
    >>> print(f"{pida.iae:.2f}")
    2.65
    """
    require_no_zero_at_origin("process", process)
    order = _check.integer("order", order, at_least=0, at_most=HIGHEST_ORDER)
    limits = requirements
    if limits.noise_gain is not None and limits.sample_time is None:
        limits = replace(limits, sample_time=noise_scale(process).sample_time)
    static = process.gain()
    if limits.mks is not None and math.isfinite(static) and limits.mks * abs(static) <= 1:
        raise ValueError(f"mks must be above 1/|P(0)| = {1 / abs(static):.4g}, found {limits.mks:g}")
    if any(sign_of_gain(plant) != sign_of_gain(process) for plant in limits.family):
        raise ValueError(
            "family must have gains of the same sign as process: no controller stabilises gains of both signs"
        )
    searches: list[Search] = []
    best = _best(process, order, limits, searches, start)
    if best is None and any(search.family for search in searches):
        raise ValueError(
            f"no controller of order {order} was found that keeps ms_worst = {limits.ms_worst:g} with all of the family"
        )
    if best is None:
        raise ValueError(_refusal(searches))
    return best


def _best(
    process: Process, order: int, limits: Requirements, searches: list[Search], start_design: Design | None
) -> Design | None:
    """Return the best design of searches with several units of time and several kinds of starts.

    Notes
    -----
    There are three kinds of starts (`ways`): the given design, candidate controllers that keep the limits, and
    candidates that are moved until they keep the limits. Each kind is tried with increasing units of time, until the
    relative difference between the IAE of the search and the simulated IAE is below `SAME_IAE`. The family is
    considered only after a search for the process alone, since `ms_worst` is rarely active.
    """
    import scipy.optimize  # noqa: F401  # loads scipy's BLAS, whose threads are limited below
    from threadpoolctl import threadpool_limits
    from tqdm import tqdm

    class Progress(tqdm):  # type: ignore[misc]
        monitor_interval = 0  # starts no monitoring thread, which some platforms do not support

    positive, *others = (upright(plant) for plant in (process, *limits.family))
    shortest, best = unit_of_time(positive, limits), None
    if limits.sample_time is not None and limits.sample_time > SLOWEST_SAMPLING * shortest:
        raise ValueError(
            f"sample_time must be at most {SLOWEST_SAMPLING * shortest:.4g} for this process, "
            f"found {limits.sample_time:g}"
        )
    # With such small matrices, several threads would make the search up to ten times slower.
    with (
        threadpool_limits(limits=1, user_api="blas"),
        Progress(desc="optimal", delay=2.0, leave=False, disable=None, unit=" descents") as bar,
    ):
        ways: list[Any] = [*([] if start_design is None else [None]), feasible_starts, approached]
        for start, factor in product(ways, UNITS_TRIED):
            # The next kind of start is not needed if there is a design. If there is a controller for the process alone
            # but none for the family, other starts would end at the same controller.
            if factor == UNITS_TRIED[0] and (best is not None or any(search.family for search in searches)):
                break
            search = search_in(positive, order, limits, factor)
            searches.append(search)
            if start_design is not None and start is None:
                known: Any = start_design.controller
                gains = sign_of_gain(process) * np.array(known.coefficients)
                end = finish(search, search.problem.unknowns(gains, known.filter_time))
                result = None if end is None else SearchResult(end, (end.value,))
            else:
                starts = start(search)
                result = descend_over_filter_times(search, starts, bar) if starts else None
            if result is None:
                continue
            if others:
                search.family = tuple(others)
                end = finish(search, result.best.x)
                if end is None:
                    continue
                result = SearchResult(end, _valleys(end.value, result.valleys))
            design = judge(process, search, result)
            if best is None or design.iae < best.iae:
                best = design
            if design.iae - result.best.value * search.problem.time < SAME_IAE * design.iae:
                break  # the horizon of the search is long enough
    return best


def _refusal(searches: list[Search]) -> str:
    """Return the error message for a failed search."""
    first = searches[0]
    order, limits = first.problem.order, first.limits
    wanted = str(limits)
    nearest = [
        (search.violation(search.nearest), _nearest(search, search.nearest))
        for search in searches
        if search.nearest is not None
    ]
    if nearest:
        return (
            f"no stable controller of order {order} with non-negative gains was found that keeps {wanted}; the nearest "
            f"controller has {min(nearest)[1]}. Relax the limits, or try another order"
        )
    hint = ""
    for other in range(HIGHEST_ORDER, order, -1):
        problem = Problem(first.problem.process, other, (first.problem.gain, first.problem.time))
        if any(True for _ in stabilising(Search(problem, Requirements(ms=2.0)))):
            hint = f"; there are stable controllers of order {other}"
    return (
        f"no stable controller of order {order} with non-negative gains was found, whatever its ms (requested: "
        f"{wanted}){hint}"
    )


def _nearest(search: Search, x: Array) -> str:
    """Return the value of each limited quantity of a controller, as text for an error message."""
    values = {**_peaks(search.loop(x)), "noise_gain": search.true_noise(x)}
    return ", ".join(f"{name} = {values[name]:.4g}" for name in search.limits.limits())


def _peaks(loop: Loop) -> dict[str, float]:
    """Return the suprema of a loop that can be limited, and its disk margin."""
    suprema = {name: peak(loop)[0] for name, peak in SUPREMA.items()}
    return {**suprema, "disk": 1 / suprema["inverse_disk"]}


def upright(process: Process) -> Process:
    """Return the process, with its sign changed if its gain is negative."""
    return process if sign_of_gain(process) > 0 else Process(-process.num, process.den, process.delay)


def judge(process: Process, search: Search, result: SearchResult) -> Design:
    """Convert the result of a search to a design for the given process, whose gain may be negative."""
    problem, limits, x = search.problem, search.limits, result.best.x
    gains, time = problem.controller(x)
    # Set the gains of negligible actions to 0. All actions are compared at the corner frequency of the filter.
    amounts = gains * time ** -np.arange(-1.0, problem.order + 1)
    gains[1:] = np.where(amounts < NEGLIGIBLE_ACTION * amounts.max(), 0.0, gains)[1:]
    controller = HighOrderPID((sign_of_gain(process) * gains).tolist(), time, problem.order + 1)
    loop = Loop(process, controller)
    heights, named = _peaks(loop), limits.limits()
    info: dict[str, Any] = {"iae": _iae(loop, problem.time), "ms": heights["ms"], "mks": heights["mks"]}
    info |= {name: heights[name] for name in ("mt", "disk") if name in named}
    if search.noise is not None:
        info["noise_gain"] = search.true_noise(x)
    if search.family:
        loops = (Loop(plant, search.loop(x).controller) for plant in search.family)
        info["ms_worst"] = max(max_sensitivity(other)[0] for other in loops)
    reached = limits.reached(info, ACTIVE)
    if search.family and info["ms_worst"] >= limits.ms_worst * (1 - ACTIVE):
        reached.append("ms_worst")
    if search.noise is not None:
        info["sample_time"] = search.noise.h
    if search.noise is not None and time <= search.noise.h * (1 + ACTIVE):
        reached.append("sample_time")
    none = [f"K_{k - 1} = 0" for k in range(1, problem.gains) if gains[k] == 0]
    info["active"] = (*reached, *none)
    info["edge"] = _edge(search, x)
    info["digits"] = int(-math.log10(max(result.best.step, 1e-9)))
    # The search computes the IAE over a limited horizon. Scale its values so that the first is the simulated IAE.
    scale = info["iae"] / result.valleys[0]
    info["valleys"] = (info["iae"], *(scale * value for value in result.valleys[1:]))
    return Design(process, controller, source="pidalab.optimal.load: least IAE", info=info)


def _edge(search: Search, x: Array) -> tuple[str, ...]:
    """Return the variables at an edge of the search range. Limits that the user set do not count."""
    index = search.problem.gains
    slowest = search.bounds[index][1]
    edges = ["filter_time"] if x[index] < FASTEST + 1e-3 or x[index] > slowest - 1e-3 else []
    return (*edges, *(["gains"] if x[:index].max() > LARGEST_GAIN * (1 - 1e-3) else []))


def _iae(loop: Loop, time: float) -> float:
    """Return the IAE of a unit load step up to infinite time. Simulate the response until it has settled."""
    try:
        return simulate_until_settled(load_response, loop, 80.0 * time).iae(horizon=math.inf)
    except ValueError as reason:
        raise ValueError(f"the limits allow only loops that are too slow to simulate: {reason}") from None


# --- the search -------------------------------------------------------------------------------------------------------


def descend_over_filter_times(search: Search, starts: list[Array], bar: Any) -> SearchResult | None:
    """Run descents from the starts and return the best result. Return None if no result keeps all limits.

    Each start is a vector of unknowns whose controller keeps all limits.

    Notes
    -----
    The search finds different local optima (see `pidalab.optimal`) in four stages:

    1. The filter time is fixed at each value of a grid in turn. At each value, `Search.near` chooses the start from the
       first of `starts` and from changes of the last optimum `x`. The search passes through the grid downwards (from
       long to short filter times), then upwards, and once more downwards without the highest derivative. `on_grid`
       collects all optima.
    2. Descents with a free filter time (`free`) begin at the optima of the grid and at the other starts.
    3. The best results are refined (`finished`).
    4. Descents from random starts around the best result (`shaken`) check that it is a local optimum. A better
       result replaces it.
    """
    first = starts[0]
    x, on_grid = first, []
    down, up = search.filter_times, search.filter_times[::-1]
    for filter_times, highest in ((down, LARGEST_GAIN), (up, LARGEST_GAIN), (down, 0.0)):
        for time in filter_times:
            value, unknowns, violation = search.descend(
                search.near(x, first, float(time)), float(time), highest
            )
            if violation <= NEARLY:
                x = unknowns
                on_grid.append((value, unknowns))
            bar.update()
    free = []
    for start in [*(x for _, x in _distinct(on_grid, len(on_grid))), *starts[1:]]:
        value, unknowns, violation = search.descend(start)
        if violation <= NEARLY:
            free.append((value, unknowns))
        bar.update()
    finished: list[Polished] = []
    for ends in (free, on_grid):
        for _, start in _distinct(ends, BEST):
            end = finish(search, start, finished)
            finished += [] if end is None else [end]
        if finished:
            break
    else:
        return None
    best = min(finished, key=lambda end: end.value)
    shaken = [search.descend(start) for start in _shaken(search, best.x)]
    kept = [end for end in shaken if end[2] <= NEARLY]
    value, start, _ = min(kept, default=(np.inf, x, 0.0), key=lambda end: end[0])
    if value < search.iae(best.x)[0] * (1 + SAME_END):
        last = finish(search, start, [best])
        if last is not None and last.value < best.value:
            best = last
    return SearchResult(best, _valleys(best.value, (other for other, _ in free)))


def _shaken(search: Search, x: Array) -> Iterator[Array]:
    """Yield random controllers around x whose loops are stable. Each run yields the same controllers."""
    rng, count = np.random.default_rng(0), search.problem.gains
    for gains, filter_time in SHAKES:
        start = x.copy()
        start[:count] *= np.exp(rng.normal(0.0, gains, count))
        start[count] = np.clip(x[count] + rng.normal(0.0, filter_time), *search.bounds[count])
        if not search.problem.unstable(start):
            yield start


def _valleys(best: float, others: Iterable[float]) -> tuple[float, ...]:
    """Return the best value, then the least value of every further local optimum.

    A descent checks its limits only on a coarse grid, so its value may be slightly too low. Values near or below the
    best value are therefore not listed.
    """
    chosen = [best]
    for value in sorted(others):
        if chosen[-1] * (1 + VALLEY_GAP) < value < VALLEY_REACH * best:
            chosen.append(value)
    return tuple(chosen)


def _distinct(on_grid: list[tuple[float, Array]], most: int) -> list[tuple[float, Array]]:
    """Return at most `most` different results of descents, the lowest IAE first."""
    chosen: list[tuple[float, Array]] = []
    for end in sorted(on_grid, key=lambda pair: pair[0]):
        if all(np.max(np.abs(end[1] - other[1])) > 1e-3 for other in chosen):
            chosen.append(end)
        if len(chosen) == most:
            break
    return chosen
