"""The doors of `pidalab.optimal`: arguments checked, a search, and its result as a `Design`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.optimal._finish import PEAKS, finish
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import FASTEST, LARGEST_GAIN, Search
from pidalab.optimal._starts import approached, at_once, stabilising
from pidalab.optimal._units import search_in, unit_of_time
from pidalab.optimal._walk import SearchResult, search
from pidalab.process import Process, require_no_zero_at_origin, sign_of_gain
from pidalab.relative_noise import noise_scale
from pidalab.requirements import Requirements
from pidalab.robustness.margins import max_sensitivity
from pidalab.rules import Design
from pidalab.simulation.exact import load_response, simulate_until_settled

HIGHEST_ORDER = 4  # order of a controller
ACTIVE = 1e-3  # share of a limit within which it is called active
NEGLIGIBLE_ACTION = 1e-6  # share of the largest action, at the corner of the filter
UNITS_TRIED = (1.0, 8.0, 64.0, 512.0)  # of time, since a limit of noise may make a loop slow
SLOWEST_SAMPLING = 100.0  # largest sample time, in the shortest unit
# relative difference between the IAE of the search and that of the simulation, above which the unit is too short
SAME_IAE = 0.02


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

    Parameters
    ----------
    process : Process
        The plant, dead time exact; if it is unstable, one that a PI controller can hold.
    order : int
        Highest derivative m: 0 for PI, 1 for PID, 2 for PIDA, at most 4. The filter has order m + 1.
    ms : float, optional
        Largest allowed maximum sensitivity, above 1.
    mks : float, optional
        Largest allowed gain from measurement noise to control signal, over all frequencies, in units of u per unit
        of y; by default none.
    mt : float, optional
        Largest allowed maximum of \|T\|, above 1; by default none.
    disk : float, optional
        Smallest allowed disk margin, between 0 and 2, as `pidalab.margins` has it; by default none. The circle that
        encloses those of Ms = M and Mt = M, which MIGO designs for, is that of the disk margin 2/(2M - 1).
    noise_gain : float, optional
        Largest allowed standard deviation of u per unit of that of white measurement noise, sampled and held, as
        `pidalab.noise_gain` has it, in units of u per unit of y; by default none.
    sample_time : float, optional
        Sample time of that noise; with `noise_gain` only. By default that of `pidalab.noise_scale`, a hundredth of the
        ultimate period; a limit of the relative noise gain is then that limit times the ``gain`` of the scale. The
        filter is not faster than the sample; where this is what holds it back, ``active`` has "sample_time".
    family : sequence of Process, optional
        Plants that the controller may meet in place of the process, all with gains of its sign. The IAE remains that of
        the process.
    ms_worst : float, optional
        Largest allowed maximum sensitivity with each of them, above 1.
    start : Design, optional
        A design of this function for the same process and order: the search goes on from there, in place of many
        starts.

    Returns
    -------
    Design
        With a `HighOrderPID`, its gains negative for a process with negative gain. Its `info` has ``iae``, ``ms`` and
        ``mks`` as they are, ``noise_gain``, ``mt``, ``disk`` and ``ms_worst`` if they were asked for, ``active`` (the
        limits that are reached, by name),
        ``edge`` (what lies at the edge of the search: without a limit of noise that is the filter time, for which
        shorter would be better) and ``valleys`` (the IAE at which descents from different starts ended: the least
        first, then others up to twice of it, to two digits; with `start` there is one descent), and ``digits``: how
        many digits of the gains, the filter time and the IAE the conditions of the optimum fix, whatever the processor.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, limits that contradict each other or the process (whatever the controller, its
        integral action makes \|C S\| at zero frequency 1/\|P(0)\|), and a process for which no controller of this order
        was found that keeps them, or none with which all of the family keep theirs.

    Notes
    -----
    The search is deterministic and has many starts, but proves no global optimum. It ends in a point that meets the
    conditions of a local one: the limits that are reached as equations, and a stationary Lagrangian. With a family it
    goes on from the optimum of the process alone, and takes the worst plants in until all keep their limit.

    Examples
    --------
    Acceleration pays if noise allows it:

    >>> import pidalab
    >>> process = pidalab.lags(3, delay=1.0)
    >>> pid, pida = (pidalab.optimal.load(process, order, ms=1.4, mks=20.0) for order in (1, 2))
    >>> print(f"{pid.iae:.2f} {pida.iae:.2f} {pida.active}")
    3.41 2.65 ('ms', 'mks')

    A plant that is slower to answer than was thought costs some of it:

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
    """Return the controller with the least IAE for a step of the load, as `load`, for requirements in one record.

    Parameters
    ----------
    process : Process
        As for `load`.
    order : int
        As for `load`.
    requirements : Requirements
        The limits.
    start : Design, optional
        As for `load`.

    Returns
    -------
    Design
        As from `load`.

    Raises
    ------
    TypeError, ValueError
        As from `load`.

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
        raise ValueError(
            f"mks must be above 1/|P(0)| = {1 / abs(static):.4g}, which integral action makes of |C S| at zero "
            f"frequency, found {limits.mks:g}"
        )
    if any(sign_of_gain(plant) != sign_of_gain(process) for plant in limits.family):
        raise ValueError("family must have gains of the sign of the process: none stabilises both signs")
    seen: list[Search] = []
    best = _best(process, order, limits, seen, start)
    if best is None and any(one.family for one in seen):
        raise ValueError(
            f"no controller of order {order} was found that keeps ms_worst <= {limits.ms_worst:g} with all of the "
            "family: allow more, or a narrower family"
        )
    if best is None:
        raise ValueError(_refusal(seen))
    return best


