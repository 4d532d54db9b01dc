"""Count unstable poles and find the rightmost poles of loops with exact dead time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, open_loop, require_well_posed
from pidalab.process import Process
from pidalab.robustness.axis import Axis
from pidalab.robustness.in_s import LoopFactors, from_factors, from_roots, loop_factors
from pidalab.robustness.in_z import axis_of

MOST_NODES = 512  # largest number of nodes of the collocation in the dead time
FARTHEST = 20.0  # decay rate, in 1/dead time, of the fastest poles that are sought
CLUSTER = 8  # at most this number of additional poles is returned, so that no cluster is split
# If the modulus of a pole times the dead time is below SLOWEST_SURE, rounding errors of the collocation are larger than
# the pole. Therefore the first approximation of these poles ignores the dead time.
SLOWEST_SURE = 1e-6

ABERTH = 100  # largest number of steps of Aberth's method
SOLVED = 1e-6  # a pole is accepted if its relative residual or its last relative step is at most this


def unstable_poles(loop: Loop) -> float:
    """Return the number of closed-loop poles in the closed right half-plane, by the argument principle.

    The dead time is exact. With a `DigitalController`, poles on or outside the unit circle are counted. An unstable
    pole counts even if a zero of L cancels it.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    int or float
        The number. It is ``math.inf`` for a neutral loop (with dead time and direct feedthrough) whose \\|L\\| is at
        least 1 at infinite frequency. This loop has infinitely many poles right of the imaginary axis, on the axis or
        arbitrarily close to it.

    Raises
    ------
    ValueError
        If the loop is ill-posed.
    ArithmeticError
        If a pole is too close to the stability limit to be counted.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.unstable_poles(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.5))
    0
    >>> pidalab.unstable_poles(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.6))
    2
    """
    return count_unstable(axis_of(loop))


def count_unstable(axis: Axis) -> float:
    """Count the unstable poles of a loop along its `Axis`."""
    if math.isinf(axis.end) and axis.delay and abs(axis.at_end) >= 1 - 1e-12:
        return math.inf
    slowest = axis.grid[0]
    # A contour that is tilted to the left also encloses roots on the imaginary axis. The last contour also encloses
    # roots near 0.
    for slope, shift in ((0.0, 0.0), (1e-9, 1e-9 * slowest), (1e-7, 1e-7 * slowest), (1e-7, 1e-2 * slowest)):
        count = axis.encirclements(slope, shift)
        if count is not None:
            return count
    raise ArithmeticError("the closed loop has a pole too close to the stability limit to be counted")


def is_stable(loop: Loop) -> bool:
    """Return True if all closed-loop poles lie in the open left half-plane, with exact dead time.

    Parameters
    ----------
    loop : Loop
        The loop.

    Returns
    -------
    bool
        False also if a chain of poles approaches the imaginary axis.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.is_stable(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.5))
    True
    >>> pidalab.is_stable(pidalab.Loop(pidalab.Process([1.0], [1.0], delay=1.0), 1.0))
    False
    """
    return unstable_poles(loop) == 0


def rightmost_poles(loop: Loop, count: int = 1) -> Array:
    """Return the closed-loop poles with the largest real parts, with exact dead time.

    The poles are approximated by collocation at Chebyshev points in the dead time, and refined by Newton's method on
    the characteristic function. The argument principle proves that all other poles lie further left.

    Parameters
    ----------
    loop : Loop
        The loop.
    count : int, optional
        Number of poles, at least 1. A few more are returned if a complex pair or a cluster would be split.

    Returns
    -------
    ndarray of complex
        Poles in 1/time, sorted by falling real part. Multiple poles are repeated. A pole of multiplicity k has only 1/k
        of the correct digits of a simple pole.

    Raises
    ------
    ValueError
        If the loop has fewer poles or is ill-posed.
    ArithmeticError
        If the argument principle does not confirm the poles. Possible reasons: the poles lie too close to their
        neighbours, or to the infinite chain of poles of a neutral loop (with dead time and direct feedthrough); they
        decay by more than a factor of e^20 in a dead time; or their frequencies are hundreds of rad per dead time.

    Examples
    --------
    >>> import pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 1.0)
    >>> pidalab.rightmost_poles(loop, count=2).round(6).tolist()
    [(-0.318132+1.337236j), (-0.318132-1.337236j)]
    """
    require_well_posed(loop)
    count = _check.order("count", count, at_least=1)
    num, _ = open_loop(loop)
    if not loop.process.delay or not np.any(num):
        poles, off = _of_ratio(loop)
        if poles.size < count:
            raise ValueError(f"count must be at most the order of the loop, {poles.size}, found {count}")
        last = _whole_pairs(poles, count)
        if np.any((off > 0) & (poles.real + off >= poles[last - 1].real)):
            raise ArithmeticError(f"the {count} rightmost poles cannot be separated from their neighbours")
        return poles[:last]
    delay, nodes = loop.process.delay, 32
    loop, factors = _in_dead_times(loop), _factors_in_dead_times(loop)
    with np.errstate(divide="ignore"):
        chain = np.log(abs(from_factors(factors).at_end))  # poles of a neutral loop approach this real part
    while nodes <= MOST_NODES:
        poles = _polished(loop, _collocation(loop, nodes))
        for last in range(count, min(count + CLUSTER, poles.size) + 1):
            if last == _whole_pairs(poles, last) and _all_of_them(factors, poles, last, chain):
                return poles[:last] / delay
        nodes *= 2
    if poles.size < count:
        raise ArithmeticError(
            f"count must be at most {poles.size}, the number of poles right of {-FARTHEST / delay:.4g}, found {count}"
        )
    others = "their neighbours"
    if chain > -math.inf:
        others = f"the chain of poles of this neutral loop at {chain / delay:.4g}"
    raise ArithmeticError(f"the {count} rightmost poles cannot be separated from {others}")


def _of_ratio(loop: Loop) -> tuple[Any, Any]:
    """Return the poles of a loop without dead time, sorted by falling real part, and bounds of their errors.

    Notes
    -----
    With many equal lags, the coefficients of the characteristic polynomial lose digits. Therefore Aberth's method
    refines the roots with L in factored form. If this method fails, for example around the poles of a fast filter, the
    error bound of a root is the order of the polynomial times the length of the Newton step.
    """
    factors, (num, den) = loop_factors(loop), open_loop(loop)
    if not np.any(num):
        return _sorted(np.array(factors.poles)), np.zeros(len(factors.poles))
    s = np.roots(np.polyadd(num, den))  # a first approximation; `pidalab.roots` might raise an error
    with np.errstate(all="ignore"):
        for _ in range(ABERTH):
            value, step = _newton(s, factors)
            solved = (np.abs(1 + value) <= SOLVED * (1 + np.abs(value))) | (
                np.abs(step) <= SOLVED * np.abs(s)
            )
            # A zero of L that equals a pole of L is a pole of the loop. At this pole L would be 0/0.
            cancelled = np.isin(s, factors.zeros) & np.isin(s, factors.poles)
            off = np.where(solved | cancelled | (s == 0), 0.0, s.size * np.abs(step))
            if not np.any(off):
                break
            others = np.sum(1 / (s[:, None] - s[None, :] + np.diag(np.full(s.size, np.inf))), axis=1)
            s = np.where(cancelled, s, s - step / (1 - step * others))
    order = _order(s)
    return s[order], off[order]


def _newton(s: Any, factors: LoopFactors) -> tuple[Any, Any]:
    """Return L = N/D and the step of Newton's method on D + N at s, computed from the factors of L."""
    from_zeros, from_poles = s[:, None] - factors.zeros, s[:, None] - factors.poles
    # Divide each factor of the numerator by a factor of the denominator before multiplying, since the product of all
    # factors of the numerator (or denominator) may overflow.
    pairs = min(factors.zeros.size, factors.poles.size)
    value = factors.gain * np.prod(from_zeros[:, :pairs] / from_poles[:, :pairs], axis=1)
    value = value / np.prod(from_poles[:, pairs:], axis=1)
    slope = np.sum(1 / from_poles, axis=1) + value * np.sum(1 / from_zeros, axis=1)
    return value, (1 + value) / slope


