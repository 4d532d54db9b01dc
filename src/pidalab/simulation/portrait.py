"""Performance portraits: measures of one loop for thousands of parameter sets (huba2024, sec. 2.3).

The sets are computed in batches. The result of a set does not depend on its batch or on the executor.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from pidalab import _check
from pidalab._check import Array
from pidalab._parts import done, require_executor
from pidalab.controllers import SeriesPIDA
from pidalab.digital.filters import held_gains
from pidalab.digital.program import part_name, program
from pidalab.loop import Loop, require_loop
from pidalab.simulation import sampled_lanes
from pidalab.simulation.operations import operations
from pidalab.simulation.sampled import limits_at_rest, require_fine_enough
from pidalab.simulation.sampled_lanes import LANES, MEASURES, Controllers
from pidalab.simulation.sampled_step import Actuator, Steps, plant_steps

PARAMETER_NAMES = ("kp", "kd", "ka", "ti", "filter_time")
MOST_SETS = 10**7  # the measures of this number of sets take about 2 GB


class Bank(NamedTuple):
    """Parameters and prefilter coefficients of many loops. Every array has the shape of the grid."""

    base: SeriesPIDA  # has the values that all sets share
    values: dict[str, Array]  # the keys are `PARAMETER_NAMES`
    num: tuple[Array, ...]  # numerator of the prefilter, with as many coefficients as den
    den: tuple[Array, ...]

    @staticmethod
    def of(
        loop: Loop, parameters: Mapping[str, ArrayLike], prefilter: tuple[Any, Any] | None, h: float
    ) -> Bank:
        """Collect the parameters of all sets, and check them for the sample time h."""
        require_loop(loop)
        base = loop.controller
        if not isinstance(base, SeriesPIDA) or loop.output_filter is not None:
            raise TypeError(f"loop must have a SeriesPIDA and no output filter, found {loop!r}")
        values = {name: np.asarray(getattr(base, name)) for name in PARAMETER_NAMES}
        values |= _differing(base, parameters)
        num, den = ([np.asarray(x) for x in part] for part in loop.blocks["prefilter"])
        if prefilter is not None:
            num, den = _coefficients(loop, prefilter)
        num = [np.zeros(())] * (len(den) - len(num)) + num
        shapes = [x.shape for x in (*values.values(), *num, *den)]
        try:
            shape = np.broadcast_shapes(*shapes)
        except ValueError:
            raise ValueError(
                f"parameters must broadcast together, found shapes {sorted(set(shapes))}"
            ) from None
        sets = math.prod(shape)
        if sets > MOST_SETS:
            raise MemoryError(
                f"parameters must have at most {MOST_SETS:.0e} sets, found shape {shape}; take several portraits"
            )
        require_fine_enough(h, float(values["filter_time"].min()) if base.filter_order else math.inf)
        _require_stable(den)
        values = {name: np.broadcast_to(x, shape) for name, x in values.items()}
        return Bank(base, values, *(tuple(np.broadcast_to(x, shape) for x in part) for part in (num, den)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.den[0].shape

    def part(self, places: Any) -> Bank:
        """Return the sets at some indices of the flattened grid."""
        values = {name: x.flat[places] for name, x in self.values.items()}
        return Bank(
            self.base, values, *(tuple(x.flat[places] for x in part) for part in (self.num, self.den))
        )

    def measures(
        self, plant: Steps, limits: tuple[float, float], h: float, r: Array, d: Array, n: Array
    ) -> Array:
        """Simulate the sets. Return an array (measures, sets). The number of sets must be a multiple of `LANES`."""
        groups = [sampled_lanes.run(bank, plant, h, r, d, n) for bank in controllers(self, limits, h)]
        return np.concatenate(groups, axis=1)


def _differing(base: SeriesPIDA, parameters: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Validate the given parameters with the checks of the controller, and return them by name."""
    if not hasattr(parameters, "keys"):
        raise TypeError(f"parameters must be a mapping of arrays by name, found {type(parameters).__name__}")
    values = {}
    # Copy the mapping to a dict, since a Series of pandas iterates over values instead of names.
    for name, given in dict(parameters).items():
        if name not in PARAMETER_NAMES:
            raise ValueError(f"parameters must be among {', '.join(PARAMETER_NAMES)}, found {name!r}")
        values[name] = _check.array(f"parameters[{name!r}]", given)
        for extreme in (values[name].min(), values[name].max()):
            changed: dict[str, Any] = {name: float(extreme)}
            replace(base, **changed)
    return values


