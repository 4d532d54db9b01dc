"""Controllers in the forms of the papers, with filters.

Every controller gives its unfiltered gains (`pidalab.forms.IdealGains`), which convert from form to form or say why
they cannot, and prints itself in all forms. Filters carry over only between forms that share their structure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.forms import FilteredGains, IdealGains
from pidalab.process import binomial, quotient

if TYPE_CHECKING:  # only who asks for a transfer function waits for python-control
    import control

    from pidalab.digital import DigitalController
    from pidalab.vendor import VendorForms

Fraction = tuple[Array, Array]  # numerator and denominator, descending powers of s


class AutomaticReset(NamedTuple):
    """Integral action as a lag behind the limited control signal, fed back positively around a stabilising controller.

    Attributes
    ----------
    time : float
        Time constant of the lag.
    stabiliser : ndarray
        Polynomial of the stabilising controller, descending powers of s.
    filter_time, filter_order : float, int
        Its binomial filter.
    """

    time: float
    stabiliser: Array
    filter_time: float
    filter_order: int


class Controller:
    """What all controllers share: evaluation, and printing themselves in every form."""

    limits: tuple[float, float] = (-math.inf, math.inf)  # of the control signal

    def automatic_reset(self) -> AutomaticReset | None:
        """Return the reset that makes the integral action, None where an integrator does.

        Returns
        -------
        AutomaticReset or None
            What a simulation with limits has to run.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.SeriesPIDA(1.0, 0.5, 0.0, ti=2.0, filter_time=0.1, filter_order=1).automatic_reset().time
        2.0
        >>> pidalab.PIDA(kp=1.0, ti=2.0).automatic_reset() is None
        True
        """
        return None

    def transfer_function(self) -> control.TransferFunction:
        """Return the filtered controller as an object of python-control.

        Returns
        -------
        control.TransferFunction
            From error to control; the factors of absent actions are left out.

        Examples
        --------
        >>> import pidalab
        >>> C = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.0).transfer_function()
        >>> C.den[0][0].round(6).tolist()
        [0.4, 4.0, 0.0]
        """
        import control

        return control.TransferFunction(*self.fraction())

    def fraction(self) -> Fraction:
        """Return numerator and denominator of the filtered controller, descending powers of s."""
        raise TypeError(f"{type(self).__name__} must define fraction")

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return the parts whose sum is the filtered controller, each with gains and a filter."""
        raise TypeError(f"{type(self).__name__} must define parts")

    def vendor_forms(self, time_unit: str = "s") -> VendorForms:
        """Return the gains without filters as controllers on the market take them, or say where no form exists.

        Parameters
        ----------
        time_unit : {"s", "min", "h"}, optional
            Unit of the model's time.

        Returns
        -------
        VendorForms
            Ideal, series and parallel form, with times in seconds and minutes.

        Raises
        ------
        ValueError
            For another unit, and for derivatives that no form of a PIDA holds.

        Examples
        --------
        >>> import pidalab
        >>> print(pidalab.PIDA(kp=2.0, ti=120.0).vendor_forms("s"))
        ideal:    Kc = 2, Ti [s] = 120, Ti [min] = 2, repeats/min = 0.5, Td [s] = 0, Td [min] = 0
        series:   Kc = 2, Ti [s] = 120, Ti [min] = 2, repeats/min = 0.5, Td [s] = 0, Td [min] = 0
        parallel: Kp = 2, Ki [1/s] = 0.016667, Ki [1/min] = 1, Kd [s] = 0, Kd [min] = 0
        """
        from pidalab.vendor import vendor_forms

        return vendor_forms(self.gains(), time_unit)

    def discretise(self, sample_time: float, method: str = "backward", **options: Any) -> DigitalController:
        """Return the digital controller for a sample time: difference equations, and the code they write.

        Parameters
        ----------
        sample_time : float
            Time from sample to sample, above 0.
        method : {"backward", "tustin", "zoh"}, optional
            How integral and filters become differences; see `pidalab.digital.discretise`.
        **options : optional
            Weights of the set point, limits, rate limit, anti-windup, deadband, bias and engineering units, as in
            `pidalab.digital.discretise`. Limits of the controller hold unless others are given.

        Returns
        -------
        DigitalController
            With ``step``, ``c()``, ``structured_text()``, ``python()`` and ``json()``.

        Raises
        ------
        TypeError, ValueError
            For a value outside its range, and for a sample time with which the method is of no use.

        Examples
        --------
        >>> import pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0).discretise(0.1, limits=(0.0, 100.0), bias=40.0)
        >>> k.step(r=1.0, y=1.0), k.step(r=1.0, y=0.9)
        (40.0, 41.205)
        """
        from pidalab.digital import discretise

        native, reset = None, self.automatic_reset()
        if reset is not None:
            gains = (0.0, *reset.stabiliser[::-1].tolist())
            native = FilteredGains("stabiliser", gains, reset.filter_time, reset.filter_order), reset.time
        if options.get("limits") is None:
            bias, span = (
                _check.real(name, options.get(name, usual)) for name, usual in (("bias", 0), ("u_span", 1))
            )
            options["limits"] = tuple(bias + span * limit for limit in self.limits)
        options.setdefault("source", repr(self))
        return discretise(self.parts(), sample_time, method, reset=native, **options)

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller."""
        raise TypeError(f"{type(self).__name__} must define gains")

    def __call__(self, s: ArrayLike) -> Any:
        """Evaluate the filtered controller at complex s."""
        num, den = self.fraction()
        at = _check.complex_array("s", s)
        return quotient(np.polyval(num, at), np.polyval(den, at))

    def __str__(self) -> str:
        lines = [repr(self)]
        gains = self.gains()
        for name, form in (
            ("standard", gains.standard),
            ("parallel", lambda: gains),
            ("non-interactive", gains.non_interactive),
            ("series", gains.series),
        ):
            try:
                text = ", ".join(f"{key} = {value:.5g}" for key, value in form()._asdict().items())
            except ValueError as reason:
                text = str(reason)
            lines.append(f"  {name + ':':17}{text}")
        return "\n".join(lines)


def _store(controller: Controller, names: Sequence[str], **bounds: float) -> None:
    """Check attributes of a frozen controller and store them as plain floats."""
    for name in names:
        object.__setattr__(controller, name, _check.real(name, getattr(controller, name), **bounds))


def _separate(
    gains: IdealGains, derivative_filter: float, acceleration_filter: float
) -> tuple[FilteredGains, ...]:
    """Return parts of which each derivative has a filter of its own, without absent ones."""
    ki, kp, kd, ka = gains
    parts = [FilteredGains("proportional", (ki, kp))]
    if kd:
        parts.append(FilteredGains("derivative", (0.0, 0.0, kd), derivative_filter, 1))
    if ka:
        parts.append(FilteredGains("acceleration", (0.0, 0.0, 0.0, ka), acceleration_filter, 2))
    return tuple(parts)


def _without_common_s(num: ArrayLike, den: ArrayLike) -> Fraction:
    """Return num/den; without integral action both end in a zero, and the common s is dropped."""
    num, den = _check.polynomial("gains", num), np.asarray(den, dtype=float)
    return (num[:-1], den[:-1]) if num.size > 1 and num[-1] == 0 else (num, den)


def _sum(terms: Sequence[tuple[list[float], list[float] | _check.Array]]) -> Fraction:
    """Add fractions num/den that share no factor worth cancelling."""
    num: Any = np.zeros(1)
    den: Any = np.ones(1)
    for n, d in terms:
        num = np.polyadd(np.convolve(num, np.array(d)), np.convolve(np.array(n), den))
        den = np.convolve(den, np.array(d))
    return _check.polynomial("num", num), den


@dataclass(frozen=True)
class PIDA(Controller):
    r"""PIDA controller in standard form with separate filters (haalman2024, eq. (2)).

    .. math:: C(s) = k_p \left(1 + \frac{1}{t_i s} + \frac{t_d s}{\frac{t_d}{n} s + 1}
              + \frac{t_a s^2}{\left(\frac{t_a}{m} s + 1\right)^2}\right)

    With ``ta = 0`` it is a PID, with ``td = ta = 0`` a PI controller. On a process of first order the filtered
    acceleration makes a hump of \\|L\\| of about kp m/2 (unit gain and lag) at m/ta, far above the crossover: look at
    `pidalab.margins`, which see it.

    ============  =======================
    haalman2024   argument
    ============  =======================
    K_p           `kp`
    T_i           `ti`
    T_d           `td`
    T_a           `ta`
    N             `n`
    M             `m`
    ============  =======================

    Parameters
    ----------
    kp : float
        Proportional gain, in units of u per unit of y; not 0.
    ti : float
        Integral time, above 0; ``math.inf`` for no integral action.
    td : float, optional
        Derivative time, not negative; default 0.
    ta : float, optional
        Acceleration time constant, in squared time units; not negative; default 0.
    n, m : float, optional
        Ratio of `td` and of `ta` to their filters' time constants, above 0. As printed in the paper, ``ta/m`` is used
        as a time although `ta` is a time squared; so `m` has the unit of time, and 10 belongs to one near the lags.

    Raises
    ------
    ValueError
        For a value outside the range above.

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

    kp: float
    ti: float
    td: float = 0.0
    ta: float = 0.0
    n: float = 10
    m: float = 10

    def __post_init__(self) -> None:
        _store(self, ("kp",))
        _store(self, ("n", "m") if self.ti == math.inf else ("ti", "n", "m"), above=0.0)
        _store(self, ("td", "ta"), at_least=0.0)
        if self.kp == 0:
            raise ValueError("kp must not be 0, found 0")

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller, eq. (1).

        Returns
        -------
        IdealGains
            ki, kp, kd, ka.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.5).gains()
        IdealGains(ki=0.5, kp=2.0, kd=2.0, ka=1.0)
        """
        return IdealGains(self.kp / self.ti, self.kp, self.kp * self.td, self.kp * self.ta)

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return proportional and integral part, and the filtered derivatives, eq. (2).

        Returns
        -------
        tuple of FilteredGains
            Without absent actions.

        Examples
        --------
        >>> import pidalab
        >>> [part.name for part in pidalab.PIDA(kp=2.0, ti=4.0, td=1.0).parts()]
        ['proportional', 'derivative']
        """
        return _separate(self.gains(), self.td / self.n, self.ta / self.m)

    def fraction(self) -> Fraction:
        """Return the filtered controller, eq. (2).

        Returns
        -------
        num, den : ndarray
            Descending powers of s; the factors of absent actions are left out.

        Examples
        --------
        >>> import pidalab
        >>> num, den = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.0).fraction()
        >>> den.round(6).tolist()
        [0.4, 4.0, 0.0]
        """
        ki, kp, kd, ka = self.gains()
        terms: list[tuple[list[float], list[float] | _check.Array]] = [([kp], [1.0])]
        if ki:
            terms.append(([kp], [self.ti, 0.0]))
        if kd:
            terms.append(([kd, 0.0], binomial(self.td / self.n, 1)))
        if ka:
            terms.append(([ka, 0.0, 0.0], binomial(self.ta / self.m, 2)))
        return _sum(terms)


