r"""Output-error least squares: the model whose simulated output lies closest to the recorded one.

The simulated output is :math:`y_0 + K \sum_k \Delta u_k\, s(t - t_k - L)`, with s the unit step response of the model's
shape in closed form and the sum over the changes of the held input; so any dead time is exact, and samples may lie
anywhere. Gain K and level :math:`y_0` enter linearly and are solved for at each try (variable projection); times and
dead time are searched from many starts, since a dead time makes several valleys.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import fftconvolve

from pidalab import _check
from pidalab._check import Array
from pidalab.identification.shapes import FIRST, INTEGRATOR, MOST_LAGS, SECOND, Shape, equal_lags
from pidalab.process import Process
from pidalab.record import Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODELS = ("fopdt", "sopdt", "lags", "ipdt", "auto")
MOST_CHANGES = 60  # of the input that are followed one by one; beyond, the record is laid on a uniform grid
MOST_SAMPLES = 4000  # that a fit looks at; a longer record is averaged over neighbours
BLIND = (
    1e7  # condition number of the parameters' sensitivities, scaled, above which the input tells too little
)
BETTER = 0.03  # share by which the residual must fall for a model with one more parameter


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a record, how sure it is, and what is left over.

    Attributes
    ----------
    process : Process
        The model.
    model : str
        Its kind: "fopdt", "sopdt", "lags" or "ipdt".
    parameters, uncertainty : mapping of str to float
        Values, and their standard uncertainties: from the sensitivity of the output to each, the size of the residuals
        and how long these stay correlated.
    residuals : ndarray, shape (n,)
        Recorded less simulated output, at the record's own times or, for a long record, at averaged ones.
    deviation : float
        Root mean square of the residuals, in the unit of y.
    noise : float
        Standard deviation of the noise at rest; a good model leaves no more.
    reason : str
        Why this model, in a sentence.
    record : Record
        What was fitted.
    """

    process: Process
    model: str
    parameters: Mapping[str, float]
    uncertainty: Mapping[str, float]
    residuals: Array
    deviation: float
    noise: float
    reason: str
    record: Record
    _covariance: Array
    _shape: Shape
    _times: Array

    def spread(self, count: int = 20, seed: int = 0) -> list[Process]:
        """Return plants as likely as the record leaves them: drawn from the parameters' joint uncertainty.

        Parameters
        ----------
        count : int, optional
            How many.
        seed : int, optional
            Of the random numbers.

        Returns
        -------
        list of Process

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.arange(0.0, 60.0)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 13, 0) / 5)) + np.random.default_rng(0).normal(0, 0.02, t.size)
        >>> fitted = pidalab.identification.fit(pidalab.Record(t, np.where(t < 10, 0.0, 1.0), y), "fopdt")
        >>> len(fitted.spread(5))
        5
        """
        count = _check.integer("count", count, at_least=1)
        names = ("gain", *self._shape.parameters, "delay")
        values = np.array([self.parameters[name] for name in names])
        # drawn as logarithms, so that a time stays positive; the dead time as a share of all times
        scale = np.abs(values)
        scale[-1] = sum(values[1:]) or 1.0
        rng = np.random.default_rng(seed)
        draws = rng.multivariate_normal(
            np.zeros(values.size), self._covariance / np.outer(scale, scale), size=count
        )
        plants = []
        for draw in draws:
            drawn = values * np.exp(np.clip(draw, -2.0, 2.0))
            drawn[-1] = max(0.0, values[-1] + draw[-1] * scale[-1])
            plants.append(self._shape.process(drawn[0], drawn[1:-1].tolist(), float(drawn[-1])))
        return plants

    def plot(self, ax: Axes) -> None:
        """Draw recorded and simulated output.

        Parameters
        ----------
        ax : matplotlib.axes.Axes
            Where.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> import matplotlib.pyplot as plt
        >>> t = np.arange(0.0, 60.0)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 13, 0) / 5))
        >>> figure, ax = plt.subplots()
        >>> pidalab.identification.fit(pidalab.Record(t, np.where(t < 10, 0.0, 1.0), y), "fopdt").plot(ax)
        >>> plt.close(figure)
        """
        simulated = np.interp(self._times, self.record.t, self.record.y) - self.residuals
        ax.plot(self.record.t, self.record.y, ".", color="0.6", markersize=3, label="record")
        ax.plot(self._times, simulated, label=self.model)
        ax.set(xlabel="time", ylabel="output")
        ax.legend()

    def __str__(self) -> str:
        values = ", ".join(
            f"{name} = {value:.4g} ± {self.uncertainty[name]:.2g}" for name, value in self.parameters.items()
        )
        return (
            f"{self.model}: {values}\nresiduals {self.deviation:.3g} (root mean square), "
            f"noise at rest {self.noise:.3g}\n{self.reason}"
        )


