"""Robustness margins with exact dead time: candidates from the frequency grid, refined to full precision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, open_loop
from pidalab.robustness.axis import (
    COMPLEMENTARY,
    DIFFERENCE,
    SENSITIVITY,
    Axis,
    TooManyTurns,
    height,
    zeros,
)
from pidalab.robustness.in_s import axis_in_s, factors_of, unit_axis
from pidalab.robustness.in_z import axis_of
from pidalab.robustness.poles import count_unstable

QUIETEST = 0.1  # with dead time, phase crossovers are searched while |L| is above this, further if they give no margin
QUIETEST_GIVEN = 0.1  # |L| of the given loop above which the turns of its dead time are followed
FAR_SHARE = 1e-2  # of the last frequency, up to which gains are looked for at first
AROUND_PEAK = np.linspace(0.97, 1.03, 61)  # a peak that lies between the frequencies looked at
MS_RTOL = 1e-6  # share by which Ms may exceed the one wanted before the last step
MOST_LOOKS = 8  # at where the peak is
DROP = 3.0  # decibels by which |T| has fallen at the bandwidth


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins of a loop; frequencies in rad per time unit.

    Attributes
    ----------
    stable : bool
        Whether the closed loop is stable. If not, the numbers below say how far it is from the next border of
        stability, as other programs print them; what a loop may bear that is stable they do not say.
    unstable_poles : int or float
        Closed-loop poles that are not stable, as `unstable_poles` counts them.
    gm : float
        Gain margin, a ratio: the smallest factor above 1 that puts a pole on the border of stability (inf if none).
    gm_low : float
        Lower gain margin, the largest factor below 1 that does (0 if none). A stable loop with one above 0 is stable on
        condition.
    pm : float
        Phase margin in degrees: the smallest rotation of L, in either direction, that does.
    dm : float
        Delay margin: the smallest extra dead time that does, over all gain crossovers.
    disk : float
        Disk margin α, one over the largest \\|S - 1/2\\|: gain and phase may change together by any complex factor
        (1 + δ/2)/(1 - δ/2) with \\|δ\\| < α. A gain alone may be from (2 - α)/(2 + α) to (2 + α)/(2 - α), a rotation
        alone up to 2 arctan(α/2).
    ms, mt : float
        Peaks of the sensitivity and of the complementary sensitivity.
    wgc, wpc : float
        Gain crossover with the smallest phase margin, phase crossover with the smallest gain margin (NaN if none).
    wms, wmt : float
        Frequencies of the peaks (inf where the peak is approached at infinite frequency).
    gain_crossovers, phase_crossovers : ndarray
        All gain crossovers; all phase crossovers, but with dead time only those where \\|L\\| is at least 0.1, and at
        least the first with \\|L\\| below 1. Where the dead time turns the phase more than a million times in there,
        none are listed, and the gain margins are NaN.
    """

    stable: bool
    unstable_poles: float
    gm: float
    gm_low: float
    pm: float
    dm: float
    disk: float
    ms: float
    mt: float
    wgc: float
    wpc: float
    wms: float
    wmt: float
    gain_crossovers: Array
    phase_crossovers: Array

    def __str__(self) -> str:
        gain = "infinite" if math.isinf(self.gm) else f"{self.gm:.4g} at {self.wpc:.4g}"
        phase = f"{self.pm:.4g} deg at {self.wgc:.4g}" if math.isfinite(self.pm) else "infinite"
        lines = (
            f"Ms = {self.ms:.4g} at {self.wms:.4g} rad/time, Mt = {self.mt:.4g} at {self.wmt:.4g}",
            f"gain margin {gain}, lower {self.gm_low:.4g}, phase margin {phase}, "
            f"delay margin {self.dm:.4g}, disk margin {self.disk:.4g}",
        )
        if self.stable:
            return "\n".join(lines)
        poles = "1 pole" if self.unstable_poles == 1 else f"{self.unstable_poles:g} poles"
        first = (
            f"closed loop unstable, {poles}: the numbers tell how far it is from the next border of stability"
        )
        return "\n".join((first, *lines))


