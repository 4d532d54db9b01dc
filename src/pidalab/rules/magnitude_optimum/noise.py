"""Magnitude optimum designs for a given noise gain: by the paper's estimate, and by its transfer function."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import brentq

from pidalab import _check
from pidalab.areas import MeasuredAreas, power_series as series
from pidalab.process import Process, binomial
from pidalab.rules._design import Design
from pidalab.rules.magnitude_optimum.design import tune
from pidalab.rules.magnitude_optimum.system import areas_of, solved, time_scale
from pidalab.statespace import discretise

MOST_UPDATES = 300  # updates of the filter time after which it is said not to settle
NO_LIMIT = "; with n = m no filter makes the noise gain as small as one likes"


def filter_time(gain: float, m: int, n: int, noise_gain: float, sample_time: float) -> float:
    r"""Filter time constant at which the highest derivative makes the noise gain wanted: the estimate of eq. (32).

    .. math:: T_F = \begin{cases} \left(\dfrac{K_m^2}{K_{HF}^2\,\omega_S} \left(\dfrac{1}{2m+1} + \dfrac{1}{2(n-m)-1}
              \right)\right)^{1/(2m+1)} & n > m \\ \left(|K_m|/K_{HF}\right)^{1/m} & n = m, \end{cases}
              \qquad \omega_S = \frac{2\pi}{T_S}

    It takes asymptotes for the filter, and noise up to the sampling frequency, twice as far as samples can hold any.

    Parameters
    ----------
    gain : float
        K_m, not 0.
    m, n : int
        Orders; n at least m and at least 1.
    noise_gain : float
        K_HF, above 0.
    sample_time : float
        T_S, above 0.

    Returns
    -------
    float
        T_F.

    Raises
    ------
    ValueError
        For a value outside these bounds; ``m = n = 0`` leaves nothing to choose, as there is no filter.

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
        raise ValueError(
            "gain must not be 0: without the highest derivative the estimate has nothing to go by"
        )
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
    """Controller for a noise gain by the estimate of eq. (32): gains and filter time in turn, Fig. 5.

    ============  =================
    vrancic2021   argument
    ============  =================
    K_HF          `noise_gain`
    T_S           `sample_time`
    ============  =================

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        As for `tune`.
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m and at least 1.
    noise_gain : float
        Ratio of the standard deviations of control signal and noise that is wanted, above 0.
    sample_time : float
        Sample time of the controller, above 0.
    first : float, optional
        Filter time to start from. The paper takes 0.1; by default it is a twentieth of the residence time A_1/A_0, or
        of the k-th root of the magnitude of A_k/A_0, k = 2 or 3, if one of these is longer.
    updates : int, optional
        How often the filter time is corrected, at least 1; the paper says that three times is usually enough. By
        default until it changes by less than 1e-12 of its value.

    Returns
    -------
    Design
        The controller, with gains for its own filter time.

    Raises
    ------
    TypeError, ValueError
        As `tune` and `filter_time`, and if the filter time does not settle. For n = m that happens if the noise gain
        is too small for any filter.

    Notes
    -----
    Of the 88 numbers in Tables 3 to 6, four updates from 0.035 give 78, and the other ten by one unit of the last
    digit; that is one of several ways to iterate that do so. Settled values give 67, and differ by up to four units, in
    the rows that settle slowly (n = m, and m = 4).

    Examples
    --------
    >>> import pidalab
    >>> process = pidalab.lags(3, delay=0.5)
    >>> pidalab.rules.magnitude_optimum.tune_for_noise(process, m=3, n=4, noise_gain=10.0, sample_time=0.002).controller
    HighOrderPID(gains=[0.844, 2.873, 3.562, 1.885, 0.352], filter_time=0.124, filter_order=4)
    """
    plain = areas_of(model, m)
    n = _check.order("n", n, at_least=max(m, 1))
    scale = time_scale(plain)
    time = start = scale / 20 if first is None else _check.real("first", first, above=0.0)
    for _ in range(MOST_UPDATES if updates is None else _check.integer("updates", updates, at_least=1)):
        before, top = time, float(solved(series.lagged(plain, time, n), m)[-1])
        time = filter_time(top, m, n, noise_gain, sample_time)
        if updates is None and not 1e-10 * scale < time < 1e5 * max(scale, start):
            break
        if updates is None and abs(time - before) <= 1e-12 * time:
            return tune(model, m, n, time)
    if updates is None:
        raise ValueError(
            f"no filter time for noise_gain = {noise_gain:g} with PID_{n}^{m}: from {start:.3g} it came to {time:.3g} "
            "without settling" + NO_LIMIT * (n == m)
        )
    return tune(model, m, n, time)


