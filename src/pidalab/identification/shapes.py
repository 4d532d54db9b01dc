"""Step responses of simple models in closed form, with a static gain of 1 and without dead time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.special import gammainc

from pidalab._check import Array
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
    """Response of 1/(tau² s² + 2 damping tau s + 1): the roots' cosines, hyperbolic above damping 1."""
    tau, damping = p
    x = np.maximum(t, 0.0) / tau
    beat = 1.0 - damping**2
    if abs(beat) < 1e-6:  # both roots in one place, to first order in their distance
        return 1.0 - np.exp(-x) * (1.0 + x)
    if beat > 0:
        w = np.sqrt(beat)
        return 1.0 - np.exp(-damping * x) * (np.cos(w * x) + damping / w * np.sin(w * x))
    w = np.sqrt(-beat)
    slow, fast = damping - w, damping + w
    return 1.0 - (fast * np.exp(-slow * x) - slow * np.exp(-fast * x)) / (2 * w)


def _second_order_and_zero(t: Array, p: Sequence[float]) -> Array:
    """Response of (zero s + 1) over that: its own and, times the zero, its slope."""
    tau, damping, zero = p
    x = np.maximum(t, 0.0) / tau
    beat = 1.0 - damping**2
    w = np.sqrt(abs(beat))
    if abs(beat) < 1e-6:
        slope = x * np.exp(-x)
    elif beat > 0:
        slope = np.exp(-damping * x) * np.sin(w * x) / w
    else:
        slope = (np.exp(-(damping - w) * x) - np.exp(-(damping + w) * x)) / (2 * w)
    return _second_order(t, p[:2]) + zero / tau * slope


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
        table = lfilter([1.0 - b, b - a], [1.0, -a], shape.step(times, p))
        return np.asarray(np.interp(t, times, table), dtype=float)

    def process(gain: float, p: Sequence[float], delay: float) -> Process:
        inner = shape.process(gain, p, delay)
        return Process(inner.num, np.convolve(inner.den, [lag, 1.0]), inner.delay)

    return Shape(shape.name, shape.parameters, step, process, shape.signed)


FIRST = Shape("fopdt", ("lag",), _first_order, lambda gain, p, delay: fopdt(gain, p[0], delay))
SECOND = Shape(
    "sopdt", ("tau", "damping"), _second_order, lambda gain, p, delay: sopdt(gain, p[0], p[1], delay)
)
INTEGRATOR = Shape("ipdt", (), _ramp, lambda gain, p, delay: ipdt(gain, delay))


def _with_zero(gain: float, p: Sequence[float], delay: float) -> Process:
    return Process([gain * p[2], gain], sopdt(gain, p[0], p[1], delay).den, delay)


def _integrator_and_lag(gain: float, p: Sequence[float], delay: float) -> Process:
    return Process([gain], [p[0], 1.0, 0.0], delay)


ZERO = Shape("sopdtz", ("tau", "damping", "zero"), _second_order_and_zero, _with_zero, signed=1)
LAGGED = Shape("ifopdt", ("lag",), _lagged_ramp, _integrator_and_lag)