def _all_of_them(factors: LoopFactors, poles: Any, last: int, chain: float) -> bool:
    """Return True if the first `last` poles are all poles to the right of a vertical line just left of them."""
    slowest = poles[last - 1].real
    border = slowest - 1 if last == poles.size else max(0.5 * (slowest + poles[last].real), slowest - 1)
    if border <= chain + 1e-6 or slowest - border <= 1e-9 * abs(border):
        return False
    try:
        shifted = from_roots(
            factors.gain * math.exp(-border), factors.zeros - border, factors.poles - border, 1.0
        )
        return count_unstable(from_factors(shifted)) == last
    except ArithmeticError:
        return False


def _in_dead_times(loop: Loop) -> Loop:
    """Return the loop with its dead time as the unit of time."""
    num, den = (p * loop.process.delay ** np.arange(1.0 - len(p), 1.0) for p in open_loop(loop))
    return Loop(Process(num / den[0], den / den[0], 1.0), 1.0)


def _factors_in_dead_times(loop: Loop) -> LoopFactors:
    factors, delay = loop_factors(loop), loop.process.delay
    gain = factors.gain * delay ** (factors.poles.size - factors.zeros.size)
    return from_roots(gain, factors.zeros * delay, factors.poles * delay, 1.0)


def _collocation(loop: Loop, nodes: int) -> Any:
    """Return approximate poles of a loop whose dead time is the unit of time.

    Notes
    -----
    The dead time acts as a line along which a signal travels as a wave. The values of the wave at Chebyshev points,
    together with the states of the rational part of L, are the state of a linear system without dead time. The
    eigenvalues of this system approximate the poles of the loop.
    """
    num, den = open_loop(loop)
    order = len(den) - 1
    direct = num[0] / den[0] if len(num) == len(den) else 0.0
    c = np.append(np.zeros(len(den) - len(num)), num)[1:] / den[0] - direct * den[1:] / den[0]
    A = np.eye(order, k=-1)
    A[:1] = -den[1:] / den[0]
    k = np.arange(nodes + 1)
    x = np.cos(np.pi * k / nodes)
    weight = np.where((k == 0) | (k == nodes), 2.0, 1.0) * (-1.0) ** k
    D = np.outer(weight, 1 / weight) / (x[:, None] - x[None, :] + np.eye(nodes + 1))
    D = (D - np.diag(D.sum(axis=1))) * 2
    generator = np.zeros((order + nodes, order + nodes))
    generator[:order, :order] = A
    generator[:order, -1] = -np.eye(1, order)  # the input is minus the output of the loop one dead time ago
    generator[order:, order:] = D[1:, 1:]
    generator[order:, :order] = np.outer(D[1:, 0], c)
    generator[order:, -1] -= direct * D[1:, 0]
    approximate, slow = np.linalg.eigvals(generator), np.roots(np.polyadd(num, den))
    return np.append(approximate[np.abs(approximate) >= SLOWEST_SURE], slow[np.abs(slow) < SLOWEST_SURE])


