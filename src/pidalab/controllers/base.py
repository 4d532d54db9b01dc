"""The base class of controllers, which can be evaluated, multiplied, converted to other forms and discretised."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.forms import FilteredGains, IdealGains
from pidalab.process import Block, fraction_at, quotient

if TYPE_CHECKING:  # Importing python-control is slow, and only transfer functions need it.
    import control

    from pidalab.digital import DigitalController
    from pidalab.plant.vendor import VendorForms

Fraction = tuple[Array, Array]  # numerator and denominator, descending powers of s


class AutomaticReset(NamedTuple):
    """Integral action by positive feedback of the limited control signal through a lag.

    Attributes
    ----------
    time : float
        Time constant of the lag.
    stabiliser : ndarray
        Numerator of the controller without its integral action (the stabilising controller), descending powers of s.
    filter_time, filter_order : float, int
        Time constant and order of the binomial filter of the stabilising controller.
    """

    time: float
    stabiliser: Array
    filter_time: float
    filter_order: int


class Controller(Block):
    """Base class of all controllers.

    A subclass must define `gains`, `parts` and `fraction`. Multiplication by a number scales the attributes listed in
    `proportional`. If none are listed, the subclass must define `_scaled`. Limits are not scaled.
    """

    proportional: tuple[str, ...] = ()
    limits: tuple[float, float] = (-math.inf, math.inf)  # limits of the control signal

    def automatic_reset(self) -> AutomaticReset | None:
        """Return the automatic reset of the controller, or None if an integrator provides the integral action.

        Returns
        -------
        AutomaticReset or None

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
            Transfer function from error to control signal.

        Examples
        --------
        >>> import pidalab
        >>> C = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.0).transfer_function()
        >>> C.den[0][0].round(6).tolist()
        [0.4, 4.0, 0.0]
        """
        import control

        return control.TransferFunction(*self.fraction())

    def _scaled(self, factor: float) -> Any:
        if not self.proportional:
            return super()._scaled(factor)
        return replace(self, **{name: factor * getattr(self, name) for name in self.proportional})  # type: ignore

    def _in_series(self, system: Any) -> control.TransferFunction:
        return self.transfer_function() * system

    def fraction(self) -> Fraction:
        """Return numerator and denominator of the filtered controller, without limits.

        Returns
        -------
        num, den : ndarray
            In descending powers of s. A common factor s, which occurs without integral action, is cancelled.

        Raises
        ------
        TypeError
            If a subclass does not define this method.

        Examples
        --------
        >>> import pidalab
        >>> num, den = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0, ta=0.0).fraction()
        >>> den.round(6).tolist()
        [0.4, 4.0, 0.0]
        >>> num, den = pidalab.HighOrderPID([0.5, 2.0, 1.0], filter_time=0.5, filter_order=1).fraction()
        >>> num.tolist(), den.tolist()
        ([1.0, 2.0, 0.5], [0.5, 1.0, 0.0])
        """
        raise TypeError(f"{type(self).__name__} must define fraction")

    def parts(self) -> tuple[FilteredGains, ...]:
        """Return the parts whose sum is the filtered controller, each with gains and a filter.

        Returns
        -------
        tuple of FilteredGains
            A single part if all gains have the same filter.

        Raises
        ------
        TypeError
            If a subclass does not define this method.

        Examples
        --------
        >>> import pidalab
        >>> [part.name for part in pidalab.PIDA(kp=2.0, ti=4.0, td=1.0).parts()]
        ['proportional', 'derivative']
        >>> pidalab.SeriesPIDA(1.0, 0.0, 0.0, ti=2.0, filter_time=0.1, filter_order=1).parts()[0].gains
        (0.5, 1.0, 0.0, 0.0)
        """
        raise TypeError(f"{type(self).__name__} must define parts")

    def vendor_forms(self, time_unit: str = "s") -> VendorForms:
        """Convert the unfiltered gains to parameters of vendors' controller blocks.

        Parameters
        ----------
        time_unit : {"s", "min", "h"}, optional
            Unit of the model's time.

        Returns
        -------
        VendorForms
            Ideal, series and parallel form, with times in seconds and minutes. If a form does not exist, its entry says
            why.

        Raises
        ------
        ValueError
            If the unit is unknown, or if there are derivatives of order 3 or more.

        Examples
        --------
        >>> import pidalab
        >>> print(pidalab.PIDA(kp=2.0, ti=120.0, td=30.0).vendor_forms("s"))
        ideal:    Kc = 2, Ti [s] = 120, Ti [min] = 2, repeats/min = 0.5, Td [s] = 30, Td [min] = 0.5
        series:   Kc = 1, Ti [s] = 60, Ti [min] = 1, repeats/min = 1, Td [s] = 60, Td [min] = 1
        parallel: Kp = 2, Ki [1/s] = 0.016667, Ki [1/min] = 1, Kd [s] = 60, Kd [min] = 1
        filters:  derivative 3 s
        """
        from pidalab.plant.vendor import vendor_forms

        return vendor_forms(self.gains(), self.parts(), time_unit)

    def discretise(
        self, sample_time: float, method: str = "backward", output_filter: Any = None, **options: Any
    ) -> DigitalController:
        """Return the digital controller for a sample time.

        Parameters
        ----------
        sample_time : float
            Time between samples, above 0.
        method : {"backward", "tustin", "zoh"}, optional
            As in `pidalab.digital.discretise`.
        output_filter : OutputFilter or control.TransferFunction, optional
            As in `pidalab.digital.discretise`.
        **options : optional
            As in `pidalab.digital.discretise`. The default limits are the ``limits`` of the controller plus `bias`. If
            the controller has derivatives but no proportional action, the default anti-windup is "clamping".

        Returns
        -------
        DigitalController
            Digital controller with ``step``, ``c()``, ``structured_text()``, ``python()`` and ``json()``.

        Raises
        ------
        TypeError, ValueError
            If a value is out of its range, the sample time is too long for the method, or the output filter is not a
            chain of equal lags with gain 1.

        Examples
        --------
        >>> import pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0, td=1.0).discretise(0.1, limits=(0.0, 100.0), bias=40.0)
        >>> k.step(r=1.0, y=1.0), k.step(r=1.0, y=0.9)
        (40.0, 41.205)
        """
        from pidalab.digital import discretise

        parts, native, reset = self.parts(), None, self.automatic_reset()
        if reset is not None:
            gains = (0.0, *reset.stabiliser[::-1].tolist())
            native = FilteredGains("stabiliser", gains, reset.filter_time, reset.filter_order), reset.time
        if options.get("limits") is None:
            bias = _check.real("bias", options.get("bias", 0.0))
            options["limits"] = tuple(bias + limit for limit in self.limits)
        proportional = any(any(part.gains[1:2]) for part in parts)
        higher = any(any(part.gains[2:]) for part in parts)
        if reset is None and higher and not proportional:  # back-calculation would need an integral time
            options.setdefault("anti_windup", "clamping")
        behind = "" if output_filter is None else f" and {output_filter!r}"
        options.setdefault("source", repr(self) + behind)
        return discretise(parts, sample_time, method, output_filter=output_filter, reset=native, **options)

    def gains(self) -> IdealGains:
        """Return the gains of the unfiltered controller."""
        raise TypeError(f"{type(self).__name__} must define gains")

    def __call__(self, s: ArrayLike) -> Any:
        """Evaluate the filtered controller at complex s. Raise ValueError on overflow."""
        return quotient(*fraction_at(*self.fraction(), s))

    def __str__(self) -> str:
        lines = [six_digits(repr(self))]
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


def six_digits(text: str) -> str:
    """Find numbers with six or more decimals in a text, and round them to six significant digits."""
    return re.sub(r"\d+\.\d{6,}(e[+-]\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def coerce_floats(controller: Controller, names: Sequence[str], **bounds: float) -> None:
    """Check attributes of a frozen controller and store them as plain floats."""
    for name in names:
        object.__setattr__(controller, name, _check.real(name, getattr(controller, name), **bounds))


def without_common_s(num: ArrayLike, den: ArrayLike) -> Fraction:
    """Return num and den without the common factor s that they have if there is no integral action."""
    num, den = _check.polynomial("gains", num), np.asarray(den, dtype=float)
    return (num[:-1], den[:-1]) if num.size > 1 and num[-1] == 0 else (num, den)
