"""Performance portraits: one loop for thousands of parameter sets, judged by its measures (huba2024, sec. 2.3).

The sets go to workers in chunks. What a set yields depends neither on its chunk nor on who computes it: threads,
processes and machines of one kind give the same bits.
"""

from __future__ import annotations

import math
import os
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import SeriesPIDA
from pidalab.loop import Loop, require_loop
from pidalab.process import Process
from pidalab.simulation import lanes
from pidalab.simulation.bank import Bank, series_controller
from pidalab.simulation.digital_bank import DigitalBank
from pidalab.simulation.kept import Kept
from pidalab.simulation.sampled import limits_at_rest
from pidalab.simulation.steps import Actuator, plant_steps

TASKS = 64  # by default the sets go to the workers in about so many chunks


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
    missing : ndarray of bool
        Whether the portrait was interrupted before this set was done; its measures are all nan then.
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
    missing: Any


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
    memory: float = 2e9,
    resume: str | os.PathLike[str] | None = None,
) -> Portrait:
    r"""Simulate a loop for many parameter sets at once, and return the measures of each.

    Each set is a `simulate_sampled` of its own, and no signal is stored. An interrupt (Ctrl-C) ends it with what is
    done, and a warning; with `resume` the next call goes on from there.

    Parameters
    ----------
    loop : Loop
        A process and a `SeriesPIDA`, whose filter order, limits and other values hold for all sets; a prefilter, too.
        Or a process and a `DigitalController`.
    parameters : mapping of str to array_like, or pandas.DataFrame
        What differs: arrays for any of `kp`, `kd`, `ka`, `ti` and `filter_time`, which are broadcast against each other
        to the shape of the grid. For a loop with a digital controller ``{"controller": array}``, with an array or
        nested lists of digital controllers, which any class makes by ``discretise``. These run one after the other,
        about as fast as `simulate_sampled`.
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
        Who computes: by default one thread for each processor that this process may use, which is compiled code and
        runs on all of them. A ``ProcessPoolExecutor``, or ``Client.get_executor()`` of Dask's `distributed` for more
        than one machine, gives the same bits on processors of the same kind. It is left open.
    chunk : int, optional
        Sets in a task, rounded up to a multiple of 64; by default there are about 64 tasks.
    progress : bool, optional
        Whether to show a progress bar.
    memory : float, optional
        Bytes that the results, and the past of a group of loops over the dead time, may take; 2 GB by default.
    resume : str or path, optional
        File that keeps what is done: written every ten seconds, at the end, and when the portrait is interrupted or
        fails. If it is there, only what is missing is computed. It belongs to this portrait alone.

    Returns
    -------
    Portrait
        Measures as arrays of the shape of the grid.

    Raises
    ------
    TypeError, ValueError
        For a controller that is neither a `SeriesPIDA` nor digital, an output filter, parameters that are unknown, not
        finite, out of range or do not fit together, a sample time above a filter's time constant, an unstable
        prefilter, what `simulate_sampled` refuses, a load or a set point that no control signal within the limits can
        hold, and a file to resume from that is none of this portrait.
    MemoryError
        For a grid, or a dead time in samples, that would take more than `memory`; before anything is computed.
    RuntimeError
        If a worker is lost, or fails, with the sets that are missing.

    Warns
    -----
    UserWarning
        If it is interrupted, with the number of sets that are missing.

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

    Digital controllers of another class, as they would run:

    >>> grid = [[pidalab.PIDA(kp, ti, 0.4).discretise(0.1, c=0.0) for ti in (4.0, 6.0)] for kp in (0.3, 0.4, 0.5)]
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), grid[0][0])
    >>> p = pidalab.portrait(loop, {"controller": grid}, 0.1 * np.arange(801), setpoint=1.0)
    >>> p.iae.round(2).tolist()
    [[6.42, 5.9], [5.02, 4.68], [4.21, 4.0]]
    """
    require_loop(loop)
    if loop.digital is None:
        series_controller(loop)
    t = _check.uniform_time("t", t)
    signals = {
        name: _compact(name, x, t.size)
        for name, x in (("setpoint", setpoint), ("load", load), ("noise", noise))
    }
    own = SeriesPIDA.limits if loop.digital is not None else loop.limits
    task = Task(loop.process, limits_at_rest(own, limits), t.size, float(t[-1] / (t.size - 1)), **signals)
    plant_steps(task.process, task.h, Actuator(*task.limits, 0.0, 0))  # complains about the plant
    bank: Bank | DigitalBank = (Bank if loop.digital is None else DigitalBank).of(loop, parameters, prefilter)
    numbers = (
        2 * math.prod(bank.shape) * len(Portrait._fields[:-1]) + lanes.LANES * task.process.delay / task.h
    )
    if 8.0 * numbers > _check.real("memory", memory, above=0.0):
        raise MemoryError(
            f"a grid of shape {bank.shape} and a dead time of {task.process.delay / task.h:.3g} samples need about "
            f"{8.0 * numbers:.3g} bytes, and memory = {memory:.3g} are allowed; take fewer sets, one portrait after "
            "the other, or allow more"
        )
    bank.require_valid(task.h)
    ends = _ends(task, bank)

    sets = math.prod(bank.shape)
    size = _check.integer("chunk", -(-sets // TASKS) if chunk is None else chunk, at_least=1)
    size = -(-size // lanes.LANES) * lanes.LANES
    raw, missing = np.full((len(lanes.MEASURES), sets), np.nan), np.ones(sets, dtype=bool)
    kept = Kept(resume, task, bank)
    kept.load(raw, missing)
    parts = [slice(start, min(start + size, sets)) for start in range(0, sets, size)]
    parts = [part for part in parts if missing[part].any()]
    computed = _computed(executor, task, bank, parts)
    try:
        with tqdm(total=sets, initial=int(sets - missing.sum()), unit="set", disable=not progress) as bar:
            for part, measures in computed:
                bar.update(int(missing[part].sum()))
                raw[:, part], missing[part] = measures, False
                kept.save(raw, missing)
    except KeyboardInterrupt:
        computed.close()
        warn(f"interrupted: {missing.sum()} of {sets} sets are missing, and nan", stacklevel=2)
    finally:
        kept.save(raw, missing, now=True)
    return _portrait(raw.reshape(-1, *bank.shape), missing.reshape(bank.shape), ends)


def _compact(name: str, value: ArrayLike, size: int) -> float | Array:
    """Check a signal; a number stays one, since every task carries it."""
    signal = _check.signal(name, value, size)
    return float(signal[0]) if np.ndim(value) == 0 else signal


def _computed(
    executor: Executor | None, task: Task, bank: Bank | DigitalBank, parts: list[slice]
) -> Generator[tuple[slice, Array]]:
    """Yield chunks as they are done; with all of them, or an error that names those that are missing."""
    if executor is None:
        with ThreadPoolExecutor(
            len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
        ) as threads:
            yield from _computed(threads, task, bank, parts)
        return
    if not isinstance(executor, Executor):
        hint = "; pass its .get_executor()" if hasattr(executor, "get_executor") else ""
        raise TypeError(
            f"executor must be a concurrent.futures.Executor or None, found {type(executor).__name__}{hint}"
        )
    futures: dict[Future[Any], slice] = {}
    lost: list[slice] = []
    reason: Exception | None = None
    try:
        for part in parts:
            try:
                futures[executor.submit(_work, task, bank.part(part))] = part
            except RuntimeError as broken:  # a pool whose worker died takes no more
                lost, reason = [*lost, part], reason or broken
        for future in as_completed(list(futures)):
            try:
                measures = future.result()
            except Exception as failure:
                lost, reason = [*lost, futures[future]], failure
            else:
                yield futures.pop(future), measures
    except KeyboardInterrupt:
        # what has been done by now counts, too
        for future, part in futures.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield part, future.result()
        raise
    finally:
        for future in futures:
            future.cancel()
    if lost:
        lost.sort(key=lambda part: part.start)
        missing, sets = (sum(part.stop - part.start for part in some) for some in (lost, parts))
        places = ", ".join(f"{part.start} to {part.stop - 1}" for part in lost[:5]) + (
            ", …" if lost[5:] else ""
        )
        raise RuntimeError(
            f"a worker failed or was lost: {missing} of {sets} sets are missing (in flat order {places}); "
            f"{type(reason).__name__}: {reason}"
        ) from reason


def _work(task: Task, bank: Bank | DigitalBank) -> Array:
    """Compute the sets of a chunk: shape (measures, sets)."""
    plant = plant_steps(task.process, task.h, Actuator(*task.limits, 0.0, 0))
    inputs = [np.broadcast_to(x, task.samples).astype(float) for x in (task.setpoint, task.load, task.noise)]
    return bank.measures(plant, task.limits, task.h, *inputs)


def _ends(task: Task, bank: Bank | DigitalBank) -> tuple[Array, Array]:
    """Return what output and control signal have to approach, and check that the limits allow it."""
    r, d = (float(np.ravel(x)[-1]) for x in (task.setpoint, task.load))
    num, den = task.process.num[-1], task.process.den[-1]
    if num == 0:
        raise ValueError(f"the process must have a static gain other than 0, found {task.process!r}")
    y = r * bank.static_gain()
    u = y * den / num - d
    low, high = bank.limits(*task.limits)
    if np.any((u < low) | (u > high)):
        raise ValueError(
            f"no state of rest: a set point of {r:g} and a load of {d:g} need u from {np.min(u):.4g} to "
            f"{np.max(u):.4g}, and the limits are ({np.max(low):g}, {np.min(high):g})"
        )
    return y, u


def _portrait(raw: Array, missing: Any, ends: tuple[Array, Array]) -> Portrait:
    """Add what the end values decide, and mark what diverged and what is missing."""
    diverged = ~np.isfinite(raw).all(axis=0) & ~missing
    values = dict(zip(lanes.MEASURES, raw, strict=True))
    with np.errstate(all="ignore"):
        for signal, end in zip("yu", ends, strict=True):
            least, most = (np.minimum(values[f"{signal}_min"], end), np.maximum(values[f"{signal}_max"], end))
            pulse = np.maximum(np.abs(2 * least - end), np.abs(2 * most - end))
            values[f"tv1_{signal}"] = values[f"tv_{signal}"] + np.abs(end - values[f"{signal}_end"]) - pulse
        kept = {name: np.where(missing, np.nan, np.where(diverged, np.inf, x)) for name, x in values.items()}
        return Portrait(**kept, diverged=diverged, missing=missing)
