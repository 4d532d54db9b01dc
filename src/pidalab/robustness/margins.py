"""Compute robustness margins with exact dead time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, open_loop
from pidalab.robustness.axis import COMPLEMENTARY, DIFFERENCE, SENSITIVITY, Axis, TooManyTurns, height, zeros
from pidalab.robustness.in_s import axis_in_s, factors_of, unit_axis
from pidalab.robustness.in_z import axis_of
from pidalab.robustness.poles import count_unstable, is_stable

# With dead time, phase crossovers are sought where |L| is above this value, and if necessary at smaller |L| (see
# `Margins`).
QUIETEST = 0.1
# `gain_for_ms` resolves the phase of the dead time at frequencies where |L| is above this value.
QUIETEST_GIVEN = 0.1
FAR_SHARE = 1e-2  # `gain_for_ms` uses the grid up to this value times the highest frequency of the grid
AROUND_PEAK = np.linspace(0.97, 1.03, 61)  # (frequencies added around a peak) / (frequency of the peak)
MS_RTOL = 1e-6  # relative tolerance of Ms before the final root search
MOST_LOOKS = 8  # largest number of times that frequencies around a peak are added
DROP = 3.0  # decrease of |T| at the bandwidth, in decibels


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins of a loop, with frequencies in rad per time unit.

    Attributes
    ----------
    stable : bool
        True if the closed loop is stable. If the loop is unstable, the following numbers are not margins but distances
        from the nearest stability limit.
    unstable_poles : int or float
        Number of unstable closed-loop poles.
    gm : float
        Gain margin, the smallest factor above 1 that brings a pole to the stability limit (inf if there is none).
    gm_low : float
        Lower gain margin, the largest factor below 1 that brings a pole to the stability limit (0 if there is none). A
        stable loop with a lower gain margin above 0 is conditionally stable.
    pm : float
        Phase margin in degrees, the smallest rotation of L, in either direction, that brings a pole to the stability
        limit.
    dm : float
        Delay margin, the smallest extra dead time that brings a pole to the stability limit.
    disk : float
        Disk margin α, the inverse of the largest \\|S - 1/2\\|. The loop stays stable if L is multiplied by any complex
        factor (1 + δ/2)/(1 - δ/2) with \\|δ\\| < α. These factors include gains from (2 - α)/(2 + α) to
        (2 + α)/(2 - α), and rotations up to 2 arctan(α/2).
    ms, mt : float
        Peaks of the sensitivity and of the complementary sensitivity.
    wgc, wpc : float
        Gain crossover with the smallest phase margin, and phase crossover with the smallest gain margin. NaN if there
        is no such crossover.
    wms, wmt : float
        Frequencies of the peaks (inf if a peak is approached at infinite frequency).
    gain_crossovers, phase_crossovers : ndarray
        All gain crossovers and phase crossovers. A continuous loop with dead time has infinitely many phase crossovers.
        Only those with \\|L\\| >= 0.1 are listed. If \\|L\\| < 1 at none of them, the limit 0.1 is lowered until
        \\|L\\| < 1 at one of them. If the phase of an unstable loop turns more than about 300,000 times in the searched
        range, no phase crossovers are listed, and the gain margins are NaN.
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
        first = f"closed loop unstable, {poles}: the numbers are distances from the nearest stability limit"
        return "\n".join((first, *lines))


def max_sensitivity(loop: Loop) -> tuple[float, float]:
    """Return the maximum sensitivity Ms and its frequency, even for an unstable loop.

    With a `DigitalController`, Ms is computed at the samples, as in `margins`.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ms, wms : float
        The supremum of \\|1/(1 + L(jw))\\| and its frequency. ``wms`` is inf if the supremum is only approached at
        infinite frequency.

    Raises
    ------
    ValueError
        If the loop is ill-posed, that is, L has no dead time and a direct feedthrough of exactly -1.

    Examples
    --------
    >>> import pidalab
    >>> ms, w = pidalab.max_sensitivity(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    >>> print(f"{ms:.6f} {w:.4f}")
    1.590490 1.1442
    """
    return axis_of(loop).peak(SENSITIVITY)


def ms_or_infinite(loop: Loop) -> float:
    """Return the maximum sensitivity, or infinity for an unstable loop."""
    return max_sensitivity(loop)[0] if is_stable(loop) else math.inf


def max_control_sensitivity(loop: Loop) -> tuple[float, float]:
    r"""Return the largest gain Mks from measurement noise to control signal, and its frequency.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not. Its output filter is part of C.

    Returns
    -------
    mks, wmks : float
        The supremum of \|C/(1 + L)\|, in units of u per unit of y, and its frequency. ``wmks`` is 0 or inf if the
        supremum is only approached at zero or infinite frequency.

    Raises
    ------
    ValueError
        As for `max_sensitivity`.

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
    # With integral action, C S at zero frequency is 1/P(0). Otherwise the lowest grid point is close enough to zero.
    (c_num, c_den), (f_num, f_den) = loop.blocks["controller"], loop.blocks["output_filter"]
    static, at_zero, at_end = loop.process.gain(), -math.inf, -math.inf
    if c_den[-1] == 0 or f_den[-1] == 0:
        at_zero = abs(1 / static) if static else math.inf
    if len(c_num) + len(f_num) == len(c_den) + len(f_den):  # C S tends to a constant at infinite frequency
        at_end = abs(loop.transfer("u", "n", 1j * axis.grid[-1]))
    return axis.supremum(SENSITIVITY, at_zero, float(at_end), controller.modulus)


def gain_crossovers(loop: Loop) -> Array:
    """Return all frequencies where \\|L\\| = 1, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit. If \\|L\\| is 1 at all frequencies, there are no crossovers.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.gain_crossovers(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 0.25)).round(9).tolist()
    [0.5]
    """
    return axis_of(loop).gain_crossovers


def bandwidth(loop: Loop) -> float:
    r"""Return the bandwidth of the closed loop: the lowest frequency at which \|T\| is 3 dB below its static value.

    Parameters
    ----------
    loop : Loop
        A stable loop. Its prefilter is not part of T.

    Returns
    -------
    float
        Bandwidth in rad per time unit, or inf if \|T\| never falls by 3 dB.

    Raises
    ------
    ValueError
        If the loop is unstable or T(0) = 0.

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
        raise ValueError("the bandwidth is not defined: the static gain of T must not be 0, found 0")
    level = static * 10 ** (-DROP / 20)
    # |T| is below the level wherever |L| < level / (1 + level).
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
    """Return the frequencies where L is real and negative, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.
    quietest : float, optional
        Smallest \\|L\\| of a returned crossover. Only used for a continuous loop with dead time, which has infinitely
        many crossovers.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit. If L is real at all frequencies, there are no crossovers.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> w = pidalab.phase_crossovers(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), quietest=0.05)
    >>> (w / np.pi).round(9).tolist()
    [0.5, 2.5]
    """
    return axis_of(loop).phase_crossovers(_check.real("quietest", quietest, above=0.0))


def margins(loop: Loop) -> Margins:
    """Return gain, phase and delay margin, peaks of S and T, and all crossovers, with exact dead time.

    With a `DigitalController`, the plant is discretised exactly, and all values are computed at the samples, up to half
    the sampling frequency.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    Margins
        Values are accurate to nine digits, frequencies of peaks to six digits.

    Raises
    ------
    ValueError
        As for `max_sensitivity`.

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
    lag = np.mod(np.angle(at_crossovers) + np.pi, 2 * np.pi)  # lag in rad that brings L to -1
    rotation = np.minimum(lag, 2 * np.pi - lag)
    wpc, places, size = _phase_crossovers(axis, bool(count))
    small, large = np.where(size < 1, size, 0.0), size[size > 1]
    (ms, wms), (mt, wmt), (difference, _) = map(axis.peak, (SENSITIVITY, COMPLEMENTARY, DIFFERENCE))
    continuous, unknown = math.isinf(axis.end), bool(np.isnan(size).any())
    return Margins(
        stable=count == 0,
        unstable_poles=count,
        gm=math.nan if unknown else float(1 / small.max()) if small.any() else math.inf,
        gm_low=math.nan if unknown else float(1 / large.min()) if large.size else 0.0,
        pm=float(np.degrees(rotation.min(initial=math.inf))),
        # With |L| >= 1 at infinite frequency, any extra dead time destabilises the loop.
        dm=0.0 if continuous and abs(axis.at_end) >= 1 else float(np.min(lag / wgc, initial=math.inf)),
        disk=1 / difference if difference else math.inf,
        ms=ms,
        mt=mt,
        wgc=float(wgc[np.argmin(rotation)]) if wgc.size else math.nan,
        wpc=float(places[np.argmax(small)]) if small.any() else math.nan,
        wms=wms,
        wmt=wmt,
        gain_crossovers=wgc,
        phase_crossovers=wpc if continuous or axis.at_end >= 0 else places[1:],
    )


