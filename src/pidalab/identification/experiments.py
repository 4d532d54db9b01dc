"""Identify a process model from a step experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, cast
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lsim

from pidalab import _check
from pidalab._check import Array
from pidalab.areas import RecordWarning
from pidalab.areas.measured import is_record
from pidalab.process import Process, ipdt

LEVELS = (0.05, 0.353, 0.853)  # levels of the three-point model, as shares of the change
# Largest accepted overshoot, as a share of the change. The model has real poles, so an overshoot must be noise.
OVERSHOOT = 0.1
MOST_ENDS = 400  # `ipdt_least_squares` tries at most this number of end times t_1
# A record has settled if the means of its last two tenths differ by less than this share of the whole change.
STILL_MOVING = 0.01
# Noise above this share of the whole change causes a warning, since single samples are then unreliable.
NOISY = 0.01
# If `excess_gain` is above this, a tuned loop has a clearly larger Ms with the process than with the model.
MOST_EXCESS_GAIN = 0.25


@dataclass(frozen=True)
class ThreePointModel:
    r"""Third-order model with dead time from three points of a step response (haalman2024, eqs. (4) and (5)).

    .. math:: \hat P(s) = \frac{K}{(1 + \tau s)\left(1 + \frac{(1 - \alpha) L}{2} s\right)^2} e^{-\alpha L s}

    ============  ==================
    haalman2024   attribute
    ============  ==================
    K             `gain`
    L             `apparent_delay`
    α             `alpha`
    τ             `tau`
    ============  ==================

    Attributes
    ----------
    gain : float
        Static gain.
    apparent_delay : float
        L, apparent dead time.
    alpha : float
        Share of L that is true dead time, between 0 and 1. The rest of L becomes two equal lags.
    tau : float
        Dominant time constant.
    times : tuple of float
        Times at which the record reaches 5 %, 35.3 % and 85.3 % of the change.
    excess_gain : float
        Largest value of (gain of the record) / (gain of the model) - 1 at frequencies up to 1/(αL). The rules place the
        crossover near 1/(αL). The value is nan if it was not computed.
    """

    gain: float
    apparent_delay: float
    alpha: float
    tau: float
    times: tuple[float, float, float]
    excess_gain: float = math.nan

    @property
    def process(self) -> Process:
        """The model as a process, multiplied out as in eqs. (6) and (7)."""
        lag = (1 - self.alpha) * self.apparent_delay / 2
        den = np.convolve([self.tau, 1.0], np.convolve([lag, 1.0], [lag, 1.0]))
        return Process([self.gain], den, delay=self.alpha * self.apparent_delay)


def three_point(
    t: ArrayLike | Any,
    y: ArrayLike | None = None,
    step: float | None = None,
    *,
    crossing: Literal["interpolated", "sampled"] = "interpolated",
) -> ThreePointModel:
    """Fit a third-order model with dead time to three points of an open-loop step response.

    Parameters
    ----------
    t : array_like, shape (n,), or Record
        Uniform times with the step at t = 0, or a `Record`, which has its own output, step and rest level.
    y : array_like, shape (n,), optional
        Output, which settles at the end. The first sample is the rest level. The mean of the last tenth of the samples
        is the final level.
    step : float, optional
        Change of the input, not 0. By default 1.
    crossing : {"interpolated", "sampled"}, optional
        How to compute the time at which a level is reached (5 %, 35.3 % and 85.3 % of the change): by linear
        interpolation, or as the time of the first sample at or above the level.

    Returns
    -------
    ThreePointModel
        Parameters of the model. Its attribute `process` is the model as a `Process`.

    Notes
    -----
    A `Record` is cut at its step and resampled on uniform times. An offset of y has no effect. The model is
    useful if the noise is at most about 1 % of the change. For more noise use `pidalab.identification.fit`.

    The formulas of eq. (5) underestimate a dead time that is short compared with the dominant lag. For a process with
    τ = 1, L = 0.25 and α = 0.9 they give α = 0.31. The step responses of model and process differ only by 3 %. But if
    the rule of haalman2024 is applied to this model with Ms = 1.4, the loop with the process has Ms = 2.99.
    A large `excess_gain` shows that a model has such an error.

    Raises
    ------
    TypeError, ValueError
        If the record never moves, still moves at its end, already moves at its beginning, or overshoots by more than
        10 %; if the model does not fit the shape of the record (alpha outside [0, 1], or a time constant that is not
        positive); or if a Record has no step or is given together with y or step.

    Warns
    -----
    RecordWarning
        If the noise of a Record is above 1 % of the change, or if `excess_gain` is above 0.25.

    References
    ----------
    R. Sanchis and I. Peñarrocha-Alós (2022), as used in haalman2024, eqs. (4), (5).

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 30.0, 3001)
    >>> y = pidalab.open_loop_step(pidalab.lags(4), t).y
    >>> model = pidalab.identification.three_point(t, y)
    >>> print(f"{model.apparent_delay:.3f} {model.alpha:.3f} {model.tau:.3f}")
    2.148 0.382 2.041
    """
    t, y, step = _experiment(t, y, step)
    (t5, t35, t85), change = _levels_reached(t, y, crossing)
    gain = change / step
    apparent_delay = 1.3 * t35 - 0.29 * t85
    tau = 0.67 * (t85 - t35)
    if apparent_delay <= 0 or tau <= 0 or t5 <= 0:
        raise ValueError(
            "y does not fit a third-order model with dead time: L and tau must be above 0, found "
            f"{apparent_delay:.4g} and {tau:.4g} from the times {t5:.4g}, {t35:.4g} and {t85:.4g}"
        )
    alpha = 0.598 + 0.4799 * t5 / apparent_delay - 0.41 / (t5 / tau) ** 0.6
    if not 0 <= alpha <= 1:
        raise ValueError(
            f"y does not fit a third-order model with dead time: alpha must be from 0 to 1, found {alpha:.4g}"
        )
    model = ThreePointModel(float(gain), float(apparent_delay), float(alpha), float(tau), (t5, t35, t85))
    highest = min(1 / (alpha * apparent_delay + 1e-300), (t.size - 1) / float(t[-1]))
    excess = _excess_gain(t, y / step, model.process, highest)
    if excess > MOST_EXCESS_GAIN:
        warn(
            f"at frequencies up to {highest:.4g}, the gain of the record exceeds that of the model by up to "
            f"{100 * excess:.0f} %; up to {100 * MOST_EXCESS_GAIN:g} % is harmless. A loop tuned with this model may "
            "be unstable; use identification.fit",
            RecordWarning,
            stacklevel=2,
        )
    return replace(model, excess_gain=excess)


def ipdt_tangent(
    t: ArrayLike | Any,
    y: ArrayLike | None = None,
    step: float | None = None,
    *,
    span: float | None = None,
) -> Process:
    r"""Approximate the steepest segment of a step response by an integrator with dead time.

    The model is :math:`K e^{-Ls}/s`. The straight line through the segment has the slope K times `step`. It meets the
    rest level at the time L after the step. The model describes the beginning of the response, even if the process
    settles later.

    ============  ===========================
    huba2018      result
    ============  ===========================
    K_sm          gain of the `ipdt`
    T_dm          delay of the `ipdt`
    ============  ===========================

    Parameters
    ----------
    t : array_like, shape (n,), or Record
        Uniform times with the step at t = 0, or a `Record`, which has its own output, step and rest level.
    y : array_like, shape (n,), optional
        Output. Its first sample is the rest level.
    step : float, optional
        Change of the input, not 0. By default 1.
    span : float, optional
        Length of the segment in time, rounded to whole steps of t. By default a third of the rise time for a Record
        with noise, and otherwise one step of t. If the segment is one sample interval h, the relative errors of slope
        and dead time are of the order of h^2. If the record is steepest at a corner, these errors are of the order of
        h. If t and y are given as arrays and y is noisy, give a longer `span`. A line is then fitted to all samples of
        the span by least squares.

    Returns
    -------
    Process
        The model, an `ipdt`.

    Raises
    ------
    TypeError, ValueError
        If the record ends where it began; if the span is longer than the record; if the line meets the rest level
        before the step; or if a Record has no step or is given together with y or step.

    References
    ----------
    huba2018, sec. V.A and Fig. 4.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> y = pidalab.open_loop_step(pidalab.lags(2, delay=1.0), t).y
    >>> pidalab.identification.ipdt_tangent(t, y)
    Process(num=[0.36787], den=[1, 0], delay=1.28171)
    """
    noisy = is_record(t) and t.noise.deviation > 0
    t, y, step = _experiment(t, y, step)
    h = float(t[-1] / (t.size - 1))
    change = _whole_change(y)
    if noisy and span is None:
        span = max(_rise_time(t, y) / 3, h)
    width = 1 if span is None else round(_check.real("span", span, above=0.0) / h)
    if width < 1:
        raise ValueError(f"span must be at least one step of t ({h:g}), found {span:g}")
    if width >= t.size:
        raise ValueError(f"span must be shorter than the record ({t[-1]:g}), found {span:g}")
    lever = np.arange(width + 1) - width / 2
    slopes = np.correlate(y, lever) / (h * np.sum(lever**2))
    # Take the steepest slope in the direction of the change, since the record may first move the other way.
    i = int(np.argmax(slopes * np.sign(change)))
    middle, level = t[i] + h * width / 2, np.mean(y[i : i + width + 1])
    delay = middle - (level - y[0]) / slopes[i]
    if delay < -1e-9 * t[-1]:
        raise ValueError(
            "y does not fit an integrator with dead time: the steepest tangent meets the level of rest before the "
            f"step, at t = {delay:.4g}"
        )
    return ipdt(float(slopes[i]) / step, max(0.0, float(delay)))


def binomial_filtered(t: ArrayLike, y: ArrayLike, filter_time: float, filter_order: int) -> Array:
    r"""Pass a record through the filter of a controller, :math:`1/(T_f s + 1)^n` (huba2024, eq. (9)).

    If a model is identified from the filtered record, it includes the delay of the filter. A controller that is
    designed for this model must use the filter (huba2024, sec. 3.1).

    Parameters
    ----------
    t : array_like, shape (n,)
        Uniform times that start at 0.
    y : array_like, shape (n,)
        Output, taken as linear between samples. Before t = 0 the output is equal to its first sample.
    filter_time : float
        Time constant of the filter, above 0.
    filter_order : int
        Order of the filter, at least 1.

    Returns
    -------
    ndarray, shape (n,)
        The filtered record.

    Raises
    ------
    ValueError
        If the times are not uniform, or the filter is out of its range.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> print(f"{pidalab.identification.binomial_filtered(t, t, filter_time=0.5, filter_order=4)[-1]:.6f}")
    8.000002
    """
    t, y = _check.signals(t, y=y)
    h = float(t[-1] / (t.size - 1)) / _check.real("filter_time", filter_time, above=0.0)
    order = _check.order("filter_order", filter_order, at_least=1)
    # The filter consists of equal lags in series. Times are divided by the filter time, so each lag has the
    # time constant 1. `lsim` interpolates the input linearly.
    lags = np.eye(order, k=-1) - np.eye(order)
    first, last = np.eye(order)[:, :1], np.eye(order)[-1:]
    _, filtered, _ = lsim((lags, first, last, [[0.0]]), y - y[0], h * np.arange(t.size))
    return np.asarray(filtered, dtype=float) + y[0]


def ipdt_least_squares(
    t: ArrayLike | Any, y: ArrayLike | None = None, step: float | None = None, *, rise: float = 0.2
) -> Process:
    r"""Fit an integrator with dead time to the beginning of a step response by least squares.

    The step response of the model :math:`K e^{-Ls}/s` is constant up to L, and then a ramp. The response is fitted to
    the record from 0 to t_1, for many values of t_1. The fit with the largest gain K is used, since a large gain makes
    the tuning cautious (huba2024, sec. 3.1). The record is not differentiated, so noise has little effect.

    ============  ===========================
    huba2024      result
    ============  ===========================
    K_s           gain of the `ipdt`
    T_d           delay of the `ipdt`
    ============  ===========================

    Parameters
    ----------
    t : array_like, shape (n,), or Record
        Uniform times with the step at t = 0, or a `Record`, which has its own output, step and rest level.
    y : array_like, shape (n,), optional
        Output. Its first sample is the rest level. If the record is noisy, set this sample to the mean before the step.
    step : float, optional
        Change of the input, not 0. By default 1.
    rise : float, optional
        Fraction of the whole change, between 0 and 1. The smallest t_1 that is tried is the time from which on
        the output stays at or above this fraction, or the time of the fifth sample if that is later. The fraction must
        be large compared with the noise. If the fraction is small and the output is steepest at its beginning, the gain
        may approach the gain from `ipdt_tangent`.

    Returns
    -------
    Process
        The model, an `ipdt`.

    Raises
    ------
    TypeError, ValueError
        If the record ends where it began, is too short, or cannot be fitted by a ramp; if `rise` is out of its range;
        or if a Record has no step or is given together with y or step.

    Notes
    -----
    The paper gives its criterion only in words: least squares, largest gain.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> y = pidalab.open_loop_step(pidalab.lags(2, delay=1.0), t).y
    >>> pidalab.identification.ipdt_least_squares(t, y)
    Process(num=[0.34489], den=[1, 0], delay=1.22681)
    """
    t, y, step = _experiment(t, y, step)
    change = _whole_change(y)
    rise = _check.real("rise", rise, above=0.0)
    if rise >= 1:
        raise ValueError(f"rise must be below 1, found {rise:g}")
    if t.size < 5:
        raise ValueError(f"y must have at least 5 samples, found {t.size}")
    first = max(int(np.flatnonzero((y - y[0]) / change < rise)[-1]) + 1, 4)
    ends = np.unique(np.linspace(first, t.size - 1, MOST_ENDS).astype(int))
    fits = [_hinge(t[: end + 1], y[: end + 1] - y[0]) for end in ends]
    slope, delay = max(fits, key=lambda fit: fit[0] * np.sign(change))
    if slope * change <= 0:
        raise ValueError("y does not fit an integrator with dead time: it has no ramp")
    return ipdt(slope / step, delay)


def _hinge(t: Array, y: Array) -> tuple[float, float]:
    """Return slope k and start L of the ramp k max(t - L, 0) that fits y best by least squares.

    Notes
    -----
    For a ramp that starts between two given samples, a regression line through the later samples gives the best start
    and slope. The start is clipped to the interval. The best ramp of all intervals is returned.
    """
    # Entry i of each array is the sum over sample i and all later samples.
    count, st, stt, sy, sty = (np.cumsum(x[::-1])[::-1] for x in (np.ones_like(t), t, t * t, y, t * y))
    i = np.arange(1, t.size - 2)  # at least two samples must lie on the ramp
    spread = count[i] * stt[i] - st[i] ** 2
    slope = (count[i] * sty[i] - st[i] * sy[i]) / spread
    # The start is where the regression line meets the rest level.
    with np.errstate(divide="ignore", invalid="ignore"):
        free = (st[i] - sy[i] / slope) / count[i]
    inside = np.clip(np.where(np.isfinite(free), free, 0.0), t[i - 1], t[i])
    # If the minimum is outside the interval, an end of the interval is best.
    delay, i = np.concatenate([inside, t[i - 1], t[i]]), np.tile(i, 3)
    square, product = stt[i] - 2 * delay * st[i] + delay**2 * count[i], sty[i] - delay * sy[i]
    best = int(np.argmax(product**2 / square))  # this ramp reduces the sum of squares most
    return float(product[best] / square[best]), float(delay[best])


def _whole_change(y: Array) -> float:
    change = float(y[-1] - y[0])
    if abs(change) <= 1e-9 * max(np.max(np.abs(y)), 1e-300):
        raise ValueError(f"y must change, found {y[0]:.4g} at the start and {y[-1]:.4g} at the end")
    return change


def _experiment(t: ArrayLike | Any, y: ArrayLike | None, step: float | None) -> tuple[Array, Array, float]:
    """Check a step experiment. Return times from the step on, output and change of the input.

    For a Record, the output is the response to a unit step, relative to the rest level.
    """
    if is_record(t):
        if y is not None or step is not None:
            raise TypeError("y and step must be left out with a Record, which contains them")
        times, response = t.after_step()
        response[0] = 0.0  # use the rest level, which is more accurate than the first sample
        change = abs(float(np.mean(response[-max(1, response.size // 10) :])))
        noise = t.noise.deviation / abs(t.step.after - t.step.before)
        if noise > NOISY * change:
            warn(
                f"the noise of the record is {100 * noise / change:.2g} % of the whole change; above {100 * NOISY:g} % "
                "use identification.fit",
                RecordWarning,
                stacklevel=3,
            )
        return times, response, 1.0
    if y is None:
        raise TypeError("y must be given, unless t is a Record")
    times = _check.uniform_time("t", cast(ArrayLike, t))
    change = 1.0 if step is None else _check.real("step", step)
    if change == 0:
        raise ValueError("step must not be 0, found 0: it is the change of the input")
    return times, _check.signal("y", y, times.size), change


def _rise_time(t: Array, y: Array) -> float:
    """Return the time from a tenth to nine tenths of the whole change of a record."""
    share = (y - y[0]) / (np.mean(y[-max(1, y.size // 10) :]) - y[0])
    before, after = np.flatnonzero(share < 0.1), np.flatnonzero(share > 0.9)
    # `after` is not empty, since some sample reaches the mean of the last tenth.
    return float(t[after[0]] - t[before[before < after[0]][-1]])


def _excess_gain(t: Array, y: Array, model: Process, highest: float) -> float:
    """Return the largest value of |record| / |model| - 1 at frequencies up to `highest`, for the record of a unit step.

    The record is taken as linear between its samples. Therefore its frequency response, the integral of y' e^{-jωt}, is
    a finite sum.
    """
    h = float(t[-1] / (t.size - 1))
    w = highest * np.geomspace(0.05, 1.0, 25)
    record = np.abs(np.exp(-1j * np.outer(w, t[:-1])) @ np.diff(y)) * np.sinc(w * h / (2 * np.pi))
    return float(np.max(record / np.abs(model(1j * w))) - 1)


def _levels_reached(t: Array, y: Array, crossing: str) -> tuple[tuple[float, float, float], float]:
    """Check a step record. Return the times at which it reaches the levels, and its whole change."""
    _check.choice("crossing", crossing, ("interpolated", "sampled"))
    if t.size < 30:
        raise ValueError(f"y must have at least 30 samples, found {t.size}")
    tenth = t.size // 10
    final, before = y[-tenth:].mean(), y[-2 * tenth : -tenth].mean()
    change = final - y[0]
    if abs(change) <= 1e-9 * max(np.max(np.abs(y)), 1e-300):
        raise ValueError(f"y never moves: it starts at {y[0]:.4g} and ends at {final:.4g}")
    if abs(final - before) > STILL_MOVING * abs(change):
        raise ValueError(
            f"y has not settled: in the last two tenths it moves by {100 * abs(final - before) / abs(change):.2g} % "
            f"of the whole change, and {100 * STILL_MOVING:g} % is allowed; record longer"
        )
    share = (y - y[0]) / change
    if share[1] > LEVELS[0]:
        raise ValueError(
            f"y already moves by {100 * share[1]:.3g} % in the first sample: t = 0 must be the time of the step"
        )
    if share.max() > 1 + OVERSHOOT:
        raise ValueError(
            f"y overshoots by {100 * (share.max() - 1):.3g} %, and {100 * OVERSHOOT:g} % is allowed for real poles"
        )
    times = []
    for level in LEVELS:
        i = int(np.argmax(share >= level))
        part = 1.0 if crossing == "sampled" else (level - share[i - 1]) / (share[i] - share[i - 1])
        times.append(float(t[i - 1] + part * (t[i] - t[i - 1])))
    return (times[0], times[1], times[2]), float(change)
