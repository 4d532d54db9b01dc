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
        table = lfilter([1.0 - b, b - a], [1.0, -a], shape.step(times, p))
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
