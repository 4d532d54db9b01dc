"""The gain with which a loop has a given maximum sensitivity."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, open_loop
from pidalab.robustness.axis import SENSITIVITY
from pidalab.robustness.in_s import unit_axis
from pidalab.robustness.poles import count_unstable

QUIETEST_GIVEN = 0.1  # |L| of the given loop above which the turns of its dead time are followed
FAR_SHARE = 1e-2  # of the last frequency, up to which gains are looked for at first
AROUND_PEAK = np.linspace(0.97, 1.03, 61)  # a peak that lies between the frequencies looked at
MS_RTOL = 1e-6  # share by which Ms may exceed the one wanted before the last step
MOST_LOOKS = 8  # at where the peak is


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
