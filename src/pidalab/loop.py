"""The feedback loop, with its blocks, signals and transfer functions."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab.controllers import AutomaticReset, Controller, Fraction
from pidalab.digital import DigitalController
from pidalab.process import AsymmetricPlant, Process, fraction_at, quotient, rational
from pidalab.roots import roots

if TYPE_CHECKING:
    import control

FREQUENCIES = 1000  # default number of frequencies of a frequency response; a dead time adds more
# Phase of the dead time in rad: largest change between neighbouring frequencies, and largest value.
TURN_BETWEEN, TURNED = 0.1, 4 * np.pi
UNITY: Fraction = np.ones(1), np.ones(1)
BLOCKS = ("process", "controller", "output_filter", "prefilter")


class Loop:
    r"""Immutable feedback loop of a process, with named blocks and signals.

    ::

                                            d                      n
                                            |                      |
        r --> [prefilter] --> (+) --> [controller] --> [output_filter] --u--> (+) --> [process] --+--> y
                               ^ -                                                                |
                               +------------------------- y + n <---------------------------------+

    ========  ===========================================================================
    signal    meaning
    ========  ===========================================================================
    ``r``     set point, before the prefilter
    ``d``     load disturbance, added to ``u`` at the process input
    ``n``     measurement noise, added to ``y`` in the feedback path
    ``y``     process output, without noise
    ``e``     control error ``r - y``
    ``u``     control signal: output of the output filter, before ``d`` is added
    ========  ===========================================================================

    Parameters
    ----------
    process : Process
        The plant with its dead time. A python-control system is taken as a plant without dead time.
    controller : controller, DigitalController, control.TransferFunction or float
        A proper controller, whose input is the filtered set point minus the measurement. If the controller is digital,
        the loop has no transfer function in s. For such a loop, use `simulate_sampled`, `noise_gain`, `margins` and
        `is_stable`.
    output_filter : Process, OutputFilter or control.TransferFunction, optional
        Proper filter without dead time, in series with the controller and inside the loop. By default 1.
    prefilter : Process, OutputFilter or control.TransferFunction, optional
        Proper and stable filter of the set point without dead time. By default 1.

    Raises
    ------
    TypeError, ValueError
        If a block is not proper, has several inputs or outputs, or is a discrete-time system of python-control. Also if
        a filter has a dead time, if the prefilter is unstable, or if the process is an `AsymmetricPlant`. A digital
        controller cannot be combined with an output filter or a second prefilter.

    Examples
    --------
    >>> import pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), pidalab.PIDA(kp=0.4, ti=8.0, td=0.0, ta=0.0))
    >>> print(f"{abs(loop.S(0.5j)):.4f}")
    1.3341
    """

    process: Process
    controller: Any
    output_filter: Any
    prefilter: Any
    blocks: Mapping[str, Fraction]
    _open_loop: Fraction

    def __init__(
        self, process: Process, controller: Any, output_filter: Any = None, prefilter: Any = None
    ) -> None:
        if isinstance(controller, Process):
            raise TypeError("controller must not be a Process; the order is Loop(process, controller)")
        if isinstance(process, AsymmetricPlant):
            raise TypeError(
                "process must be linear, found an AsymmetricPlant; make the Loop with its attribute `rising`, and give "
                "the AsymmetricPlant to simulate_sampled(plant=...)"
            )
        if not isinstance(process, Process):
            process = Process(*_rational("process", process, Process))
        digital = isinstance(controller, DigitalController)
        if digital and output_filter is not None:
            raise ValueError(f"output_filter must be None with a digital controller, found {output_filter!r}")
        if digital and controller.prefilter is not None and prefilter is not None:
            raise ValueError(f"prefilter must be None: the digital controller has one, found {prefilter!r}")
        blocks = {} if digital else {"controller": _rational("controller", controller, Controller)}
        blocks |= {
            "process": (process.num, process.den),
            "output_filter": _filter("output_filter", output_filter),
            "prefilter": _filter("prefilter", prefilter),
        }
        rightmost = max(roots(blocks["prefilter"][1]).tolist(), key=lambda pole: pole.real, default=-1.0)
        if rightmost.real >= 0:
            raise ValueError(f"prefilter must be stable, found a pole at {rightmost:.4g}")
        num, den = (np.ones(1), np.ones(1)) if digital else _in_series(*(blocks[name] for name in BLOCKS[:3]))
        for array in (num, den, *(part for fraction in blocks.values() for part in fraction)):
            array.setflags(write=False)
        vars(self).update(
            process=process,
            controller=controller,
            output_filter=output_filter,
            prefilter=prefilter,
            blocks=MappingProxyType(blocks),
            _open_loop=(num, den),
        )

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Loop cannot be changed; make a new one with another {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return Loop, (self.process, self.controller, self.output_filter, self.prefilter)

    @property
    def open_loop(self) -> Fraction:
        """L without its dead time: process times controller times output filter, without cancellation.

        Raises
        ------
        TypeError
            If the controller is digital.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 0.5).open_loop
        (array([1.]), array([1., 0.]))
        """
        if self.digital is not None:
            raise TypeError(
                "controller must be continuous, found a digital one; use simulate_sampled, noise_gain, margins, "
                "is_stable, or the loop of the continuous controller"
            )
        return self._open_loop

    @property
    def digital(self) -> DigitalController | None:
        """The controller if it is digital, else None."""
        return self.controller if isinstance(self.controller, DigitalController) else None

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the controller relative to the state of rest, infinite if there are none."""
        if self.digital is not None:
            low, high = (limit - self.digital.bias for limit in self.digital.limits)
            return low, high
        return self.controller.limits if isinstance(self.controller, Controller) else Controller.limits

    @property
    def automatic_reset(self) -> AutomaticReset | None:
        """Automatic reset of the controller, or None."""
        return self.controller.automatic_reset() if isinstance(self.controller, Controller) else None

    def block(self, name: str, s: ArrayLike) -> Any:
        """Evaluate the rational part of one block at complex s.

        Parameters
        ----------
        name : {"process", "controller", "output_filter", "prefilter"}
            Name of the block.
        s : array_like of complex
            Complex frequencies, in rad per time unit (use ``1j * w``).

        Returns
        -------
        complex or ndarray
            The values, without the dead time of the process.

        Raises
        ------
        ValueError
            If the name is unknown, or on overflow.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 0.5).block("process", 4.0)
        np.complex128(0.5+0j)
        """
        if name not in BLOCKS:
            raise ValueError(f"name must be one of {', '.join(BLOCKS)}, found {name!r}")
        if name == "controller":
            _ = self.open_loop  # raises an error for a digital controller
        return quotient(*fraction_at(*self.blocks[name], s))

    def _fraction(self, s: ArrayLike) -> tuple[Any, Any]:
        """Return numerator (including the dead time) and denominator of L at complex s."""
        return fraction_at(*self.open_loop, s, self.process.delay)

    def L(self, s: ArrayLike) -> Any:
        """Evaluate the loop transfer function L of process, controller and output filter, with the exact dead time.

        Parameters
        ----------
        s : array_like of complex
            Complex frequencies in rad per time unit.

        Returns
        -------
        complex or ndarray

        Raises
        ------
        ValueError
            On overflow.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.Loop(pidalab.ipdt(2.0, delay=0.0), 0.5).L(4.0)
        np.complex128(0.25+0j)
        """
        forward, back = self._fraction(s)
        return quotient(forward, back)

    def S(self, s: ArrayLike) -> Any:
        """Evaluate the sensitivity 1 / (1 + L), the factor by which feedback changes a disturbance at the output.

        Parameters
        ----------
        s : array_like of complex
            Complex frequencies in rad per time unit.

        Returns
        -------
        complex or ndarray

        Raises
        ------
        ValueError
            On overflow.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.Loop(pidalab.ipdt(2.0, delay=0.0), 0.5).S(1.0)
        np.complex128(0.5+0j)
        """
        # With integral action this form gives S(0) = 0, although L(0) is infinite.
        forward, back = self._fraction(s)
        return quotient(back, back + forward)

    def T(self, s: ArrayLike) -> Any:
        """Evaluate the complementary sensitivity L / (1 + L) = 1 - S.

        Parameters
        ----------
        s : array_like of complex
            Complex frequencies in rad per time unit.

        Returns
        -------
        complex or ndarray

        Raises
        ------
        ValueError
            On overflow.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.Loop(pidalab.ipdt(2.0, delay=0.0), 0.5).T(1.0)
        np.complex128(0.5+0j)
        """
        forward, back = self._fraction(s)
        return quotient(forward, back + forward)

    def transfer(self, output: str, source: str, s: ArrayLike) -> Any:
        """Evaluate the closed-loop transfer function between two named signals.

        Parameters
        ----------
        output : {"y", "u", "e"}
            Process output, control signal or control error.
        source : {"r", "d", "n"}
            Set point, load disturbance or measurement noise.
        s : array_like of complex
            Complex frequencies in rad per time unit.

        Returns
        -------
        complex or ndarray

        Raises
        ------
        ValueError
            If a signal name is unknown, or on overflow.

        Examples
        --------
        >>> import pidalab
        >>> loop = pidalab.Loop(pidalab.ipdt(2.0, delay=0.0), 0.5)
        >>> loop.transfer("y", "d", 1.0)
        np.complex128(1+0j)
        """
        _check.choice("output", output, ("y", "u", "e"))
        _check.choice("source", source, ("r", "d", "n"))
        forward, back = self._fraction(s)
        p, q = fraction_at(*self.blocks["process"], s, self.process.delay)
        controller, output_filter = (fraction_at(*self.blocks[name], s) for name in BLOCKS[1:3])
        c, d = (first * second for first, second in zip(controller, output_filter, strict=True))
        # Use the same denominator for y and u. Otherwise the result at a pole of a block, such as s = 0 with integral
        # action, would be 0 times infinity.
        if source == "d":
            y, u = quotient(p * d, back + forward), quotient(-forward, back + forward)
        else:
            entry = self.block("prefilter", s) if source == "r" else -1.0
            y, u = (quotient(part, back + forward) * entry for part in (forward, c * q))
        if output == "e":
            return (1.0 if source == "r" else 0.0) - y
        return y if output == "y" else u

    def frequency_response(self, frequencies: ArrayLike | None = None) -> control.FrequencyResponseData:
        """Return L on a grid of frequencies for plots of python-control, with exact dead time.

        Parameters
        ----------
        frequencies : array_like, optional
            Rising frequencies in rad per time unit, above 0. The default grid extends the range of corner frequencies
            of L by a decade on both sides. The grid ends before the dead time turns the phase by more than 4π.

        Returns
        -------
        control.FrequencyResponseData

        Raises
        ------
        TypeError, ValueError
            If the controller is digital, or if frequencies are not finite, rising and above 0.

        Examples
        --------
        >>> import control, pidalab
        >>> L = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5).frequency_response()
        >>> gain_margin, phase_margin, *_ = control.stability_margins(L)
        >>> print(f"{gain_margin:.4f} {phase_margin:.3f}")
        3.1416 61.352
        """
        w = self._frequencies() if frequencies is None else _check.vector("frequencies", frequencies)
        if w[0] <= 0 or np.any(np.diff(w) <= 0):
            raise ValueError(f"frequencies must rise and be above 0, found {w[0]:g} to {w[-1]:g}")
        import control

        return control.FrequencyResponseData(self.L(1j * w), w, name="L")

    def _frequencies(self) -> _check.Array:
        """Return frequencies around the corners of L, dense enough for the phase of the dead time."""
        corners = np.abs(np.concatenate([roots(part) for part in self.open_loop]))
        delay = self.process.delay
        corners = np.append(corners[corners > 0], 1 / delay if delay else [])
        low, high = (float(np.min(corners)), float(np.max(corners))) if corners.size else (1.0, 1.0)
        low, high = 0.1 * low, 10 * high
        if not delay:
            return np.geomspace(low, high, FREQUENCIES)
        high = min(high, TURNED / delay)
        return np.union1d(np.geomspace(low, high, FREQUENCIES), np.arange(low, high, TURN_BETWEEN / delay))

    def __repr__(self) -> str:
        filters = {"output_filter": self.output_filter, "prefilter": self.prefilter}
        extras = "".join(f", {name}={value!r}" for name, value in filters.items() if value is not None)
        return f"Loop({self.process!r}, {self.controller!r}{extras})"


