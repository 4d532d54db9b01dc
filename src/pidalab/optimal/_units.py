"""The unit of time of a search, in which the loop around a process has numbers near 1."""

from __future__ import annotations

import math

import numpy as np

from pidalab._check import Array
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import SPARE, Search
from pidalab.process import Process
from pidalab.reduction import turned_phase
from pidalab.requirements import Requirements
from pidalab.roots import roots

CORNER = -0.75 * math.pi  # phase of the process at the frequency that sets the unit of time
INTEGRATORS_TURN = 0.25 * math.pi  # the same, after what several integrators turn it by
# factor by which a limit of noise has to be slower than that phase before it sets the unit
NOISE_SLOWDOWN = 8.0
QUIET_SHARE = 0.1  # of the noise allowed, proportional action in that unit, where nothing else sets it


def unit_of_time(process: Process, limits: Requirements) -> float:
    """Unit of time in which a loop around the process has numbers near 1, if nothing but robustness limits it."""
    poles = roots(process.den)
    integrators = int(np.sum(poles == 0))
    speeds = np.abs(np.concatenate([poles, roots(process.num)]))
    speeds = speeds[speeds > 0]
    corners = np.append(speeds, 1 / process.delay) if process.delay else speeds
    if not corners.size:
        return _by_noise(process, integrators, limits)
    growing = np.max(poles.real, initial=0.0)
    if growing > 0:  # between what runs away and what cannot be answered sooner
        return 1 / math.sqrt(growing * float(corners.max()))
    w = np.geomspace(1e-3 * corners.min(), 1e3 * corners.max(), 4000)
    at_rest = -0.5 * np.pi * integrators
    turned = at_rest + turned_phase(process, w) < min(CORNER, at_rest - INTEGRATORS_TURN)
    fastest = float(w[np.argmax(turned)]) if turned.any() else float(corners.max())
    loudest = _loudest(process, limits, w)
    return 1 / (loudest if fastest > NOISE_SLOWDOWN * loudest else fastest)


def _loudest(process: Process, limits: Requirements, w: Array) -> float:
    """Frequency up to which a loop can act under a limit of noise: to act is to have |C S| near 1/|P|."""
    asked = 1 / np.abs(process(1j * w))
    able = np.ones(w.size, dtype=bool)
    if limits.mks is not None:
        able &= asked <= limits.mks
    if limits.noise_gain is not None and limits.sample_time is not None:
        # white noise that is sampled has its power below pi over the sample time, evenly
        power = np.cumsum(asked**2 * np.gradient(w)) * limits.sample_time / np.pi
        able &= power <= limits.noise_gain**2
    return float(w[able].max()) if able.any() else math.inf


def _by_noise(process: Process, integrators: int, limits: Requirements) -> float:
    """The unit for integrators alone, around which nothing but noise limits a loop."""
    loudest = limits.mks or limits.noise_gain
    if not integrators or loudest is None:
        raise ValueError(
            "process must have a lag or a dead time: a gain alone has no best controller, and integrators alone have "
            "one only under a limit of noise (mks, or noise_gain with sample_time)"
        )
    gain = abs(float(process.num[-1] / process.den[0]))
    return float((gain * QUIET_SHARE * loudest) ** (-1 / integrators))


def search_in(
    process: Process, order: int, limits: Requirements, factor: float = 1.0, spare: float = SPARE
) -> Search:
    """Return a search in the unit of time that fits a process, times a factor.

    Parameters
    ----------
    process : Process
        With positive gain.
    order : int
        Highest derivative.
    limits : Requirements
        Requirements of the design.
    factor : float, optional
        Of the unit of time.
    spare : float, optional
        Share of a limit that is kept free, for peaks between the frequencies looked at.

    Returns
    -------
    Search

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.optimal.parts import search_in
    >>> from pidalab.requirements import Requirements
    >>> search_in(pidalab.lags(3, delay=1.0), 1, Requirements(ms=1.6)).problem.gains
    3
    """
    unit = factor * unit_of_time(process, limits)
    return Search(Problem(process, order, (abs(complex(process(1j / unit))), unit)), limits, spare)
