"""From filtered gains to a digital controller."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from pidalab import _check
from pidalab.digital.controller import DigitalController
from pidalab.digital.parameters import DISCRETE_ANTI_WINDUP, anti_windup_word
from pidalab.digital.paths import METHOD_WEIGHTS, METHODS, paths
from pidalab.digital.prefilter import discrete
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
    r"""Turn gains behind filters into difference equations with limits, anti-windup and units; see the options here.

    Controllers call it: ``controller.discretise(sample_time, method, **options)``.

    =========  ===========================================  ==========================================================
    method     what it is                                   which sample times serve
    =========  ===========================================  ==========================================================
    backward   :math:`s = (1 - z^{-1})/h`, as in most PLCs  any: a stable controller stays stable
    tustin     :math:`s = 2(1 - z^{-1})/(h(1 + z^{-1}))`    up to twice the time constant of each filter
    zoh        exact for an input that is held              up to the time constant of each filter
    =========  ===========================================  ==========================================================

    ==================  ==============================================================================================
    anti-windup         what the integral does while the control signal is at a limit of its range or rate
    ==================  ==============================================================================================
    reset               of a `SeriesPIDA`: the integral is a lag of time constant :math:`t_i` behind the limited signal
                        (huba2024, Fig. 1, eqs. (3), (8)), if b = c = 1. Otherwise back-calculation with the integral
                        time as tracking time, which for backward differences and b = 1 is that lag behind the limited
                        signal less its derivative parts
    back-calculation    it takes back :math:`h/(T_t + h)` of what was cut off, with the tracking time :math:`T_t`
    clamping            it grows up to the limit, and rests while it would drive the signal further beyond
    None                it integrates on
    ==================  ==============================================================================================

    Take *reset*, the default, unless you know better. *clamping* serves where there is no integral time to go by
    (integral and derivative action without proportional action), and where u sits at a limit for long and must leave it
    late; *back-calculation* with a short `tracking_time` leaves a limit early. None of them locks. None is for
    actuators without limits.

    Parameters
    ----------
    parts : tuple of FilteredGains
        What the controller is the sum of.
    sample_time : float
        Time h from sample to sample, above 0.
    method : {"backward", "tustin", "zoh"}, optional
        As in the table.
    b, c : float, optional
        Weights of the set point in the proportional and in the derivative parts; ``c=0`` takes derivatives of the
        measurement alone. Default 1.
    limits : tuple of float, optional
        Lower and upper limit of the control signal, in its units.
    rate_limit : float, optional
        Largest change of the control signal in a unit of time, above 0.
    anti_windup : {"reset", "back-calculation", "clamping", None}, optional
        As in the table; "none" means None. ("conditioning" belongs to `pidalab.simulate_sampled`.)
    tracking_time : float, optional
        Of back-calculation, above 0; by default the root of integral and derivative time, or the integral time where
        there is no derivative. (Of integral action alone that is 0: the integral stays at the limit.)
    deadband : float, optional
        Errors up to this size count as zero, larger ones less it. In units of the measurement, not negative.
    bias : float, optional
        Control signal at the working point, which is 0 in the model: what the controller starts with.
    y_offset : float, optional
        Measurement at the working point.
    prefilter : control.TransferFunction, optional
        Filter of the set point, stable and of static gain 1, discretised with the same method. It works in manual mode,
        too, and starts at rest at the first set point.
    output_filter : OutputFilter or control.TransferFunction, optional
        A filter behind the controller that becomes a part of it: equal lags of gain 1.
    feedforward : bool, optional
        Whether ``step`` and the written code take a further signal, which is added before the limits: what a load
        that is measured, or the set point, asks of u.
    tunable : bool, optional
        Whether the gains may change while it runs, without a bump: variables of the written code, and ``retune`` here.
    reset : tuple of FilteredGains and float, optional
        Stabilising controller and time constant of an automatic reset.
    source : str, optional
        What was discretised, for the head of written code.

    Returns
    -------
    DigitalController
        With its start at the first measurement.

    Raises
    ------
    TypeError, ValueError
        For a value outside its range; for a filter that is too fast for the sample time, unless the method is
        backward; for anti-windup by an integral time that is not above 0.

    Warns
    -----
    UserWarning
        For a sample time beyond the integral time of the controller, or beyond its derivative time if it has no
        integral action.

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
        raise TypeError(
            f"parts must be a tuple of FilteredGains, as controller.parts() gives, found {parts!r}"
        )
    h = _check.real("sample_time", sample_time, above=0.0)
    _check.choice("method", method, METHODS)
    anti_windup = anti_windup_word(anti_windup, DISCRETE_ANTI_WINDUP, "for a digital controller")
    if tracking_time is not None and anti_windup != "back-calculation":
        raise ValueError(
            f"tracking_time is of anti_windup='back-calculation', found anti_windup={anti_windup!r}"
        )
    b, c = _check.real("b", b), _check.real("c", c)
    _warn_of_long_samples(parts, h)
    behind = equal_lags(output_filter)
    ki = sum(part.gains[0] for part in parts)
    native = anti_windup == "reset" and reset is not None and b == c == 1.0
    if native and reset is not None:
        stabiliser, ti = reset
        own = paths((stabiliser,), behind, h, method, b, c)
        growth, taken_back = _reset_growth(h, ti, method)
        tracking_gain = taken_back
    else:
        own = paths(parts, behind, h, method, b, c)
        if not ki and not any(path.weight for path in own):
            raise ValueError(
                f"b must not be {b:g} with c = {c:g} without integral action: the set point would have no effect"
            )
        if tunable and not ki:
            raise ValueError("tunable must be False without integral action, which is what takes up a bump")
        growth = (ki * h * METHOD_WEIGHTS[method][0], ki * h * METHOD_WEIGHTS[method][1])
        taken_back = _back_calculation_gain(parts, h, anti_windup, tracking_time) if ki else 0.0
        tracking_gain = taken_back or 1.0
    return DigitalController(
        sample_time=h,
        method=method,
        paths=own,
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
        prefilter=None if prefilter is None else discrete(*rational("prefilter", prefilter), h, method),
        feedforward=feedforward,
        tunable=tunable,
    )