def max_sensitivity(loop: Loop) -> tuple[float, float]:
    """Maximum sensitivity Ms and the frequency where it lies, whether the loop is stable or not.

    With a `DigitalController` it is that at the samples, as in `margins`.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ms, wms : float
        The supremum of \\|1/(1 + L(jw))\\| over all frequencies; ``wms`` is inf where it is only approached.

    Raises
    ------
    ValueError
        For an ill-posed loop: no dead time and a direct feedthrough of exactly -1.

    Examples
    --------
    >>> import pidalab
    >>> ms, w = pidalab.max_sensitivity(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    >>> print(f"{ms:.6f} {w:.4f}")
    1.590490 1.1442
    """
    return axis_of(loop).peak(SENSITIVITY)


def max_control_sensitivity(loop: Loop) -> tuple[float, float]:
    r"""Largest gain Mks from measurement noise to control signal, and the frequency where it lies.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not; its output filter is part of the controller.

    Returns
    -------
    mks, wmks : float
        The supremum of \|C/(1 + L)\| over all frequencies, in units of u per unit of y; ``wmks`` is 0 or inf where
        it is only approached.

    Raises
    ------
    ValueError
        For an ill-posed loop: no dead time and a direct feedthrough of exactly -1.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.robustness import max_control_sensitivity
    >>> controller = pidalab.HighOrderPID([0.3, 0.8, 0.4], filter_time=0.05, filter_order=2)
    >>> mks, w = max_control_sensitivity(pidalab.Loop(pidalab.lags(3, delay=1.0), controller))
    >>> print(f"{mks:.4f} {w:.2f}")
    4.0109 19.75
    """
    axis, controller = axis_in_s(loop), factors_of(loop, "controller", "output_filter")
    # at zero frequency C S is 1/P, or C where it does not integrate
    (c_num, c_den), (f_num, f_den) = loop.blocks["controller"], loop.blocks["output_filter"]
    static, at_zero, at_end = loop.process.gain(), -math.inf, -math.inf
    if c_den[-1] == 0 or f_den[-1] == 0:
        at_zero = abs(1 / static) if static else math.inf
    if len(c_num) + len(f_num) == len(c_den) + len(f_den):  # C S tends to a constant
        at_end = abs(loop.transfer("u", "n", 1j * axis.grid[-1]))
    return axis.supremum(SENSITIVITY, at_zero, float(at_end), controller.modulus)


def gain_crossovers(loop: Loop) -> Array:
    """All frequencies where \\|L\\| = 1, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit; the dead time has no influence on them. Where \\|L\\| is 1 along the whole
        axis, there are none.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.gain_crossovers(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 0.25)).round(9).tolist()
    [0.5]
    """
    return axis_of(loop).gain_crossovers


def bandwidth(loop: Loop) -> float:
    r"""Bandwidth of the closed loop: the lowest frequency at which \|T\| is 3 dB below its value at rest.

    Parameters
    ----------
    loop : Loop
        A stable loop; its prefilter is not in T.

    Returns
    -------
    float
        In rad per time unit; inf where T does not fall so far.

    Raises
    ------
    ValueError
        For an unstable loop, and for one whose T is 0 at rest.

    Examples
    --------
    >>> import pidalab
    >>> print(f"{pidalab.bandwidth(pidalab.Loop(pidalab.ipdt(1.0, delay=0.0), 0.5)):.4f}")
    0.4988
    """
    axis = axis_of(loop)
    if count_unstable(axis):
        raise ValueError("the closed loop is unstable: it has no bandwidth")
    static = 1.0 if math.isinf(axis.at_zero) else abs(axis.at_zero / (1 + axis.at_zero))
    if static == 0:
        raise ValueError("T is 0 at rest, found static gain 0: its bandwidth is not defined")
    level = static * 10 ** (-DROP / 20)
    # where |L| < level / (1 + level), |T| is below the level
    w = axis.follow(0.9 * level / (1 + level))

    def excess(w: Any) -> Any:
        _, num, den = axis.at(w)
        return height(COMPLEMENTARY, num, den) - level

    values = excess(w)
    first = int(np.argmax(values < 0))
    if values[first] >= 0:
        return math.inf
    return float(zeros(excess, w[: first + 1], values[: first + 1])[0])


