r"""Relative noise gain: a noise gain that does not depend on the units of y, u and time.

White measurement noise has a new value in each sample time h. The *noise gain* of a loop is the standard deviation of u
divided by the standard deviation of this noise. The noise gain depends on h, which is here a hundredth of the
ultimate period of the plant. The *relative noise gain* is the noise gain divided by the ultimate gain of the plant. A
proportional controller with a tenth of the ultimate gain has a relative noise gain near 0.1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pidalab.controllers import Controller
from pidalab.loop import Loop, require_loop
from pidalab.process import Process, require_no_zero_at_origin
from pidalab.reduction import ultimate_frequency
from pidalab.roots import roots
from pidalab.simulation.sampled import noise_gain

SAMPLES = 100  # number of samples of the noise in an ultimate period


class NoiseScale(NamedTuple):
    """Sample time of measurement noise and unit of the noise gain for one plant.

    Attributes
    ----------
    sample_time : float
        Time over which a value of the noise is held.
    gain : float
        Gain, in units of u per unit of y, by which noise gains are divided.
    """

    sample_time: float
    gain: float

    @property
    def period(self) -> float:
        """Period T of `noise_scale`, which is 100 sample times."""
        return SAMPLES * self.sample_time


def noise_scale(process: Process) -> NoiseScale:
    r"""Return the sample time of noise and the unit of the noise gain for a plant.

    With the ultimate frequency :math:`\omega_u` (see `pidalab.reduction.ultimate_frequency`), the period is :math:`T =
    2\pi/\omega_u` and the gain is :math:`1/|P(j\omega_u)|`. Some plants have no ultimate frequency, such as two lags
    without dead time. For these, and for unstable plants, T is the sum of the time constants and the dead time, and the
    gain is :math:`1/|P(0)|`. If such a plant has k integrators, :math:`P \to K/s^k` at low frequency, and the gain is
    :math:`1/(|K|\,T^k)`. The time constant of a pole p is :math:`1/|p|`.

    Parameters
    ----------
    process : Process
        The plant.

    Returns
    -------
    NoiseScale
        The sample time T/100, and the gain.

    Raises
    ------
    TypeError, ValueError
        If the argument is not a Process, the static gain is 0, or the plant has neither time constant nor dead time,
        such as 1/s.

    Examples
    --------
    >>> import pidalab
    >>> scale = pidalab.noise_scale(pidalab.lags(3))
    >>> print(f"{scale.gain:.3f} {scale.sample_time:.4f}")
    8.000 0.0363
    """
    require_no_zero_at_origin("process", process)
    try:
        w = ultimate_frequency(process)
    except ValueError:
        return _without_ultimate_period(process)
    return NoiseScale(2 * math.pi / w / SAMPLES, 1 / float(abs(process(1j * w))))


def _without_ultimate_period(process: Process) -> NoiseScale:
    poles = np.abs(roots(process.den))
    integrators = int(np.sum(poles == 0))
    time = float(np.sum(1 / poles[poles > 0])) + process.delay
    if not time:
        raise ValueError(
            f"process must have a time constant or a dead time, found {process!r}; for this process, give a sample time"
        )
    static = float(process.num[-1] / process.den[-1 - integrators])
    return NoiseScale(time / SAMPLES, 1 / (abs(static) * time**integrators))


def relative_noise_gain(loop: Loop) -> float:
    """Return the dimensionless noise gain of a loop, relative to its plant.

    Parameters
    ----------
    loop : Loop
        A stable loop with a continuous controller.

    Returns
    -------
    float
        `pidalab.noise_gain` with the sample time of `noise_scale`, divided by the gain of `noise_scale`. If the filter
        time of the controller is below the sample time, the controller is discretised by backward differences.

    Raises
    ------
    TypeError, ValueError
        As for `noise_scale` and `pidalab.noise_gain`.

    Examples
    --------
    >>> import pidalab
    >>> loop = pidalab.Loop(pidalab.lags(3), pidalab.PIDA(kp=0.8, ti=3.0))
    >>> print(f"{pidalab.relative_noise_gain(loop):.3f}")
    0.100
    """
    require_loop(loop)
    scale = noise_scale(loop.process)
    gain, remark = sampled_noise(loop, scale.sample_time)
    if math.isnan(gain):
        raise ValueError(remark)
    return gain / scale.gain


def sampled_noise(loop: Loop, sample_time: float) -> tuple[float, str]:
    """Return the noise gain of the sampled loop and a remark, which says what was measured or why the gain is NaN."""
    try:
        return noise_gain(loop, sample_time), ""
    except ValueError as refusal:
        reason = " ".join(str(refusal).split())
    if not isinstance(loop.controller, Controller):
        return math.nan, f"no noise gain: {reason}"
    # If the filter is faster than the sample time, measure the controller as a PLC would run it.
    try:
        digital = loop.controller.discretise(sample_time, "backward", loop.output_filter)
        remark = "noise gain of the digital form (backward differences)"
        return noise_gain(Loop(loop.process, digital), sample_time), remark
    except ValueError:
        return math.nan, f"no noise gain: {reason}"
