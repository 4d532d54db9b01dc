"""Controllers that sum proportional, integral and derivative parts, as in haalman2024, heo2023 and vrancic2021."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pidalab import _check
from pidalab.controllers.base import Controller, Fraction, coerce_floats, six_digits, without_common_s
from pidalab.forms import FilteredGains, IdealGains
from pidalab.process import binomial


def _separate(
    gains: IdealGains, derivative_filter: float, acceleration_filter: float
) -> tuple[FilteredGains, ...]:
    """Return the parts that are present, each derivative with its own filter."""
    ki, kp, kd, ka = gains
    parts = [FilteredGains("proportional", (ki, kp))]
    if kd:
        parts.append(FilteredGains("derivative", (0.0, 0.0, kd), derivative_filter, 1))
    if ka:
        parts.append(FilteredGains("acceleration", (0.0, 0.0, 0.0, ka), acceleration_filter, 2))
    return tuple(parts)


def _fraction(kp: float, ti: float, parts: tuple[FilteredGains, ...]) -> Fraction:
    """Return kp (1 + 1/(ti s)) plus the derivative parts as one fraction with a common denominator."""
    num: Any = np.array([kp])
    den: Any = np.ones(1)
    if math.isfinite(ti):
        num, den = np.array([kp * ti, kp]), np.array([ti, 0.0])
    for part in parts[1:]:
        lags = binomial(part.filter_time, part.filter_order)
        num = np.polyadd(np.convolve(num, lags), np.convolve(part.gains[:0:-1], den))
        den = np.convolve(den, lags)
    return _check.polynomial("num", num), den


@dataclass(frozen=True)
class PIDA(Controller):
    r"""PIDA controller in standard form with separate filters (haalman2024, eq. (2)).

    .. math:: C(s) = k_p \left(1 + \frac{1}{t_i s} + \frac{t_d s}{\frac{t_d}{n} s + 1}
              + \frac{t_a s^2}{\left(\frac{t_a}{m} s + 1\right)^2}\right)

    ``ta = 0`` gives a PID controller, and ``td = ta = 0`` a PI controller. With the process 1/(s + 1) the filtered
    acceleration causes a second peak of \\|L\\| at the frequency m/ta, far above the crossover. The height of the peak
    is about kp m/2.

    Parameters
    ----------
    kp : float
        Proportional gain in units of u per unit of y, not 0.
    ti : float
        Integral time, above 0. ``math.inf`` gives no integral action.
    td : float, optional
        Derivative time, not negative.
    ta : float, optional
        Acceleration time constant in squared time units, not negative.
    n, m : float, optional
        The filters have the time constants ``td/n`` and ``ta/m``, with `n` and `m` above 0. Therefore `m` has the unit
        of time. The default 10 suits processes with lags near 1.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> print(pidalab.PIDA(kp=1.31, ti=3.37, td=0.938, ta=0.269))
    PIDA(kp=1.31, ti=3.37, td=0.938, ta=0.269, n=10.0, m=10.0)
      standard:        kp = 1.31, ti = 3.37, td = 0.938, ta = 0.269
      parallel:        ki = 0.38872, kp = 1.31, kd = 1.2288, ka = 0.35239
      non-interactive: kc = 1.31, tau_i = 3.37, tau_d = 0.938, tau_a = 0.73348
      series:          kp = 0.79153, kd = 1.0557, ka = 0.35239, ti = 2.0362
    """

    proportional = ("kp",)

    kp: float
    ti: float
    td: float = 0.0
    ta: float = 0.0
    n: float = 10
    m: float = 10

    def __post_init__(self) -> None:
        coerce_floats(self, ("kp",))
        endless = isinstance(self.ti, (float, np.floating)) and self.ti == math.inf
        coerce_floats(self, ("n", "m") if endless else ("ti", "n", "m"), above=0.0)
        coerce_floats(self, ("td", "ta"), at_least=0.0)
        if self.kp == 0:
            raise ValueError("kp must not be 0, found 0")

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller, eq. (1).

        Returns
        -------
        IdealGains

        Examples
        --------
        >>> import pidalab
        >>> pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.5).gains()
        IdealGains(ki=0.5, kp=2.0, kd=2.0, ka=1.0)
        """
        return IdealGains(self.kp / self.ti, self.kp, self.kp * self.td, self.kp * self.ta)

    def parts(self) -> tuple[FilteredGains, ...]:
        return _separate(self.gains(), self.td / self.n, self.ta / self.m)

    def fraction(self) -> Fraction:
        return _fraction(self.kp, self.ti, self.parts())


