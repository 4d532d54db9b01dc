"""Step responses of simple models in closed form, with a static gain of 1 and without dead time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import solve_banded
from scipy.optimize import least_squares
from scipy.special import gammainc

from pidalab._check import Array
from pidalab.plant.record import Record
from pidalab.process import Process, fopdt, ipdt, lags, sopdt

MOST_LAGS = 8
TABLE = 4001  # times at which the response behind a further lag is worked out


@dataclass(frozen=True)
class Shape:
    """A model whose shape depends on times, and possibly on a damping; its gain and dead time are apart.

    Attributes
    ----------
    name : str
        As `fit` calls it.
    parameters : tuple of str
        Names of the shape's parameters.
    step : callable
        Unit step response at times (0 before 0), from times and shape parameters.
    process : callable
        The Process, from gain, shape parameters and dead time.
    signed : int
        How many of the parameters, the last ones, may be negative.
    """

    name: str
    parameters: tuple[str, ...]
    step: Callable[[Array, Sequence[float]], Array]
    process: Callable[[float, Sequence[float], float], Process]
    signed: int = 0


def _first_order(t: Array, p: Sequence[float]) -> Array:
    return -np.expm1(-np.maximum(t, 0.0) / p[0])


def _second_order(t: Array, p: Sequence[float]) -> Array:
    """Response of (zero s + 1)/(tau² s² + 2 damping tau s + 1), from tau, damping and, if there is one, the zero."""
    tau, damping, zero = (*p, 0.0)[:3]
    x = np.maximum(t, 0.0) / tau
    apart = damping**2 - 1.0
    # half the distance of the poles, imaginary for an oscillation; two close poles stand for a double one
    half = np.emath.sqrt(apart) if abs(apart) > 1e-10 else 1e-5
    slow = damping - half
    late, early = np.exp(-slow * x), np.exp(-(damping + half) * x)
    impulse = (late - early) / (2 * half)
    return np.asarray(np.real(1.0 - late + (zero / tau - slow) * impulse), dtype=float)


def _lagged_ramp(t: Array, p: Sequence[float]) -> Array:
    since = np.maximum(t, 0.0)
    return since + p[0] * np.expm1(-since / p[0])


def _ramp(t: Array, p: Sequence[float]) -> Array:
    return np.maximum(t, 0.0)


def equal_lags(order: int) -> Shape:
    """Return the shape of `order` equal lags: its step response is a regularised incomplete gamma function."""
    return Shape(
        "lags",
        ("lag",),
        lambda t, p: np.asarray(gammainc(order, np.maximum(t, 0.0) / p[0]), dtype=float),
        lambda gain, p, delay: lags(order, p[0], gain, delay),
    )


def behind_lag(shape: Shape, lag: float) -> Shape:
    """Return the shape with a further lag of known time constant in series, which its parameters do not show.

    The lag takes the response over from a table, between whose times it counts as straight.
    """

    def step(t: Array, p: Sequence[float]) -> Array:
        times = np.linspace(0.0, max(float(np.max(t)), lag), TABLE)
        x = times[1] / lag
        # exact for an input that is straight between the times: y_k = a y_{k-1} + (1 - b) u_k + (b - a) u_{k-1}
        a = np.exp(-x)
        b = -np.expm1(-x) / x
        inner = shape.step(times, p)
        driven = (1.0 - b) * inner + (b - a) * np.append(0.0, inner[:-1])
        # the recursion as equations: one on the diagonal, -a below it
        table = solve_banded((1, 0), np.vstack([np.ones(TABLE), np.full(TABLE, -a)]), driven)
        return np.asarray(np.interp(t, times, table), dtype=float)

    def process(gain: float, p: Sequence[float], delay: float) -> Process:
        inner = shape.process(gain, p, delay)
        return Process(inner.num, np.convolve(inner.den, [lag, 1.0]), inner.delay)

    return Shape(shape.name, shape.parameters, step, process, shape.signed)


FIRST_ORDER = Shape("fopdt", ("lag",), _first_order, lambda gain, p, delay: fopdt(gain, p[0], delay))
SECOND_ORDER = Shape(
    "sopdt", ("tau", "damping"), _second_order, lambda gain, p, delay: sopdt(gain, p[0], p[1], delay)
)
INTEGRATOR = Shape("ipdt", (), _ramp, lambda gain, p, delay: ipdt(gain, delay))


def _with_zero(gain: float, p: Sequence[float], delay: float) -> Process:
    return Process([gain * p[2], gain], sopdt(gain, p[0], p[1], delay).den, delay)


def _integrator_and_lag(gain: float, p: Sequence[float], delay: float) -> Process:
    return Process([gain], [p[0], 1.0, 0.0], delay)


ORDER_WITH_ZERO = Shape("sopdtz", ("tau", "damping", "zero"), _second_order, _with_zero, signed=1)
LAGGED = Shape("ifopdt", ("lag",), _lagged_ramp, _integrator_and_lag)


MOST_CHANGES = 60  # of the input that are followed one by one; beyond, the record is laid on a uniform grid
MOST_SAMPLES = 4000  # that a fit looks at; a longer record is averaged over neighbours
SUMMED_SAMPLES = 1000  # samples up to which a sum of products is faster than Fourier transforms
BETTER = 0.03  # share by which the residual must fall for a model with one more parameter
NONE = 1e-3  # dead time in samples that counts as none
LEVEL = 1  # place of the output's level among the parameters
DESCENTS = 6  # from different starts, of which the lowest end counts
SKETCHED, FINISHED = (
    1e-6,
    1e-12,
)  # relative changes at which a descent ends: of all of them, then of the lowest
MOST_DAMPED = 20.0  # damping beyond which a second order is a first one
LOADS = 46  # times at which a step of the load is tried
HIDDEN = np.geomspace(0.01, 0.5, 12)  # further lags that are tried, as shares of all times of the model


class FitData(NamedTuple):
    """A record as the fit sees it."""

    t: Array
    y: Array
    changes: Array  # of the input
    change_times: Array
    unseen: float  # mean interval between samples in which the input changed
    grid: float  # sampling interval of a uniform grid on which the input changes at every sample; 0 otherwise
    free: bool = False  # whether the plant starts from a state that is not rest
    load: float = np.nan  # when the output begins to answer a step of the load; nan for none

    @property
    def loaded(self) -> bool:
        """Whether a step of the load moved the output, too."""
        return not np.isnan(self.load)

    def simulated(self, shape: Shape, p: Sequence[float], delay: float) -> Array:
        """Response of the shape with gain 1 and dead time to the recorded input."""
        if self.grid:
            response = shape.step(self.t - self.t[0] - delay, p)
            if self.t.size <= SUMMED_SAMPLES:
                return np.convolve(self.changes, response)[: self.t.size]
            length = next_fast_len(2 * self.t.size)
            product = np.fft.rfft(self.changes, length) * np.fft.rfft(response, length)
            return np.asarray(np.fft.irfft(product, length)[: self.t.size], dtype=float)
        since = self.t[:, None] - self.change_times - delay
        return shape.step(since.ravel(), p).reshape(since.shape) @ self.changes

    def basis(self, shape: Shape, p: Sequence[float]) -> Array:
        """Return columns for what enters linearly: gain, level, a free initial state and its slope, a load."""
        columns = [self.simulated(shape, p[:-1], p[-1]), np.ones(self.t.size)]
        if self.free:
            settling = shape.step(self.t - self.t[0], p[:-1])
            columns.append(settling)
            if shape.name not in ("fopdt", "ipdt"):
                columns.append(np.gradient(settling, self.t))
        if self.loaded:
            columns.append(shape.step(self.t - self.load, p[:-1]))
        return np.column_stack(columns)

    def until(self, time: float) -> FitData:
        """Return the data up to a time."""
        seen, moved = self.t <= time, self.change_times <= time
        return self._replace(
            t=self.t[seen], y=self.y[seen], changes=self.changes[moved], change_times=self.change_times[moved]
        )


def prepared(record: Record) -> FitData:
    """Return what a fit looks at of a record."""
    t, u, y = record.t, record.u, record.y
    moved = np.diff(u, prepend=record.u_before)
    changed = np.flatnonzero(moved)
    free = not record.at_rest
    if changed.size > MOST_CHANGES:
        # a moving input: on a uniform grid its changes and the response are one convolution
        count = min(MOST_SAMPLES, round(np.ptp(t) / record.sampling) + 1)
        uniform = np.linspace(t[0], t[-1], count)
        held = u[np.searchsorted(t, uniform, side="right") - 1]
        moved = np.diff(held, prepend=record.u_before)
        return FitData(uniform, np.interp(uniform, t, y), moved, uniform, 0.0, uniform[1] - uniform[0], free)
    intervals = np.diff(t, prepend=t[0] - record.sampling)
    unseen = float(np.mean(intervals[changed]))
    moments, changes = t[changed], moved[changed]
    if t.size > MOST_SAMPLES:
        # neighbours are averaged: noise falls, and the response is smooth over so short a time
        parts = np.array_split(np.arange(t.size), MOST_SAMPLES)
        t, y = (np.array([x[part].mean() for part in parts]) for x in (t, y))
    return FitData(t, y, changes, moments, unseen, 0.0, free)


class FitResult(NamedTuple):
    shape: Shape
    values: Array  # gain, level, shape parameters, delay
    residuals: Array
    jacobian: Array
    converged: bool  # whether the descent came to rest
    data: FitData  # with the load at its place

    @property
    def cost(self) -> float:
        return float(self.residuals @ self.residuals)

    @property
    def deviation(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def near(self) -> float:
        """Root mean square of residuals that count as no larger, ignoring rounding."""
        return self.deviation * (1 + BETTER) + 1e-9 * float(np.ptp(self.jacobian[:, 0] * self.values[0]))


def tried_models(data: FitData, models: Sequence[str]) -> tuple[list[FitResult], str]:
    """Return what the searches end with, and why the last one that failed did."""
    tried, failed = [], ""
    for shape in (shape for model in models for shape in _candidates(model)):
        try:
            tried.append(search(data, shape))
        except ArithmeticError as why:
            failed = str(why)
    return tried, failed


def _candidates(model: str) -> list[Shape]:
    if model == "lags":
        return [equal_lags(order) for order in range(2, MOST_LAGS + 1)]
    return [
        shape
        for shape in (FIRST_ORDER, SECOND_ORDER, INTEGRATOR, LAGGED, ORDER_WITH_ZERO)
        if shape.name == model
    ]


def search(data: FitData, shape: Shape) -> FitResult:
    """Least squares over shape and dead time from a grid of starts, gain and level solved for at each try."""
    span = data.t[-1] - float(data.change_times[0])
    times = span * np.geomspace(0.01, 0.5, 5)
    delays = span * np.array([0.0, 0.01, 0.03, 0.08, 0.2, 0.35])
    grid = [[*start, delay] for start in _starts(shape, times) for delay in delays]
    costs = [float(np.sum(projected(data, shape, p)[0] ** 2)) for p in grid]
    # the best start of each part of the list, so that an oscillation gets its chance beside an overdamped shape
    parts = [part for part in np.array_split(np.arange(len(grid)), DESCENTS) if part.size]
    starts = [grid[int(part[np.argmin(np.array(costs)[part])])] for part in parts]
    runs = [refined(data, shape, start, span, SKETCHED) for start in starts]
    ended = [found for found in runs if found.converged]
    if not ended:
        raise ArithmeticError(
            f"no descent of a fit of shape {shape.name} came to rest, from {len(starts)} starts"
        )
    lowest = min(ended, key=lambda found: found.cost)
    finished = refined(lowest.data, shape, lowest.values[2:].tolist(), span)
    return finished if finished.converged and finished.cost <= lowest.cost else lowest


def _starts(shape: Shape, times: Array) -> list[list[float]]:
    if shape.name == "sopdtz":
        return [
            [time / 2, damping, share * time]
            for share in (-0.5, 0.5)
            for damping in (0.5, 1.0)
            for time in times
        ]
    if shape.name == "sopdt":
        return [[time / 2, damping] for damping in (0.2, 0.5, 1.0) for time in times]
    if shape.name == "lags":
        return [[time / 3] for time in times]
    return [[time] for time in times] if shape.parameters else [[]]


def projected(data: FitData, shape: Shape, p: Sequence[float]) -> tuple[Array, Array]:
    """Residuals with the best gain and level for these times, and these two (and the initial state)."""
    basis = data.basis(shape, p)
    linear, *_ = np.linalg.lstsq(basis, data.y, rcond=None)
    return np.asarray(data.y - basis @ linear, dtype=float), np.asarray(linear, dtype=float)


def refined(
    data: FitData, shape: Shape, start: Sequence[float], span: float, near: float = FINISHED
) -> FitResult:
    """Follow one start down until relative changes are `near`; times by their logarithms, the dead time from 0 up."""
    count = len(shape.parameters) - shape.signed

    def times(x: Array) -> list[float]:
        return [*(span * np.exp(x[:count])).tolist(), *(span * x[count : len(start)]).tolist()]

    def placed(x: Array) -> FitData:
        return data._replace(load=data.t[0] + span * float(x[-1])) if data.loaded else data

    low, high = [-9.0] * count + [-1.0] * shape.signed, [3.0] * count + [1.0] * shape.signed
    if "damping" in shape.parameters:  # the second one, kept as a share of the span for one scale
        low[1], high[1] = np.log(0.02 / span), np.log(MOST_DAMPED / span)
    x = np.array(start) / span
    x[:count] = np.log(x[:count])
    x = np.clip(x, [*(np.array(low) + 1e-6), 1e-6], [*(np.array(high) - 1e-6), 0.9])
    low, high = [*low, 0.0], [*high, 0.95]
    if data.loaded:
        low, high = [*low, 0.0], [*high, float(np.ptp(data.t)) / span]
        x = np.append(x, np.clip((data.load - data.t[0]) / span, 1e-6, 0.99 * high[-1]))
    found = least_squares(
        lambda x: projected(placed(x), shape, times(x))[0],
        x,
        bounds=(low, high),
        x_scale=[*([0.1] * count), *([0.02] * (x.size - count))],
        xtol=near,
        ftol=near,
        gtol=near,
        max_nfev=200,
    )
    p, data = times(found.x), placed(found.x)
    # the search stops a hair above the edge; no record tells so short a dead time from none
    p[-1] = p[-1] if p[-1] > NONE * float(np.median(np.diff(data.t))) else 0.0
    residuals, linear = projected(data, shape, p)
    jacobian = _sensitivity(data, shape, linear, p)
    return FitResult(shape, np.array([*linear[:2], *p]), residuals, jacobian, bool(found.success), data)


def _sensitivity(data: FitData, shape: Shape, linear: Array, p: Sequence[float]) -> Array:
    """Derivatives of the simulated output by gain, level, shape and dead time (by differences), and initial state."""
    basis = data.basis(shape, p)
    columns = [basis[:, 0], basis[:, 1]]
    whole = max(float(np.sum(np.abs(p))), 1e-3 * float(np.ptp(data.t)))
    for k in range(len(p)):
        h = 1e-4 * (p[k] if k < len(p) - 1 else whole)
        high, low = list(p), list(p)
        high[k], low[k] = p[k] + h, p[k] - h if k < len(p) - 1 else max(p[k] - h, 0.0)
        above, below = (data.basis(shape, q) @ linear for q in (high, low))
        columns.append((above - below) / (high[k] - low[k]))
    columns += list(basis[:, 2:].T)
    if data.loaded:
        columns.append(np.gradient(linear[-1] * basis[:, -1], data.t))
    return np.column_stack(columns)


def loaded(data: FitData) -> FitData:
    """Return the data with a step of the load where one explains most of what the input does not."""
    span = float(np.ptp(data.t))
    tried = [data._replace(load=data.t[0] + span * at) for at in np.linspace(0.0, 0.9, LOADS)]
    ways = [[span * lag, span * delay] for lag in (0.01, 0.03, 0.1, 0.3) for delay in (0.0, 0.01, 0.03, 0.1)]
    return min(
        tried, key=lambda one: min(float(np.sum(projected(one, FIRST_ORDER, p)[0] ** 2)) for p in ways)
    )


def rivals(data: FitData, found: FitResult) -> tuple[tuple[Shape, Array], ...]:
    """Return models with one lag more that the record does not rule out: the longest such lag, and a middle one.

    For equal lags there are unequal ones, too: they do nearly what a mean lag does to a record.
    """
    span = data.t[-1] - float(data.change_times[0])
    left = _hidden(data, found, span, found.near)
    if found.shape.name == "lags":
        unequal = search(data, SECOND_ORDER)
        left += _hidden(data, unequal, span, found.near)
    return tuple(left)


def _hidden(data: FitData, found: FitResult, span: float, near: float) -> list[tuple[Shape, Array]]:
    """Return the longest further lag with which the model still serves, and a middle one."""
    *times, delay = found.values[2:].tolist()
    # of an integrator that shows no dead time, a lag within a sample is hidden too
    whole = max(sum(map(abs, times)) + delay, float(np.median(np.diff(data.t))))
    left = []
    for lag in whole * HIDDEN:
        # a further lag first takes the place of dead time
        rival = refined(data, behind_lag(found.shape, lag), [*times, max(delay - lag, 0.0)], span)
        if rival.deviation <= near:  # which is all that is asked of one, at rest or not
            left.append((rival.shape, np.delete(rival.values, LEVEL)))
    return [left[len(left) // 2], left[-1]] if len(left) > 1 else left