def require_well_posed(loop: Loop) -> None:
    """Raise if the equations of a loop have no solution: no dead time, and a direct feedthrough of L of exactly -1."""
    num, den = open_loop(loop)
    if not loop.process.delay and len(num) == len(den) and abs(1 + num[0] / den[0]) < 1e-12:
        raise ValueError("the loop is ill-posed: without dead time, its direct feedthrough is exactly -1")


def require_loop(loop: Loop) -> None:
    """Raise unless `loop` is a Loop."""
    if not isinstance(loop, Loop):
        raise TypeError(f"loop must be a pidalab.Loop, found {type(loop).__name__}")


def open_loop(loop: Loop) -> Fraction:
    """Return (num, den) of the loop transfer function without dead time and without cancellation."""
    require_loop(loop)
    return loop.open_loop


def _rational(name: str, block: Any, kind: type) -> Fraction:
    """Return (num, den) of a block, or raise if it is not a block."""
    hint = "" if hasattr(block, "fraction") else _check.carrier(block, kind)
    if hint:
        raise TypeError(f"{name} must be a block of the loop, found {type(block).__name__}{hint}")
    return rational(name, block)


def _in_series(first: Fraction, *others: Fraction) -> Fraction:
    """Multiply fractions without cancellation."""
    num, den = first
    for other in others:
        if other is not UNITY:
            num, den = np.convolve(num, other[0]), np.convolve(den, other[1])
    return num, den


def _filter(name: str, block: Any) -> Fraction:
    """Return (num, den) of a filter, or 1 if there is none."""
    if block is None:
        return UNITY
    if not isinstance(block, Process):
        return rational(name, block)
    if block.delay:
        raise ValueError(f"{name} must have no dead time, found {block.delay:g}")
    return block.num, block.den