def _warn_of_long_samples(parts: tuple[FilteredGains, ...], h: float) -> None:
    """Warn of a sample time in which the controller would have to act more than once."""
    ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
    what, above, below = ("integral time kp/ki", kp, ki) if ki else ("derivative time kd/kp", kd, kp)
    time = abs(above / below) if below else 0.0
    if 0.0 < time < h:
        warnings.warn(
            f"sample_time should be at most {time:.6g}, the {what} of the controller, found {h:.6g}: from one sample "
            "to the next it would have acted and gone on; sample faster, or check the unit of time",
            stacklevel=4,
        )


def equal_lags(output_filter: Any) -> tuple[float, int]:
    """Return time constant and order of a filter, which has to be equal lags of gain 1; none for None."""
    num, den = rational("output_filter", 1.0 if output_filter is None else output_filter)
    order = den.size - 1
    time = float(den[-2] / den[-1]) / order if order and den[-1] else 0.0
    lags = binomial(time, order) * den[-1]
    equal = num.size == 1 and (time > 0 or not order) and np.allclose(lags, den, rtol=1e-9, atol=0.0)
    if not equal or abs(num[0] / den[-1] - 1) > 1e-9:
        raise ValueError(
            "output_filter must be equal lags of gain 1, 1/(T s + 1)^n, to become a part of a digital controller, "
            f"found [{', '.join(f'{c:.6g}' for c in num)}] / [{', '.join(f'{c:.6g}' for c in den)}]"
        )
    return time, order


def _reset_growth(h: float, ti: float, method: str) -> tuple[tuple[float, float], float]:
    """Return by how much of the stabiliser's signal a reset grows, now and from before, and what a limit takes back."""
    if method == "backward":
        return (h / ti, 0.0), h / (ti + h)
    if method == "tustin":
        return (h / (2 * ti), h / (2 * ti)), h / (2 * ti + h)
    return (0.0, -math.expm1(-h / ti)), 0.0


def _back_calculation_gain(
    parts: tuple[FilteredGains, ...], h: float, way: str | None, time: float | None
) -> float:
    """Return the back-calculation gain: the share of u less its wanted value that is added to the integral."""
    if way in (None, "clamping"):
        return 0.0
    if time is None:
        ki, kp, kd = (sum(part.gains[k] for part in parts if len(part.gains) > k) for k in range(3))
        if not any(any(part.gains[1:]) for part in parts):
            return 1.0  # integral action alone: its time is 0, and it stays at the limit
        if kp / ki <= 0:
            raise ValueError(
                f"anti_windup={way!r} goes by the integral time, which must be above 0, found kp/ki = {kp / ki:.4g}; "
                "take 'clamping', or 'back-calculation' with a tracking_time"
            )
        derivative_time = kd / kp if way == "back-calculation" else 0.0
        time = math.sqrt(kp / ki * derivative_time) if derivative_time > 0 else kp / ki
    time = _check.real("tracking_time", time, above=0.0)
    return h / (time + h)
