"""Search the parameters of simple models by least squares, with step responses in closed form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
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
TABLE = 4001  # number of points in the table from which `behind_lag` interpolates


@dataclass(frozen=True)
class Shape:
    """A model of gain 1 without dead time.

    Attributes
    ----------
    name : str
        Name of the model, as in `fit`.
    parameters : tuple of str
        Names of the parameters of the shape.
    step : callable
        Function of times and shape parameters that returns the unit step response (0 before time 0).
    process : callable
        Function of gain, shape parameters and dead time that returns the Process.
    signed : int
        Number of parameters, at the end of `parameters`, that may be negative.
    """

    name: str
    parameters: tuple[str, ...]
    step: Callable[[Array, Sequence[float]], Array]
    process: Callable[[float, Sequence[float], float], Process]
    signed: int = 0


def _second_order(t: Array, p: Sequence[float]) -> Array:
    """Return the unit step response of (zero s + 1)/(tau² s² + 2 damping tau s + 1)."""
    tau, damping, zero = (*p, 0.0)[:3]
    x = np.maximum(t, 0.0) / tau
    apart = damping**2 - 1.0
    # `half` is half the distance between the poles, times tau. It is imaginary if the poles are complex. Separate a
    # double pole slightly, since the formula divides by `half`.
    half = np.emath.sqrt(apart) if abs(apart) > 1e-10 else 1e-5
    slow = damping - half
    late, early = np.exp(-slow * x), np.exp(-(damping + half) * x)
    impulse = (late - early) / (2 * half)
    return np.asarray(np.real(1.0 - late + (zero / tau - slow) * impulse), dtype=float)


def equal_lags(order: int) -> Shape:
    """Return a shape with equal lags. Its step response is a regularised incomplete gamma function."""
    return Shape(
        "lags",
        ("lag",),
        lambda t, p: np.asarray(gammainc(order, np.maximum(t, 0.0) / p[0]), dtype=float),
        lambda gain, p, delay: lags(order, p[0], gain, delay),
    )


def behind_lag(shape: Shape, lag: float) -> Shape:
    """Return a shape with a further lag of fixed time constant in series.

    The response of the shape is tabulated and interpolated linearly. The recursion of the lag is exact for an input
    that is linear between the tabulated times.
    """

    def step(t: Array, p: Sequence[float]) -> Array:
        times = np.linspace(0.0, max(float(np.max(t)), lag), TABLE)
        x = times[1] / lag
        # y_k = a y_{k-1} + (1 - b) u_k + (b - a) u_{k-1} is the lag's output for the input u.
        a = np.exp(-x)
        b = -np.expm1(-x) / x
        inner = shape.step(times, p)
        driven = (1.0 - b) * inner + (b - a) * np.append(0.0, inner[:-1])
        # Write the recursion as linear equations, with 1 on the diagonal and -a below it.
        table = solve_banded((1, 0), np.vstack([np.ones(TABLE), np.full(TABLE, -a)]), driven)
        return np.asarray(np.interp(t, times, table), dtype=float)

    def process(gain: float, p: Sequence[float], delay: float) -> Process:
        inner = shape.process(gain, p, delay)
        return Process(inner.num, np.convolve(inner.den, [lag, 1.0]), inner.delay)

    return Shape(shape.name, shape.parameters, step, process, shape.signed)


FIRST_ORDER = Shape(
    "fopdt",
    ("lag",),
    lambda t, p: -np.expm1(-np.maximum(t, 0.0) / p[0]),
    lambda gain, p, delay: fopdt(gain, p[0], delay),
)
SECOND_ORDER = Shape(
    "sopdt", ("tau", "damping"), _second_order, lambda gain, p, delay: sopdt(gain, p[0], p[1], delay)
)
INTEGRATOR = Shape("ipdt", (), lambda t, p: np.maximum(t, 0.0), lambda gain, p, delay: ipdt(gain, delay))
ORDER_WITH_ZERO = Shape(
    "sopdtz",
    ("tau", "damping", "zero"),
    _second_order,
    lambda gain, p, delay: Process([gain * p[2], gain], sopdt(gain, p[0], p[1], delay).den, delay),
    signed=1,
)
LAGGED = Shape(
    "ifopdt",
    ("lag",),
    lambda t, p: np.maximum(t, 0.0) + p[0] * np.expm1(-np.maximum(t, 0.0) / p[0]),
    lambda gain, p, delay: Process([gain], [p[0], 1.0, 0.0], delay),
)
SHAPES = {shape.name: [shape] for shape in (FIRST_ORDER, SECOND_ORDER, INTEGRATOR, LAGGED, ORDER_WITH_ZERO)}
SHAPES["lags"] = [equal_lags(order) for order in range(2, MOST_LAGS + 1)]

MOST_CHANGES = 60  # a record with more changes of the input is resampled to a uniform grid
MOST_SAMPLES = 4000  # in a longer record, neighbouring samples are averaged
SUMMED_SAMPLES = 1000  # up to this number of samples, direct convolution is faster than Fourier transforms
BETTER = 0.03  # a simpler model is preferred if its residuals are larger by at most this share
NONE = 1e-3  # a dead time shorter than this share of a sampling interval is set to 0
LEVEL = 1  # index in `FitResult.values` of the level, a constant that is added to the output
DESCENTS = 6  # number of descents from different starts
# Each descent ends when its relative changes are below SKETCHED. Then the best descent is continued until its relative
# changes are below FINISHED.
SKETCHED, FINISHED = 1e-6, 1e-12
MOST_DAMPED = 20.0  # with more damping a second-order model is practically a first-order model
LOADS = 46  # a step of the load is tried at this number of points in time
HIDDEN = np.geomspace(0.01, 0.5, 12)  # further lags to try, as shares of the sum of lags and dead time
# Start values of the parameters of a shape, as functions of the response time of the plant.
STARTS: dict[str, Callable[[float], list[list[float]]]] = {
    "ipdt": lambda time: [],
    "lags": lambda time: [[time / 3]],
    "sopdt": lambda time: [[time / 2, damping] for damping in (0.2, 0.5, 1.0)],
    "sopdtz": lambda time: [[time / 2, z, share * time] for share in (-0.5, 0.5) for z in (0.5, 1.0)],
}


class FitData(NamedTuple):
    """The data of a record in the form that a fit needs."""

    t: Array
    y: Array
    changes: Array  # changes of the input
    change_times: Array
    unseen: float  # mean interval between the samples before and after a change of the input
    grid: float  # interval of the uniform grid to which the record was resampled, or 0
    free: bool = False  # True if the plant does not start from rest
    load: float = np.nan  # time at which the output begins to respond to a step of the load, or nan

    @property
    def loaded(self) -> bool:
        """True if the fit includes a step of the load."""
        return not np.isnan(self.load)

    def simulated(self, shape: Shape, p: Sequence[float], delay: float) -> Array:
        """Return the response of a shape, with gain 1 and a dead time, to the recorded input."""
        if self.grid:
            response = shape.step(self.t - self.t[0] - delay, p)
            if self.t.size <= SUMMED_SAMPLES:
                return np.convolve(self.changes, response)[: self.t.size]
            length = next_fast_len(2 * self.t.size)
            product = np.fft.rfft(self.changes, length) * np.fft.rfft(response, length)
            return np.asarray(np.fft.irfft(product, length)[: self.t.size], dtype=float)
        elapsed = self.t[:, None] - self.change_times - delay
        return shape.step(elapsed.ravel(), p).reshape(elapsed.shape) @ self.changes

    def basis(self, shape: Shape, p: Sequence[float]) -> Array:
        """Return the simulated output for a unit value of each linear parameter, as columns.

        The linear parameters are gain, level, free initial state (1 or 2 columns) and load.
        """
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
        early, moved = self.t <= time, self.change_times <= time
        part = self._replace(t=self.t[early], y=self.y[early])
        return part._replace(changes=self.changes[moved], change_times=self.change_times[moved])


def prepared(record: Record) -> FitData:
    """Convert a record to the form that a fit needs."""
    t, u, y = record.t, record.u, record.y
    moved = np.diff(u, prepend=record.u_before)
    changed = np.flatnonzero(moved)
    free = not record.at_rest
    if changed.size > MOST_CHANGES:
        # On a uniform grid the output is a single convolution of input changes and step response.
        count = min(MOST_SAMPLES, round(np.ptp(t) / record.sampling) + 1)
        uniform = np.linspace(t[0], t[-1], count)
        held = u[np.searchsorted(t, uniform, side="right") - 1]
        moved = np.diff(held, prepend=record.u_before)
        return FitData(uniform, np.interp(uniform, t, y), moved, uniform, 0.0, uniform[1] - uniform[0], free)
    intervals = np.diff(t, prepend=t[0] - record.sampling)
    unseen = float(np.mean(intervals[changed]))
    moments, changes = t[changed], moved[changed]
    if t.size > MOST_SAMPLES:
        # Averaging reduces noise, and the response is almost a straight line over the few samples of an average.
        parts = np.array_split(np.arange(t.size), MOST_SAMPLES)
        t, y = (np.array([x[part].mean() for part in parts]) for x in (t, y))
    return FitData(t, y, changes, moments, unseen, 0.0, free)


class FitResult(NamedTuple):
    """The result of a descent."""

    shape: Shape
    values: Array  # gain, level, shape parameters, delay
    residuals: Array
    jacobian: Array
    converged: bool
    data: FitData  # data with the fitted time of the load

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def deviation(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def near(self) -> float:
        """Largest root mean square of the residuals with which another model counts as equally good."""
        return self.deviation * (1 + BETTER) + 1e-9 * float(np.ptp(self.jacobian[:, 0] * self.values[0]))


def tried_models(data: FitData, models: Sequence[str]) -> tuple[list[FitResult], str]:
    """Fit each model. Return the results, and the message of the last failure."""
    tried, failed = [], ""
    for shape in (shape for model in models for shape in SHAPES[model]):
        try:
            tried.append(search(data, shape))
        except ArithmeticError as why:
            failed = str(why)
    return tried, failed


def search(data: FitData, shape: Shape) -> FitResult:
    """Fit shape parameters and dead time by least squares, with descents from a grid of starts.

    Notes
    -----
    Gain, level, initial state and load enter linearly, and `projected` solves for them at each step of the search
    (variable projection, Golub and Pereyra 1973). The grid is divided into parts with similar shapes. A descent begins
    at the best start of each part, so that oscillating and overdamped shapes are both tried. The descent with the least
    cost is refined.
    """
    span = data.t[-1] - float(data.change_times[0])
    delays = span * np.array([0.0, 0.01, 0.03, 0.08, 0.2, 0.35])
    times = span * np.geomspace(0.01, 0.5, 5)
    starts = [STARTS[shape.name](time) if shape.name in STARTS else [[time]] for time in times]
    grid = [[*start, delay] for kind in zip(*starts, strict=True) for start in kind for delay in delays]
    grid = grid or [[delay] for delay in delays]
    costs = [float(np.sum(projected(data, shape, p)[0] ** 2)) for p in grid]
    parts = [part for part in np.array_split(np.arange(len(grid)), DESCENTS) if part.size]
    best = [grid[int(part[np.argmin(np.array(costs)[part])])] for part in parts]
    runs = [refined(data, shape, start, span, SKETCHED) for start in best]
    ended = [result for result in runs if result.converged]
    if not ended:
        raise ArithmeticError(f"no fit of {shape.name} converged, from {len(best)} starts")
    lowest = min(ended, key=lambda result: result.cost)
    finished = refined(lowest.data, shape, lowest.values[2:].tolist(), span)
    return finished if finished.converged and finished.cost <= lowest.cost else lowest


def projected(data: FitData, shape: Shape, p: Sequence[float]) -> tuple[Array, Array]:
    """Return the residuals with the best linear parameters, and these parameters."""
    basis = data.basis(shape, p)
    linear, *_ = np.linalg.lstsq(basis, data.y, rcond=None)
    return np.asarray(data.y - basis @ linear, dtype=float), np.asarray(linear, dtype=float)


def refined(
    data: FitData, shape: Shape, start: Sequence[float], span: float, near: float = FINISHED
) -> FitResult:
    """Descend from one start until relative changes are below `near`. Lags and damping are searched as logarithms."""
    count = len(shape.parameters) - shape.signed

    def times(x: Array) -> list[float]:
        return [*(span * np.exp(x[:count])).tolist(), *(span * x[count : len(start)]).tolist()]

    def placed(x: Array) -> FitData:
        return data._replace(load=data.t[0] + span * float(x[-1])) if data.loaded else data

    low, high = [-9.0] * count + [-1.0] * shape.signed, [3.0] * count + [1.0] * shape.signed
    if "damping" in shape.parameters:  # damping is the second parameter and is scaled like the times
        low[1], high[1] = np.log(0.02 / span), np.log(MOST_DAMPED / span)
    x = np.array(start) / span
    x[:count] = np.log(x[:count])
    x = np.clip(x, [*(np.array(low) + 1e-6), 1e-6], [*(np.array(high) - 1e-6), 0.9])
    low, high = [*low, 0.0], [*high, 0.95]
    if data.loaded:
        low, high = [*low, 0.0], [*high, float(np.ptp(data.t)) / span]
        x = np.append(x, np.clip((data.load - data.t[0]) / span, 1e-6, 0.99 * high[-1]))
    scale = [*([0.1] * count), *([0.02] * (x.size - count))]
    options = dict.fromkeys(("xtol", "ftol", "gtol"), near) | {"x_scale": scale, "max_nfev": 200}
    solution = least_squares(
        lambda x: projected(placed(x), shape, times(x))[0], x, bounds=(low, high), **options
    )
    p, data = times(solution.x), placed(solution.x)
    # If the best dead time is 0, the search ends just above 0. No record shows so short a dead time, so set it to 0.
    p[-1] = p[-1] if p[-1] > NONE * float(np.median(np.diff(data.t))) else 0.0
    residuals, linear = projected(data, shape, p)
    jacobian = _sensitivity(data, shape, linear, p)
    return FitResult(shape, np.array([*linear[:2], *p]), residuals, jacobian, bool(solution.success), data)


def _sensitivity(data: FitData, shape: Shape, linear: Array, p: Sequence[float]) -> Array:
    """Return the derivatives of the simulated output with respect to all parameters.

    The columns belong to `FitResult.values`, the initial state, and the size and time of the load.
    """
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
    """Add a step of the load at the time that leaves the smallest residuals."""
    span = float(np.ptp(data.t))
    models = span * np.array([*product((0.01, 0.03, 0.1, 0.3), (0.0, 0.01, 0.03, 0.1))])

    def cost(tried: FitData) -> float:
        return min(float(np.sum(projected(tried, FIRST_ORDER, p)[0] ** 2)) for p in models)

    times = data.t[0] + span * np.linspace(0.0, 0.9, LOADS)
    return min((data._replace(load=float(time)) for time in times), key=cost)


def rivals(data: FitData, result: FitResult) -> tuple[tuple[Shape, Array], ...]:
    """Return models with a further lag that fit the record nearly as well as the fitted model.

    If the fitted model has equal lags, also fit a second-order model and add a further lag to it, since a second-order
    model has almost the same response as equal lags.
    """
    span = data.t[-1] - float(data.change_times[0])
    hidden = _hidden(data, result, span, result.near)
    if result.shape.name == "lags":
        hidden += _hidden(data, search(data, SECOND_ORDER), span, result.near)
    return tuple(hidden)


def _hidden(data: FitData, result: FitResult, span: float, near: float) -> list[tuple[Shape, Array]]:
    """Return models with a further lag. Of the lags with which the model still fits, use the median and the longest."""
    *times, delay = result.values[2:].tolist()
    # `whole` is at least one sampling interval, since an integrator without dead time can hide a lag of this length.
    whole = max(sum(map(abs, times)) + delay, float(np.median(np.diff(data.t))))
    hidden = []
    for lag in whole * HIDDEN:
        # A further lag resembles a dead time, so start with a dead time that is shorter by `lag`.
        rival = refined(data, behind_lag(result.shape, lag), [*times, max(delay - lag, 0.0)], span)
        if rival.deviation <= near:
            hidden.append((rival.shape, np.delete(rival.values, LEVEL)))
    return [hidden[len(hidden) // 2], hidden[-1]] if len(hidden) > 1 else hidden