def tune_for_filter_noise(
    model: Process | MeasuredAreas | ArrayLike, m: int, n: int, noise_gain: float, sample_time: float
) -> Design:
    r"""Controller for a noise gain of its highest actions and its filter alone, in place of the estimate (32).

    The noise is white and held for a sample. The equation of the paper that is solved leaves the loop out: at high
    frequencies the process passes nothing, so that the transfer function from the noise to the control signal is about

    .. math:: \frac{1/A_0 + K_1 s + \dots + K_m s^m}{(T_F s + 1)^n}

    (for m = 0 with :math:`K_0` on top), eqs. (21) and (35). The noise gain is the H2 norm of its sampled form, without
    the asymptotes of eq. (26). `pidalab.noise_gain` is that of the loop itself: it differs by some per cent where the
    filter is not much faster than the loop.

    Where n is above m + 1 the estimate wastes up to two thirds of the noise gain; see the column σ_rel of Table 4.

    Parameters
    ----------
    model : Process, MeasuredAreas or array_like, shape (at least 2m + 4,)
        As for `tune`.
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m and at least 1.
    noise_gain : float
        Ratio of the standard deviations of control signal and noise that is wanted, above 0.
    sample_time : float
        Sample time of the controller, above 0.

    Returns
    -------
    Design
        The controller.

    Raises
    ------
    TypeError, ValueError
        As `tune`, and if no filter time between 1e-5 and 1e3 times the residence time (see `tune_for_noise`) gives this
        noise gain.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.rules import magnitude_optimum
    >>> process = pidalab.lags(3, delay=0.5)
    >>> design = magnitude_optimum.tune_for_filter_noise(process, 3, 6, noise_gain=10.0, sample_time=0.002)
    >>> design.filter_time
    0.0745
    """
    plain = areas_of(model, m)
    n = _check.order("n", n, at_least=max(m, 1))
    wanted = _check.real("noise_gain", noise_gain, above=0.0)

    def excess(log_time: float) -> float:
        time = math.exp(log_time)
        found = [float(gain) for gain in solved(series.lagged(plain, time, n), m)]
        ratio = filtered_noise_gain(found, time, n, float(plain[0]), sample_time) / wanted
        return math.log(max(ratio, sys.float_info.min))  # 0 where K_0 of a PI controller changes its sign

    low, high = _bracket(excess, math.log(time_scale(plain) / 20))
    if high is None:
        raise ValueError(
            f"no filter time for noise_gain = {noise_gain:g} with PID_{n}^{m}: at {math.exp(low):.3g} it is "
            f"{noise_gain * math.exp(excess(low)):.4g}, and nearly constant" + NO_LIMIT * (n == m)
        )
    return tune(model, m, n, math.exp(brentq(excess, low, high, xtol=1e-13)))


def _bracket(excess: Callable[[float], float], start: float) -> tuple[float, float | None]:
    """Return two logarithms of filter times with the noise gain wanted between them, or None for the second.

    A longer filter passes less noise.
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
    """H2 norm of the sampled form of eq. (21), for noise that is held."""
    h = _check.real("sample_time", sample_time, above=0.0)
    top = [1 / static_gain, *gains[2:]] if len(gains) > 2 else [gains[1]]
    A, b, c, d = discretise(np.array(top[::-1]), binomial(filter_time, n), h)
    spread = c @ solve_discrete_lyapunov(A, np.outer(b, b)) @ c if b.size else 0.0
    return math.sqrt(spread + d**2)
