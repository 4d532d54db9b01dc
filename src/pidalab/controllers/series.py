"""The controller of huba2024, which is a stabilising controller with automatic reset."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers.base import AutomaticReset, Controller, Fraction, coerce_floats, without_common_s
from pidalab.forms import FilteredGains, IdealGains
from pidalab.process import binomial


@dataclass(frozen=True)
class SeriesPIDA(Controller):
    r"""Series PIDA: a filtered PDA controller with automatic reset (huba2024, Fig. 1, eqs. (4), (5), (9)).

    .. math:: C(s) = \frac{k_p + k_d s + k_a s^2}{(T_f s + 1)^n} \cdot \frac{1 + t_i s}{t_i s}

    The PDA controller has proportional, derivative and acceleration action. The automatic reset adds integral action by
    positive feedback of the limited control signal through a lag. Therefore the transfer function holds only within the
    limits. `pidalab.simulate_sampled` and `pidalab.portrait` simulate the reset with the limits.

    Parameters
    ----------
    kp, kd, ka : float
        Gains of the stabilising controller.
    ti : float
        Time constant of the automatic reset, above 0.
    filter_time : float
        Time constant of the filter, above 0.
    filter_order : int
        Order of the filter, not below the order of the highest derivative.
    limits : tuple of float, optional
        Lower and upper limit of the control signal.

    Raises
    ------
    TypeError, ValueError
        If a value is out of its range, or if the limits are not two numbers in order.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.SeriesPIDA(kp=2.0, kd=2.0, ka=0.0, ti=2.0, filter_time=0.1, filter_order=2)
    >>> C.gains()
    IdealGains(ki=1.0, kp=3.0, kd=2.0, ka=0.0)
    """

    proportional = ("kp", "kd", "ka")

    kp: float
    kd: float
    ka: float
    ti: float
    filter_time: float
    filter_order: int
    limits: tuple[float, float] = (-math.inf, math.inf)

    def __post_init__(self) -> None:
        coerce_floats(self, ("kp", "kd", "ka"))
        coerce_floats(self, ("ti", "filter_time"), above=0.0)
        _check.order("filter_order", self.filter_order, at_least=2 if self.ka else 1 if self.kd else 0)
        object.__setattr__(self, "limits", _check.limits(self.limits))

    def gains(self) -> IdealGains:
        """Return the gains of the controller without filter and limits, from eq. (5).

        Returns
        -------
        IdealGains

        Examples
        --------
        >>> import pidalab
        >>> pidalab.SeriesPIDA(1.0, 0.0, 0.0, ti=2.0, filter_time=0.1, filter_order=1).gains()
        IdealGains(ki=0.5, kp=1.0, kd=0.0, ka=0.0)
        """
        kp, kd, ka, ti = self.kp, self.kd, self.ka, self.ti
        return IdealGains(kp / ti, kp + kd / ti, kd + ka / ti, ka)

    def parts(self) -> tuple[FilteredGains, ...]:
        return (FilteredGains("filtered", tuple(self.gains()), self.filter_time, self.filter_order),)

    def fraction(self) -> Fraction:
        den = np.convolve(binomial(self.filter_time, self.filter_order), [self.ti, 0.0])
        return without_common_s(np.convolve([self.ka, self.kd, self.kp], [self.ti, 1.0]), den)

    def automatic_reset(self) -> AutomaticReset:
        """Return the automatic reset, eqs. (3) and (4).

        Returns
        -------
        AutomaticReset

        Examples
        --------
        >>> import pidalab
        >>> C = pidalab.SeriesPIDA(kp=1.0, kd=0.5, ka=0.0, ti=2.0, filter_time=0.1, filter_order=1)
        >>> C.automatic_reset().stabiliser.tolist()
        [0.5, 1.0]
        """
        stabiliser = _check.polynomial("gains", [self.ka, self.kd, self.kp])
        return AutomaticReset(self.ti, stabiliser, self.filter_time, self.filter_order)

    def reset_signal(self, u: ArrayLike, sample_time: float) -> Array:
        """Compute the state of the automatic reset from the limited control signal, eq. (3).

        If an integrating process is at rest, this state equals minus the load.

        Parameters
        ----------
        u : array_like, shape (n,)
            Limited control signal, held from each sample to the next. Before the first sample it rests at 0.
        sample_time : float
            Time between samples, above 0.

        Returns
        -------
        ndarray, shape (n,)
            The state at the samples, exact for a held signal.

        Raises
        ------
        TypeError, ValueError
            If the signal is not a vector of finite numbers, or the sample time is not above 0.

        Examples
        --------
        >>> import pidalab
        >>> C = pidalab.SeriesPIDA(1.0, 0.0, 0.0, ti=2.0, filter_time=0.1, filter_order=1)
        >>> C.reset_signal([1.0, 1.0, 1.0], sample_time=2.0)
        array([0.   , 0.632, 0.865])
        """
        u = _check.vector("u", u)
        new = -math.expm1(-_check.real("sample_time", sample_time, above=0.0) / self.ti)
        from scipy.signal import lfilter

        return np.asarray(lfilter([0.0, new], [1.0, new - 1.0], u))