class _Data(NamedTuple):
    """A record as the fit sees it."""

    t: Array
    y: Array
    changes: Array  # of the input
    moments: Array  # when they happen
    grid: float  # sampling interval of a uniform grid on which the input changes at every sample; 0 otherwise

    def simulated(self, shape: Shape, p: Sequence[float], delay: float) -> Array:
        """Response of the shape with gain 1 and dead time to the recorded input."""
        if self.grid:
            response = shape.step(self.t - self.t[0] - delay, p)
            return fftconvolve(self.changes, response)[: self.t.size]
        since = self.t[:, None] - self.moments - delay
        return shape.step(since.ravel(), p).reshape(since.shape) @ self.changes


def _prepared(record: Record) -> _Data:
    t, u, y = record.t, record.u, record.y
    changed = np.flatnonzero(np.diff(u)) + 1
    if changed.size > MOST_CHANGES:
        # a moving input: on a uniform grid its changes and the response are one convolution
        count = min(MOST_SAMPLES, round(np.ptp(t) / record.sampling) + 1)
        uniform = np.linspace(t[0], t[-1], count)
        held = u[np.searchsorted(t, uniform, side="right") - 1]
        return _Data(
            uniform, np.interp(uniform, t, y), np.diff(held, prepend=u[0]), uniform, uniform[1] - uniform[0]
        )
    moments, changes = t[changed], np.diff(u)[changed - 1]
    if t.size > MOST_SAMPLES:
        # neighbours are averaged: noise falls, and the response is smooth over so short a time
        parts = np.array_split(np.arange(t.size), MOST_SAMPLES)
        t, y = (np.array([x[part].mean() for part in parts]) for x in (t, y))
    return _Data(t, y, changes, moments, 0.0)


class _Found(NamedTuple):
    shape: Shape
    values: Array  # gain, level, shape parameters, delay
    residuals: Array
    jacobian: Array

    @property
    def cost(self) -> float:
        return float(self.residuals @ self.residuals)


def fit(record: Record, model: str = "auto") -> Fit:
    """Fit a simple model with dead time to a record, in open or in closed loop.

    Parameters
    ----------
    record : Record
        Any input that moves enough: one step is enough, several or a closed loop's set-point change serve too.
    model : {"auto", "fopdt", "sopdt", "lags", "ipdt"}, optional
        One lag, two poles with damping, up to eight equal lags, an integrator, each with dead time; "auto" takes the
        simplest that no other one beats by more than 3 % in the residuals.

    Returns
    -------
    Fit

    Raises
    ------
    TypeError
        If `record` is not a Record.
    ValueError
        For another word as `model`, an input that does not tell the parameters apart, an output that does not answer.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.arange(0.0, 80.0, 0.5)
    >>> u = np.where(t < 10.0, 40.0, 47.0)
    >>> y = 300.0 + 7.0 * 2.3 * (1 - np.exp(-np.maximum(t - 15.0, 0.0) / 12.0))
    >>> fitted = pidalab.identification.fit(pidalab.Record(t, u, y))
    >>> fitted.model, {name: round(value, 6) for name, value in fitted.parameters.items()}
    ('fopdt', {'gain': 2.3, 'lag': 12.0, 'delay': 5.0})
    """
    if not isinstance(record, Record):
        raise TypeError(
            f"record must be a pidalab.Record, found {type(record).__name__}; write Record(t, u, y)"
        )
    if model not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, found {model!r}")
    data = _prepared(record)
    if model != "auto":
        best = min((_search(data, shape) for shape in _candidates(model)), key=lambda found: found.cost)
        return _result(record, data, best, f"{model} was asked for.")
    tried = [
        _search(data, shape) for name in ("fopdt", "lags", "sopdt", "ipdt") for shape in _candidates(name)
    ]
    chosen, reason = _choice(tried)
    return _result(record, data, chosen, reason)