def _best(
    process: Process,
    order: int,
    limits: Requirements,
    seen: list[Search],
    near: Design | None,
) -> Design | None:
    """The best design over the units of time; first from starts at hand, and where none serves from approached ones."""
    import scipy.optimize  # noqa: F401  # whose own BLAS is to be known when its threads are limited
    from threadpoolctl import threadpool_limits
    from tqdm import tqdm

    positive, *others = (upright(plant) for plant in (process, *limits.family))
    shortest, best = unit_of_time(positive, limits), None
    if limits.sample_time is not None and limits.sample_time > SLOWEST_SAMPLING * shortest:
        raise ValueError(
            f"sample_time must be at most {SLOWEST_SAMPLING * shortest:.4g} for this process, found "
            f"{limits.sample_time:g}: no loop needs to be that slow"
        )
    # the matrices are small: handing them to other threads takes longer than the work, up to ten times in all
    with (
        threadpool_limits(limits=1, user_api="blas"),
        tqdm(desc="optimal", delay=2.0, leave=False, disable=None, unit=" descents") as bar,
    ):
        ways: list[Any] = [at_once, approached] if near is None else [None, at_once, approached]
        for start, factor in product(ways, UNITS_TRIED):
            # where the family alone stood in the way, other starts lead to the same
            if factor == UNITS_TRIED[0] and (best is not None or any(one.family for one in seen)):
                break
            one = search_in(positive, order, limits, factor)
            seen.append(one)
            if near is not None and start is None:
                known: Any = near.controller
                gains = sign_of_gain(process) * np.array(known.coefficients)
                end = finish(one, one.problem.unknowns(gains, known.filter_time))
                found = None if end is None else SearchResult(end, (end.value,))
            else:
                starts = start(one)
                found = search(one, starts, bar) if starts else None
            if found is None:
                continue
            if others:
                one.guard(others)
                end = finish(one, found.best.x)
                if end is None:
                    continue
                found = SearchResult(end, found.valleys)
            design = judge(process, one, found)
            if best is None or design.iae < best.iae:
                best = design
            if design.iae - found.best.value * one.problem.time < SAME_IAE * design.iae:
                break  # the search has seen all of the response
    return best