@dataclass(frozen=True)
class NonInteractivePIDA(Controller):
    r"""PIDA controller whose acceleration time has the unit of a time (heo2023, eq. (16)).

    .. math:: C(s) = k_c \left(1 + \frac{1}{\tau_i s} + \frac{\tau_d s}{\alpha_d \tau_d s + 1}
              + \frac{\tau_a^2 s^2}{2 (\alpha_a \tau_a s + 1)^2}\right)

    Parameters
    ----------
    kc : float
        Proportional gain; not 0.
    tau_i : float
        Integral time, above 0.
    tau_d, tau_a : float
        Derivative and acceleration time, not negative.
    alpha_d, alpha_a : float, optional
        Filter time constants as a share of `tau_d` and `tau_a`, above 0.

    Raises
    ------
    ValueError
        For a value outside the range above.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.NonInteractivePIDA(kc=2.0, tau_i=4.0, tau_d=1.0, tau_a=1.0)
    >>> C.gains()
    IdealGains(ki=0.5, kp=2.0, kd=2.0, ka=1.0)
    >>> print(f"{abs(C(1e9j)) / 2.0:.1f}")
    821.0
    """

    kc: float
    tau_i: float
    tau_d: float
    tau_a: float
    alpha_d: float = 0.05
    alpha_a: float = 0.025

    def __post_init__(self) -> None:
        _store(self, ("kc",))
        _store(self, ("tau_i", "alpha_d", "alpha_a"), above=0.0)
        _store(self, ("tau_d", "tau_a"), at_least=0.0)
        if self.kc == 0:
            raise ValueError("kc must not be 0, found 0")

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller, eq. (6).

        Returns
        -------
        IdealGains
            ki, kp, kd, ka.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.NonInteractivePIDA(kc=1.0, tau_i=2.0, tau_d=0.5, tau_a=2.0).gains()
        IdealGains(ki=0.5, kp=1.0, kd=0.5, ka=2.0)
        """
        return IdealGains(self.kc / self.tau_i, self.kc, self.kc * self.tau_d, self.kc * self.tau_a**2 / 2)

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return proportional and integral part, and the filtered derivatives, eq. (16).

        Returns
        -------
        tuple of FilteredGains
            Without absent actions.

        Examples
        --------
        >>> import pidalab
        >>> [part.name for part in pidalab.NonInteractivePIDA(1.0, 2.0, 0.0, 1.0).parts()]
        ['proportional', 'acceleration']
        """
        return _separate(self.gains(), self.alpha_d * self.tau_d, self.alpha_a * self.tau_a)

    def fraction(self) -> Fraction:
        """Return the filtered controller, eq. (16).

        Returns
        -------
        num, den : ndarray
            Descending powers of s; the factors of absent actions are left out.

        Examples
        --------
        >>> import pidalab
        >>> num, den = pidalab.NonInteractivePIDA(kc=1.0, tau_i=2.0, tau_d=0.0, tau_a=0.0).fraction()
        >>> num.tolist(), den.tolist()
        ([2.0, 1.0], [2.0, 0.0])
        """
        _, kc, kd, ka = self.gains()
        terms: list[tuple[list[float], list[float] | _check.Array]] = [
            ([kc], [1.0]),
            ([kc], [self.tau_i, 0.0]),
        ]
        if kd:
            terms.append(([kd, 0.0], binomial(self.alpha_d * self.tau_d, 1)))
        if ka:
            terms.append(([ka, 0.0, 0.0], binomial(self.alpha_a * self.tau_a, 2)))
        return _sum(terms)