def _candidates(model: str) -> list[Shape]:
    if model == "lags":
        return [equal_lags(order) for order in range(2, MOST_LAGS + 1)]
    return [{"fopdt": FIRST, "sopdt": SECOND, "ipdt": INTEGRATOR}[model]]


def _choice(tried: Sequence[_Found]) -> tuple[_Found, str]:
    """Return the simplest candidate close to the best, and why."""
    size = {id(found): float(np.sqrt(found.cost / found.residuals.size)) for found in tried}
    best = min(tried, key=lambda found: found.cost)
    floor = size[id(best)]
    scale = float(np.ptp(best.jacobian[:, 0] * best.values[0])) or 1.0
    near = [found for found in tried if size[id(found)] <= floor * (1 + BETTER) + 1e-9 * scale]
    chosen = min(near, key=lambda found: (found.values.size, found.cost))
    kind = chosen.shape.name
    others: dict[str, float] = {}
    for found in tried:
        name = found.shape.name
        others[name] = min(others.get(name, np.inf), size[id(found)])
    said = ", ".join(
        f"{name} {value:.3g}" for name, value in sorted(others.items(), key=lambda item: item[1])
    )
    return chosen, f"{kind} is the simplest within {100 * BETTER:.0f} % of the least residual ({said})."


def _search(data: _Data, shape: Shape) -> _Found:
    """Least squares over shape and dead time from a grid of starts, gain and level solved for at each try."""
    span = data.t[-1] - float(data.moments[0])
    times = span * np.geomspace(0.01, 0.5, 5)
    delays = span * np.array([0.0, 0.01, 0.03, 0.08, 0.2, 0.35])
    grid = [[*start, delay] for start in _starts(shape, times) for delay in delays]
    costs = [float(np.sum(_projected(data, shape, p)[0] ** 2)) for p in grid]
    # the best start of each third of the list, so that an oscillation gets its chance beside an overdamped shape
    thirds = [part for part in np.array_split(np.arange(len(grid)), 3) if part.size]
    starts = [grid[int(part[np.argmin(np.array(costs)[part])])] for part in thirds]
    runs = [_refined(data, shape, start, span) for start in starts]
    return min(runs, key=lambda found: found.cost)


def _starts(shape: Shape, times: Array) -> list[list[float]]:
    if shape.name == "sopdt":
        return [[time / 2, damping] for damping in (0.2, 0.5, 1.0) for time in times]
    if shape.name == "lags":
        return [[time / 3] for time in times]
    return [[time] for time in times] if shape.parameters else [[]]


def _projected(data: _Data, shape: Shape, p: Sequence[float]) -> tuple[Array, Array]:
    """Residuals with the best gain and level for these times, and these two."""
    response = data.simulated(shape, p[:-1], p[-1])
    basis = np.column_stack([response, np.ones_like(response)])
    linear, *_ = np.linalg.lstsq(basis, data.y, rcond=None)
    return np.asarray(data.y - basis @ linear, dtype=float), np.asarray(linear, dtype=float)


def _refined(data: _Data, shape: Shape, start: Sequence[float], span: float) -> _Found:
    """Follow one start down; times by their logarithms, the dead time as it is, from 0 up."""
    count = len(shape.parameters)

    def times(x: Array) -> list[float]:
        return [*(span * np.exp(x[:count])).tolist(), span * float(x[-1])]

    low, high = [-9.0] * count, [3.0] * count
    if shape.name == "sopdt":  # its second parameter is a damping, kept as a share of the span for one scale
        low[1], high[1] = np.log(0.02 / span), np.log(20.0 / span)
    x = np.array([*np.log(np.array(start[:-1]) / span), start[-1] / span])
    x = np.clip(x, [*(np.array(low) + 1e-6), 1e-6], [*(np.array(high) - 1e-6), 0.9])
    found = least_squares(
        lambda x: _projected(data, shape, times(x))[0],
        x,
        bounds=([*low, 0.0], [*high, 0.95]),
        x_scale=[*([0.1] * count), 0.02],
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=200,
    )
    p = times(found.x)
    residuals, (gain, level) = _projected(data, shape, p)
    return _Found(shape, np.array([gain, level, *p]), residuals, _sensitivity(data, shape, gain, p))


