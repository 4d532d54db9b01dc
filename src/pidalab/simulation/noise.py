"""Measurement noise that is held between samples: a record reproducible by its seed, and what a loop makes of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.simulation.sampled import simulate_sampled

FIRST, MOST = 4096, 1 << 20  # samples of a response to noise, at first and at most
FADED = 1e-12  # share of the squares that the second half of such a response may hold


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
    return np.repeat(values, repeats)[: t.size]


def noise_gain(loop: Loop, sample_time: float) -> float:
    r"""Standard deviation of the control signal per unit of that of white measurement noise, in the sampled loop.

    The noise n is held for a sample, the controller is digital as in `simulate_sampled`, and set point and load rest.
    By Parseval the ratio is the root of the sum of squares of the control signal after a single sample of noise of
    height 1, that is, the H2 norm from n to u; no random number takes part.

    Parameters
    ----------
    loop : Loop
        The loop, stable also with this sample time.
    sample_time : float
        Sample time of controller and noise, above 0.

    Returns
    -------
    float
        The ratio, in units of u per unit of y: σ_rel of vrancic2021, eq. (35).

    Raises
    ------
    TypeError, ValueError
        As `simulate_sampled`, for a controller with limits, and if the response to the noise does not fade within a
        million samples.

    Examples
    --------
    >>> import pidalab
    >>> loop = pidalab.Loop(pidalab.Process([1.0], [1.0, 1.0]), pidalab.PIDA(kp=2.0, ti=1.0))
    >>> pidalab.noise_gain(loop, sample_time=0.01)
    2.002
    """
    h, samples = _check.real("sample_time", sample_time, above=0.0), FIRST
    own = getattr(getattr(loop, "controller", None), "limits", (-math.inf, math.inf))
    if any(map(math.isfinite, own)):
        raise ValueError(f"loop must be linear, found a controller with limits {own!r}")
    while samples <= MOST:
        t = h * np.arange(samples)
        pulse = np.zeros(samples)
        pulse[0] = 1.0
        u = simulate_sampled(loop, t, setpoint=0.0, noise=pulse).u
        largest = float(np.max(np.abs(u))) or 1.0
        squares = (u / largest) ** 2
        total, late = float(np.sum(squares)), float(np.sum(squares[samples // 2 :]))
        if late <= FADED * total:
            return largest * math.sqrt(total)
        samples *= 4
    raise ValueError(
        f"loop must be stable with sample_time = {h:g}: {100 * late / total:.3g} % of the squares of u after one "
        f"pulse of noise come in the second half of {samples // 4} samples"
    )