def _coefficients(loop: Loop, prefilter: tuple[Any, Any]) -> tuple[list[Array], list[Array]]:
    """Check the coefficients of the given prefilters, and return numerator and denominator."""
    if loop.prefilter is not None:
        raise ValueError(f"prefilter must be None, since the loop already has one, {loop.prefilter!r}")
    # Check the type first, because iterating over a transfer function raises an unclear error.
    two = isinstance(prefilter, (tuple, list)) and len(prefilter) == 2
    if not (two and all(map(np.iterable, prefilter))):
        raise TypeError(f"prefilter must be two sequences of coefficients, found {prefilter!r}")
    num, den = ([_check.array("prefilter", x) for x in part] for part in prefilter)
    if not 0 < len(num) <= len(den):
        raise ValueError(f"prefilter must be proper, found {len(num)} and {len(den)} coefficients")
    return num, den


def _require_stable(den: list[Array]) -> None:
    """Raise an error if a prefilter is unstable or if its denominator begins or ends with 0."""
    if np.any(den[0] == 0) or np.any(den[-1] == 0):
        raise ValueError(
            "prefilter must have a denominator whose first and last coefficients are not 0, found 0"
        )
    if len(den) > 1:
        each = np.stack(np.broadcast_arrays(*den), axis=-1)
        poles = np.linalg.eigvals(_companion(each / each[..., :1]))
        if np.any(poles.real >= 0):
            raise ValueError(f"prefilter must be stable, found a pole at {poles[poles.real >= 0][0]:.4g}")


def _companion(den: Array) -> Array:
    """Return companion matrices of monic polynomials, shape (..., degree + 1)."""
    q = den.shape[-1] - 1
    A = np.zeros((*den.shape[:-1], q, q))
    A[..., 0, :] = -den[..., 1:]
    A[..., 1:, :-1] += np.eye(q - 1)
    return A


def controllers(bank: Bank, limits: tuple[float, float], h: float) -> Iterator[Controllers]:
    """Discretise the sets for the sample time h, in groups of `LANES` sets.

    All sets run the step of one `DigitalController`, which is exact for held inputs. Only the numbers differ.
    """
    kp, kd, ka, ti, time = bank.values.values()
    n = bank.base.filter_order
    gains = np.stack([kp, kd / time, ka / time**2, *np.zeros((n, kp.size))][: n + 1], axis=-1)
    if n:
        gains = held_gains(gains, np.repeat(time[:, None], n, axis=1), h)
    any_gains = SeriesPIDA(1.0, 0.0, 0.0, ti=1.0, filter_time=1.0, filter_order=n).discretise(
        min(h, 1.0), "zoh", limits=limits
    )
    path = any_gains.paths[0]._replace(gains=(1.0,) * (n + 1))
    step = program(replace(any_gains, paths=(path,)))
    code, places, numbers = operations(step, {**step.states, "started": True})
    table = np.repeat(numbers[:, None], kp.size, axis=1)
    name = part_name(0).upper()
    table[[places[f"{name}_GAIN_{k}"] for k in range(n + 1)]] = gains.T
    table[places["INTEGRAL_OLD"]] = -np.expm1(-h / ti)
    if n:
        table[places[f"{name}_OLD"]] = -np.expm1(-h / time)
    arrays = (table, *_prefilter(bank, h))
    # Copy each group, so that its numbers are contiguous in memory.
    for start in range(0, kp.size, sampled_lanes.LANES):
        yield Controllers(
            code, *(np.ascontiguousarray(x[..., start : start + sampled_lanes.LANES]) for x in arrays)
        )


