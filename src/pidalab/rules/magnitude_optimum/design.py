"""Magnitude optimum designs: the gains for given areas, and the controller for a given filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.areas import MeasuredAreas, power_series as series
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.robustness.poles import is_stable
from pidalab.rules._design import Design
from pidalab.rules.magnitude_optimum.system import areas_of, measured_uncertainty, require_digits, solved

MO_SOURCES = {
    "gains": "eqs. (14) to (17)",
    "filter_time": "chosen",
    "static_gain": "eq. (6)",
    "ie": "eq. (37)",
    "uncertainty": "from that of the areas",
}
UNSURE = 1.0  # relative uncertainty at which a gain from a record is refused


def gains(areas: ArrayLike, m: int) -> Array:
    r"""Gains for given areas of process and filter together, eqs. (14) to (17).

    For a filter that is not binomial, as that of eq. (47): take its areas in with `pidalab.areas.with_filter`.

    Parameters
    ----------
    areas : array_like, shape (at least 2m + 4,)
        A_0, A_1, ..., with the filter.
    m : int
        Order of the highest derivative, at least 0.

    Returns
    -------
    ndarray, shape (m + 2,)
        :math:`K_{-1}, K_0, \dots, K_m`.

    Raises
    ------
    ValueError
        For too few areas, a static gain of 0, and areas that make the system singular or so ill-conditioned that
        rounding them decides the gains.

    Examples
    --------
    >>> import pidalab
    >>> areas = pidalab.areas.from_process(pidalab.lags(4), 6)
    >>> pidalab.rules.magnitude_optimum.gains(pidalab.areas.with_binomial_filter(areas, 0.1, 1), m=1)
    array([0.438, 1.295, 1.041])
    """
    m = _check.order("m", m, at_least=0)
    filtered = areas_of(areas, m)
    result = solved(filtered, m)
    require_digits(filtered, result)
    return np.array(result, dtype=float)


def tune(model: Process | MeasuredAreas | ArrayLike, m: int, n: int, filter_time: float) -> Design:
    """Controller with a filter that is given, eqs. (8) and (17).

    ============  =================
    vrancic2021   argument
    ============  =================
    m, n          `m`, `n`
    T_F           `filter_time`
    ============  =================

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        A stable process; or areas, without the filter.
    m : int
        Order of the highest derivative, at least 0: 0 is PI, 1 PID, 2 PIDA.
    n : int
        Order of the filter, at least m.
    filter_time : float
        Time constant of the filter, above 0; with ``n=0`` it is 0.

    Returns
    -------
    Design
        The controller. Its `info`: ``gains`` :math:`K_{-1}` to :math:`K_m`; ``filter_time`` T_F; ``static_gain`` A_0
        of the process; ``ie``, the integral of the error after a unit step of the filtered set point,
        :math:`1/(A_0 K_{-1})`, eq. (37); ``uncertainty``, the standard uncertainty of each gain in its own unit, from
        that of the areas; zeros for a model.

    Raises
    ------
    TypeError, ValueError
        For an order or filter outside these bounds; a process that is integrating, unstable or without static gain, or
        with which the loop would be unstable; too few areas; a system that is singular or so ill-conditioned that
        rounding decides the gains; measured areas of which a gain is as uncertain as it is large, or with which the
        integral gain has the wrong sign.

    Notes
    -----
    Whether the loop is stable can be tested with a `Process` only. Areas tell nothing about high frequencies: test a
    controller from a record on a fitted model.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.magnitude_optimum.tune(pidalab.lags(2, delay=0.5), m=2, n=2, filter_time=0.1).controller
    HighOrderPID(gains=[1.140, 2.578, 1.738, 0.300], filter_time=0.1, filter_order=2)
    """
    m = _check.order("m", m, at_least=0)
    plain = areas_of(model, m)
    n = _check.order("n", n, at_least=m)
    filtered = series.lagged(plain, _check.real("filter_time", filter_time, at_least=0.0), n)
    exact_gains = solved(filtered, m)
    controller = HighOrderPID(series.floats(exact_gains).tolist(), filter_time, n)
    require_digits(filtered, exact_gains)
    unsure = np.zeros(m + 2)
    if isinstance(model, MeasuredAreas):
        share = measured_uncertainty(filtered, exact_gains, model, filter_time, n)
        _require_sure(share, m)
        _require_sign(controller, model)
        unsure = share * np.abs(controller.coefficients)
    if isinstance(model, Process):
        _require_stable(Loop(model, controller), m, n, filter_time)
    info = {
        "gains": controller.coefficients,
        "filter_time": controller.filter_time,
        "static_gain": float(plain[0]),
        "ie": 1 / float(plain[0] * exact_gains[0]),
        "uncertainty": tuple(unsure.tolist()),
    }
    source = "vrancic2021, eqs. (8) and (14) to (17)"
    return Design(model, controller, source=source, info=info, sources=MO_SOURCES)


def _require_stable(loop: Loop, m: int, n: int, filter_time: float) -> None:
    """Raise unless the loop is known to be stable."""
    try:
        found = "" if is_stable(loop) else "is unstable"
    except ArithmeticError as reason:
        found = f"cannot be told stable ({reason})"
    if found:
        raise ValueError(
            f"the loop of PID_{n}^{m} with T_F = {filter_time:.4g} and {loop.process!r} {found}: the magnitude optimum "
            "shapes low frequencies only; take a lower m or a longer filter, or look at the gains with areas as model"
        )


def _require_sure(share: Array, m: int) -> None:
    """Raise if the record leaves a gain as uncertain as it is large."""
    if not np.max(share) < UNSURE:
        worst = int(np.argmax(share))
        raise ValueError(
            f"model: the record does not support m = {m}; it leaves K_{worst - 1} uncertain by "
            f"{100 * share[worst]:.3g} %, and {100 * UNSURE:g} % is allowed; take a lower m, or a better record"
        )


def _require_sign(controller: HighOrderPID, model: MeasuredAreas) -> None:
    """Raise if integral action drives the output away; more about stability the areas do not tell."""
    integral = controller.coefficients[0]
    if integral * model.gain <= 0:
        raise ValueError(
            f"model: with m = {len(controller.coefficients) - 2} the record gives K_-1 = {integral:.4g}, whose sign is "
            f"not that of the gain A_0 = {model.gain:.4g}: the loop would be unstable; take another m or another filter"
        )
