"""The exact engine for many loops at once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial

from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab._many import each
from pidalab.loop import Loop, require_loop
from pidalab.response import Response
from pidalab.simulation.exact import respond


def simulate_many(
    loops: Sequence[Loop],
    t: ArrayLike,
    setpoint: ArrayLike = 0.0,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    executor: Executor | None = None,
    progress: bool = False,
) -> list[Response]:
    """Simulate the same experiment on many linear loops, exactly, on all processors.

    Parameters
    ----------
    loops : sequence of Loop
        The loops, stable or not.
    t : array_like, shape (n,)
        Uniform times that start at 0.
    setpoint, load, noise : float or array_like, shape (n,), optional
        The same for all loops. A number is a step at t = 0; an array is held from each sample to the next.
    executor : concurrent.futures.Executor, optional
        Who computes: by default one thread for each processor that this process may use. It is left open.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    list of Response
        As `simulate` returns them, in the order of the loops.

    Raises
    ------
    TypeError, ValueError
        As `simulate`, with the number of the loop.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> loops = [pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), gain) for gain in (0.3, 0.4, 0.5)]
    >>> responses = pidalab.simulate_many(loops, np.linspace(0.0, 40.0, 401), setpoint=1.0)
    >>> [round(r.iae(), 3) for r in responses]
    [3.333, 2.504, 2.169]
    """
    t = _check.uniform_time("t", t)
    r, d, n = (
        _check.signal(*pair, t.size) for pair in (("setpoint", setpoint), ("load", load), ("noise", noise))
    )
    return each("loops", partial(_one, t, r, d, n), loops, executor, progress)


def _one(t: Array, r: Array, d: Array, n: Array, loop: Loop) -> Response:
    require_loop(loop)
    return respond(loop, t, r, d, [n])[0]
