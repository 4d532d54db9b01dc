"""Performance portraits: one loop for thousands of parameter sets, judged by its measures (huba2024, sec. 2.3).

The sets go to an executor in chunks. The result of a set depends neither on its chunk nor on the executor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab._many import TASKS, each
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.simulation import lanes
from pidalab.simulation.bank import Bank, require_series
from pidalab.simulation.sampled import limits_at_rest
from pidalab.simulation.steps import Actuator, plant_steps

MOST_SETS = 10**7  # whose measures take about 2 GB


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


class Task(NamedTuple):
    """All that a worker needs besides its sets."""

    process: Process
    limits: tuple[float, float]
    samples: int
    h: float
    setpoint: float | Array
    load: float | Array
    noise: float | Array


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
    chunk: int | None = None,
    progress: bool = False,
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
    chunk : int, optional
        Sets in a task, rounded up to a multiple of 128; by default there are about 64 tasks.
    progress : bool, optional
        Whether to show a progress bar.

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
    require_series(loop)
    t = _check.uniform_time("t", t)
    signals = {
        name: _compact(name, x, t.size)
        for name, x in (("setpoint", setpoint), ("load", load), ("noise", noise))
    }
    task = Task(
        loop.process, limits_at_rest(loop.limits, limits), t.size, float(t[-1] / (t.size - 1)), **signals
    )
    plant_steps(task.process, task.h, Actuator(*task.limits, 0.0, 0))  # complains about the plant
    bank = Bank.of(loop, parameters, prefilter)
    sets = math.prod(bank.shape)
    if sets > MOST_SETS:
        raise MemoryError(
            f"a grid of shape {bank.shape} has {sets:.3g} sets, and {MOST_SETS:.0e} are allowed; take one portrait "
            "after the other"
        )
    bank.require_valid(task.h)
    rest = _state_of_rest(task, bank)

    size = _check.integer("chunk", -(-sets // TASKS) if chunk is None else chunk, at_least=1)
    size = -(-size // lanes.LANES) * lanes.LANES
    parts = [bank.part(slice(start, min(start + size, sets))) for start in range(0, sets, size)]
    measures = each("parameters", partial(_work, task), parts, executor, progress)
    return _portrait(np.concatenate(measures, axis=1).reshape(-1, *bank.shape), rest)


def _compact(name: str, value: ArrayLike, size: int) -> float | Array:
    """Check a signal; a number stays one, since every task carries it."""
    signal = _check.signal(name, value, size)
    return float(signal[0]) if np.ndim(value) == 0 else signal


def _work(task: Task, bank: Bank) -> Array:
    """Compute the sets of a chunk: shape (measures, sets)."""
    plant = plant_steps(task.process, task.h, Actuator(*task.limits, 0.0, 0))
    inputs = [np.broadcast_to(x, task.samples).astype(float) for x in (task.setpoint, task.load, task.noise)]
    return bank.measures(plant, task.limits, task.h, *inputs)


def _state_of_rest(task: Task, bank: Bank) -> tuple[Array, Array]:
    """Return the final values of output and control signal, and check that the limits allow them."""
    r, d = (float(np.ravel(x)[-1]) for x in (task.setpoint, task.load))
    num, den = task.process.num[-1], task.process.den[-1]
    if num == 0:
        raise ValueError(f"the process must have a static gain other than 0, found {task.process!r}")
    y = r * bank.static_gain()
    u = y * den / num - d
    low, high = task.limits
    if np.any((u < low) | (u > high)):
        raise ValueError(
            f"no state of rest: a set point of {r:g} and a load of {d:g} need u from {np.min(u):.4g} to "
            f"{np.max(u):.4g}, and the limits are ({low:g}, {high:g})"
        )
    return y, u


def _portrait(raw: Array, rest: tuple[Array, Array]) -> Portrait:
    """Add the excess over one pulse, which the final values decide, and mark the sets that diverged."""
    diverged = ~np.isfinite(raw).all(axis=0)
    values = dict(zip(lanes.MEASURES, raw, strict=True))
    with np.errstate(all="ignore"):
        for signal, end in zip("yu", rest, strict=True):
            least, most = (np.minimum(values[f"{signal}_min"], end), np.maximum(values[f"{signal}_max"], end))
            pulse = np.maximum(np.abs(2 * least - end), np.abs(2 * most - end))
            values[f"tv1_{signal}"] = values[f"tv_{signal}"] + np.abs(end - values[f"{signal}_end"]) - pulse
    measures = {name: np.where(diverged, np.inf, x) for name, x in values.items()}
    return Portrait(**measures, diverged=diverged)
