"""Processes, which consist of a rational transfer function and a dead time in series."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check


def of_control(system: Any) -> bool:
    """Return True for a system of python-control, without importing python-control."""
    return type(system).__name__ in ("TransferFunction", "StateSpace") and type(system).__module__.startswith(
        "control"
    )


class Block:
    """Base class of processes and controllers, for ``2 * block``, ``block / 2``, ``-block`` and products.

    The other factor of a product is a number or a system of python-control.
    """

    __array_ufunc__ = None  # makes numpy leave products to this class

    def _scaled(self, factor: float) -> Any:
        """Return the block with its gain multiplied by a factor."""
        raise TypeError(f"{type(self).__name__} must define _scaled to be multiplied by a number")

    def _in_series(self, system: Any) -> Any:
        """Return the product with a system of python-control."""
        raise TypeError(f"{type(self).__name__} must define _in_series to be multiplied by {system!r}")

    def __mul__(self, other: Any) -> Any:
        if of_control(other):
            return self._in_series(other)
        if isinstance(other, (int, float, np.integer, np.floating)):
            return self._scaled(_check.real("the factor", other))
        hint = "; to connect process and controller, use pidalab.Loop(process, controller)"
        raise TypeError(
            f"a {type(self).__name__} can be multiplied by a number or a system of python-control, found "
            f"{type(other).__name__}{hint if isinstance(other, Block) else ''}"
        )

    __rmul__ = __mul__  # the order does not matter for one input and one output

    def __truediv__(self, divisor: float) -> Any:
        divisor = _check.real("the divisor", divisor)
        if divisor == 0:
            raise ValueError("the divisor must not be 0, found 0")
        return self._scaled(1 / divisor)

    def __neg__(self) -> Any:
        return self._scaled(-1.0)


if TYPE_CHECKING:  # Importing python-control is slow, so it is imported only when it is used.
    import control


SHORTEST_TIME = 1e-150  # its square does not underflow


class Process(Block):
    r"""A single-input, single-output process :math:`P(s) = \frac{b(s)}{a(s)} e^{-s\,\mathrm{delay}}`.

    Parameters
    ----------
    num, den : array_like, shape (k,)
        Coefficients of :math:`b` and :math:`a` in descending powers of s, as for ``control.tf``.
        The degree of `num` must not exceed that of `den`.
    delay : float, optional
        Dead time, which is never approximated. It must be 0 or at least 1e-150.

    Raises
    ------
    TypeError
        If a python-control system is given instead of coefficients (use `from_control`).
    ValueError
        If the rational part is improper, the denominator is zero, the dead time is negative, or a number is not finite.

    Examples
    --------
    >>> import pidalab
    >>> P = pidalab.Process([1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    >>> P
    Process(num=[1], den=[0.905, 3.159, 3.37, 1], delay=0.826)
    >>> complex(P(1j * 0.0))
    (1+0j)

    A product is a series connection, without cancellation:

    >>> 2 * pidalab.ipdt(1.0, delay=0.5) * pidalab.fopdt(1.0, lag=3.0, delay=1.0)
    Process(num=[2], den=[3, 1, 0], delay=1.5)
    """

    def __init__(self, num: ArrayLike, den: ArrayLike, delay: float = 0.0) -> None:
        if of_control(num):
            raise TypeError(
                "num must be coefficients; for a python-control system use Process.from_control(sys, delay)"
            )
        self.num = _check.polynomial("num", num)
        self.den = _check.polynomial("den", den)
        self.delay = _check.real("delay", delay, at_least=0.0)
        if 0 < self.delay < SHORTEST_TIME:
            raise ValueError(f"delay must be 0, or at least {SHORTEST_TIME:g}, found {delay:g}")
        _check.proper("the process", self.num, self.den)
        self.num.setflags(write=False)
        self.den.setflags(write=False)

    def __setattr__(self, name: str, value: Any) -> None:
        if hasattr(self, name):
            raise AttributeError(f"a Process cannot be changed; make a new one with another {name}")
        super().__setattr__(name, value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Process) and repr(self._key()) == repr(other._key())

    def __hash__(self) -> int:
        return hash(repr(self._key()))

    def _key(self) -> tuple[list[float], list[float], float]:
        return self.num.tolist(), self.den.tolist(), self.delay

    @classmethod
    def from_control(cls, sys: control.TransferFunction, delay: float = 0.0) -> Process:
        """Make a process from a transfer function of python-control and a dead time.

        Parameters
        ----------
        sys : control.TransferFunction
            Continuous-time, proper transfer function with one input and one output.
        delay : float, optional
            Dead time, not negative.

        Returns
        -------
        Process

        Raises
        ------
        TypeError, ValueError
            If the system has another type, several inputs or outputs, or discrete time.

        Examples
        --------
        >>> import control, pidalab
        >>> pidalab.Process.from_control(control.tf([2], [3, 1]), delay=0.5)
        Process(num=[2], den=[3, 1], delay=0.5)
        """
        num, den = rational("sys", sys)
        return cls(num, den, delay)

    def _scaled(self, factor: float) -> Process:
        return Process(factor * self.num, self.den, self.delay)

    def _in_series(self, system: Any) -> Process:
        num, den = rational("the factor", system)
        return Process(np.convolve(self.num, num), np.convolve(self.den, den), self.delay)

    def __mul__(self, other: Any) -> Process:
        if isinstance(other, Process):
            product = np.convolve(self.num, other.num), np.convolve(self.den, other.den)
            return Process(*product, self.delay + other.delay)
        return super().__mul__(other)

    __rmul__ = __mul__

    def __call__(self, s: ArrayLike) -> Any:
        """Evaluate P at complex s with the exact dead time. Raise ValueError on overflow."""
        return quotient(*fraction_at(self.num, self.den, s, self.delay))

    def rational_part(self) -> control.TransferFunction:
        """Return the process without its dead time.

        Returns
        -------
        control.TransferFunction
            The rational part b(s)/a(s).

        Examples
        --------
        >>> import pidalab
        >>> pidalab.fopdt(gain=2.0, lag=3.0, delay=0.5).rational_part().den[0][0].tolist()
        [3.0, 1.0]
        """
        import control

        return control.TransferFunction(self.num, self.den)

    def gain(self) -> float:
        """Return the static gain P(0).

        Returns
        -------
        float
            P(0) after cancelling common factors s. It is plus or minus infinity for an integrating process.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.lags(order=4, gain=2.0).gain()
        2.0
        """
        return static_gain(self.num, self.den)

    def __repr__(self) -> str:
        num, den = (", ".join(f"{c:.10g}" for c in p) for p in (self.num, self.den))
        return f"Process(num=[{num}], den=[{den}], delay={self.delay:.10g})"


def fraction_at(num: _check.Array, den: _check.Array, s: ArrayLike, delay: float = 0.0) -> tuple[Any, Any]:
    """Return num exp(-s delay) and den at complex s. Raise ValueError on overflow."""
    points = _check.complex_array("s", s)
    try:
        with np.errstate(over="raise", invalid="raise"):
            return np.polyval(num, points) * np.exp(-points * delay), np.polyval(den, points)
    except FloatingPointError:
        largest = points.flat[
            np.argmax(np.abs(points / 2))
        ]  # the factor 1/2 prevents overflow of the modulus
        raise ValueError(f"s must be smaller, since the values overflow, found {largest:.3g}") from None


def quotient(num: Any, den: Any) -> Any:
    """Return num/den, which is infinite at a pole and NaN if both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(den == 0, np.where(num == 0, np.nan, np.inf), num / den)[()]


def static_gain(num: _check.Array, den: _check.Array) -> float:
    """Return the limit of num/den as s decreases to 0. With integrators it is plus or minus infinity."""
    if not num.any():
        return 0.0
    zeros, poles = (next(i for i, x in enumerate(p[::-1].tolist()) if x) for p in (num, den))
    ratio = float(num[-1 - zeros] / den[-1 - poles])
    return 0.0 if zeros > poles else math.copysign(math.inf, ratio) if poles > zeros else ratio


def binomial(lag: float, order: int) -> _check.Array:
    """Return the polynomial (lag s + 1)^order."""
    factor = np.array([lag, 1.0])
    polynomial = factor if order else np.ones(1)
    for _ in range(order - 1):
        polynomial = np.convolve(polynomial, factor)
    return polynomial


def rational(name: str, system: Any) -> tuple[_check.Array, _check.Array]:
    """Return (num, den) of a number, a controller or a proper continuous SISO transfer function of python-control."""
    if hasattr(system, "fraction"):
        num, den = system.fraction()
    elif of_control(system):
        if type(system).__name__ == "StateSpace":
            raise TypeError(f"{name} must be a transfer function; convert a StateSpace with control.tf")
        if system.ninputs != 1 or system.noutputs != 1:
            raise ValueError(
                f"{name} must have one input and output, found {system.ninputs} and {system.noutputs}"
            )
        if system.isdtime(strict=True):
            raise ValueError(f"{name} must be continuous in time, found sample time {system.dt}")
        num, den = system.num[0][0], system.den[0][0]
    elif isinstance(system, (int, float, np.floating, np.integer)) and not isinstance(system, bool):
        num, den = [system], [1.0]
    else:
        raise TypeError(
            f"{name} must be a number, a controller or a transfer function, found {type(system).__name__}"
        )
    num, den = _check.polynomial(f"{name}.num", num), _check.polynomial(f"{name}.den", den)
    _check.proper(name, num, den)
    return num, den


def require_process(name: str, value: Any) -> None:
    """Raise unless `value` is a Process."""
    if not isinstance(value, Process):
        hint = _check.carrier(value, Process)
        raise TypeError(f"{name} must be a pidalab.Process, found {type(value).__name__}{hint}")


def require_no_zero_at_origin(name: str, value: Any) -> None:
    """Raise unless `value` is a Process without a zero at the origin."""
    require_process(name, value)
    if value.num[-1] == 0:
        raise ValueError(f"{name} must have a static gain other than 0, or an integrator, found {value!r}")


def sign_of_gain(process: Process) -> float:
    """Return the sign that the gains of a controller need for stable integral action."""
    return math.copysign(1.0, process.num[-1]) * math.copysign(1.0, process.den[0])


def fopdt(gain: float, lag: float, delay: float) -> Process:
    r"""Return a first-order process with dead time, :math:`\frac{gain}{lag\,s + 1} e^{-s\,delay}`.

    Parameters
    ----------
    gain : float
        Static gain.
    lag : float
        Time constant, above 0.
    delay : float
        Dead time, not negative.

    Returns
    -------
    Process

    Raises
    ------
    ValueError
        If the lag is not positive or the dead time is negative.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.fopdt(gain=2.0, lag=3.0, delay=0.5)
    Process(num=[2], den=[3, 1], delay=0.5)
    """
    return Process([_check.real("gain", gain)], [_check.real("lag", lag, above=0.0), 1.0], delay)


def sopdt(gain: float, tau: float, damping: float, delay: float) -> Process:
    r"""Return a second-order process, :math:`\frac{gain}{tau^2 s^2 + 2\,damping\,tau\,s + 1} e^{-s\,delay}`.

    Parameters
    ----------
    gain : float
        Static gain.
    tau : float
        Time constant, above 0.
    damping : float
        Damping ratio, at least 0. Above 1 the poles are real.
    delay : float
        Dead time, not negative.

    Returns
    -------
    Process

    Raises
    ------
    ValueError
        If the time constant is not positive, or if damping or dead time is negative.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.sopdt(gain=1.0, tau=2.0, damping=0.5, delay=1.0)
    Process(num=[1], den=[4, 2, 1], delay=1)
    """
    tau = _check.real("tau", tau, above=0.0)
    if not SHORTEST_TIME < tau < 1 / SHORTEST_TIME:
        raise ValueError(f"tau must be from {SHORTEST_TIME:g} to {1 / SHORTEST_TIME:g}, found {tau:g}")
    damping = _check.real("damping", damping, at_least=0.0)
    return Process([_check.real("gain", gain)], [tau**2, 2 * damping * tau, 1.0], delay)


def ipdt(gain: float, delay: float) -> Process:
    r"""Return an integrator with dead time, :math:`\frac{gain}{s} e^{-s\,delay}`.

    Parameters
    ----------
    gain : float
        Velocity gain: slope of the output (change per time unit) divided by the constant input.
    delay : float
        Dead time, not negative.

    Returns
    -------
    Process

    Raises
    ------
    ValueError
        If the dead time is negative.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.ipdt(gain=0.5, delay=1.0)
    Process(num=[0.5], den=[1, 0], delay=1)
    """
    return Process([_check.real("gain", gain)], [1.0, 0.0], delay)


def lags(order: int, lag: float = 1.0, gain: float = 1.0, delay: float = 0.0) -> Process:
    r"""Return a chain of equal lags, :math:`\frac{gain}{(lag\,s + 1)^{order}} e^{-s\,delay}`.

    Parameters
    ----------
    order : int
        Number of lags, at least 1.
    lag : float, optional
        Time constant of each lag, above 0.
    gain : float, optional
        Static gain.
    delay : float, optional
        Dead time, not negative.

    Returns
    -------
    Process

    Raises
    ------
    ValueError
        If the order is below 1, the lag is not positive, or the dead time is negative.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.lags(order=4)
    Process(num=[1], den=[1, 4, 6, 4, 1], delay=0)
    """
    order, lag = _check.order("order", order, at_least=1), _check.real("lag", lag, above=0.0)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        den = binomial(lag, order)
    if not (np.all(np.isfinite(den)) and np.all(den)):
        raise ValueError(f"(lag s + 1)^order overflows for lag = {lag:g} and order = {order}")
    return Process([_check.real("gain", gain)], den, delay)


@dataclass(frozen=True)
class AsymmetricPlant:
    r"""Plant whose first lag (the store) fills and empties at different speeds.

    .. math:: T(w, x)\,\dot x = w - x, \quad T = T_{rise} \text{ where } w > x, \text{ otherwise } T_{fall};
              \qquad y = G(s)\,x + D(s)\,w; \qquad w(t) = v(t - L)

    where v is the input, w the delayed input, x the state of the store, and y the output. At rest x = w, so the static
    gain is the same in both directions. Therefore each signal may be measured from its value at any state of rest.

    Parameters
    ----------
    main : control.TransferFunction
        G, the proper transfer function from the state x of the store to the output.
    rise, fall : float
        Time constants of the store, above 0.
    direct : control.TransferFunction or float, optional
        D, the proper transfer function from the delayed input w to the output, in parallel with the store.
    delay : float, optional
        Dead time L, not negative.

    Raises
    ------
    TypeError, ValueError
        If a path is not proper, a time constant is not positive, or the dead time is negative.

    Examples
    --------
    >>> import control, pidalab
    >>> plant = pidalab.AsymmetricPlant(control.tf([2.0], [5.0, 1.0]), rise=1.0, fall=3.0)
    >>> plant.rising, plant.falling
    (Process(num=[2], den=[5, 6, 1], delay=0), Process(num=[2], den=[15, 8, 1], delay=0))
    """

    main: Any
    rise: float
    fall: float
    direct: Any = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("main", "direct"):
            rational(name, getattr(self, name))
        for name in ("rise", "fall"):
            object.__setattr__(self, name, _check.real(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "delay", _check.real("delay", self.delay, at_least=0.0))

    @property
    def rising(self) -> Process:
        """Linear process while the store fills."""
        return self._linear(self.rise)

    @property
    def falling(self) -> Process:
        """Linear process while the store empties."""
        return self._linear(self.fall)

    def _linear(self, time: float) -> Process:
        (main, under), (past, below) = rational("main", self.main), rational("direct", self.direct)
        under = np.convolve(under, [time, 1.0])
        extra, rest = np.polydiv(under, below) if under.size >= below.size else (np.ones(1), under)
        # If the denominator `under` is a multiple of the denominator `below`, the common denominator is `under`.
        if np.max(np.abs(rest)) < 1e-12 * np.max(np.abs(under)):
            return Process(np.polyadd(main, np.convolve(past, extra)), under, self.delay)
        num = np.polyadd(np.convolve(main, below), np.convolve(past, under))
        return Process(num, np.convolve(under, below), self.delay)