def phase_crossovers(loop: Loop, quietest: float = QUIETEST) -> Array:
    """Frequencies where L is real and negative, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.
    quietest : float, optional
        A dead time makes infinitely many; those with \\|L\\| below this are left out. Without dead time all count.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit. Where L is real along the whole axis, there are none.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> w = pidalab.phase_crossovers(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), quietest=0.05)
    >>> (w / np.pi).round(9).tolist()
    [0.5, 2.5]
    """
    return axis_of(loop).phase_crossovers(_check.real("quietest", quietest, above=0.0))


def margins(loop: Loop) -> Margins:
    """Gain, phase and delay margin, peaks of S and T, and all crossovers, with exact dead time.

    Of a loop with a `DigitalController` they are those at the samples, with the plant discretised exactly, up to half
    the sampling frequency: beside those of the continuous loop they say what sampling costs. Extra dead time of whole
    samples turns that loop as it turns a continuous one; `dm` over the sample time is the delay margin in samples.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    Margins
        Named values, accurate to nine digits, frequencies of peaks to six. For an unstable loop ``stable`` is False,
        and they are read off the same curve.

    Raises
    ------
    ValueError
        For an ill-posed loop: no dead time and a direct feedthrough of exactly -1.

    Examples
    --------
    >>> import pidalab
    >>> result = pidalab.margins(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    >>> print(result)
    Ms = 1.59 at 1.144 rad/time, Mt = 1 at 0
    gain margin 3.142 at 1.571, lower 0, phase margin 61.35 deg at 0.5, delay margin 2.142, disk margin 0.8832
    """
    axis = axis_of(loop)
    count, wgc = count_unstable(axis), axis.gain_crossovers
    at_crossovers = axis.L(wgc)
    lag = np.mod(np.angle(at_crossovers) + np.pi, 2 * np.pi)  # what further dead time must add
    rotation = np.minimum(lag, 2 * np.pi - lag)
    wpc, at, size = _phase_crossovers(axis, bool(count))
    small, large = np.where(size < 1, size, 0.0), size[size > 1]
    (ms, wms), (mt, wmt), (difference, _) = map(axis.peak, (SENSITIVITY, COMPLEMENTARY, DIFFERENCE))
    continuous, unknown = math.isinf(axis.end), bool(np.isnan(size).any())
    return Margins(
        stable=count == 0,
        unstable_poles=count,
        gm=math.nan if unknown else float(1 / small.max()) if small.any() else math.inf,
        gm_low=math.nan if unknown else float(1 / large.min()) if large.size else 0.0,
        pm=float(np.degrees(rotation.min(initial=math.inf))),
        # with |L| >= 1 out to infinity, any extra dead time is too much
        dm=0.0 if continuous and abs(axis.at_end) >= 1 else float(np.min(lag / wgc, initial=math.inf)),
        disk=1 / difference if difference else math.inf,
        ms=ms,
        mt=mt,
        wgc=float(wgc[np.argmin(rotation)]) if wgc.size else math.nan,
        wpc=float(at[np.argmax(small)]) if small.any() else math.nan,
        wms=wms,
        wmt=wmt,
        gain_crossovers=wgc,
        phase_crossovers=wpc if continuous or axis.at_end >= 0 else at[1:],
    )


def _phase_crossovers(axis: Axis, unstable: bool) -> tuple[Array, Array, Array]:
    """Phase crossovers; the same with both ends of the axis, and |L| there, 0 where it is positive."""
    quietest = QUIETEST
    try:
        wpc = axis.phase_crossovers(quietest)
        L = np.abs(axis.L(wpc))
        while axis.delay and quietest > 1e-12 and not np.any(L < 1):
            quietest /= 10
            wpc = axis.phase_crossovers(quietest)
            L = np.abs(axis.L(wpc))
    except TooManyTurns:
        if not unstable:
            raise
        return np.zeros(0), np.zeros(1), np.full(1, math.nan)
    # at the ends of the axis L is real: these are phase crossovers too where it is negative
    at = np.concatenate([[0.0], wpc, [axis.end]])
    return wpc, at, np.concatenate([[max(-axis.at_zero, 0.0)], L, [max(-axis.at_end, 0.0)]])