@dataclass(frozen=True)
class NonInteractivePIDA(Controller):
    r"""PIDA controller whose acceleration time has the unit of time (heo2023, eq. (16)).

    .. math:: C(s) = k_c \left(1 + \frac{1}{\tau_i s} + \frac{\tau_d s}{\alpha_d \tau_d s + 1}
              + \frac{\tau_a^2 s^2}{2 (\alpha_a \tau_a s + 1)^2}\right)

    Parameters
    ----------
    kc : float
        Proportional gain, not 0.
    tau_i : float
        Integral time, above 0.
    tau_d, tau_a : float
        Derivative and acceleration time, not negative.
    alpha_d, alpha_a : float, optional
        Time constants of the two filters, divided by `tau_d` and `tau_a`. Both above 0.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.NonInteractivePIDA(kc=2.0, tau_i=4.0, tau_d=1.0, tau_a=1.0)
    >>> C.gains()
    IdealGains(ki=0.5, kp=2.0, kd=2.0, ka=1.0)
    >>> print(f"{abs(C(1e9j)) / 2.0:.1f}")
    821.0
    """

    proportional = ("kc",)

    kc: float
    tau_i: float
    tau_d: float
    tau_a: float
    alpha_d: float = 0.05
    alpha_a: float = 0.025

    def __post_init__(self) -> None:
        coerce_floats(self, ("kc",))
        coerce_floats(self, ("tau_i", "alpha_d", "alpha_a"), above=0.0)
        coerce_floats(self, ("tau_d", "tau_a"), at_least=0.0)
        if self.kc == 0:
            raise ValueError("kc must not be 0, found 0")

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller, eq. (6).

        Returns
        -------
        IdealGains

        Examples
        --------
        >>> import pidalab
        >>> pidalab.NonInteractivePIDA(kc=1.0, tau_i=2.0, tau_d=0.5, tau_a=2.0).gains()
        IdealGains(ki=0.5, kp=1.0, kd=0.5, ka=2.0)
        """
        return IdealGains(self.kc / self.tau_i, self.kc, self.kc * self.tau_d, self.kc * self.tau_a**2 / 2)

    def parts(self) -> tuple[FilteredGains, ...]:
        return _separate(self.gains(), self.alpha_d * self.tau_d, self.alpha_a * self.tau_a)

    def fraction(self) -> Fraction:
        return _fraction(self.kc, self.tau_i, self.parts())


@dataclass(frozen=True)
class HighOrderPID(Controller):
    r"""PID controller with derivatives up to order m and one binomial filter of order n (vrancic2021, eq. (1)).

    .. math:: C(s) = \frac{K_{-1} s^{-1} + K_0 + K_1 s + \dots + K_m s^m}{(1 + T_F s)^n}

    Parameters
    ----------
    gains : sequence of float
        :math:`K_{-1}, K_0, \dots, K_m`, at least two values.
    filter_time : float
        Time constant of the filter, above 0, or 0 if ``filter_order=0``.
    filter_order : int
        Order of the filter, at least m.

    Raises
    ------
    ValueError
        If there are fewer than two gains, the filter order is below m, or the filter time does not match the order.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.HighOrderPID([0.5, 2.0, 1.0, 0.25], filter_time=0.1, filter_order=2)
    >>> C.gains()
    IdealGains(ki=0.5, kp=2.0, kd=1.0, ka=0.25)
    """

    coefficients: tuple[float, ...]
    filter_time: float
    filter_order: int

    def __init__(self, gains: Sequence[float], filter_time: float, filter_order: int) -> None:
        coefficients = _check.vector("gains", gains, minimum_length=2)
        order = _check.order("filter_order", filter_order, at_least=coefficients.size - 2)
        time = _check.real("filter_time", filter_time, at_least=0.0)
        if bool(time) != bool(order):
            raise ValueError(
                f"filter_time must be 0 if filter_order is 0, and above 0 otherwise, found {filter_time!r}"
            )
        vars(self).update(coefficients=tuple(coefficients.tolist()), filter_time=time, filter_order=order)

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller up to the second derivative.

        Returns
        -------
        IdealGains

        Raises
        ------
        ValueError
            If there are derivatives of order 3 or more.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.HighOrderPID([0.5, 2.0], filter_time=0.0, filter_order=0).gains()
        IdealGains(ki=0.5, kp=2.0, kd=0.0, ka=0.0)
        """
        if any(self.coefficients[4:]):
            raise ValueError(f"no PIDA form: derivatives go up to order {len(self.coefficients) - 2}")
        return IdealGains(*(*self.coefficients, 0.0, 0.0)[:4])

    def named_gains(self) -> dict[str, float]:
        r"""Return the gains by name: ``km1`` for :math:`K_{-1}`, ``k0``, ``k1`` and so on.

        Returns
        -------
        dict of str to float

        Examples
        --------
        >>> import pidalab
        >>> pidalab.HighOrderPID([0.5, 2.0, 1.0], filter_time=0.1, filter_order=1).named_gains()
        {'km1': 0.5, 'k0': 2.0, 'k1': 1.0}
        """
        names = ["km1", *(f"k{i}" for i in range(len(self.coefficients) - 1))]
        return dict(zip(names, self.coefficients, strict=True))

    def parts(self) -> tuple[FilteredGains, ...]:
        return (FilteredGains("filtered", self.coefficients, self.filter_time, self.filter_order),)

    def fraction(self) -> Fraction:
        den = np.convolve(binomial(self.filter_time, self.filter_order), [1.0, 0.0])
        return without_common_s(self.coefficients[::-1], den)

    def _scaled(self, factor: float) -> HighOrderPID:
        gains = [factor * gain for gain in self.coefficients]
        return HighOrderPID(gains, self.filter_time, self.filter_order)

    def __repr__(self) -> str:
        return (
            f"HighOrderPID(gains={list(self.coefficients)}, filter_time={self.filter_time}, "
            f"filter_order={self.filter_order})"
        )

    def __str__(self) -> str:
        names = ", ".join(f"K_{k} = {value:.5g}" for k, value in enumerate(self.coefficients, start=-1))
        return super().__str__() if not any(self.coefficients[4:]) else f"{six_digits(repr(self))}\n  {names}"