def _refusal(seen: list[Search]) -> str:
    """Say what prevents a design, from searches in several units of time none of which came to a design."""
    first = seen[0]
    order, limits = first.problem.order, first.limits
    wanted = str(limits)
    near = [(one.missed(one.nearest), _nearest(one, one.nearest)) for one in seen if one.nearest is not None]
    if near:
        return (
            f"no stable controller of order {order} with non-negative gains was found that keeps {wanted}; the nearest "
            f"has {min(near)[1]}: allow more, or take another order"
        )
    hint = ""
    for other in range(HIGHEST_ORDER, order, -1):
        problem = Problem(first.problem.process, other, (first.problem.gain, first.problem.time))
        if any(True for _ in stabilising(Search(problem, Requirements(ms=2.0)))):
            hint = f"; order {other} has some"
    return (
        f"no stable controller of order {order} with non-negative gains was found, whatever its ms (requested: "
        f"{wanted}){hint}"
    )


def _nearest(one: Search, x: Array) -> str:
    """What the nearest controller makes of the quantities that are limited."""
    values = {**_heights(one.loop(x)), "noise_gain": one.true_noise(x)}
    return ", ".join(f"{name} = {values[name]:.4g}" for name in one.limits.limits())


def _heights(loop: Loop) -> dict[str, float]:
    """What a loop has of all that may be limited at all frequencies."""
    found = {name: peak(loop)[0] for name, peak in PEAKS.items()}
    return {**found, "disk": 1 / found["inverse_disk"]}


def upright(process: Process) -> Process:
    """Return the process with positive gain."""
    return process if sign_of_gain(process) > 0 else Process(-process.num, process.den, process.delay)


def judge(process: Process, one: Search, found: SearchResult) -> Design:
    """Make a design of what was found, judged on the process itself."""
    problem, limits, x = one.problem, one.limits, found.best.x
    gains, time = problem.controller(x)
    # what an action amounts to at the corner of the filter tells whether there is any
    amounts = gains * time ** -np.arange(-1.0, problem.order + 1)
    gains[1:] = np.where(amounts < NEGLIGIBLE_ACTION * amounts.max(), 0.0, gains)[1:]
    controller = HighOrderPID((sign_of_gain(process) * gains).tolist(), time, problem.order + 1)
    loop = Loop(process, controller)
    heights, named = _heights(loop), limits.limits()
    info: dict[str, Any] = {"iae": _iae(loop, problem.time), "ms": heights["ms"], "mks": heights["mks"]}
    info |= {name: heights[name] for name in ("mt", "disk") if name in named}
    if one.noise is not None:
        info["noise_gain"] = one.true_noise(x)
    if one.family:
        loops = (Loop(plant, one.loop(x).controller) for plant in one.family)
        info["ms_worst"] = max(max_sensitivity(own)[0] for own in loops)
    reached = limits.reached(info, ACTIVE)
    if one.family and info["ms_worst"] >= limits.ms_worst * (1 - ACTIVE):
        reached.append("ms_worst")
    if one.noise is not None:
        info["sample_time"] = one.noise.h
    if one.noise is not None and time <= one.noise.h * (1 + ACTIVE):
        reached.append("sample_time")
    none = [f"K_{k - 1} = 0" for k in range(1, problem.gains) if gains[k] == 0]
    info["active"] = (*reached, *none)
    info["edge"] = _edge(one, x)
    info["digits"] = int(-math.log10(max(found.best.step, 1e-9)))
    info["valleys"] = tuple(problem.time * value for value in found.valleys)
    return Design(process, controller, source="pidalab.optimal.load: least IAE", info=info)


def _edge(one: Search, x: Array) -> tuple[str, ...]:
    """What lies at the edge of the search, where no limit of the user's is the edge."""
    at = one.problem.gains
    slowest = one.bounds[at][1]
    found = ["filter_time"] if x[at] < FASTEST + 1e-3 or x[at] > slowest - 1e-3 else []
    return (*found, *(["gains"] if x[:at].max() > LARGEST_GAIN * (1 - 1e-3) else []))


def _iae(loop: Loop, time: float) -> float:
    """IAE of a unit step of the load, until it has settled."""
    try:
        return simulate_until_settled(load_response, loop, 80.0 * time).iae(horizon=math.inf)
    except ValueError as reason:
        raise ValueError(
            f"the limits leave only loops too slow to be followed for this process: {reason}"
        ) from None
