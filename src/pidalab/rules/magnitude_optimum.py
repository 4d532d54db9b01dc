r"""Magnitude optimum tuning of PID_n^m, from a model or from a record (vrancic2021).

PID_n^m denotes a controller with derivatives up to order m and a filter of order n: m = 0 is PI, 1 is PID and 2 is
PIDA. The loop follows its set point well if :math:`|T(j\omega)|` stays near 1 up to a high frequency, that is, if the
real part of :math:`L(j\omega)` stays near -1/2. Expanded in powers of :math:`\omega`, this real part has coefficients
that are linear in the gains, eqs. (13) and (14). The gains are :math:`K_{-1}` (integral), :math:`K_0` (proportional)
and :math:`K_1` to :math:`K_m` (derivatives). These m + 2 gains satisfy m + 2 conditions,

.. math:: \sum_{c=0}^{m+1} (-1)^{c+1} A_{2r+1-c} K_{c-1} = \begin{cases} -\tfrac12 & r = 0 \\ 0 & r = 1 \dots m+1,
          \end{cases}

eqs. (15) and (16). Here A_k are the areas (see `pidalab.areas`) of process and filter in series. Areas with a negative
index are 0. The last condition contains :math:`A_{2m+3}`, so 2m + 4 areas are needed. The equations are solved in exact
fractions, because their condition number grows more than a hundredfold if m rises by 1. If the controller can cancel
every pole of process and filter, the gains are unbounded and the equations are singular.

The conditions do not ensure stability. If the delay dominates or the process oscillates, the loop is unstable for some
m.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_discrete_lyapunov, toeplitz
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.areas import MeasuredAreas, exact, power_series as series
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process, binomial
from pidalab.robustness.poles import is_stable
from pidalab.rules._design import Design
from pidalab.statespace import discretise

__all__ = ["filter_time", "gains", "tune", "tune_for_filter_noise", "tune_for_noise"]

MO_SOURCES = {
    "gains": "eqs. (14) to (17)",
    "filter_time": "chosen",
    "static_gain": "eq. (6)",
    "ie": "eq. (37)",
    "uncertainty": "from the covariance of the areas",
}
UNSURE = 1.0  # a gain with at least this relative uncertainty is refused
MOST_UPDATES = 300  # number of updates of the filter time before an error is raised
NO_LIMIT = "; with n = m the noise gain has a lower bound: take a larger noise gain, or n above m"
MOST_DERIVATIVES = 16  # with a larger order m, rounding errors of the areas dominate
LOST = 1e-3  # a gain is refused if rounding the areas may change it by this fraction


def gains(areas: ArrayLike, m: int) -> Array:
    r"""Compute gains from the areas of process and filter in series, eqs. (14) to (17).

    For a filter that is not binomial, such as eq. (47), compute the areas with `pidalab.areas.with_filter`.

    Parameters
    ----------
    areas : array_like, shape (at least 2m + 4,)
        A_0, A_1, ... of process and filter in series.
    m : int
        Order of the highest derivative, at least 0.

    Returns
    -------
    ndarray, shape (m + 2,)
        :math:`K_{-1}, K_0, \dots, K_m`.

    Raises
    ------
    ValueError
        If there are too few areas, the static gain is 0, or the equations are singular or too ill-conditioned.

    Examples
    --------
    >>> import pidalab
    >>> areas = pidalab.areas.from_process(pidalab.lags(4), 6)
    >>> pidalab.rules.magnitude_optimum.gains(pidalab.areas.with_binomial_filter(areas, 0.1, 1), m=1)
    array([0.438, 1.295, 1.041])
    """
    m = _check.order("m", m, at_least=0)
    filtered = _areas_of(areas, m)
    result = _solved(filtered, m)
    _require_digits(filtered, result)
    return np.array(result, dtype=float)


def tune(model: Process | MeasuredAreas | ArrayLike, m: int, n: int, filter_time: float) -> Design:
    """Design a controller for a given filter, eqs. (8) and (17).

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        A stable process, or its areas without the filter.
    m : int
        Order of the highest derivative, at least 0 (0 is PI, 1 is PID, 2 is PIDA).
    n : int
        Order of the filter, at least m.
    filter_time : float
        Time constant T_F of the filter, above 0. Without filter (``n=0``) it must be 0.

    Returns
    -------
    Design
        The controller. `info` has

        - ``gains``: :math:`K_{-1}` to :math:`K_m`,
        - ``filter_time``: T_F,
        - ``static_gain``: A_0 of the process,
        - ``ie``: the integral of the error after a unit step of the filtered set point, :math:`1/(A_0 K_{-1})`,
          eq. (37),
        - ``uncertainty``: the standard uncertainty of each gain, in the unit of the gain. It is 0 if the areas were not
          measured.

    Raises
    ------
    TypeError, ValueError
        If an order or the filter is out of its range; if the process is integrating or unstable, has no static gain, or
        gives an unstable loop; if there are too few areas; or if the equations are singular or too ill-conditioned. For
        measured areas, also if the uncertainty of a gain is as large as the gain, or if the integral gain has the wrong
        sign.

    Notes
    -----
    Stability is tested only if a `Process` is given. If areas are given, test the controller with a fitted model.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.magnitude_optimum.tune(pidalab.lags(2, delay=0.5), m=2, n=2, filter_time=0.1).controller
    HighOrderPID(gains=[1.140, 2.578, 1.738, 0.300], filter_time=0.1, filter_order=2)
    """
    m = _check.order("m", m, at_least=0)
    plain = _areas_of(model, m)
    n = _check.order("n", n, at_least=m)
    filtered = series.lagged(plain, _check.real("filter_time", filter_time, at_least=0.0), n)
    exact_gains = _solved(filtered, m)
    controller = HighOrderPID(series.floats(exact_gains).tolist(), filter_time, n)
    _require_digits(filtered, exact_gains)
    unsure = np.zeros(m + 2)
    if isinstance(model, MeasuredAreas):
        share = _measured_uncertainty(filtered, exact_gains, model, filter_time, n)
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


def filter_time(gain: float, m: int, n: int, noise_gain: float, sample_time: float) -> float:
    r"""Estimate the filter time constant for a noise gain, from the gain of the highest derivative, eq. (32).

    .. math:: T_F = \begin{cases} \left(\dfrac{K_m^2}{K_{HF}^2\,\omega_S} \left(\dfrac{1}{2m+1} + \dfrac{1}{2(n-m)-1}
              \right)\right)^{1/(2m+1)} & n > m \\ \left(|K_m|/K_{HF}\right)^{1/m} & n = m, \end{cases}
              \qquad \omega_S = \frac{2\pi}{T_S}

    The estimate uses asymptotes of the filter, and counts noise up to the sampling frequency (twice the Nyquist
    frequency).

    Parameters
    ----------
    gain : float
        K_m, gain of the highest derivative, not 0.
    m, n : int
        Orders of derivative and filter. n must be at least m and at least 1.
    noise_gain : float
        K_HF, wanted ratio of the standard deviations of control signal and noise, above 0.
    sample_time : float
        T_S, sample time of the controller, above 0.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.magnitude_optimum.filter_time(0.352, m=3, n=4, noise_gain=10.0, sample_time=0.002)
    0.124
    """
    m = _check.order("m", m, at_least=0)
    n = _check.order("n", n, at_least=max(m, 1))
    wanted = _check.real("noise_gain", noise_gain, above=0.0)
    band = 2 * math.pi / _check.real("sample_time", sample_time, above=0.0)
    ratio = abs(_check.real("gain", gain)) / wanted
    if not ratio:
        raise ValueError("gain must not be 0: the estimate is proportional to a power of the gain")
    if n == m:
        return ratio ** (1 / m)
    return (ratio**2 / band * (1 / (2 * m + 1) + 1 / (2 * (n - m) - 1))) ** (1 / (2 * m + 1))


def tune_for_noise(
    model: Process | MeasuredAreas | ArrayLike,
    m: int,
    n: int,
    noise_gain: float,
    sample_time: float,
    first: float | None = None,
    updates: int | None = None,
) -> Design:
    r"""Design for a noise gain: compute the gains and the filter time of eq. (32) in turn, Fig. 5.

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        As for `tune`.
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m and at least 1.
    noise_gain : float
        K_HF, wanted ratio of the standard deviations of control signal and noise, above 0.
    sample_time : float
        T_S, sample time of the controller, above 0.
    first : float, optional
        Initial filter time, 0.1 in the paper. The default is a twentieth of the longest of the times \|A_k/A_0\|^(1/k),
        k = 1, 2, 3.
    updates : int, optional
        Number of updates of the filter time, at least 1. The paper makes four (Fig. 5). By default the updates
        continue until the relative change of the filter time is below 1e-12.

    Returns
    -------
    Design
        The gains are those for the final filter time.

    Raises
    ------
    TypeError, ValueError
        As for `tune` and `filter_time`, and if the filter time does not converge. For n = m this happens if no filter
        gives so small a noise gain.

    Notes
    -----
    The paper uses ``first=0.1`` and ``updates=4`` (Fig. 5). With these values, 69 of the 70 filter times and gains in
    Tables 3 to 5 agree with the paper within a unit of the last digit, and so do all 18 in Table 6. With the default
    number of updates the results differ by up to four units of the last digit in the rows where the filter time
    converges slowly (n = m, and m = 4).

    Examples
    --------
    >>> import pidalab
    >>> process = pidalab.lags(3, delay=0.5)
    >>> pidalab.rules.magnitude_optimum.tune_for_noise(process, m=3, n=4, noise_gain=10.0, sample_time=0.002).controller
    HighOrderPID(gains=[0.844, 2.873, 3.562, 1.885, 0.352], filter_time=0.124, filter_order=4)
    """
    plain = _areas_of(model, m)
    n = _check.order("n", n, at_least=max(m, 1))
    scale = _time_scale(plain)
    time = start = scale / 20 if first is None else _check.real("first", first, above=0.0)
    for _ in range(MOST_UPDATES if updates is None else _check.integer("updates", updates, at_least=1)):
        before, highest_gain = time, float(_solved(series.lagged(plain, time, n), m)[-1])
        time = filter_time(highest_gain, m, n, noise_gain, sample_time)
        if updates is None and not 1e-10 * scale < time < 1e5 * max(scale, start):
            break
        if updates is None and abs(time - before) <= 1e-12 * time:
            return tune(model, m, n, time)
    if updates is None:
        raise ValueError(
            f"noise_gain = {noise_gain:g} gives no filter time with PID_{n}^{m}" + NO_LIMIT * (n == m)
        )
    return tune(model, m, n, time)


def tune_for_filter_noise(
    model: Process | MeasuredAreas | ArrayLike, m: int, n: int, noise_gain: float, sample_time: float
) -> Design:
    r"""Design for a noise gain of the controller alone, by eqs. (21) and (35) instead of the estimate of eq. (32).

    The noise is white and constant between samples. At high frequencies the gain of the process is small, so the
    feedback is neglected. The transfer function from the noise to the control signal is then about

    .. math:: \frac{1/A_0 + K_1 s + \dots + K_m s^m}{(T_F s + 1)^n}

    For m = 0 the numerator is :math:`K_0`. The noise gain is the H2 norm of the sampled form of this transfer function.
    `pidalab.noise_gain`, which includes the loop, gives a result that differs by a few per cent if the filter is not
    much faster than the loop.

    For n above m + 1, the estimate of eq. (32) may lead to only a third of the requested noise gain (column σ_rel of
    Table 4).

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        As for `tune`.
    m, n : int
        As for `tune_for_noise`.
    noise_gain, sample_time : float
        As for `tune_for_noise`.

    Returns
    -------
    Design

    Raises
    ------
    TypeError, ValueError
        As for `tune`, and if no filter time gives this noise gain. The search covers a factor of e^10 above and below
        the default initial value of `tune_for_noise`.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.rules import magnitude_optimum
    >>> process = pidalab.lags(3, delay=0.5)
    >>> design = magnitude_optimum.tune_for_filter_noise(process, 3, 6, noise_gain=10.0, sample_time=0.002)
    >>> design.filter_time
    0.0745
    """
    plain = _areas_of(model, m)
    n = _check.order("n", n, at_least=max(m, 1))
    wanted = _check.real("noise_gain", noise_gain, above=0.0)

    def excess(log_time: float) -> float:
        time = math.exp(log_time)
        filtered_gains = [float(gain) for gain in _solved(series.lagged(plain, time, n), m)]
        ratio = filtered_noise_gain(filtered_gains, time, n, float(plain[0]), sample_time) / wanted
        # The ratio is 0 where K_0 of a PI controller changes its sign.
        return math.log(max(ratio, sys.float_info.min))

    low, high = _bracket(excess, math.log(_time_scale(plain) / 20))
    if high is None:
        raise ValueError(
            f"noise_gain = {noise_gain:g} gives no filter time with PID_{n}^{m}" + NO_LIMIT * (n == m)
        )
    return tune(model, m, n, math.exp(brentq(excess, low, high, xtol=1e-13)))


def _bracket(excess: Callable[[float], float], start: float) -> tuple[float, float | None]:
    """Return the logarithms of two filter times whose noise gains are above and below the requested one.

    A longer filter time gives less noise. The second value is None if the search fails.
    """
    here = start
    sign = math.copysign(1.0, excess(here))
    for _ in range(20):
        there = here + 0.5 * sign
        if sign * excess(there) <= 0:
            return min(here, there), max(here, there)
        here = there
    return here, None


def filtered_noise_gain(
    gains: Sequence[float], filter_time: float, n: int, static_gain: float, sample_time: float
) -> float:
    """Return the H2 norm of the sampled form of eq. (21), for white noise held between samples."""
    h = _check.real("sample_time", sample_time, above=0.0)
    numerator = [1 / static_gain, *gains[2:]] if len(gains) > 2 else [gains[1]]
    A, b, c, d = discretise(np.array(numerator[::-1]), binomial(filter_time, n), h)
    spread = c @ solve_discrete_lyapunov(A, np.outer(b, b)) @ c if b.size else 0.0
    return math.sqrt(spread + d**2)


def _require_stable(loop: Loop, m: int, n: int, filter_time: float) -> None:
    """Raise if the loop is unstable or may be unstable."""
    try:
        verdict = "" if is_stable(loop) else "is unstable"
    except ArithmeticError as reason:
        verdict = f"may be unstable ({reason})"
    if verdict:
        raise ValueError(
            f"the loop of PID_{n}^{m} with T_F = {filter_time:.4g} and {loop.process!r} {verdict}; take a lower m "
            "or a longer filter (to get the gains anyway, give areas as model)"
        )


def _require_sure(share: Array, m: int) -> None:
    """Raise if the uncertainty of a gain is as large as the gain."""
    if not np.max(share) < UNSURE:
        worst = int(np.argmax(share))
        raise ValueError(
            f"model: the record leaves K_{worst - 1} uncertain by {100 * share[worst]:.3g} % with m = {m}, and "
            f"less than {100 * UNSURE:g} % is allowed; take a lower m, or a better record"
        )


def _require_sign(controller: HighOrderPID, model: MeasuredAreas) -> None:
    """Raise if the integral gain has the wrong sign."""
    integral = controller.coefficients[0]
    if integral * model.gain <= 0:
        raise ValueError(
            f"model: K_-1 = {integral:.4g} must have the sign of A_0 = {model.gain:.4g}; take another m or filter"
        )


def _areas_of(model: Process | MeasuredAreas | ArrayLike, m: int) -> list[Fraction]:
    """Return the 2m + 4 areas for order m as fractions, or raise an error."""
    need = 2 * _check.integer("m", m, at_least=0, at_most=MOST_DERIVATIVES) + 4
    if isinstance(model, Process):
        areas = exact(model, need)
    elif isinstance(getattr(model, "process", None), Process):  # a fit: its `values` are not areas
        raise TypeError(f"model must be a Process or areas, found {type(model).__name__}; pass its .process")
    else:
        values = model.values if isinstance(model, MeasuredAreas) else model
        areas = series.fractions(_check.vector("model", values))
    if len(areas) < need:
        raise ValueError(f"model must have at least 2m + 4 = {need} areas for m = {m}, found {len(areas)}")
    if not areas[0]:
        raise ValueError("model must have a static gain A_0 other than 0, found 0: integral action needs one")
    return areas[:need]


def _time_scale(areas: Sequence[Fraction]) -> float:
    """Return the longest of the times |A_k/A_0|^(1/k), k = 1, 2, 3.

    For lags and dead time the longest is A_1/A_0. Other processes, such as (2s + 1)/(s + 1)^2, may have A_1 = 0.
    """
    return max(abs(float(area / areas[0])) ** (1 / k) for k, area in enumerate(areas[1:4], start=1)) or 1.0


def _row(areas: Sequence[Fraction], r: int, size: int) -> list[Fraction]:
    """Return row r of M, eq. (15)."""
    return [(-1) ** (c + 1) * areas[2 * r + 1 - c] if c <= 2 * r + 1 else Fraction(0) for c in range(size)]


def _solved(areas: Sequence[Fraction], m: int) -> list[Fraction]:
    """Solve M K = C, eqs. (15) to (17), for areas that include the filter. Raise if M is singular."""
    size = m + 2
    matrix = [_row(areas, r, size) for r in range(size)]
    result = series.solve(matrix, [Fraction(-1, 2), *[Fraction(0)] * (size - 1)])
    if result is None:
        raise ValueError(
            f"the areas do not determine the gains for m = {m} (singular matrix); take a lower m or a higher n"
        )
    return result


def _sensitivity(areas: Sequence[Fraction], gains: Sequence[Fraction], steps: Sequence[Fraction]) -> Array:
    """Return relative changes of gain i if area k changes by ``steps[k]``, shape (m + 2, 2m + 4), possibly infinite."""
    size = len(gains)
    scale = [gain if gain else Fraction(1) for gain in gains]
    scaled = [[value * s for value, s in zip(_row(areas, r, size), scale, strict=True)] for r in range(size)]
    largest = [max(map(abs, row)) for row in scaled]
    matrix = np.array([[float(x / unit) for x in row] for row, unit in zip(scaled, largest, strict=True)])
    moved = np.zeros((size, len(areas)))  # change of condition r if area k changes by steps[k]
    for r in range(size):
        for c in range(min(size, 2 * r + 2)):
            k = 2 * r + 1 - c
            moved[r, k] += float((-1) ** (c + 1) * gains[c] * steps[k] / largest[r])
    try:
        return -np.linalg.solve(matrix, moved)
    except np.linalg.LinAlgError:
        return np.full(moved.shape, np.inf)


def _require_digits(areas: Sequence[Fraction], gains: Sequence[Fraction]) -> None:
    """Raise if rounding the areas to double precision would change a gain too much."""
    m, changes = len(gains) - 2, np.abs(_sensitivity(areas, gains, areas))
    error = float(np.max(changes.sum(axis=1))) * np.finfo(float).eps / 2
    if not error < LOST:
        raise ValueError(
            f"the areas leave the gains for m = {m} ill-conditioned: rounding may change gains by {100 * error:.2g} %, "
            f"and less than {100 * LOST:g} % is allowed; take a lower m or a higher n"
        )


def _measured_uncertainty(
    areas: Sequence[Fraction], gains: Sequence[Fraction], model: MeasuredAreas, filter_time: float, n: int
) -> Array:
    """Return the relative standard uncertainty of each gain for measured areas, to first order."""
    size = len(areas)
    change = _sensitivity(areas, gains, [Fraction(1)] * size)
    unit = series.lagged([Fraction(1), *[Fraction(0)] * (size - 1)], filter_time, n)
    step = change @ np.tril(toeplitz(np.array(unit, dtype=float)))
    return np.sqrt(np.einsum("ij,jk,ik->i", step, model.covariance[:size, :size], step))