@dataclass(frozen=True)
class HighOrderPID(Controller):
    r"""PID with derivatives up to order m behind one binomial filter of order n (vrancic2021, eq. (1)).

    .. math:: C(s) = \frac{K_{-1} s^{-1} + K_0 + K_1 s + \dots + K_m s^m}{(1 + T_F s)^n}

    Parameters
    ----------
    gains : sequence of float
        :math:`K_{-1}, K_0, \dots, K_m`; at least two values.
    filter_time : float
        Time constant of the filter, above 0; with ``filter_order=0`` it is 0.
    filter_order : int
        Order of the filter, at least m.

    Raises
    ------
    ValueError
        For fewer than two gains, a filter order below m, a filter time that is not positive, and one without filter.

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
        order = _check.integer("filter_order", filter_order, at_least=coefficients.size - 2)
        time = _check.real("filter_time", filter_time, at_least=0.0)
        if order and not time:
            raise ValueError(
                f"filter_time must be above 0 for a filter of order {order}, found {filter_time!r}"
            )
        if time and not order:
            raise ValueError(
                f"filter_time must be 0 without a filter (filter_order=0), found {filter_time!r}"
            )
        object.__setattr__(self, "coefficients", tuple(coefficients.tolist()))
        object.__setattr__(self, "filter_time", time)
        object.__setattr__(self, "filter_order", order)

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller up to the second derivative.

        Returns
        -------
        IdealGains
            ki, kp, kd, ka.

        Raises
        ------
        ValueError
            For derivatives of order 3 or more, which no PIDA form holds.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.HighOrderPID([0.5, 2.0], filter_time=0.0, filter_order=0).gains()
        IdealGains(ki=0.5, kp=2.0, kd=0.0, ka=0.0)
        """
        if any(self.coefficients[4:]):
            raise ValueError(
                f"no PIDA form: the controller has derivatives up to order {len(self.coefficients) - 2}"
            )
        return IdealGains(*(*self.coefficients, 0.0, 0.0)[:4])

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return the controller as it is: one filter for all gains, eq. (1).

        Returns
        -------
        tuple of FilteredGains
            One.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.HighOrderPID([0.5, 2.0], filter_time=0.1, filter_order=1).parts()[0].gains
        (0.5, 2.0)
        """
        return (FilteredGains("filtered", self.coefficients, self.filter_time, self.filter_order),)

    def fraction(self) -> Fraction:
        """Return the filtered controller, eq. (1).

        Returns
        -------
        num, den : ndarray
            Descending powers of s.

        Examples
        --------
        >>> import pidalab
        >>> num, den = pidalab.HighOrderPID([0.5, 2.0, 1.0], filter_time=0.5, filter_order=1).fraction()
        >>> num.tolist(), den.tolist()
        ([1.0, 2.0, 0.5], [0.5, 1.0, 0.0])
        """
        den = np.convolve(binomial(self.filter_time, self.filter_order), [1.0, 0.0])
        return _without_common_s(self.coefficients[::-1], den)

    def __repr__(self) -> str:
        return (
            f"HighOrderPID(gains={list(self.coefficients)}, filter_time={self.filter_time}, "
            f"filter_order={self.filter_order})"
        )

    def __str__(self) -> str:
        names = ", ".join(f"K_{k} = {value:.5g}" for k, value in enumerate(self.coefficients, start=-1))
        return super().__str__() if not any(self.coefficients[4:]) else f"{self!r}\n  {names}"


@dataclass(frozen=True)
class SeriesPIDA(Controller):
    r"""Series PIDA: a filtered PDA controller with automatic reset (huba2024, Fig. 1, eqs. (4), (5), (9)).

    .. math:: C(s) = \frac{k_p + k_d s + k_a s^2}{(T_f s + 1)^n} \cdot \frac{1 + t_i s}{t_i s}

    The reset is positive feedback of the limited control signal, so the linear transfer function holds while the limits
    are not reached. `pidalab.simulate_sampled` and `pidalab.portrait` run the reset itself, with its limits.

    Parameters
    ----------
    kp, kd, ka : float
        Gains of the stabilising controller.
    ti : float
        Time constant of the automatic reset, above 0.
    filter_time : float
        Time constant of the filter, above 0.
    filter_order : int
        Order of the filter, at least that of the highest derivative.
    limits : tuple of float, optional
        Lower and upper limit of the control signal.

    Raises
    ------
    TypeError, ValueError
        For a value outside the range above, and limits that are not two numbers in order.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.SeriesPIDA(kp=2.0, kd=2.0, ka=0.0, ti=2.0, filter_time=0.1, filter_order=2)
    >>> C.gains()
    IdealGains(ki=1.0, kp=3.0, kd=2.0, ka=0.0)
    """

    kp: float
    kd: float
    ka: float
    ti: float
    filter_time: float
    filter_order: int
    limits: tuple[float, float] = (-math.inf, math.inf)

    def __post_init__(self) -> None:
        _store(self, ("kp", "kd", "ka"))
        _store(self, ("ti", "filter_time"), above=0.0)
        _check.integer("filter_order", self.filter_order, at_least=2 if self.ka else 1 if self.kd else 0)
        object.__setattr__(self, "limits", _check.limits(self.limits))

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered, unlimited controller, eq. (5) multiplied out.

        Returns
        -------
        IdealGains
            ki, kp, kd, ka.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.SeriesPIDA(1.0, 0.0, 0.0, ti=2.0, filter_time=0.1, filter_order=1).gains()
        IdealGains(ki=0.5, kp=1.0, kd=0.0, ka=0.0)
        """
        return IdealGains(
            self.kp / self.ti, self.kp + self.kd / self.ti, self.kd + self.ka / self.ti, self.ka
        )

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return the controller between its limits, eq. (5) multiplied out: one filter for all gains.

        Returns
        -------
        tuple of FilteredGains
            One.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.SeriesPIDA(1.0, 0.0, 0.0, ti=2.0, filter_time=0.1, filter_order=1).parts()[0].gains
        (0.5, 1.0, 0.0, 0.0)
        """
        return (FilteredGains("filtered", tuple(self.gains()), self.filter_time, self.filter_order),)

    def fraction(self) -> Fraction:
        """Return the filtered controller between its limits.

        Returns
        -------
        num, den : ndarray
            Descending powers of s.

        Examples
        --------
        >>> import pidalab
        >>> num, den = pidalab.SeriesPIDA(2.0, 0.0, 0.0, ti=4.0, filter_time=0.5, filter_order=1).fraction()
        >>> num.tolist(), den.tolist()
        ([8.0, 2.0], [2.0, 4.0, 0.0])
        """
        den = np.convolve(binomial(self.filter_time, self.filter_order), [self.ti, 0.0])
        return _without_common_s(np.convolve([self.ka, self.kd, self.kp], [self.ti, 1.0]), den)

    def automatic_reset(self) -> AutomaticReset:
        """Return the reset: eqs. (3) and (4).

        Returns
        -------
        AutomaticReset
            Of time constant ti around the PDA controller.

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
        """State of the automatic reset, a lag behind the limited control signal: eq. (3).

        With an integrating process at rest it is the load with its sign changed, so its negative estimates the load.

        Parameters
        ----------
        u : array_like, shape (n,)
            Limited control signal, held from each sample to the next; it rests at 0 before the first.
        sample_time : float
            Time from sample to sample, above 0.

        Returns
        -------
        ndarray, shape (n,)
            The state at the samples, without error for a held signal.

        Raises
        ------
        TypeError, ValueError
            For a signal that is not a vector of finite numbers, and a sample time that is not above 0.

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