def _prefilter(bank: Bank, h: float) -> tuple[Array, Array, Array, Array]:
    """Discretise the prefilters in controllable canonical form. The sets are on the last axis."""
    q = len(bank.den) - 1
    num, den = np.stack(bank.num, axis=-1), np.stack(bank.den, axis=-1)
    num, den = num / den[:, :1], den / den[:, :1]
    # Choose a unit of time in which the poles are near 1 in size, so that the companion matrix is well scaled.
    unit = np.abs(den[:, -1:]) ** (-1 / max(q, 1))
    scale = unit ** np.arange(q + 1)
    num, den = num * scale, den * scale
    # Treat the held input as a further state. One exponential then gives the transition and the input's influence.
    augmented = np.zeros((len(den), q + 1, q + 1))
    if q:
        augmented[:, :q, :q] = _companion(den)
        augmented[:, 0, q] = 1.0
    transition = expm(augmented * (h / unit)[:, :, None])
    phi, gamma = transition[:, :q, :q], transition[:, :q, q]
    # Split the numerator into the direct feedthrough d and a remainder, whose coefficients c multiply the states.
    d = num[:, 0]
    c = num[:, 1:] - d[:, None] * den[:, 1:]
    return tuple(np.moveaxis(x, 0, -1) for x in (phi, gamma, c, d))  # type: ignore[return-value]


TASKS = 64  # approximate number of parts into which the grid is divided


