"""Stability of loops with exact dead time, by the argument principle."""

from __future__ import annotations

import math

import numpy as np

from pidalab._check import Array
from pidalab.frequency import ends, grid
from pidalab.loop import Loop, open_loop, require_well_posed

ON_AXIS = 1e-9  # characteristic function relative to its terms below which a pole is taken to lie on the contour


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
    ValueError
        For an ill-posed loop: no dead time and a direct feedthrough of exactly -1.
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
    require_well_posed(loop)
    if loop.process.delay and abs(ends(loop)[1]) >= 1 - 1e-12:
        return math.inf
    w = np.concatenate([[0.0], grid(loop, 0.5)])
    for lean in (0.0, 1e-9, 1e-7):  # a contour that leans to the left takes in the roots on the axis
        count = _encirclements(loop, w, lean)
        if count is not None:
            return count
    raise ArithmeticError("the closed loop has a pole so close to the imaginary axis that it cannot be counted")


def _encirclements(loop: Loop, w: Array, lean: float) -> int | None:
    """Count the zeros of the characteristic function right of s = jw - lean (w + w_min); None if one is on it."""
    num, den = open_loop(loop)
    roots, slowest = np.roots(den), w[1]
    reference = np.where(roots == 0, np.min(np.abs(roots[roots != 0]), initial=1.0), np.abs(roots))

    def characteristic(w: Array) -> tuple[Array, Array]:
        s = 1j * w - lean * (w + slowest)
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
    limit = 1.0 if loop.process.delay else 1 + ends(loop)[1]  # with dead time f circles around 1, |L| < 1
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