def _polished(loop: Loop, approximate: Any) -> Any:
    """Refine poles by Newton's method on the characteristic function. Drop poles that do not converge to a zero."""
    num, den = open_loop(loop)
    slope_num, slope_den = np.polyder(num), np.polyder(den)
    start = best = s = approximate[approximate.real > -FARTHEST]
    least = np.full(s.shape, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(20):
            forward = np.exp(-s)
            value = np.polyval(den, s) + np.polyval(num, s) * forward
            better = (np.abs(value) < least) & (np.abs(s - start) <= 1e-2 * (np.abs(s) + SLOWEST_SURE))
            best, least = np.where(better, s, best), np.where(better, np.abs(value), least)
            slope = np.polyval(slope_den, s) + (np.polyval(slope_num, s) - np.polyval(num, s)) * forward
            step = np.where(value == 0, 0.0, value / slope)
            s = s - step
        # Far right of the axis the dead time makes `forward` negligible, and `value` consists only of rounding errors.
        # Then a pole is accepted if the step is short.
        still = np.abs(step) <= 1e-9 * np.abs(s)
        is_near = np.abs(s - start) <= 1e-2 * (np.abs(s) + SLOWEST_SURE)
        value = np.polyval(den, s) + np.polyval(num, s) * np.exp(-s)
        # In a cluster Newton's method diverges when value and slope consist only of rounding errors. Then the best
        # iterate is used.
        s = np.where(is_near & (np.abs(value) <= 10 * least), s, best)
        back, forward = np.polyval(den, s), np.polyval(num, s) * np.exp(-s)
        solved = np.abs(back + forward) <= 1e-6 * (np.abs(back) + np.abs(forward))
    return _sorted(s[solved | still & is_near])


def _sorted(poles: Any) -> Any:
    """Sort poles by falling real part. Complex pairs stay together, the pole with positive imaginary part first."""
    return poles[_order(poles)]


def _order(poles: Any) -> Any:
    unit = np.exp2(np.ceil(np.log2(np.maximum(np.abs(poles), 1e-300))))
    real, height = (np.round(part / unit, 13) * unit for part in (poles.real, np.abs(poles.imag)))
    return np.lexsort((-poles.imag, -height, -real))


def _whole_pairs(poles: Array, count: int) -> int:
    """Return `count`, or `count` + 1 if the first `count` poles would split a complex pair."""
    if count >= poles.size:
        return poles.size
    last, following = poles[count - 1], poles[count]
    return count + 1 if last.imag > 0 and abs(following - last.conjugate()) <= 1e-6 * abs(last) else count
