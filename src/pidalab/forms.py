"""Gains of unfiltered PIDA controllers in the forms of the papers, and the conversions between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pidalab.roots import roots


class StandardForm(NamedTuple):
    """Standard form kp (1 + 1/(ti s) + td s + ta s^2), haalman2024 eq. (1)."""

    kp: float
    ti: float
    td: float
    ta: float


class NonInteractiveForm(NamedTuple):
    """Non-interactive form kc (1 + 1/(tau_i s) + tau_d s + tau_a^2/2 s^2), heo2023 eq. (6)."""

    kc: float
    tau_i: float
    tau_d: float
    tau_a: float


class SeriesForm(NamedTuple):
    """Series form (kp + kd s + ka s^2) (1 + ti s)/(ti s), huba2024 eq. (5)."""

    kp: float
    kd: float
    ka: float
    ti: float


class FilteredGains(NamedTuple):
    r"""Part of a controller: a weighted sum of the error, its integral and its derivatives, filtered by equal lags.

    A controller is the sum of its parts.

    .. math:: \frac{K_{-1} s^{-1} + K_0 + K_1 s + \dots}{(1 + T_F s)^n}

    Attributes
    ----------
    name : str
        Name of the part in generated code.
    gains : tuple of float
        :math:`K_{-1}, K_0, K_1, \dots`
    filter_time, filter_order : float, int
        Time constant and number of the lags.
    """

    name: str
    gains: tuple[float, ...]
    filter_time: float = 0.0
    filter_order: int = 0


class IdealGains(NamedTuple):
    """Parallel form ki/s + kp + kd s + ka s^2 without filters, which converts to all other forms.

    Examples
    --------
    >>> from pidalab.forms import IdealGains
    >>> IdealGains(ki=0.5, kp=2.0, kd=1.0, ka=0.25).standard()
    StandardForm(kp=2.0, ti=4.0, td=0.5, ta=0.125)
    """

    ki: float
    kp: float
    kd: float
    ka: float

    def standard(self) -> StandardForm:
        """Return kp, ti, td, ta.

        Returns
        -------
        StandardForm
            The form. ``ti`` is infinite if there is no integral action.

        Raises
        ------
        ValueError
            If there is no proportional action.

        Examples
        --------
        >>> from pidalab.forms import IdealGains
        >>> IdealGains(ki=1.0, kp=0.0, kd=0.0, ka=0.0).standard()
        Traceback (most recent call last):
        ...
        ValueError: no standard form: kp is 0, so ti = kp/ki and td = kd/kp do not exist
        """
        if self.kp == 0:
            raise ValueError("no standard form: kp is 0, so ti = kp/ki and td = kd/kp do not exist")
        ti = self.kp / self.ki if self.ki else math.inf
        return StandardForm(self.kp, ti, self.kd / self.kp, self.ka / self.kp)

    def non_interactive(self) -> NonInteractiveForm:
        """Return kc, tau_i, tau_d, tau_a with the acceleration term kc tau_a^2/2 s^2.

        Returns
        -------
        NonInteractiveForm
            The gains, with tau_a = sqrt(2 ta).

        Raises
        ------
        ValueError
            If kp is 0, or if ka and kp have opposite signs.

        Examples
        --------
        >>> from pidalab.forms import IdealGains
        >>> IdealGains(ki=0.5, kp=2.0, kd=1.0, ka=0.25).non_interactive()
        NonInteractiveForm(kc=2.0, tau_i=4.0, tau_d=0.5, tau_a=0.5)
        """
        kp, ti, td, ta = self.standard()
        if ta < 0:
            raise ValueError(f"no non-interactive form: tau_a^2 = 2 ta = {2 * ta:.4g} is negative")
        return NonInteractiveForm(kp, ti, td, math.sqrt(2 * ta))

    def series(self) -> SeriesForm:
        """Return the series form, which automatic reset uses, with the largest possible ti.

        Returns
        -------
        SeriesForm
            The factors (kp + kd s + ka s^2) and (1 + ti s)/(ti s).

        Raises
        ------
        ValueError
            If there is no integral action, or if the numerator has no zero on the negative real axis (as for a PID
            controller with ti < 4 td).

        Examples
        --------
        >>> from pidalab.forms import IdealGains
        >>> IdealGains(ki=1.0, kp=3.0, kd=2.0, ka=0.0).series()
        SeriesForm(kp=2.0, kd=2.0, ka=0.0, ti=2.0)
        >>> IdealGains(ki=1.0, kp=1.0, kd=1.0, ka=0.0).series()
        Traceback (most recent call last):
        ...
        ValueError: no series form: no zero is real and negative (a PID needs ti >= 4 td)
        """
        if self.ki == 0:
            raise ValueError("no series form: there is no integral action to factor out")
        zeros = roots([self.ka, self.kd, self.kp, self.ki])
        real = zeros.real[(np.abs(zeros.imag) < 1e-7 * np.abs(zeros)) & (zeros.real < 0)]
        if real.size == 0:
            raise ValueError("no series form: no zero is real and negative (a PID needs ti >= 4 td)")
        ti = -1 / float(real.max())
        kd = self.kd - self.ka / ti
        return SeriesForm(self.ki * ti, kd if abs(kd) > 1e-12 * abs(self.kd) else 0.0, self.ka, ti)
