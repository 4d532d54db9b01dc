"""Performance portraits: one loop for thousands of parameter sets, judged by its measures (huba2024, sec. 2.3).

The sets go to an executor in parts. The result of a set depends neither on its part nor on the executor.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab._parts import done, require_executor
from pidalab.loop import Loop
from pidalab.simulation.bank import Bank
from pidalab.simulation.sampled import limits_at_rest
from pidalab.simulation.sampled_lanes import LANES, MEASURES
from pidalab.simulation.sampled_plant import Actuator, plant_steps

TASKS = 64  # for the workers, about


class Portrait(NamedTuple):
    """Measures of a loop for many parameter sets, as arrays of the grid's shape; `Response` defines them.

    Attributes
    ----------
    ie, iae, ise, itae : ndarray
        Integrals of the control error r - y up to the last time.
    tv_y, tv_u : ndarray
        Total variation of output and control signal from their state of rest, 0, to the last sample.
    tv1_y, tv1_u : ndarray
        Excess over one pulse (huba2024, eq. (24)), from 0 to the value that output and control signal have to approach:
        the set point, and the control signal that holds it against the load.
    y_min, y_max, u_min, u_max : ndarray
        Extremes over the samples and the state of rest.
    y_end, u_end : ndarray
        Last sample.
    diverged : ndarray of bool
        Whether the loop left the range of numbers; its measures are all infinite then. A limited loop on an integrator
        diverges more slowly and has large numbers.
    """

    ie: Array
    iae: Array
    ise: Array
    itae: Array
    tv_y: Array
    tv_u: Array
    tv1_y: Array
    tv1_u: Array
    y_min: Array
    y_max: Array
    u_min: Array
    u_max: Array
    y_end: Array
    u_end: Array
    diverged: Any


def portrait(
    loop: Loop,
    parameters: Mapping[str, Any],
    t: ArrayLike,
    setpoint: ArrayLike = 0.0,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    prefilter: tuple[Sequence[ArrayLike], Sequence[ArrayLike]] | None = None,
    executor: Executor | None = None,
) -> Portrait:
    r"""Simulate a loop for many parameter sets at once, and return the measures of each.

    Each set is a `simulate_sampled` of its own, and no signal is stored.

    Parameters
    ----------
    loop : Loop
        A process and a `SeriesPIDA`, whose filter order, limits and other values hold for all sets; a prefilter, too.
    parameters : mapping of str to array_like, or pandas.DataFrame
        What differs: arrays for any of `kp`, `kd`, `ka`, `ti` and `filter_time`, which are broadcast against each other
        to the shape of the grid.
    t : array_like, shape (n,)
        Uniform times that start at 0; their step is the sample time.
    setpoint, load, noise : float or array_like, shape (n,), optional
        The same for all sets. A number is a step at t = 0; an array is held from each sample to the next.
    limits : tuple of float, optional
        Smallest and largest control signal; those of the controller hold too.
    prefilter : tuple of two sequences of array_like, optional
        Prefilters that differ: numerator and denominator in descending powers of s, of which each coefficient is a
        number or an array over the grid. Proper and stable.
    executor : concurrent.futures.Executor, optional
        Who computes: by default one thread for each processor that this process may use. It is left open.

    Returns
    -------
    Portrait
        Measures as arrays of the shape of the grid.

    Raises
    ------
    TypeError, ValueError
        For a controller that is no `SeriesPIDA`, an output filter, parameters that are unknown, not finite, out of
        range or do not fit together, a sample time above a filter's time constant, an unstable prefilter, what
        `simulate_sampled` refuses, and a load or a set point that no control signal within the limits can hold.
    MemoryError
        For a grid of more than ten million sets; before anything is computed.

    See Also
    --------
    pidalab.simulate_sampled : One set, with its signals.

    Examples
    --------
    Acceleration gains and reset times around huba2024, eq. (25), for a load that the actuator can just bear:

    >>> import numpy as np, pidalab
    >>> pda = pidalab.SeriesPIDA(0.094, 0.45, 0.208, ti=0.648, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
    >>> loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), pda), 0.01 * np.arange(6001)
    >>> grid = {"ka": [[0.18], [0.21]], "ti": [[0.5, 0.65, 0.8]]}
    >>> p = pidalab.portrait(loop, grid, t, load=1.0)
    >>> p.iae.round(2).tolist()
    [[14.74, 15.56, 16.49], [14.04, 14.79, 15.67]]

    With a table of sets, one in each row: ``table.assign(**pidalab.portrait(loop, table, t, load=1.0)._asdict())``.
    """
    t, *held = _check.signals(t, setpoint=setpoint, load=load, noise=noise)
    r, d, n = map(np.ascontiguousarray, held)  # as kernels read them
    h = float(t[-1] / (t.size - 1))
    bank = Bank.of(loop, parameters, prefilter, h)
    at_rest = limits_at_rest(loop.limits, limits)
    plant = plant_steps(loop.process, h, Actuator(*at_rest, 0.0, 0))
    rest = _state_of_rest(loop, bank, at_rest, r[-1], d[-1])
    require_executor(executor)
    # whole groups of lanes, the last one filled up with the last set
    sets = math.prod(bank.shape)
    places = np.minimum(np.arange(-(-sets // LANES) * LANES), sets - 1)
    size = -(-places.size // (TASKS * LANES)) * LANES
    parts = [bank.part(places[start : start + size]) for start in range(0, places.size, size)]
    work = partial(Bank.measures, plant=plant, limits=at_rest, h=h, r=r, d=d, n=n)
    # compiled code lets go of the interpreter
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    with nullcontext(executor) if executor is not None else ThreadPoolExecutor(available) as workers:
        measures = done(work, parts, workers, "part")
    return _portrait(np.concatenate(measures, axis=1)[:, :sets].reshape(-1, *bank.shape), rest)


def _state_of_rest(
    loop: Loop, bank: Bank, limits: tuple[float, float], r: float, d: float
) -> tuple[Array, Array]:
    """Return the final values of output and control signal, and check that the limits allow them."""
    num, den = loop.process.num[-1], loop.process.den[-1]
    if num == 0:
        raise ValueError(f"the process must have a static gain other than 0, found {loop.process!r}")
    y = r * bank.static_gain()
    u = y * den / num - d
    low, high = limits
    if np.any((u < low) | (u > high)):
        raise ValueError(
            f"no state of rest: a set point of {r:g} and a load of {d:g} need u from {np.min(u):.4g} to "
            f"{np.max(u):.4g}, and the limits are ({low:g}, {high:g})"
        )
    return y, u


def _portrait(raw: Array, rest: tuple[Array, Array]) -> Portrait:
    """Add the excess over one pulse, which the final values decide, and mark the sets that diverged."""
    diverged = ~np.isfinite(raw).all(axis=0)
    values = dict(zip(MEASURES, raw, strict=True))
    with np.errstate(all="ignore"):
        for signal, end in zip("yu", rest, strict=True):
            least, most = (np.minimum(values[f"{signal}_min"], end), np.maximum(values[f"{signal}_max"], end))
            pulse = np.maximum(np.abs(2 * least - end), np.abs(2 * most - end))
            values[f"tv1_{signal}"] = values[f"tv_{signal}"] + np.abs(end - values[f"{signal}_end"]) - pulse
    measures = {name: np.where(diverged, np.inf, x) for name, x in values.items()}
    return Portrait(**measures, diverged=diverged)
