"""Discretise filtered gains."""

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

    ``controller.discretise(sample_time, method, **options)`` calls it with these options.

    =========  ===========================================  ==========================================================
    method     definition                                   suitable sample times
    =========  ===========================================  ==========================================================
    backward   :math:`s = (1 - z^{-1})/h`, as in most PLCs  any; a stable controller stays stable
    tustin     :math:`s = 2(1 - z^{-1})/(h(1 + z^{-1}))`    up to twice the time constant of each filter
    zoh        exact for an input that is held              up to the time constant of each filter
    =========  ===========================================  ==========================================================

    ==================  ==============================================================================================
    anti-windup         the integral while the control signal is at a limit of its range or rate
    ==================  ==============================================================================================
    reset               of a `SeriesPIDA`: the integral is a lag of time constant :math:`t_i` behind the limited signal
                        (huba2024, Fig. 1, eqs. (3), (8)), if b = c = 1. Otherwise back-calculation with the integral
                        time as tracking time, which for backward differences and b = 1 is that lag behind the limited
                        signal less its derivative parts
    back-calculation    it takes back :math:`h/(T_t + h)` of the part cut off, with the tracking time :math:`T_t`
    clamping            it grows up to the limit, and rests while it would drive the signal further beyond
    None                it integrates on
    ==================  ==============================================================================================

    *reset*, the default, is right for most loops. Use *clamping* for a controller without an integral time (integral
    and derivative action without proportional action), and where u stays at a limit for long and must leave it late.
    *back-calculation* with a short `tracking_time` leaves a limit early. With each of them the controller always leaves
    the limit. None is for actuators without limits.

    Parameters
    ----------
    parts : tuple of FilteredGains
        Parts whose sum is the controller.
    sample_time : float
        Time h from sample to sample, above 0.
    method : {"backward", "tustin", "zoh"}, optional
        As in the table.
    b, c : float, optional
        Set-point weights of the proportional and the derivative parts; with ``c=0`` only the measurement is
        differentiated. By default 1.
    limits : tuple of float, optional
        Lower and upper limit of the control signal, in its units.
    rate_limit : float, optional
        Largest change of the control signal in a unit of time, above 0.
    anti_windup : {"reset", "back-calculation", "clamping", None}, optional
        As in the table; "none" means None. ("conditioning" belongs to `pidalab.simulate_sampled`.)
    tracking_time : float, optional
        For back-calculation, above 0. By default the geometric mean of integral and derivative time, the integral time
        without derivative, and 0 for integral action alone: its integral stays at the limit.
    deadband : float, optional
        Errors up to this size count as zero, and it is subtracted from larger ones. At least 0, in units of y.
    bias : float, optional
        Control signal at the working point, which the controller starts with.
    y_offset : float, optional
        Measurement at the working point.
    prefilter : control.TransferFunction, optional
        Filter of the set point, stable and of static gain 1, discretised with the same method. It also runs in manual
        mode, and starts at rest at the first set point.
    output_filter : OutputFilter or control.TransferFunction, optional
        A filter of the control signal, which becomes a part of the controller: equal lags of gain 1.
    feedforward : bool, optional
        True for a further input of ``step`` and of the written code, which is added before the limits.
    tunable : bool, optional
        True for gains that may change without a bump while the controller runs: variables in the written code, and
        ``retune`` in Python.
    reset : tuple of FilteredGains and float, optional
        Stabilising controller and time constant of an automatic reset.
    source : str, optional
        Description of the controller, for the head of written code.

    Returns
    -------
    DigitalController
        It starts at its first measurement.

    Raises
    ------
    TypeError, ValueError
        For a value outside its range; for a filter that is too fast for the sample time (except with backward); for
        anti-windup that needs an integral time above 0.

    Warns
    -----
    UserWarning
        For a sample time above the integral time of the controller, or above its derivative time if it has no integral
        action.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.PIDA(kp=1.0, ti=2.0, td=0.5, n=10).discretise(1.0, method="zoh")
    Traceback (most recent call last):
    ...
    ValueError: sample_time must be at most 0.05 with method='zoh', found 1: the filter of the derivative part has the
    time constant 0.05, and a derivative behind it would have forgotten each step at the next sample; take
    method='backward', sample faster or filter longer
    """
    if not isinstance(parts, tuple) or not all(isinstance(part, FilteredGains) for part in parts):
        raise TypeError(f"parts must be those of controller.parts(), found {parts!r}")
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
                f"b = {b:g} with c = {c:g} leaves the set point no effect without integral action"
            )
        if tunable and not ki:
            raise ValueError("tunable must be False without integral action, which absorbs the bump")
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
    """Warn of a sample time above the integral time, or above the derivative time without integral action."""
    ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
    what, above, below = ("integral time kp/ki", kp, ki) if ki else ("derivative time kd/kp", kd, kp)
    time = abs(above / below) if below else 0.0
    if 0.0 < time < h:
        warnings.warn(
            f"sample_time should be at most the {what}, {time:.6g}, found {h:.6g}; check the unit of time",
            stacklevel=4,
        )


def equal_lags(output_filter: Any) -> tuple[float, int]:
    """Return time constant and order of an output filter, which must be equal lags of gain 1."""
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
    """Return the growth of an automatic reset (present and previous signal) and its back-calculation gain."""
    if method == "backward":
        return (h / ti, 0.0), h / (ti + h)
    if method == "tustin":
        return (h / (2 * ti), h / (2 * ti)), h / (2 * ti + h)
    return (0.0, -math.expm1(-h / ti)), 0.0


def _back_calculation_gain(
    parts: tuple[FilteredGains, ...], h: float, way: str | None, time: float | None
) -> float:
    """Return the share of the part cut off by a limit that is added to the integral."""
    if way in (None, "clamping"):
        return 0.0
    if time is None:
        ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
        if not any(any(part.gains[1:]) for part in parts):
            return 1.0  # integral action alone stays at the limit
        if kp / ki <= 0:
            raise ValueError(
                f"anti_windup={way!r} needs kp/ki above 0, found {kp / ki:.4g}; take 'clamping' or a tracking_time"
            )
        derivative_time = kd / kp if way == "back-calculation" else 0.0
        time = math.sqrt(kp / ki * derivative_time) if derivative_time > 0 else kp / ki
    time = _check.real("tracking_time", time, above=0.0)
    return h / (time + h)
