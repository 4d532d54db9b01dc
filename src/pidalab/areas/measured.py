r"""Measure characteristic areas from a record, for tuning without a model (vrancic2021).

The paper integrates the record repeatedly: :math:`y_k = \int (A_{k-1} u_0 - y_{k-1})\,dt`, :math:`A_k = y_k(\infty)`.
Here :math:`u_0` and :math:`y_0` are the changes of u and y, divided by the final change of u. This module computes the
areas from moments of u and y about the time of the change. The integrals end when the record has settled. Without noise
both methods give the same areas. Repeated integration runs to the end of the record, where noise has the largest
weight. An example is a unit step response of 1/(s + 1)^4 that is 50 time constants long, has 100 samples in each time
constant, and contains white noise of standard deviation 0.001. The rms error of A_5 is 3 % with moments. With repeated
integration it is 66 %, even if each final value is a mean over the last ten time constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeGuard
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import toeplitz
from scipy.special import bernoulli, factorial

from pidalab import _check
from pidalab._check import Array

PIECES = 16  # a steady state is divided into this number of pieces, and their means are compared
LAGS = (0.5, 1.0, 2.0, 4.0, 8.0)  # time constants of the exponentials in `_transients`, in lengths of a piece
SHORTEST = 0.05  # least length of a steady state, relative to the record after the first move of u
SHORTER = 0.9  # if a section is not steady, the next section tried is shorter by this factor
DRIFT = 2.5  # a transient of up to this number of standard deviations counts as noise
FADE = 5.0  # like DRIFT, but for the squared deviations, which scatter more
LONGER = 1.1  # the visible duration of a transient is multiplied by this, since noise hides its end
ROUNDING = float(np.finfo(float).eps)  # a smaller drift, relative to the level, is a rounding error
UNCERTAIN = 0.05  # a larger relative uncertainty of an area causes a warning


class RecordWarning(UserWarning):
    """The record is too short or too noisy, or it does not match the model."""


def is_record(given: Any) -> TypeGuard[Any]:
    """Return True for a plant record such as `pidalab.Record`."""
    return hasattr(given, "after_step")


@dataclass(frozen=True, eq=False)
class MeasuredAreas:
    """Areas measured from a record, with their uncertainty.

    Attributes
    ----------
    values : ndarray, shape (count,)
        A_0, A_1, .... The unit of A_k is (unit of y) / (unit of u) * time^k.
    covariance : ndarray, shape (count, count)
        Covariance of the errors of `values`, estimated from noise and drift in the final steady state.
    input_levels, output_levels : tuple of float
        Levels before and after the change.
    span : tuple of float
        Times between which the record is used: first move of the input, and beginning of the final steady state.
    settled : bool
        True if no drift in the final steady state exceeds the noise.
    noise : float
        Standard deviation of the output in the final steady state.
    """

    values: Array
    covariance: Array
    input_levels: tuple[float, float]
    output_levels: tuple[float, float]
    span: tuple[float, float]
    settled: bool
    noise: float

    @property
    def gain(self) -> float:
        """Static gain, A_0."""
        return float(self.values[0])

    @property
    def uncertainty(self) -> Array:
        """Standard uncertainty of each area, shape (count,), in the unit of the area."""
        return np.sqrt(np.diag(self.covariance))


def from_record(
    t: ArrayLike | Any,
    u: ArrayLike | None = None,
    y: ArrayLike | None = None,
    count: int | None = None,
    start: tuple[float, float] | None = None,
) -> MeasuredAreas:
    r"""Compute the areas from a measured change between two steady states. The input may have any shape in between.

    Let :math:`\tau` be the time since the first move of the input, :math:`\tau_1` its value when the integration ends,
    :math:`\Delta y` the whole change of y, and :math:`y_\infty` the final level of y. Then the moments

    .. math:: a_0 = \Delta y, \qquad
              a_k = \int_0^{\tau_1} \frac{\tau^{k-1}}{(k-1)!} \left(y_\infty - y(\tau)\right) d\tau

    are the areas of s y(s). The areas of s u(s) follow in the same way. Both lists of areas are the
    coefficients of a power series. The quotient of the two series has the areas of the process as coefficients.

    Parameters
    ----------
    t : array_like, shape (n,), or Record
        Uniform times from 0. A `pidalab.Record` replaces t, u and y.
    u, y : array_like, shape (n,), optional
        Input (held from each sample to the next) and output. Both must be steady at the end. Without `start`, they must
        be steady at the beginning, too.
    count : int
        Number of areas, at least 1. The magnitude optimum needs 2m + 4 areas for a controller of order m.
    start : tuple of float, optional
        Levels (u, y) before the record, for a change that begins with the first sample. By default, the level of u is
        its first sample, and the level of y is the mean of y until u first moves. Give `start` if u is noisy.

    Returns
    -------
    MeasuredAreas

    Raises
    ------
    TypeError, ValueError
        If the input never moves or ends where it began; if signals differ in length; if fewer than 16 samples follow
        the first move of the input; or if a Record is given together with u or y.

    Warns
    -----
    RecordWarning
        If noise, or drift at the end of the record, makes an area uncertain by more than 5 %.

    Notes
    -----
    Sampling with step h causes only one error that matters. If the slope of y jumps by y', as in the response of
    a single lag, the error of A_1 is about h² y'/12, divided by the change of u.

    The last section of the record counts as a steady state if no transient is found in it. The section is divided into
    sixteen pieces. The means of the pieces are projected on five decaying exponentials, whose time constants are 1/32
    to 1/2 of the section. A transient is found if one of these five components exceeds 2.5 times the standard deviation
    that noise alone would cause. A decaying oscillation hardly changes the means. So the same test is applied to the
    squared deviations from the mean, with 5 in place of 2.5 standard deviations.

    Noise hides the end of the transient, and without this end all areas would be too small. Therefore the time from the
    first move of the input to the steady state is made a tenth longer. The integrals end where the
    steady state begins. The final levels are means of the steady state.

    The uncertainty covers noise during the change, noise in the final level (with the weight :math:`\tau_1^k/k!` in
    :math:`A_k`), quantisation, and a slow tail hidden in the steady state. The steady state is divided into quarters.
    The quarter whose mean differs most from the overall mean gives the size of the tail. The noise may be coloured if
    its correlation time is below a sixteenth of the steady state. If the record ends before it has settled, the
    estimated uncertainty is large but still too small. Load disturbances and outliers are not detected.

    References
    ----------
    vrancic2021, eqs. (3) to (6), and multiple integration in its references 32 and 34.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 50.0, 5001)
    >>> u = np.where(t < 2.0, 30.0, 35.0)
    >>> y = 100.0 + pidalab.simulate(pidalab.Loop(pidalab.lags(4), 0.0), t, load=u - 30.0).y
    >>> pidalab.areas.from_record(t, u, y, count=6).values.round(4).tolist()
    [1.0, 4.0, 10.0, 20.0, 35.0, 56.0]
    """
    t, u, y = _signals(t, u, y)
    count = _check.order("count", count, at_least=1)
    h = float(t[-1] / (t.size - 1))
    first, (u0, y0), before = _beginning(u, y, start)
    last, settled = _end(t, u, y, first)
    u1, y1 = float(np.mean(u[last:])), float(np.mean(y[last:]))
    step = u1 - u0
    if abs(step) <= 1e-9 * np.max(np.abs(u - u0)):
        raise ValueError(f"u must not return to its first level: it starts at {u0:.6g} and ends at {u1:.6g}")
    tau = h * np.arange(last - first + 1)
    # Row k is tau^k / k!.
    weights = np.cumprod([np.ones_like(tau), *(tau / k for k in range(1, max(count, 3) + 1))], axis=0)
    a_u = np.append(step, _of_steps(u1 - u[first : last + 1], weights)) / step
    a_y = np.append(y1 - y0, _of_samples(y1 - y[first : last + 1], weights, h)) / step
    quotient = _over(a_u)
    values = quotient @ a_y
    errors = _moment_covariance(values, weights, u[last:], y[last:], h, before, _quantisation(y, y[last:]))
    result = MeasuredAreas(
        values=values[:count],
        covariance=(quotient @ errors @ quotient.T / step**2)[:count, :count],
        input_levels=(u0, u1),
        output_levels=(y0, y1),
        span=(float(t[first]), float(t[last])),
        settled=settled,
        noise=float(np.std(y[last:])),
    )
    _warn(result)
    return result


def _signals(t: Any, u: ArrayLike | None, y: ArrayLike | None) -> tuple[Array, Array, Array]:
    """Check times, input and output. A Record provides them on a uniform grid."""
    if is_record(t):
        if u is not None or y is not None:
            raise TypeError("u and y must be left out with a Record, which contains them")
        t, u, y = t.uniform()
    elif u is None or y is None:
        raise TypeError("u and y must be given, unless t is a Record")
    t, u, y = _check.signals(t, u=u, y=y)
    _check.squarable("u", u)
    _check.squarable("y", y)
    return t, u, y


def _beginning(u: Array, y: Array, start: tuple[float, float] | None) -> tuple[int, tuple[float, float], int]:
    """Return the first sample of the change, the levels of u and y before it, and the number of samples before it."""
    if start is not None:
        u0, y0 = _check.pair("start", "the levels of u and y", start)
        return 0, (_check.real("start[0]", u0), _check.real("start[1]", y0)), 0
    moved = np.flatnonzero(np.abs(u - u[0]) > 1e-9 * np.ptp(u))
    if not moved.size:
        raise ValueError(f"u must move, found {u[0]:.6g} throughout; if u stepped at t = 0, give start")
    before = int(moved[0])
    return before, (float(u[0]), float(np.mean(y[:before]))), before


def _end(t: Array, u: Array, y: Array, first: int) -> tuple[int, bool]:
    """Return the sample at which the steady state begins, and True if no transient is found after this sample."""
    length, least = t.size - first - 1, max(PIECES, math.ceil(SHORTEST * (t.size - first)))
    if length < least:
        raise ValueError(f"y must have at least {PIECES} samples after u first moves, found {length}")
    drifts = {}
    while length >= least:
        last = t.size - length
        if _steady(u[last:]) and _steady(y[last:]):
            return min(first + round(LONGER * (last - first)), t.size - least), True
        drifts[last] = _noise(y[last:], 1.0)[1]
        length = int(SHORTER * length)
    return min(drifts, key=lambda last: drifts[last]), False


def _pieces(x: Array) -> tuple[Array, float]:
    """Return the mean of each piece of x - x[-1], and the standard deviation of such a mean due to noise."""
    size = x.size // PIECES
    means = np.mean((x[: size * PIECES] - x[-1]).reshape(PIECES, size), axis=1)
    # For Gaussian noise, the median of the absolute differences is 0.954 standard deviations.
    return means, float(np.median(np.abs(np.diff(means))) / 0.954)


def _noise(x: Array, h: float) -> tuple[float, float]:
    """Return the spectral density of low-frequency noise, and the largest abs(mean of a quarter - overall mean)."""
    means, spread = _pieces(x)
    quarters = np.mean(means.reshape(4, -1), axis=1)
    return spread**2 * (x.size // PIECES) * h, float(np.max(np.abs(quarters - np.mean(means))))


def _steady(x: Array) -> bool:
    """Return True if noise explains all transients in a section of the record.

    A decaying oscillation, or a transient with the mean 0, appears only in the squared deviations.
    """
    # The mean of each piece has a rounding error, and `_transients` adds these errors.
    rounding, room = 4 * ROUNDING * float(np.max(np.abs(x))), math.sqrt(PIECES)
    squares = (x - np.mean(x[x.size // 2 :])) ** 2
    means, power = _transients(x), _transients(squares)
    level = np.max(np.abs(means[0])) <= DRIFT * means[1] + room * rounding
    return bool(level and np.max(power[0]) <= FADE * power[1] + room * rounding**2)


def _transients(x: Array) -> tuple[Array, float]:
    """Return the components of decaying exponentials in the means of the pieces.

    Also return the standard deviation of these components due to noise.
    """
    means, spread = _pieces(x)
    shapes = np.exp(-np.arange(PIECES) / np.array(LAGS)[:, None])
    shapes -= np.mean(shapes, axis=1, keepdims=True)
    return shapes @ means / np.linalg.norm(shapes, axis=1), spread


def _of_samples(x: Array, weights: Array, h: float) -> Array:
    """Integrate the product of a smooth signal x and tau^(k-1)/(k-1)! for k = 1, 2, ... by the trapezoidal rule.

    The rule is exact to all powers of h if the integrand is flat at both ends. At the beginning, x is constant, so the
    integrand is a constant times a power of tau. The Euler-Maclaurin formula gives the correction for this end.
    """
    product = weights[:-2] * x
    k = np.arange(1, len(product) + 1)
    ends = np.where(k % 2, 0.0, bernoulli(len(product))[1:] * h**k / factorial(k)) * x[0]
    return h * (np.sum(product, axis=1) - 0.5 * (product[:, 0] + product[:, -1])) + ends


def _of_steps(x: Array, weights: Array) -> Array:
    """Compute the integrals of `_of_samples` for an x that is held from sample to sample."""
    return np.diff(weights[1:-1]) @ x[:-1]


def _moment_covariance(
    values: Array, weights: Array, u: Array, y: Array, h: float, before: int, unseen: float
) -> Array:
    """Estimate the covariance of the moments of y from the steady state at the end.

    Errors in the moments of u are replaced by errors in the moments of y with the same effect on the areas. `before` is
    the number of samples before the change, and `unseen` is the error of a level due to quantisation.
    """
    (density, drift), window, size = _noise(y, h), h * (y.size - 1), len(values)
    level = weights[:size, -1]
    tail, per_drift = _tail(values, level, window)
    errors = np.zeros((size, size))
    errors[1:, 1:] = density * h * weights[: size - 1] @ weights[: size - 1].T
    errors[0, 0] = density / (h * before) if before else 0.0
    for source in (
        level * math.sqrt(density / window),
        tail * (per_drift * (drift + ROUNDING * np.max(np.abs(y))) + unseen),
        level * unseen,
        np.convolve(values, tail * per_drift)[:size] * _noise(u, h)[1],
    ):
        errors += np.outer(source, source)
    return errors


def _quantisation(y: Array, end: Array) -> float:
    """Return the largest error of a level due to quantisation: half a quantisation step, reduced by noise.

    The step is the smallest difference of two values of the record. If y has fewer than three different values, the
    step is unknown and the result is 0. Gaussian noise of standard deviation sigma multiplies the error of a mean by
    exp(-2 pi^2 sigma^2/step^2), if only the first harmonic of the error is counted.
    """
    steps = np.diff(np.unique(y))
    if steps.size < 2:
        return 0.0
    step = float(np.min(steps))
    return 0.5 * step * math.exp(-2 * (math.pi * min(float(np.std(end)) / step, 4.0)) ** 2)


def _tail(values: Array, level: Array, window: float) -> tuple[Array, float]:
    """Return (errors of the moments) / (height of a slow tail), and (height of the tail) / (drift that it causes).

    The tail decays like a lag. Its time constant is the standard deviation of the impulse response, so that a dead time
    has no effect. The tail causes two errors: the integrals end before it has decayed, and it shifts the final level.
    The drift is the mean of the first quarter of the steady state minus the overall mean.
    """
    gain, mean, square = values[:3]
    lag = math.sqrt(abs(2 * square / gain - (mean / gain) ** 2)) if gain else 0.0
    lag = min(max(lag, 1e-3 * window), 1e3 * window)
    average = lag / window * -math.expm1(-window / lag)
    drift = 4 * lag / window * -math.expm1(-window / (4 * lag)) - average
    tail = np.convolve(level, lag ** np.arange(level.size))[: level.size] - level
    return average * level + tail, 1 / drift


def _over(a: Array) -> Array:
    """Return the matrix that divides a power series by the series a, whose first coefficient is 1."""
    inverse = np.zeros_like(a)
    inverse[0] = 1 / a[0]
    for k in range(1, a.size):
        inverse[k] = -(a[1 : k + 1] @ inverse[k - 1 :: -1][:k]) / a[0]
    return np.tril(toeplitz(inverse))


def _warn(areas: MeasuredAreas) -> None:
    with np.errstate(divide="ignore", invalid="ignore"):
        share = areas.uncertainty / np.abs(areas.values)
    bad = np.flatnonzero(share > UNCERTAIN)
    if not bad.size:
        return
    listed = " and ".join(f"A_{k} by {100 * share[k]:.2g} %" for k in sorted({bad[0], bad[-1]}))
    cause = f"noise of standard deviation {areas.noise:.3g}"
    if not areas.settled:
        cause = f"the record still drifts at its end, after t = {areas.span[1]:.4g}"
    warn(
        f"the record makes areas uncertain: {listed} ({cause}). Use only the areas before A_{bad[0]} (a controller of "
        "order m needs 2m + 4 areas)",
        RecordWarning,
        stacklevel=3,
    )