class Portrait(NamedTuple):
    """Measures (as in `Response`) of a loop for many parameter sets. Each array has the shape of the grid.

    Attributes
    ----------
    ie, iae, ise, itae : ndarray
        Integrals of the control error r - y over the whole simulation.
    tv_y, tv_u : ndarray
        Total variation of output and control signal, including the first change from 0.
    tv1_y, tv1_u : ndarray
        Total variation minus the total variation of one pulse, which goes from 0 to an extreme and back to the final
        value (huba2024, eq. (24)). The final y is the prefiltered set point. The final u holds y at this value against
        the load.
    y_min, y_max, u_min, u_max : ndarray
        Smallest and largest value, including the initial value 0.
    y_end, u_end : ndarray
        Last sample.
    diverged : ndarray of bool
        True for a loop that overflowed; its measures are infinite. A limited loop with an integrating process may
        diverge too slowly to overflow. Its measures are large and finite.
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
    *,
    setpoint: ArrayLike = 0.0,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    prefilter: tuple[Sequence[ArrayLike], Sequence[ArrayLike]] | None = None,
    executor: Executor | None = None,
) -> Portrait:
    r"""Simulate a loop for many parameter sets as `simulate_sampled` does, and return measures instead of signals.

    Parameters
    ----------
    loop : Loop
        A process and a `SeriesPIDA`. If `parameters` lacks a parameter, all sets use the controller's value. The loop
        may have a prefilter, but no output filter.
    parameters : mapping of str to array_like, or pandas.DataFrame
        Arrays for any of `kp`, `kd`, `ka`, `ti` and `filter_time`, which are broadcast to the shape of the grid.
    t : array_like, shape (n,)
        Uniform times that start at 0. Their step is the sample time.
    setpoint, load, noise : float or array_like, shape (n,), optional
        Inputs that all sets share, as for `simulate`.
    limits : tuple of float, optional
        Smallest and largest control signal. The limits of the controller also apply.
    prefilter : tuple of two sequences of array_like, optional
        Numerator and denominator of prefilters in descending powers of s. Each coefficient is a number or an array over
        the grid. The prefilters must be proper and stable.
    executor : concurrent.futures.Executor, optional
        Executor for the parts of the grid; it is not closed. By default one thread runs on each available processor.

    Returns
    -------
    Portrait
        Measures as arrays of the shape of the grid.

    Raises
    ------
    TypeError, ValueError
        As for `simulate_sampled`. Also in these cases:

        * The controller is not a `SeriesPIDA`, or the loop has an output filter.
        * Parameters are unknown, not finite or out of range, or do not broadcast.
        * A prefilter is unstable.
        * No control signal within the limits can hold the set point against the load.
    MemoryError
        If the grid has more than ten million sets.

    Examples
    --------
    Vary acceleration gain and reset time near the values of huba2024, eq. (25). The actuator can just compensate the
    load:

    >>> import numpy as np, pidalab
    >>> pda = pidalab.SeriesPIDA(0.094, 0.45, 0.208, ti=0.648, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
    >>> loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), pda), 0.01 * np.arange(6001)
    >>> grid = {"ka": [[0.18], [0.21]], "ti": [[0.5, 0.65, 0.8]]}
    >>> p = pidalab.portrait(loop, grid, t, load=1.0)
    >>> p.iae.round(2).tolist()
    [[14.74, 15.56, 16.49], [14.04, 14.79, 15.67]]

    For a table with one set in each row, use ``table.assign(**pidalab.portrait(loop, table, t, load=1.0)._asdict())``.
    """
    t, *held = _check.signals(t, setpoint=setpoint, load=load, noise=noise)
    r, d, n = map(np.ascontiguousarray, held)  # kernels need contiguous arrays
    h = float(t[-1] / (t.size - 1))
    bank = Bank.of(loop, parameters, prefilter, h)
    at_rest = limits_at_rest(loop.limits, limits)
    plant = plant_steps(loop.process, h, Actuator(*at_rest, 0.0, 0))
    rest = _state_of_rest(loop, bank, at_rest, r[-1], d[-1])
    require_executor(executor)
    # Kernels compute groups of `LANES` sets, so copies of the last set fill the last group.
    sets = math.prod(bank.shape)
    places = np.minimum(np.arange(-(-sets // LANES) * LANES), sets - 1)
    size = -(-places.size // (TASKS * LANES)) * LANES
    parts = [bank.part(places[start : start + size]) for start in range(0, places.size, size)]
    work = partial(Bank.measures, plant=plant, limits=at_rest, h=h, r=r, d=d, n=n)
    # Threads are enough, since compiled code releases the interpreter lock.
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    with nullcontext(executor) if executor is not None else ThreadPoolExecutor(available) as workers:
        measures = done(work, parts, workers, "part")
    return _portrait(np.concatenate(measures, axis=1)[:, :sets].reshape(-1, *bank.shape), rest)


def _state_of_rest(
    loop: Loop, bank: Bank, limits: tuple[float, float], r: float, d: float
) -> tuple[Array, Array]:
    """Return the final values of output and control signal. Raise if the limits do not contain the control signal."""
    num, den = loop.process.num[-1], loop.process.den[-1]
    if num == 0:
        raise ValueError(f"the process must have a static gain other than 0, found {loop.process!r}")
    y = r * np.asarray(bank.num[-1] / bank.den[-1])
    u = y * den / num - d
    low, high = limits
    if np.any((u < low) | (u > high)):
        raise ValueError(
            f"limits must contain the final u from {np.min(u):.4g} to {np.max(u):.4g}, found ({low:g}, {high:g})"
        )
    return y, u


def _portrait(raw: Array, rest: tuple[Array, Array]) -> Portrait:
    """Add `tv1_y` and `tv1_u`, which need the final values, and mark the sets that diverged."""
    diverged = ~np.isfinite(raw).all(axis=0)
    values = dict(zip(MEASURES, raw, strict=True))
    with np.errstate(all="ignore"):
        for signal, end in zip("yu", rest, strict=True):
            least, most = (np.minimum(values[f"{signal}_min"], end), np.maximum(values[f"{signal}_max"], end))
            pulse = np.maximum(np.abs(2 * least - end), np.abs(2 * most - end))
            values[f"tv1_{signal}"] = values[f"tv_{signal}"] + np.abs(end - values[f"{signal}_end"]) - pulse
    measures = {name: np.where(diverged, np.inf, x) for name, x in values.items()}
    return Portrait(**measures, diverged=diverged)
