"""Scale a design to a given robustness and noise, so that the IAE of different designs can be compared."""

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

LONGEST_FILTER = 1e4  # longest filter time that is tried, in sample times
# Smallest allowed factor of the gains. With smaller gains, a controller has almost no effect.
LEAST_SCALE = 0.01
TIME_RTOL = 1e-7  # relative accuracy of the filter time
# With DENSITY times the usual number of frequencies, six digits of the noise gain are correct.
DENSITY = 4


def at_equal_terms(
    design: Design, process: Process, ms: float, noise_gain: float, sample_time: float
) -> Design:
    r"""Scale the gain and the filter of a design to a given maximum sensitivity and noise gain.

    The ratios of the gains, and so ti, td and ta, do not change. The filter of `pidalab.optimal`,
    :math:`1/(1 + T_f s)^{m+1}`, replaces the filters of the rule and acts on all terms. Here m is the order of the
    highest derivative. :math:`T_f` is the shortest filter time that keeps the noise gain within its limit, but at least
    the sample time. The gain is the largest with which Ms is at most `ms`.

    Parameters
    ----------
    design : Design
        Design of any rule. Its prefilter is ignored.
    process : Process
        The plant.
    ms : float
        Maximum sensitivity of the result, above 1.
    noise_gain : float
        Largest allowed noise gain, in units of u per unit of y.
    sample_time : float
        Sample time of the noise, and shortest allowed filter time.

    Returns
    -------
    Design
        Design with a `HighOrderPID`. Its `info` contains ``factor`` (by which the gains were multiplied), ``ms`` and
        ``noise_gain``.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, if no gain above a hundredth of the rule's gain gives a stable loop with this
        Ms, or if no filter time keeps the noise gain within its limit.

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
            raise ValueError(f"ms = {limit:g} needs gains scaled by {factor:.2g}, below {LEAST_SCALE:g}")
        return noise_of(factor * gains, time), factor, _filtered(factor * gains, time)

    noise, factor, controller = _quiet_enough(scaled, most)
    reached = max_sensitivity(Loop(process, controller))[0]
    info = {"factor": factor, "ms": reached, "noise_gain": noise}
    return Design(process, controller, source=f"{design.source}, at equal terms", info=info)


def gains_of(controller: Controller) -> Array:
    """Return the gains from the integral gain up to the gain of the highest derivative."""
    values = controller.coefficients if isinstance(controller, HighOrderPID) else controller.gains()
    gains = np.trim_zeros(np.array(values), "b")
    return np.append(gains, np.zeros(max(0, 2 - gains.size)))


def _filtered(gains: Array, time: float) -> HighOrderPID:
    return HighOrderPID(gains.tolist(), time, gains.size - 1)


def _noise(process: Process, size: int, sample_time: float) -> Callable[[Array, float], float]:
    """Return a function that computes the noise gain, which is infinite for an unstable sampled loop."""
    from pidalab.optimal.problem import Problem, SampledNoise

    problem = Problem(process, size - 2, (1.0, time_scale(process)))
    noise = SampledNoise(problem, sample_time, DENSITY)
    return lambda gains, time: noise.gain(np.append(gains / problem.units, math.log(time / problem.time)))


def _quiet_enough(scaled: Any, most: float) -> tuple[float, float, HighOrderPID]:
    """Search for the shortest filter time that keeps the noise within its limit.

    `scaled` is a function of log(filter time / sample time). Like this search, it returns the noise gain, the factor
    of the gains and the controller.
    """
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
            raise ValueError(f"no filter time of this design keeps the noise gain at or below {most:g}")
    # The noise gain may jump as the filter time changes, because the largest allowed gain may jump. So there
    # may be no filter time at which the noise gain equals its limit. Use the shortest filter time that was found to
    # keep the limit.
    return tried[border(quiet, inside=high, outside=low, share=TIME_RTOL / high)]
