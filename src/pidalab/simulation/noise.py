"""Measurement noise that is held between samples, reproducible by its seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array


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