# --- the gain for a maximum sensitivity -----------------------------------------------------------------------------


def gain_for_ms(loop: Loop, ms: float) -> float:
    r"""Factor of the controller's gain with which the loop is stable and has the maximum sensitivity `ms`.

    Where several factors do, it is the largest at which Ms is reached from below.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not; output filter included. Its own gain is the unit of the answer.
    ms : float
        Maximum sensitivity asked for, above 1.

    Returns
    -------
    float
        k, above 0: ``Loop(process, k * controller, output_filter)`` has ``max_sensitivity(...)[0] == ms``.

    Raises
    ------
    TypeError
        For a loop with a digital controller.
    ValueError
        If `ms` is not above 1, and where no factor gives a stable loop that reaches this Ms from below.

    Examples
    --------
    >>> import pidalab
    >>> process, controller = pidalab.lags(3, delay=1.0), pidalab.PIDA(kp=1.0, ti=3.0, td=0.8)
    >>> k = pidalab.gain_for_ms(pidalab.Loop(process, controller), ms=1.6)
    >>> print(f"{k:.4f} {pidalab.max_sensitivity(pidalab.Loop(process, k * controller))[0]:.6f}")
    0.9232 1.600000
    """
    open_loop(loop)  # raises for a loop that is not continuous
    ms = _check.real("ms", ms, above=1.0)
    axis = unit_axis(loop)

    def excess(k: float) -> float:
        return 1 / ms - 1 / axis.scaled(k).peak(SENSITIVITY)[0]

    def stable(k: float) -> bool:
        try:
            return count_unstable(axis.scaled(k)) == 0
        except ArithmeticError:  # its phase turns too often to follow: it is far from stable
            return False

    # at the ends of the axis L is real, and at infinity not 0 if process and controller are biproper
    ends = [L for L in (axis.at_zero, axis.at_end) if math.isfinite(L)]
    w = axis.follow(QUIETEST_GIVEN)
    w = w[w <= FAR_SHARE * w[-1]]
    for _ in range(MOST_LOOKS):
        candidates = _reached_from_below(np.append(axis.L(w), ends), ms)
        largest = next((k for c in candidates if stable(k := c * (1 - MS_RTOL))), None)
        if largest is None:
            break
        peak, at = axis.scaled(largest).peak(SENSITIVITY)
        if peak <= ms * (1 + MS_RTOL):
            low, high = largest * (1 - 10 * MS_RTOL), largest * (1 + 10 * MS_RTOL)
            if not excess(low) < 0 <= excess(high):
                return largest
            return float(brentq(excess, low, high, xtol=1e-15 * largest, rtol=1e-14))
        if not 0 < at < math.inf:
            break
        w = np.sort(np.append(w, at * AROUND_PEAK))
    raise ValueError(f"no gain of this controller gives a stable loop that reaches ms = {ms:g} from below")


def _reached_from_below(unit: Array, ms: float) -> list[float]:
    r"""Factors k, the largest first, at which :math:`|1 + k L| \ge 1/M_s` is about to be lost at one frequency.

    At each frequency it is lost between the roots of :math:`|L|^2 k^2 + 2 \mathrm{Re}(L) k + 1 - 1/M_s^2`.
    """
    size = np.abs(unit) ** 2
    root = unit.real**2 - size * (1 - 1 / ms**2)
    lost = (unit.real < 0) & (root > 0)
    spread = np.sqrt(root[lost])
    low, high = ((-unit.real[lost] + sign * spread) / size[lost] for sign in (-1, 1))
    order = np.argsort(low)
    low, high = low[order], high[order]
    # an interval that begins behind all that began before leaves a gap of allowed factors below it
    behind = np.concatenate([[0.0], np.maximum.accumulate(high)[:-1]])
    return low[low > behind][::-1].tolist()