def _phase_crossovers(axis: Axis, unstable: bool) -> tuple[Array, Array, Array]:
    """Return the phase crossovers `wpc`, the array [0, *wpc, end of the axis], and max(-L, 0) at these points."""
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
    # L is real at both ends of the axis. An end at which L is negative counts as a phase crossover.
    places = np.concatenate([[0.0], wpc, [axis.end]])
    return wpc, places, np.concatenate([[max(-axis.at_zero, 0.0)], L, [max(-axis.at_end, 0.0)]])


# --- the gain for a maximum sensitivity -----------------------------------------------------------------------------


def gain_for_ms(loop: Loop, ms: float) -> float:
    r"""Return the factor of the controller with which the loop is stable and has the maximum sensitivity `ms`.

    If there are several such factors, return the largest at which Ms rises to `ms` as the gain increases.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    ms : float
        Required maximum sensitivity, above 1.

    Returns
    -------
    float
        Factor k, above 0, for ``Loop(process, k * controller, output_filter)``.

    Raises
    ------
    TypeError
        If the controller is digital.
    ValueError
        If `ms` is not above 1, or if there is no such factor.

    Examples
    --------
    >>> import pidalab
    >>> process, controller = pidalab.lags(3, delay=1.0), pidalab.PIDA(kp=1.0, ti=3.0, td=0.8)
    >>> k = pidalab.gain_for_ms(pidalab.Loop(process, controller), ms=1.6)
    >>> print(f"{k:.4f} {pidalab.max_sensitivity(pidalab.Loop(process, k * controller))[0]:.6f}")
    0.9232 1.600000
    """
    open_loop(loop)  # raises an error for a sampled loop
    ms = _check.real("ms", ms, above=1.0)
    axis = unit_axis(loop)

    def excess(k: float) -> float:
        return 1 / ms - 1 / axis.scaled(k).peak(SENSITIVITY)[0]

    def stable(k: float) -> bool:
        try:
            return count_unstable(axis.scaled(k)) == 0
        except ArithmeticError:  # if the phase turns too often, the loop is far from stable
            return False

    # Include the ends of the axis. If process and controller are biproper, L is not 0 at infinite frequency.
    ends = [L for L in (axis.at_zero, axis.at_end) if math.isfinite(L)]
    w = axis.follow(QUIETEST_GIVEN)
    w = w[w <= FAR_SHARE * w[-1]]
    for _ in range(MOST_LOOKS):
        candidates = _reached_from_below(np.append(axis.L(w), ends), ms)
        largest = next((k for c in candidates if stable(k := c * (1 - MS_RTOL))), None)
        if largest is None:
            break
        peak, where = axis.scaled(largest).peak(SENSITIVITY)
        if peak <= ms * (1 + MS_RTOL):
            low, high = largest * (1 - 10 * MS_RTOL), largest * (1 + 10 * MS_RTOL)
            if not excess(low) < 0 <= excess(high):
                return largest
            return float(brentq(excess, low, high, xtol=1e-15 * largest, rtol=1e-14))
        if not 0 < where < math.inf:
            break
        w = np.sort(np.append(w, where * AROUND_PEAK))
    raise ValueError(f"no gain of this controller gives a stable loop whose Ms rises to ms = {ms:g}")


def _reached_from_below(unit: Array, ms: float) -> list[float]:
    r"""Return the factors k, largest first, at which :math:`|1 + k L|` falls below :math:`1/M_s` as k rises.

    At each frequency, :math:`|1 + k L| < 1/M_s` holds for k between the two roots of
    :math:`|L|^2 k^2 + 2 \mathrm{Re}(L) k + 1 - 1/M_s^2`.
    """
    size = np.abs(unit) ** 2
    root = unit.real**2 - size * (1 - 1 / ms**2)
    lost = (unit.real < 0) & (root > 0)
    spread = np.sqrt(root[lost])
    low, high = ((-unit.real[lost] + sign * spread) / size[lost] for sign in (-1, 1))
    order = np.argsort(low)
    low, high = low[order], high[order]
    # At each frequency, k from `low` to `high` is forbidden. If one of these intervals begins above the ends of all
    # preceding intervals, k just below its start is allowed.
    behind = np.concatenate([[0.0], np.maximum.accumulate(high)[:-1]])
    return low[low > behind][::-1].tolist()
