r"""Characteristic areas of a model (vrancic2021).

The areas :math:`A_k` are, with alternating signs, the coefficients of the Taylor series of P(s) about s = 0, eq. (6).
They are also the moments of the impulse response h(t), eqs. (4) and (5):

.. math:: P(s) = A_0 - A_1 s + A_2 s^2 - A_3 s^3 + \dots, \qquad A_k = \frac{1}{k!} \int_0^\infty t^k h(t)\,dt .

If blocks are in series, the areas of the whole are the convolution of the areas of the blocks. In our copy of the
paper, eq. (7) has :math:`A_1` where the recursion needs :math:`A_i`.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.areas import power_series as series
from pidalab.process import Process, rational, require_process
from pidalab.roots import roots


def from_process(process: Process, count: int) -> Array:
    """Compute the areas of a model, including its dead time. Each area is correctly rounded (eqs. (2) to (7)).

    Parameters
    ----------
    process : Process
        Stable process. A common factor s of numerator and denominator is cancelled.
    count : int
        Number of areas, at least 1.

    Returns
    -------
    ndarray, shape (count,)
        A_0, A_1, ....

    Raises
    ------
    TypeError, ValueError
        If `process` is not a stable `Process`, or if the count is below 1.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.areas.from_process(pidalab.lags(4), 10).tolist()
    [1.0, 4.0, 10.0, 20.0, 35.0, 56.0, 84.0, 120.0, 165.0, 220.0]
    >>> pidalab.areas.from_process(pidalab.lags(2, delay=0.5), 4).round(3).tolist()
    [1.0, 2.5, 4.125, 5.771]
    """
    return series.floats(exact(process, count))


def exact(process: Process, count: int) -> list[Fraction]:
    """Compute the areas of a model as exact fractions of its coefficients.

    Parameters
    ----------
    process : Process
        As for `from_process`.
    count : int
        Number of areas, at least 1.

    Returns
    -------
    list of Fraction
        A_0, A_1, ....

    Raises
    ------
    TypeError, ValueError
        As for `from_process`.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.areas.exact(pidalab.fopdt(gain=2.0, lag=0.5, delay=0.25), 3)
    [Fraction(2, 1), Fraction(3, 2), Fraction(13, 16)]
    """
    require_process("process", process)
    count = _check.order("count", count, at_least=1)
    rational_part = _stable_series("process", process.num, process.den, count)
    return series.product(rational_part, series.dead_time(process.delay, count))


def with_filter(areas: ArrayLike, block: Any) -> Array:
    """Compute the areas of a process in series with a rational block, such as a filter.

    Parameters
    ----------
    areas : array_like, shape (count,)
        Areas of the process.
    block : control.TransferFunction or controller without integral action
        Proper and stable block, such as the filter of eq. (47).

    Returns
    -------
    ndarray, shape (count,)

    Raises
    ------
    TypeError, ValueError
        If the block is not a proper continuous transfer function with one input and output, or if it is integrating or
        unstable.

    Examples
    --------
    >>> import control, pidalab
    >>> pidalab.areas.with_filter([1.0, 4.0, 10.0], control.tf([1.0], [0.5, 1.0])).tolist()
    [1.0, 4.5, 12.25]
    """
    values = series.fractions(_check.vector("areas", areas))
    filter_series = _stable_series("block", *rational("block", block), len(values))
    return series.floats(series.product(values, filter_series))


def with_binomial_filter(areas: ArrayLike, filter_time: float, filter_order: int) -> Array:
    """Compute the areas of a process in series with the filter 1/(filter_time s + 1)^filter_order, eq. (8).

    Parameters
    ----------
    areas : array_like, shape (count,)
        Areas of the process.
    filter_time : float
        Time constant, not negative.
    filter_order : int
        Number of lags, at least 0.

    Returns
    -------
    ndarray, shape (count,)

    Raises
    ------
    ValueError
        If the time constant or the order is negative.

    Examples
    --------
    >>> import pidalab
    >>> areas = pidalab.areas.from_process(pidalab.lags(4), 4)
    >>> pidalab.areas.with_binomial_filter(areas, filter_time=0.1, filter_order=2).round(3).tolist()
    [1.0, 4.2, 10.83, 22.124]
    """
    values = series.fractions(_check.vector("areas", areas))
    lag = _check.real("filter_time", filter_time, at_least=0.0)
    order = _check.order("filter_order", filter_order, at_least=0)
    return series.floats(series.lagged(values, lag, order))


def _stable_series(name: str, num: Array, den: Array, count: int) -> list[Fraction]:
    """Expand a proper rational function about s = 0. Raise an error if it is integrating or unstable."""
    while num.size > 1 and den.size > 1 and num[-1] == 0 == den[-1]:
        num, den = num[:-1], den[:-1]
    if den[-1] == 0:
        raise ValueError(f"{name} must have a static gain, but it integrates, so its areas are infinite")
    poles = roots(den)
    if np.any(poles.real >= 0):
        raise ValueError(f"{name} must be stable, found a pole at {poles[np.argmax(poles.real)]:.4g}")
    return series.quotient(series.polynomial(num, count), series.polynomial(den, count))
