"""Measurement noise that is held between samples: a record reproducible by its seed, and what a loop makes of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, require_loop
from pidalab.robustness.poles import is_stable
from pidalab.simulation.sampled import simulate_sampled

TAIL_SAMPLES, LONGEST_TAIL = 4096, 1 << 20  # samples of a response to noise, at first and at most
# Share of the squares that the second half of such a response may hold. What comes later is left out: of a tail that
# falls by e in N samples at most FADED N / TAIL_SAMPLES of the squares, so the gain is low by at most half of that,
# 1e-10 of itself for a tail of a million samples, 1e-7 for one of a thousand millions.
FADED = 1e-12
# dead times that such a response covers at least: what comes back of the noise comes after the first
ECHOES = 4


def uniform_noise(t: ArrayLike, amplitude: float, seed: int, hold: float | None = None) -> Array:
    """Uniformly distributed noise in [-amplitude, amplitude], held for a fixed time.

    Parameters
    ----------
    t : array_like, shape (n,)
        Uniform times that start at 0.
    amplitude : float
        Largest absolute value, not negative.
    seed : int
        Seed of the generator; the same seed gives the same record.
    hold : float, optional
        Time for which a value is held, a multiple of the step of t; by default one step.

    Returns
    -------
    ndarray, shape (n,)
        The record.

    Raises
    ------
    ValueError
        For a negative amplitude or a hold that is not a multiple of the step.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.uniform_noise(np.arange(4) * 0.5, amplitude=0.1, seed=0, hold=1.0).round(4).tolist()
    [0.0274, 0.0274, -0.046, -0.046]
    """
    t = _check.uniform_time("t", t)
    amplitude = _check.real("amplitude", amplitude, at_least=0.0)
    step = t[-1] / (t.size - 1)
    each = 1.0 if hold is None else _check.real("hold", hold, above=0.0) / step
    repeats = round(each)
    if repeats < 1 or abs(each - repeats) > 1e-6:
        raise ValueError(f"hold must be a multiple of the step of t ({step:g}), found {hold!r}")
    values = np.random.default_rng(_check.integer("seed", seed, at_least=0)).uniform(
        -amplitude, amplitude, -(-t.size // repeats)
    )
    return np.repeat(values, min(repeats, t.size))[: t.size]


def noise_gain(loop: Loop, sample_time: float) -> float:
    r"""Standard deviation of the control signal per unit of that of white measurement noise, in the sampled loop.

    The noise n is held for a sample, the controller is digital as in `simulate_sampled`, and set point and load rest.
    Limits, a limit of rate and a deadband are left out: the ratio is that of the linear loop.
    By Parseval the ratio is the root of the sum of squares of the control signal after a single sample of noise of
    height 1, that is, the H2 norm from n to u; no random number takes part.

    Parameters
    ----------
    loop : Loop
        The loop, stable, and stable also with this sample time.
    sample_time : float
        Sample time of controller and noise, above 0.

    Returns
    -------
    float
        The ratio, in units of u per unit of y: σ_rel of vrancic2021, eq. (35).

    Raises
    ------
    TypeError, ValueError
        As `simulate_sampled`; for an unstable loop; and if a million samples do not hold four dead times, or the
        response to the noise does not fade within them.

    Examples
    --------
    >>> import pidalab
    >>> loop = pidalab.Loop(pidalab.Process([1.0], [1.0, 1.0]), pidalab.PIDA(kp=2.0, ti=1.0))
    >>> pidalab.noise_gain(loop, sample_time=0.01)
    2.002
    """
    h = _check.real("sample_time", sample_time, above=0.0)
    loop = _linear(loop)
    for samples in _lengths(loop, h):
        pulse = np.zeros(samples)
        pulse[0] = 1.0
        u = simulate_sampled(loop, h * np.arange(samples), setpoint=0.0, noise=pulse).u
        largest = float(np.max(np.abs(u))) or 1.0
        squares = (u / largest) ** 2
        total, late = float(np.sum(squares)), float(np.sum(squares[samples // 2 :]))
        if late <= FADED * total:
            return largest * math.sqrt(total)
    raise ValueError(
        f"loop must be stable with sample_time = {h:g}, and fade sooner: {100 * late / total:.3g} % of the squares of "
        f"u after one pulse of noise come in the second half of {samples} samples"
    )


def _linear(loop: Loop) -> Loop:
    """Return the loop without limits and deadband."""
    require_loop(loop)
    own, none = loop.controller, (-math.inf, math.inf)
    if loop.digital is not None:
        own = replace(loop.digital, limits=none, rate_limit=math.inf, deadband=0.0)
    elif loop.limits != none:
        own = replace(own, limits=none)
    return loop if own is loop.controller else Loop(loop.process, own, loop.output_filter, loop.prefilter)


def _lengths(loop: Loop, h: float) -> list[int]:
    """Return the numbers of samples to try, or raise for a loop whose noise comes back later, or ever stronger."""
    if not is_stable(loop):
        border = "in the closed right half-plane, or arbitrarily near it"
        where = border if loop.digital is None else "on or outside the unit circle"
        raise ValueError(f"loop must be stable, found poles {where}")
    shortest = ECHOES * loop.process.delay / h
    if shortest > LONGEST_TAIL:
        raise ValueError(
            f"sample_time must be at least {ECHOES * loop.process.delay / LONGEST_TAIL:.3g}, for {ECHOES} dead "
            f"times in {LONGEST_TAIL} samples, found {h:g}"
        )
    lengths = [max(TAIL_SAMPLES, math.ceil(shortest))]
    while 4 * lengths[-1] <= LONGEST_TAIL:
        lengths.append(4 * lengths[-1])
    return lengths
