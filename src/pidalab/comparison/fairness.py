"""A design at the robustness and the noise of others: only then do their errors compare."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import Controller, HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process, require_process
from pidalab.rules import Design

AROUND = np.linspace(0.97, 1.03, 61)  # a peak that lies between the frequencies looked at
KEPT = 1e-6  # share by which Ms may be missed
ROUNDS = 8  # of looking where the peak is
SLOWEST = 1e4  # filter time that is tried, in sample times
CLOSE = 1e-5  # share to which the filter time is found
DENSITY = 4  # of the frequencies over which noise is summed: good for six digits
TOO_LOUD = 3.0  # logarithm of a noise gain over its limit: more is no worse
SMALLEST = 0.01  # factor of the gains: with less of it nearly any loop is robust, and does nothing


def at_equal_terms(
    design: Design, process: Process, ms: float, noise_gain: float, sample_time: float
) -> Design:
    r"""Scale the gain and the filter of a design to a given maximum sensitivity and noise gain.

    The proportions of its gains stay: ti, td and ta are the rule's own. Its filters give way to that of the optima,
    :math:`1/(1 + T_f s)^{m+1}` behind all actions, m the highest derivative. :math:`T_f` is the shortest, from the
    sample time upwards, with which the noise gain stays within its limit, and the gain is the largest with which Ms is
    reached from below.

    Parameters
    ----------
    design : Design
        Of any rule; its prefilter is left out, for it changes neither Ms nor noise nor the response to a load.
    process : Process
        The plant.
    ms : float
        Maximum sensitivity to be reached, above 1.
    noise_gain : float
        Largest standard deviation of u per unit of that of white measurement noise.
    sample_time : float
        Sample time of that noise, and shortest filter time.

    Returns
    -------
    Design
        With a `HighOrderPID`. Its `info`: ``factor`` of the gains, ``ms``, and ``noise_gain``, which stays below its
        limit where the filter is as short as the sample.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, for a design whose gains have no common form, and where no gain above a hundredth
        of the rule's gives a stable loop with this Ms, or no filter one with this noise.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.comparison import at_equal_terms
    >>> process = pidalab.lags(3, delay=1.0)
    >>> design = pidalab.rules.classical.simc(process)
    >>> fair = at_equal_terms(design, process, ms=1.4, noise_gain=1.0, sample_time=0.1)
    >>> print(f"{fair.factor:.2f} {pidalab.max_sensitivity(fair.loop())[0]:.3f} {fair.noise_gain:.2f}")
    0.62 1.400 1.00
    """
    if not isinstance(design, Design):
        raise TypeError(f"design must be a pidalab.Design, found {type(design).__name__}")
    require_process("process", process)
    limit = _check.real("ms", ms, above=1.0)
    most = _check.real("noise_gain", noise_gain, above=0.0)
    shortest = _check.real("sample_time", sample_time, above=0.0)
    gains = _gains(design.controller)
    noise_of = _noise(process, gains.size, shortest)

    def scaled(log_time: float) -> tuple[float, float, HighOrderPID]:
        time = shortest * math.exp(log_time)
        factor = _largest_gain(process, gains, time, limit)
        return noise_of(factor * gains, time), factor, _filtered(factor * gains, time)

    noise, factor, controller = _quiet_enough(scaled, most)
    reached = _peak(Loop(process, controller))[0]
    info = {"factor": factor, "ms": reached, "noise_gain": noise}
    return Design(process, controller, source=f"{design.source}, at equal terms", info=info)


def _gains(controller: Controller) -> Array:
    """Gains from the integral upwards, without absent derivatives."""
    own = controller.coefficients if isinstance(controller, HighOrderPID) else controller.gains()
    gains = np.trim_zeros(np.array(own), "b")
    return np.append(gains, np.zeros(max(0, 2 - gains.size)))


def _filtered(gains: Array, time: float) -> HighOrderPID:
    return HighOrderPID(gains.tolist(), time, gains.size - 1)


def _noise(process: Process, size: int, sample_time: float) -> Callable[[Array, float], float]:
    """Return the function that gives the noise gain; infinite where the loop does not bear to be sampled."""
    from pidalab.comparison.candidates import time_scale
    from pidalab.optimal._noise import SampledNoise
    from pidalab.optimal._problem import Problem

    problem = Problem(process, size - 2, (1.0, time_scale(process)), "load")
    variance = SampledNoise(problem, sample_time, DENSITY)

    def noise_of(gains: Array, time: float) -> float:
        x = np.append(gains / problem.units, math.log(time / problem.time))
        return math.inf if variance.unstable(x) else math.sqrt(variance(x)[0])

    return noise_of


def _peak(loop: Loop) -> tuple[float, float]:
    from pidalab.robustness.margins import max_sensitivity

    return max_sensitivity(loop)


def _quiet_enough(scaled: Any, most: float) -> tuple[float, float, HighOrderPID]:
    """The shortest filter with which the noise stays within its limit, found in the logarithm of its time."""
    from scipy.optimize import brentq

    def excess(log_time: float) -> float:
        noise = scaled(log_time)[0]
        return min(math.log(noise / most), TOO_LOUD)

    low, high = 0.0, 1.0
    if excess(low) <= 0:
        return scaled(low)
    while excess(high) > 0:
        low, high = high, high + 1.0
        if high > math.log(SLOWEST):
            raise ValueError(
                f"no filter time keeps noise_gain = {most:g} with the proportions of this design"
            )
    found = scaled(brentq(excess, low, high, xtol=CLOSE))
    if found[0] <= most * (1 + 10 * CLOSE):
        return found
    # the gain jumps there from one range of allowed gains to another: stay on the side that is quiet enough
    while high - low > CLOSE:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return scaled(high)


def _largest_gain(process: Process, gains: Array, time: float, ms: float) -> float:
    """The largest factor of the gains with which the loop is stable and Ms is reached from below."""
    from pidalab.robustness.poles import is_stable

    unit = Loop(process, _filtered(gains, time))
    w = _frequencies(process, time)
    for _ in range(ROUNDS):
        candidates = (factor * (1 - KEPT) for factor in _reached_from_below(unit.L(1j * w), ms))
        stable = (
            k for k in candidates if k >= SMALLEST and is_stable(Loop(process, _filtered(k * gains, time)))
        )
        factor = next(stable, None)
        if factor is None:
            break
        peak, at = _peak(Loop(process, _filtered(factor * gains, time)))
        if peak <= ms * (1 + KEPT):
            return factor
        w = np.sort(np.append(w, at * AROUND))
    raise ValueError(
        f"no gain above {SMALLEST:g} of its own gives the proportions of this design a stable loop with Ms = {ms:g}"
    )


def _frequencies(process: Process, time: float) -> Array:
    """From far below the slowest corner of plant and filter to far above the fastest."""
    from pidalab.roots import roots

    corners = np.abs(np.concatenate([roots(process.den), roots(process.num)]))
    corners = np.append(corners[corners > 0], 1 / time)
    corners = np.append(corners, 1 / process.delay) if process.delay else corners
    low, high = 1e-3 * corners.min(), 1e2 * corners.max()
    return np.geomspace(low, high, int(300 * math.log10(high / low)))


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
