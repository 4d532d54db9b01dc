"""Robustness margins with exact dead time: candidates from the frequency grid, refined to full precision."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize.elementwise import find_minimum, find_root

from pidalab._check import Array
from pidalab.frequency import ends, grid, rational_part
from pidalab.loop import Loop
from pidalab.stability import is_stable

QUIETEST = 1e-2  # loops are searched for phase crossovers while |L| is above this, lower if there are none


@dataclass(frozen=True)
class Margins:
    """Margins of a loop; frequencies in rad per time unit.

    Attributes
    ----------
    stable : bool
        Whether the closed loop is stable. If not, all margins are NaN: numbers read off an unstable loop mislead.
    gm : float
        Gain margin, a ratio: the smallest factor above 1 that makes the loop unstable (inf if none).
    gm_low : float
        The largest factor below 1 that makes a conditionally stable loop unstable (0 if none).
    pm : float
        Phase margin in degrees: the smallest rotation of L, in either direction, that makes the loop unstable.
    dm : float
        Delay margin: the smallest extra dead time that makes the loop unstable, over all gain crossovers.
    ms, mt : float
        Peaks of the sensitivity and of the complementary sensitivity.
    wgc, wpc : float
        Gain crossover with the smallest phase margin, phase crossover with the smallest gain margin (NaN if none).
    wms, wmt : float
        Frequencies of the peaks (inf where the peak is approached at infinite frequency).
    gain_crossovers, phase_crossovers : ndarray
        All gain crossovers; all phase crossovers where \\|L\\| is at least 0.01 (lower if there are none above).
    """

    stable: bool
    gm: float
    gm_low: float
    pm: float
    dm: float
    ms: float
    mt: float
    wgc: float
    wpc: float
    wms: float
    wmt: float
    gain_crossovers: Array
    phase_crossovers: Array

    def __str__(self) -> str:
        if not self.stable:
            return "closed loop unstable: it has no margins"
        return (
            f"Ms = {self.ms:.4g} at {self.wms:.4g} rad/time, Mt = {self.mt:.4g} at {self.wmt:.4g}\n"
            f"gain margin {self.gm:.4g} at {self.wpc:.4g}, phase margin {self.pm:.4g} deg at {self.wgc:.4g}, "
            f"delay margin {self.dm:.4g}"
        )


def _peak(loop: Loop, w: Array, complementary: bool) -> tuple[float, float]:
    """Supremum of |S|, or of |T|, and where it lies."""

    def value(w: Array) -> Array:
        return np.abs(loop.T(1j * w) if complementary else loop.S(1j * w))

    loop_value, height = loop.L(1j * w), value(w)
    at_zero, at_infinity = ends(loop)
    if loop.process.delay:  # far out the phase takes every value, so also the worst
        at_infinity = -abs(at_infinity)
    where, heights = [w[np.argmax(height)]], [height.max()]
    # a maximum between points is out of reach if L cannot come close enough to -1 from there
    step = np.abs(np.diff(loop_value))
    closest = np.abs(1 + loop_value[1:-1]) - np.maximum(step[1:], step[:-1])
    top = np.abs(loop_value[1:-1]) if complementary else 1.0
    local = (height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])
    inner = np.flatnonzero(local & (closest * height.max() <= 1.5 * top)) + 1
    if inner.size:
        bracket = (np.log(w[inner - 1]), np.log(w[inner]), np.log(w[inner + 1]))
        found = find_minimum(lambda x: -value(np.exp(x)), bracket, tolerances={"xatol": 0, "xrtol": 1e-10})
        where.extend(np.exp(found.x))
        heights.extend(-found.f_x)
    best = int(np.nanargmax(heights))
    for end, at in ((at_zero, 0.0), (at_infinity, math.inf)):
        if end == -1:
            return math.inf, at
        share = 1 / (1 + end) if not complementary else 1.0 if math.isinf(end) else end / (1 + end)
        if abs(share) >= heights[best] * (1 - 1e-7):  # the grid only comes close to the ends
            return abs(share), at
    return float(heights[best]), float(where[best])


def max_sensitivity(loop: Loop) -> tuple[float, float]:
    """Maximum sensitivity Ms and the frequency where it lies, whether the loop is stable or not.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ms, wms : float
        The supremum of \\|1/(1 + L(jw))\\| over all frequencies; ``wms`` is inf where it is only approached.

    Examples
    --------
    >>> import pidalab
    >>> ms, w = pidalab.max_sensitivity(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    >>> print(f"{ms:.6f} {w:.4f}")
    1.590490 1.1442
    """
    first = np.abs(loop.S(1j * grid(loop, 0.5))).max()
    floor = 1 - 1 / max(first, 1 + 1e-9)  # where |L| is smaller than this, |S| cannot be larger than found
    return _peak(loop, grid(loop, 0.99 * floor), complementary=False)


def gain_crossovers(loop: Loop) -> Array:
    """All frequencies where \\|L\\| = 1, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit; the dead time has no influence on them.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.gain_crossovers(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 0.25)).round(9).tolist()
    [0.5]
    """

    def excess(x: Array) -> Array:
        return np.log(np.abs(rational_part(loop, np.exp(x))))

    x = np.log(grid(loop, np.inf))
    return np.exp(_sign_changes(excess, x, excess(x)))


def _sign_changes(function: Callable[[Array], Array], x: Array, value: Array) -> Array:
    i = np.flatnonzero(np.sign(value[:-1]) * np.sign(value[1:]) < 0)
    zeros = x[value == 0]
    if not i.size:
        return zeros
    return np.sort(np.concatenate([find_root(function, (x[i], x[i + 1])).x, zeros]))


def phase_crossovers(loop: Loop, quietest: float = QUIETEST) -> Array:
    """Frequencies where L is real and negative, ascending.

    Parameters
    ----------
    loop : Loop
        The loop.
    quietest : float, optional
        A dead time makes infinitely many; those with \\|L\\| below this are left out.

    Returns
    -------
    ndarray
        Frequencies in rad per time unit.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> w = pidalab.phase_crossovers(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), quietest=0.05)
    >>> (w / np.pi).round(9).tolist()
    [0.5, 2.5]
    """

    def imaginary(x: Array) -> Array:
        loop_value = loop.L(1j * np.exp(x))
        return loop_value.imag / np.abs(loop_value)

    x = np.log(grid(loop, quietest))
    w = np.exp(_sign_changes(imaginary, x, imaginary(x)))
    value = loop.L(1j * w)
    return w[(value.real < 0) & (np.abs(value) >= quietest)]


def margins(loop: Loop) -> Margins:
    """Gain, phase and delay margin, peaks of S and T, and all crossovers, with exact dead time.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    Margins
        Named values. For an unstable loop ``stable`` is False and the margins are NaN.

    Examples
    --------
    >>> import pidalab
    >>> result = pidalab.margins(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    >>> print(result)
    Ms = 1.59 at 1.144 rad/time, Mt = 1 at 0
    gain margin 3.142 at 1.571, phase margin 61.35 deg at 0.5, delay margin 2.142
    """
    wgc, quietest = gain_crossovers(loop), QUIETEST
    wpc = phase_crossovers(loop, quietest)
    while not wpc.size and loop.process.delay and quietest > 1e-12:
        quietest /= 100
        wpc = phase_crossovers(loop, quietest)
    stable = is_stable(loop)
    if not stable:
        none = math.nan
        return Margins(False, none, none, none, none, none, none, none, none, none, none, wgc, wpc)
    lag = np.mod(np.angle(loop.L(1j * wgc)) + np.pi, 2 * np.pi)  # what further dead time must add
    rotation = np.minimum(lag, 2 * np.pi - lag)
    size = np.abs(loop.L(1j * wpc))
    small, large = size < 1, size > 1
    ms, wms = max_sensitivity(loop)
    mt, wmt = _peak(loop, grid(loop, 0.05), complementary=True)
    end = abs(ends(loop)[1])
    worst = float(max(size[small].max(initial=0.0), end if loop.process.delay else 0.0))
    # with |L| >= 1 out to infinity, any extra dead time is too much
    return Margins(
        stable=True,
        gm=1 / worst if worst else math.inf,
        gm_low=float(1 / size[large].min()) if large.any() else 0.0,
        pm=float(np.degrees(rotation.min(initial=math.inf))),
        dm=0.0 if end >= 1 else float(np.min(lag / wgc, initial=math.inf)),
        ms=ms,
        mt=mt,
        wgc=float(wgc[np.argmin(rotation)]) if wgc.size else math.nan,
        wpc=float(wpc[small][np.argmax(size[small])]) if small.any() else math.nan,
        wms=wms,
        wmt=wmt,
        gain_crossovers=wgc,
        phase_crossovers=wpc,
    )
