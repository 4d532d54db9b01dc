"""Discretisation of a controller that is given as filtered gains."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from pidalab import _check
from pidalab.digital.controller import DigitalController
from pidalab.digital.filters import METHOD_WEIGHTS, METHODS, discrete_prefilter, filter_chains
from pidalab.digital.parameters import DISCRETE_ANTI_WINDUP, anti_windup_word
from pidalab.forms import FilteredGains
from pidalab.process import binomial, rational


def discretise(
    parts: tuple[FilteredGains, ...],
    sample_time: float,
    method: str = "backward",
    *,
    b: float = 1.0,
    c: float = 1.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    rate_limit: float = math.inf,
    anti_windup: str | None = "reset",
    tracking_time: float | None = None,
    deadband: float = 0.0,
    bias: float = 0.0,
    y_offset: float = 0.0,
    prefilter: Any = None,
    output_filter: Any = None,
    feedforward: bool = False,
    tunable: bool = False,
    reset: tuple[FilteredGains, float] | None = None,
    source: str = "",
) -> DigitalController:
    r"""Turn filtered gains into a digital controller with limits, anti-windup and a working point.

    The options of ``controller.discretise(sample_time, method, **options)`` are those of this function.

    =========  ===========================================  ==========================================================
    method     definition                                   suitable sample times
    =========  ===========================================  ==========================================================
    backward   :math:`s = (1 - z^{-1})/h`, as in most PLCs  any; a stable controller stays stable
    tustin     :math:`s = 2(1 - z^{-1})/(h(1 + z^{-1}))`    at most twice the time constant of each filter
    zoh        exact if the input is held                   at most the time constant of each filter
    =========  ===========================================  ==========================================================

    ==================  ==============================================================================================
    anti-windup         what happens to the integral at a limit of the range or rate of the control signal
    ==================  ==============================================================================================
    reset               For a `SeriesPIDA` with b = c = 1, the integral is the limited signal, filtered by a lag of time
                        constant :math:`t_i` (huba2024, Fig. 1, eqs. (3), (8)). For other controllers,
                        back-calculation is used with the integral time as tracking time.
    back-calculation    The integral is reduced by :math:`h/(T_t + h)` times the excess of the signal over the limit.
                        :math:`T_t` is the tracking time.
    clamping            An increment of the integral that would drive the signal beyond the limit is reduced, so that
                        the signal just reaches the limit. If the signal is beyond the limit without the increment, the
                        integral stays constant.
    None                The integral is computed as if there were no limit.
    ==================  ==============================================================================================

    The default *reset* suits most loops. Use *clamping* for a controller with integral and derivative action but
    without proportional action. *Clamping* also suits loops in which u stays at a limit for long and must leave the
    limit late. With *back-calculation* and a short `tracking_time`, u leaves a limit early. With each of these three
    methods, u can always leave a limit again. Use None only for actuators without limits.

    Parameters
    ----------
    parts : tuple of FilteredGains
        Filtered gains whose sum is the controller.
    sample_time : float
        Time h between samples, above 0.
    method : {"backward", "tustin", "zoh"}, optional
        As in the table.
    b, c : float, optional
        Set-point weights of the proportional and the derivative parts, by default 1. With ``c=0`` only the measurement
        is differentiated.
    limits : tuple of float, optional
        Lower and upper limit of the control signal.
    rate_limit : float, optional
        Largest change of the control signal in a unit of time, above 0.
    anti_windup : {"reset", "back-calculation", "clamping", None}, optional
        As in the table. "none" means None.
    tracking_time : float, optional
        Tracking time of back-calculation, above 0. By default it is the geometric mean of integral and derivative time,
        or the integral time if there is no derivative. For integral action alone it is 0, so the integral takes the
        value at which u is at the limit.
    deadband : float, optional
        Errors up to this size count as zero, and larger errors are reduced by this size. At least 0, in units of y.
    bias : float, optional
        Control signal at the working point, with which the controller starts.
    y_offset : float, optional
        Measurement at the working point.
    prefilter : control.TransferFunction, optional
        Filter of the set point, stable and of static gain 1. It also runs in manual mode, and starts at rest at the
        first set point.
    output_filter : OutputFilter or control.TransferFunction, optional
        Equal lags of gain 1 that filter the control signal. They become a part of the controller.
    feedforward : bool, optional
        True if ``step`` and the written code have a further input, which is added to the control signal before the
        limits.
    tunable : bool, optional
        True if the gains may change without a bump while the controller runs. Then the gains are variables in the
        written code, and ``retune`` changes them in Python.
    reset : tuple of FilteredGains and float, optional
        For an automatic reset: the controller without the reset, and the time constant of the reset.
    source : str, optional
        Description of the controller, for the head of written code.

    Returns
    -------
    DigitalController
        A controller that has not run yet.

    Raises
    ------
    TypeError, ValueError
        If a value is out of its range; if a filter is too fast for the sample time (except with backward); or if the
        anti-windup needs an integral time above 0 and there is none.

    Warns
    -----
    UserWarning
        If the sample time exceeds the integral time or, without integral action, the derivative time.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.PIDA(kp=1.0, ti=2.0, td=0.5, n=10).discretise(1.0, method="zoh")
    Traceback (most recent call last):
    ...
    ValueError: sample_time must be at most 0.05 with method='zoh', found 1: the filter of the derivative part has the
    time constant 0.05, and the effect of a step on a filtered derivative would have decayed before the next sample;
    take method='backward', a shorter sample time or a longer time constant
    """
    if not isinstance(parts, tuple) or not all(isinstance(part, FilteredGains) for part in parts):
        raise TypeError(f"parts must be the result of controller.parts(), found {parts!r}")
    h = _check.real("sample_time", sample_time, above=0.0)
    _check.choice("method", method, METHODS)
    anti_windup = anti_windup_word(anti_windup, DISCRETE_ANTI_WINDUP, "for a digital controller")
    if tracking_time is not None and anti_windup != "back-calculation":
        raise ValueError(f"tracking_time needs anti_windup='back-calculation', found {anti_windup!r}")
    b, c = _check.real("b", b), _check.real("c", c)
    _warn_of_long_samples(parts, h)
    behind = equal_lags(output_filter)
    ki = sum(part.gains[0] for part in parts)
    native = anti_windup == "reset" and reset is not None and b == c == 1.0
    if native and reset is not None:
        stabiliser, ti = reset
        chains = filter_chains((stabiliser,), behind, h, method, b, c)
        growth, taken_back = _reset_growth(h, ti, method)
        tracking_gain = taken_back
    else:
        chains = filter_chains(parts, behind, h, method, b, c)
        if not ki and not any(path.weight for path in chains):
            raise ValueError(
                f"the set point has no effect with b = {b:g} and c = {c:g} without integral action"
            )
        if tunable and not ki:
            raise ValueError("tunable needs integral action, which absorbs the bump of a change of gains")
        growth = (ki * h * METHOD_WEIGHTS[method][0], ki * h * METHOD_WEIGHTS[method][1])
        taken_back = _back_calculation_gain(parts, h, anti_windup, tracking_time) if ki else 0.0
        tracking_gain = taken_back or 1.0
    return DigitalController(
        sample_time=h,
        method=method,
        paths=chains,
        integrates=native or ki != 0,
        from_signal=native,
        growth=growth,
        back_calculation_gain=taken_back,
        tracking_gain=tracking_gain,
        anti_windup=anti_windup if native or ki else None,
        weights=(b, c),
        limits=limits,
        rate_limit=rate_limit,
        deadband=deadband,
        bias=bias,
        y_offset=y_offset,
        source=source,
        prefilter=None
        if prefilter is None
        else discrete_prefilter(*rational("prefilter", prefilter), h, method),
        feedforward=feedforward,
        tunable=tunable,
    )


def _warn_of_long_samples(parts: tuple[FilteredGains, ...], h: float) -> None:
    ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
    what, above, below = ("integral time kp/ki", kp, ki) if ki else ("derivative time kd/kp", kd, kp)
    time = abs(above / below) if below else 0.0
    if 0.0 < time < h:
        warnings.warn(
            f"sample_time should be at most the {what}, {time:.6g}, found {h:.6g}; check the unit of time",
            stacklevel=4,
        )


def equal_lags(output_filter: Any) -> tuple[float, int]:
    """Return time constant and order of an output filter, which must consist of equal lags of gain 1."""
    num, den = rational("output_filter", 1.0 if output_filter is None else output_filter)
    order = den.size - 1
    time = float(den[-2] / den[-1]) / order if order and den[-1] else 0.0
    lags = binomial(time, order) * den[-1]
    equal = num.size == 1 and (time > 0 or not order) and np.allclose(lags, den, rtol=1e-9, atol=0.0)
    if not equal or abs(num[0] / den[-1] - 1) > 1e-9:
        raise ValueError(
            "output_filter must be equal lags of gain 1, 1/(T s + 1)^n, "
            f"found [{', '.join(f'{c:.6g}' for c in num)}] / [{', '.join(f'{c:.6g}' for c in den)}]"
        )
    return time, order


def _reset_growth(h: float, ti: float, method: str) -> tuple[tuple[float, float], float]:
    """Return three gains of an automatic reset: for the present signal, the previous signal, and back-calculation."""
    if method == "backward":
        return (h / ti, 0.0), h / (ti + h)
    if method == "tustin":
        return (h / (2 * ti), h / (2 * ti)), h / (2 * ti + h)
    return (0.0, -math.expm1(-h / ti)), 0.0


def _back_calculation_gain(
    parts: tuple[FilteredGains, ...], h: float, way: str | None, time: float | None
) -> float:
    """Return the correction of the integral, divided by the part of the control signal that a limit cuts off."""
    if way in (None, "clamping"):
        return 0.0
    if time is None:
        ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
        if not any(any(part.gains[1:]) for part in parts):
            return 1.0  # without proportional or derivative action the integral stays at the limit
        if kp / ki <= 0:
            raise ValueError(
                f"anti_windup={way!r} needs kp/ki above 0, found {kp / ki:.4g}; take 'clamping' or a tracking_time"
            )
        derivative_time = kd / kp if way == "back-calculation" else 0.0
        time = math.sqrt(kp / ki * derivative_time) if derivative_time > 0 else kp / ki
    time = _check.real("tracking_time", time, above=0.0)
    return h / (time + h)
