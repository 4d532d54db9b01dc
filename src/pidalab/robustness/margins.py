"""Robustness margins with exact dead time: candidates from the frequency grid, refined to full precision."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, require_well_posed
from pidalab.robustness._grid import Scan, divided, ends, scan
from pidalab.robustness.poles import is_stable
from pidalab.robustness.sampled import margins_sampled

QUIETEST = 0.1  # with dead time, phase crossovers are searched while |L| is above this, further if they give no margin


@dataclass(frozen=True, eq=False)
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
        All gain crossovers; all phase crossovers, but with dead time only those where \\|L\\| is at least 0.1, and at
        least the first with \\|L\\| below 1. None are listed for an unstable loop.
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
        gain = f"{self.gm:.4g} at {self.wpc:.4g}" if math.isfinite(self.gm) else "infinite"
        phase = f"{self.pm:.4g} deg at {self.wgc:.4g}" if math.isfinite(self.pm) else "infinite"
        return (
            f"Ms = {self.ms:.4g} at {self.wms:.4g} rad/time, Mt = {self.mt:.4g} at {self.wmt:.4g}\n"
            f"gain margin {gain}, phase margin {phase}, delay margin {self.dm:.4g}"
        )


def _peaks(loop: Loop, looked: Scan, kinds: int) -> list[tuple[float, float]]:
    """Suprema of |S|, and of |T| if two kinds are asked for, and where they lie."""
    from pidalab.robustness import _scan

    require_well_posed(loop)
    first, _ = _scan.peaks(looked.w, looked.parts(0.5), False, *looked.factors)
    # where |L| is smaller than this, |S| or |T| cannot be larger than what was found
    ms, mt = np.minimum(first, 1e300).tolist()
    loud = 0.99 * (1 - 1 / max(ms, 1 + 1e-6)), 0.99 * mt / (1 + mt)
    best, where = _scan.peaks(looked.w, looked.parts(min(loud[:kinds])), True, *looked.factors)
    return [_with_ends(loop, k == 1, float(best[k]), float(where[k])) for k in range(kinds)]


def _with_ends(loop: Loop, complementary: bool, height: float, at: float) -> tuple[float, float]:
    """Take zero or infinite frequency for the peak where it is approached there; the grid only comes close."""
    for end, there in zip(_worst_ends(loop), (0.0, math.inf), strict=True):
        if end == -1:
            return math.inf, there
        share = 1 / (1 + end) if not complementary else 1.0 if math.isinf(end) else end / (1 + end)
        if abs(share) >= height * (1 - 1e-7):
            return abs(share), there
    return height, at


def _worst_ends(loop: Loop) -> tuple[float, float]:
    """L at zero and infinite frequency; with dead time it takes every phase far out, so also the worst."""
    at_zero, at_infinity = ends(loop)
    return at_zero, -abs(at_infinity) if loop.process.delay else at_infinity


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
    return _peaks(loop, scan(loop), 1)[0]


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

    return _gain_crossovers(scan(loop))


def _gain_crossovers(looked: Scan) -> Array:
    from pidalab.robustness import _scan

    return np.sort(_scan.gain_crossings(looked.w, looked.size, *looked.factors[:4]))


def bandwidth(loop: Loop, drop: float = 3.0) -> float:
    r"""Bandwidth of the closed loop: the lowest frequency at which \|T\| is `drop` decibels below its value at rest.

    Parameters
    ----------
    loop : Loop
        A stable loop; its prefilter is not in T.
    drop : float, optional
        In decibels, above 0.

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
    if not is_stable(loop):
        raise ValueError("the closed loop is unstable: it has no bandwidth")
    at_rest = ends(loop)[0]
    static = 1.0 if math.isinf(at_rest) else abs(at_rest / (1 + at_rest))
    if static == 0:
        raise ValueError("T is 0 at rest: there is nothing to fall from")
    level = static * 10 ** (-_check.real("drop", drop, above=0.0) / 20)

    def excess(w: float) -> float:
        return float(np.abs(loop.T(1j * w))) - level

    # where |L| < level / (1 + level), |T| is below the level
    looked = scan(loop)
    w = divided(looked.w, looked.parts(0.9 * level / (1 + level)))
    below = np.flatnonzero(np.abs(loop.T(1j * w)) < level)
    if not below.size:
        return math.inf
    first = int(below[0])
    return (
        float(brentq(excess, w[max(first - 1, 0)], w[first], xtol=1e-15 * w[first], rtol=1e-14))
        if first
        else float(w[0])
    )


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
    return _phase_crossovers(scan(loop), _check.real("quietest", quietest, above=0.0))


def _phase_crossovers(looked: Scan, quietest: float) -> Array:
    from pidalab.robustness import _scan

    floor = quietest if looked.factors.delay else 0.0
    return _scan.phase_crossings(looked.w, looked.parts(quietest, _scan.COARSE), floor, *looked.factors)


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
        Named values, right to nine digits, frequencies of peaks to six. For an unstable loop ``stable`` is False and
        the margins are NaN.

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
    gain margin 3.142 at 1.571, phase margin 61.35 deg at 0.5, delay margin 2.142
    """
    if getattr(loop, "digital", None) is not None:
        return _sampled(loop)
    require_well_posed(loop)
    looked, quietest = scan(loop), QUIETEST
    wgc = _gain_crossovers(looked)
    if not is_stable(loop):
        none = math.nan
        return Margins(False, none, none, none, none, none, none, none, none, none, none, wgc, np.zeros(0))
    wpc = _phase_crossovers(looked, quietest)
    while loop.process.delay and quietest > 1e-12 and not np.any(np.abs(loop.L(1j * wpc)) < 1):
        quietest /= 10
        wpc = _phase_crossovers(looked, quietest)
    lag = np.mod(np.angle(loop.L(1j * wgc)) + np.pi, 2 * np.pi)  # what further dead time must add
    rotation = np.minimum(lag, 2 * np.pi - lag)
    # at zero and infinite frequency L is real: these are phase crossovers too where it is negative
    at = np.concatenate([[0.0], wpc, [math.inf]])
    at_zero, at_infinity = _worst_ends(loop)
    size = np.concatenate([[max(-at_zero, 0.0)], np.abs(loop.L(1j * wpc)), [max(-at_infinity, 0.0)]])
    small, large = np.where(size < 1, size, 0.0), size[size > 1]
    (ms, wms), (mt, wmt) = _peaks(loop, looked, 2)
    return Margins(
        stable=True,
        gm=float(1 / small.max()) if small.any() else math.inf,
        gm_low=float(1 / large.min()) if large.size else 0.0,
        pm=float(np.degrees(rotation.min(initial=math.inf))),
        # with |L| >= 1 out to infinity, any extra dead time is too much
        dm=0.0 if abs(ends(loop)[1]) >= 1 else float(np.min(lag / wgc, initial=math.inf)),
        ms=ms,
        mt=mt,
        wgc=float(wgc[np.argmin(rotation)]) if wgc.size else math.nan,
        wpc=float(at[np.argmax(small)]) if small.any() else math.nan,
        wms=wms,
        wmt=wmt,
        gain_crossovers=wgc,
        phase_crossovers=wpc,
    )


def _sampled(loop: Loop) -> Margins:
    """Margins of a loop with a digital controller."""
    if is_stable(loop):
        return Margins(**margins_sampled(loop, loop.controller))
    none = math.nan
    return Margins(
        False, none, none, none, none, none, none, none, none, none, none, np.zeros(0), np.zeros(0)
    )
