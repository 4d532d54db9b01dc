"""Scale a design to the robustness and the noise of others, so that their errors compare."""

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
from pidalab.robustness.margins import gain_for_ms, max_sensitivity
from pidalab.roots import border
from pidalab.rules import Design
from pidalab.rules.models import time_scale

LONGEST_FILTER = 1e4  # that is tried, in sample times
LEAST_SCALE = 0.01  # of the gains: with less, nearly any loop is robust and does nothing
TIME_RTOL = 1e-7  # share to which the filter time is found
DENSITY = 4  # factor of the number of frequencies for the noise: good for six digits


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
    gains = gains_of(design.controller)
    noise_of = _noise(process, gains.size, shortest)

    def scaled(log_time: float) -> tuple[float, float, HighOrderPID]:
        time = shortest * math.exp(log_time)
        factor = gain_for_ms(Loop(process, _filtered(gains, time)), limit)
        if factor < LEAST_SCALE:
            raise ValueError(f"ms = {limit:g} needs gains times {factor:.2g}, below {LEAST_SCALE:g}")
        return noise_of(factor * gains, time), factor, _filtered(factor * gains, time)

    noise, factor, controller = _quiet_enough(scaled, most)
    reached = max_sensitivity(Loop(process, controller))[0]
    info = {"factor": factor, "ms": reached, "noise_gain": noise}
    return Design(process, controller, source=f"{design.source}, at equal terms", info=info)


def gains_of(controller: Controller) -> Array:
    """Return the gains from the integral upwards, without absent derivatives."""
    values = controller.coefficients if isinstance(controller, HighOrderPID) else controller.gains()
    gains = np.trim_zeros(np.array(values), "b")
    return np.append(gains, np.zeros(max(0, 2 - gains.size)))


def _filtered(gains: Array, time: float) -> HighOrderPID:
    return HighOrderPID(gains.tolist(), time, gains.size - 1)


def _noise(process: Process, size: int, sample_time: float) -> Callable[[Array, float], float]:
    """Return the function that gives the noise gain; infinite where the sampled loop is unstable."""
    from pidalab.optimal.problem import Problem, SampledNoise

    problem = Problem(process, size - 2, (1.0, time_scale(process)))
    noise = SampledNoise(problem, sample_time, DENSITY)
    return lambda gains, time: noise.gain(np.append(gains / problem.units, math.log(time / problem.time)))


def _quiet_enough(scaled: Any, most: float) -> tuple[float, float, HighOrderPID]:
    """The shortest filter with which the noise stays within its limit, found in the logarithm of its time."""
    tried: dict[float, tuple[float, float, HighOrderPID]] = {}

    def quiet(log_time: float) -> bool:
        tried[log_time] = scaled(log_time)
        return tried[log_time][0] <= most

    if quiet(0.0):
        return tried[0.0]
    low, high = 0.0, 1.0
    while not quiet(high):
        low, high = high, high + 1.0
        if high > math.log(LONGEST_FILTER):
            raise ValueError(f"no filter time of this design keeps noise_gain = {most:g}")
    # by halves, and from above: the noise jumps where the gain does, from one range of allowed gains to another
    return tried[border(quiet, inside=high, outside=low, share=TIME_RTOL / high)]
