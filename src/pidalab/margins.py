r"""Robustness margins and stability with exact dead time.

The magnitude of L(jw) is that of its rational part: smooth on a logarithmic grid. Its phase also turns by the dead
time, without end. So the grid is logarithmic, and is divided further where the dead time turns the phase quickly *and*
L is large enough for it to matter. Candidates from the grid are then refined to full precision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize.elementwise import find_minimum, find_root

from pidalab._check import Array
from pidalab.loop import Loop, open_loop

PER_DECADE = 120  # points of the logarithmic grid
TURN = 0.25  # largest turn of the phase by the dead time between two points, in rad
QUIETEST = 1e-2  # loops are searched for phase crossovers while |L| is above this, lower if there are none
ON_AXIS = 1e-9  # closed-loop characteristic relative to its terms below which a pole is taken to lie on the axis


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


def _roots(loop: Loop) -> Array:
    return np.concatenate([np.roots(p) for p in open_loop(loop)])


def _rational(loop: Loop, w: Array) -> Any:
    s = 1j * w
    value = np.ones_like(s)
    for name in ("process", "controller", "output_filter"):
        value = value * loop.block(name, s)
    return value


def _grid(loop: Loop, loud: float) -> Array:
    """Frequencies that follow L everywhere, and the turns of its dead time wherever |L| >= loud."""
    roots = _roots(loop)
    delay = loop.process.delay
    corners = np.abs(roots[roots != 0])
    scale = np.concatenate([corners, [1 / delay] if delay else [], [1.0] if not corners.size and not delay else []])
    low, high = np.log10(scale.min()) - 4, np.log10(scale.max()) + 4
    w = np.logspace(low, high, int(PER_DECADE * (high - low)) + 1)
    # lightly damped roots are narrower than the grid: add points around each at the scale of its damping
    near = np.concatenate([-np.logspace(3, -2, 40), [0.0], np.logspace(-2, 3, 40)])
    sharp = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.2 * np.abs(roots))]
    local = [abs(root.imag) + np.maximum(abs(root.real), 1e-9 * abs(root)) * near for root in sharp]
    w = np.unique(np.concatenate([w, *local]))
    w = w[(w > 10**low) & (w < 10**high)]
    if delay:
        size = np.abs(_rational(loop, w))
        heard = np.maximum(size[:-1], size[1:]) >= loud
        pieces = np.where(heard, np.ceil(np.diff(w) * delay / TURN), 1).astype(int)
        first = np.repeat(np.cumsum(pieces) - pieces, pieces)
        share = (np.arange(pieces.sum()) - first) / np.repeat(pieces, pieces)
        w = np.append(np.repeat(w[:-1], pieces) + share * np.repeat(np.diff(w), pieces), w[-1])
    return w


def _ends(loop: Loop) -> tuple[float, float]:
    """Limits of L(s) e^{s delay}, a real number, at s = 0 (infinite for integral action) and at infinity."""
    num, den = open_loop(loop)
    at_zero = num[-1] / den[-1] if den[-1] else math.inf if num[-1] else _ends_cancelled(num, den)
    return float(at_zero), float(num[0] / den[0]) if len(num) == len(den) else 0.0


def _ends_cancelled(num: Array, den: Array) -> float:
    """The limit at s = 0 where both num and den vanish there."""
    zeros, poles = (int(np.flatnonzero(p[::-1])[0]) for p in (num, den))
    return 0.0 if zeros > poles else math.inf if poles > zeros else float(num[-1 - zeros] / den[-1 - poles])


def _peak(loop: Loop, w: Array, complementary: bool) -> tuple[float, float]:
    """Supremum of |S|, or of |T|, and where it lies."""

    def value(w: Array) -> Array:
        return np.abs(loop.T(1j * w) if complementary else loop.S(1j * w))

    loop_value, height = loop.L(1j * w), value(w)
    at_zero, at_infinity = _ends(loop)
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
    first = np.abs(loop.S(1j * _grid(loop, 0.5))).max()
    floor = 1 - 1 / max(first, 1 + 1e-9)  # where |L| is smaller than this, |S| cannot be larger than found
    return _peak(loop, _grid(loop, 0.99 * floor), complementary=False)


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
        return np.log(np.abs(_rational(loop, np.exp(x))))

    x = np.log(_grid(loop, np.inf))
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

    x = np.log(_grid(loop, quietest))
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
    mt, wmt = _peak(loop, _grid(loop, 0.05), complementary=True)
    end = abs(_ends(loop)[1])
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


def unstable_poles(loop: Loop) -> float:
    """Number of closed-loop poles in the closed right half-plane, by the argument principle with exact dead time.

    The characteristic function D(s) + N(s) e^{-s delay} is not reduced, so a cancelled unstable pole counts.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    int or float
        The number; ``math.inf`` for a neutral loop with \\|L\\| >= 1 at infinite frequency, which has infinitely many
        poles on or to the right of the axis (or arbitrarily near it).

    Raises
    ------
    ArithmeticError
        If the argument cannot be followed: a root too close to the contour.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.unstable_poles(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.5))
    0
    >>> pidalab.unstable_poles(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.6))
    2
    """
    if loop.process.delay and abs(_ends(loop)[1]) >= 1 - 1e-12:
        return math.inf
    w = np.concatenate([[0.0], _grid(loop, 0.5)])
    scale = float(w[1]) * 1e4  # the slowest corner of the loop
    for shift in (0.0, -1e-7 * scale, -1e-5 * scale):  # a contour just left of the axis takes in the roots on it
        count = _encirclements(loop, w, shift)
        if count is not None:
            return count
    raise ArithmeticError("the closed loop has a pole so close to the imaginary axis that it cannot be counted")


def _encirclements(loop: Loop, w: Array, shift: float) -> int | None:
    """Count the zeros of the characteristic function to the right of Re s = shift; None if one is on the contour."""
    num, den = open_loop(loop)
    roots = np.roots(den)
    reference = np.where(roots == 0, np.min(np.abs(roots[roots != 0]), initial=1.0), np.abs(roots)) + 2 * abs(shift)

    def characteristic(w: Array) -> tuple[Array, Array]:
        s = shift + 1j * w
        scaled_den, scaled_num = np.ones_like(s), np.full_like(s, 1 / den[0])
        for root, ref in zip(roots, reference, strict=True):
            scaled_den = scaled_den * (s - root) / (s + ref)
        scaled_num = np.polyval(num, s) / den[0] * np.exp(-s * loop.process.delay)
        for ref in reference:
            scaled_num = scaled_num / (s + ref)
        return scaled_den + scaled_num, np.abs(scaled_den) + np.abs(scaled_num)

    f, size = characteristic(w)
    for _ in range(60):
        if np.any(np.abs(f) <= ON_AXIS * size):
            return None
        turn = np.angle(f[1:] / f[:-1])
        wide = np.flatnonzero(np.abs(turn) > 0.8)
        if not wide.size:
            break
        middle = 0.5 * (w[wide] + w[wide + 1])
        f_mid, size_mid = characteristic(middle)
        w, f, size = np.insert(w, wide + 1, middle), np.insert(f, wide + 1, f_mid), np.insert(size, wide + 1, size_mid)
    else:
        return None
    limit = 1.0 if loop.process.delay else 1 + _ends(loop)[1]  # with dead time f circles around 1, |L| < 1
    total = float(np.sum(turn)) - float(np.angle(f[-1] / limit))
    count = -total / np.pi
    return round(count) if abs(count - round(count)) < 0.2 else None


def is_stable(loop: Loop) -> bool:
    """Whether all closed-loop poles lie in the open left half-plane, with exact dead time.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    bool
        True if stable. A pole on the imaginary axis, or a chain of poles that approaches it, is not stable.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.is_stable(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.5))
    True
    >>> pidalab.is_stable(pidalab.Loop(pidalab.Process([1.0], [1.0], delay=1.0), 1.0))
    False
    """
    return unstable_poles(loop) == 0