def _sensitivity(data: _Data, shape: Shape, gain: float, p: Sequence[float]) -> Array:
    """Derivatives of the simulated output by gain, level, shape and dead time; the last ones by central differences."""
    columns = [data.simulated(shape, p[:-1], p[-1]), np.ones(data.t.size)]
    whole = max(float(sum(p)), 1e-3 * float(np.ptp(data.t)))
    for k in range(len(p)):
        h = 1e-4 * (p[k] if k < len(p) - 1 else whole)
        high, low = list(p), list(p)
        high[k], low[k] = p[k] + h, max(p[k] - h, 0.0)
        above, below = (data.simulated(shape, q[:-1], q[-1]) for q in (high, low))
        columns.append(gain * (above - below) / (high[k] - low[k]))
    return np.column_stack(columns)


def _result(record: Record, data: _Data, found: _Found, reason: str) -> Fit:
    names = ("gain", "level", *found.shape.parameters, "delay")
    if found.values[0] == 0 or not np.all(np.isfinite(found.values)):
        raise ValueError("the output does not answer to the input: no gain can be found")
    answer = float(np.ptp(found.jacobian[:, 0] * found.values[0]))
    deviation = float(np.sqrt(np.mean(found.residuals**2)))
    if answer < 3 * deviation:
        raise ValueError(
            f"the output answers by {answer:.3g}, not clearly above what is left over ({deviation:.3g}): "
            f"the step is too small against the noise, or something else moved the output (level {found.values[1]:.4g})"
        )
    # sensitivities scaled to the change that each parameter makes
    scaled = found.jacobian / np.linalg.norm(found.jacobian, axis=0)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > BLIND:
        raise ValueError(
            f"the input tells too little to fit {found.shape.name}: its parameters cannot be told apart "
            "(in closed loop, move the set point more; in open loop, step the input)"
        )
    covariance = _covariance(found)
    sigma = np.sqrt(np.diag(covariance))
    parameters = dict(zip(names, found.values.tolist(), strict=True))
    uncertainty = dict(zip(names, sigma.tolist(), strict=True))
    del parameters["level"], uncertainty["level"]
    process = found.shape.process(parameters["gain"], found.values[2:-1].tolist(), parameters["delay"])
    keep = [k for k, name in enumerate(names) if name != "level"]
    return Fit(
        process=process,
        model=found.shape.name,
        parameters=MappingProxyType(parameters),
        uncertainty=MappingProxyType(uncertainty),
        residuals=found.residuals,
        deviation=deviation,
        noise=record.noise.deviation,
        reason=reason,
        record=record,
        _covariance=covariance[np.ix_(keep, keep)],
        _shape=found.shape,
        _times=data.t,
    )


def _covariance(found: _Found) -> Array:
    """Covariance of the parameters: that of white residuals, times how many samples share one error."""
    r, J = found.residuals, found.jacobian
    freedom = max(1, r.size - J.shape[1])
    variance = float(r @ r) / freedom
    if variance == 0.0:
        return np.zeros((J.shape[1], J.shape[1]))
    # correlation time of the residuals in samples, up to where the correlation first falls to zero
    spectrum = np.abs(np.fft.rfft(r, 2 * r.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: r.size]
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0)) or r.size
    together = 1.0 + 2.0 * float(correlation[1:end].sum())
    scale = np.linalg.norm(J, axis=0)
    inverse = np.linalg.pinv((J / scale).T @ (J / scale), hermitian=True)
    return np.asarray(variance * together * inverse / np.outer(scale, scale))
