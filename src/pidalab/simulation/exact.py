r"""Exact simulation of linear loops with dead time.

Cut at its dead time h, the loop is x' = A x + b w with w(t) = v(t - h): one delayed channel, or three beside a
filter that is far faster than the plant, with matrices in place of b, c_v and d_v. Stack the state with its own past,
(x(t), x(t - h), x(t - 2h), ...): between multiples of h this stack obeys an ordinary linear differential equation whose
matrix is block Toeplitz, that is, a polynomial in the shift z = e^{-hs}:

.. math:: \mathcal A(z) = A + b\,(c_v z + d_v c_v z^2 + d_v^2 c_v z^3 + \dots).

So :math:`x(t + \tau) = \sum_j \Phi_j(\tau)\, x(t - jh)` with :math:`\sum_j \Phi_j(\tau) z^j = e^{\mathcal A(z)\tau}`,
without any approximation as long as no multiple of h lies strictly between t and t + tau. The simulation takes four
steps:

1. a ladder of :math:`e^{\mathcal A(z)\tau} - 1` for tau = step * 2^p, by squaring (kept without the 1, so that slow
   states keep their digits next to fast ones);
2. the states at the multiples of h, one after the other;
3. from there to the first requested time in each interval: by the ladder, and a Taylor series for the rest;
4. all other requested times as matrix products: rows for a run of times, applied to the stacks of all intervals at
   once.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, require_loop
from pidalab.process import Process
from pidalab.response import Response
from pidalab.roots import roots
from pidalab.signals import REFINEMENT, apply_to_finer


def unit_step_responses(loop: Loop, t: Array, inputs: str) -> Array:
    """Exact responses of y, the running integral of y, and u to unit steps at t = 0.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    t : ndarray, shape (n,)
        Uniform times from 0. Values at a jump are those just after it.
    inputs : str
        Which inputs step, one after the other: letters out of "r", "d", "n".

    Returns
    -------
    ndarray, shape (len(inputs), 3, n)
        For each input the three signals.

    Raises
    ------
    ValueError
        For an ill-posed loop, an unstable loop whose response overflows, and a loop whose memory of past dead times
        does not fade (\\|L\\| near 1 or above at infinite frequency) over too many of them.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> from pidalab.simulation.exact import unit_step_responses
    >>> square = pidalab.Loop(pidalab.Process([1.0], [1.0], delay=1.0), 1.0)
    >>> unit_step_responses(square, np.arange(6) * 0.5, "r")[0, 0].tolist()
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    """
    from pidalab.simulation.digits import checked_responses  # compiled code: loaded when it is needed

    unit = checked_responses(loop, inputs, t.size, t[-1] / (t.size - 1))
    if not _check.all_finite(unit):
        lost = ~np.isfinite(unit).all(axis=(0, 1))
        raise ValueError(
            f"the response of the unstable loop leaves the range of numbers before t = {t[lost][0]:.4g}"
        )
    return unit


def simulate(
    loop: Loop, t: ArrayLike, setpoint: ArrayLike = 0.0, load: ArrayLike = 0.0, noise: ArrayLike = 0.0
) -> Response:
    """Simulate a linear loop exactly, dead time included.

    The loop is at rest before t = 0. No Padé approximation, no interpolation: the values are those of the
    continuous-time loop at the requested times, whether or not these are aligned with the dead time.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    t : array_like, shape (n,)
        Uniform times that start at 0.
    setpoint, load, noise : float or array_like, shape (n,), optional
        A number is a step at t = 0; an array is held from each sample to the next.

    Returns
    -------
    Response
        Signals at the times t; at a jump the value just after it.

    Raises
    ------
    ValueError
        For times that are not uniform from 0, signals of another length or with NaN, a loop that is ill-posed, and a
        controller whose limits the linear control signal exceeds: this engine has no saturation.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5)
    >>> r = pidalab.simulate(loop, np.arange(5.0), setpoint=1.0)
    >>> r.y.round(6).tolist()
    [0.0, 0.0, 0.5, 0.875, 1.020833]
    """
    require_loop(loop)
    t, r, d, n = _check.signals(t, setpoint=setpoint, load=load, noise=noise)
    return respond(loop, t, r, d, [n])[0]


def simulate_ensemble(
    loop: Loop, t: ArrayLike, noise: ArrayLike, setpoint: ArrayLike = 0.0, load: ArrayLike = 0.0
) -> list[Response]:
    """Simulate the same experiment under several records of noise, for the cost of little more than one.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    t : array_like, shape (n,)
        Uniform times that start at 0.
    noise : array_like, shape (k, n)
        One record of held noise in each row.
    setpoint, load : float or array_like, shape (n,), optional
        As for `simulate`.

    Returns
    -------
    list of Response
        One for each row.

    Raises
    ------
    ValueError
        As for `simulate`.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> noise = [pidalab.uniform_noise(t, 0.1, seed=seed) for seed in range(3)]
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.3)
    >>> len(pidalab.simulate_ensemble(loop, t, noise, setpoint=1.0))
    3
    """
    require_loop(loop)
    t = _check.uniform_time("t", t)
    rows = list(noise) if np.iterable(noise) else []
    if not rows or not all(np.iterable(row) for row in rows):
        raise ValueError("noise must have one record in each row (shape (k, n)), found no rows")
    records = [_check.signal("noise", row, t.size) for row in rows]
    r, d = _check.signal("setpoint", setpoint, t.size), _check.signal("load", load, t.size)
    return respond(loop, t, r, d, records)


def respond(loop: Loop, t: Array, r: Array, d: Array, records: list[Array]) -> list[Response]:
    """Responses to set point and load under each record of noise; the arrays have been checked."""
    require_loop(loop)
    noisy = any(_acts(record) for record in records)
    driven = "r" * _acts(r) + "d" * _acts(d) + "n" * noisy
    unit = unit_step_responses(loop, t, driven) if driven else np.zeros((0, 3, t.size))
    added = [
        _superpose(unit[driven.index(key)], held, t) for key, held in (("r", r), ("d", d)) if key in driven
    ]
    common: Array = sum(added[1:], start=added[0]) if added else np.zeros((3, t.size))
    responses = []
    for n in records:
        quiet = not (noisy and _acts(n))
        y, area, u = common if quiet else common + _superpose(unit[-1], n, t)
        # noise is defined by its samples: there is no finer grid
        finer, speed = (
            (partial(_respond_finer, loop, t, r, d), partial(_speed, loop)) if quiet else (None, None)
        )
        responses.append(Response._of_engine(finer, speed, t=t, r=r, d=d, n=n, y=y, u=u, area=area))
        _require_within_limits(loop, responses[-1])
    return responses


def _acts(signal: Array) -> bool:
    """Return True if a held signal is not 0 throughout."""
    return bool(signal[0]) if signal.strides == (0,) else bool(signal.any())


def _respond_finer(loop: Loop, t: Array, r: Array, d: Array) -> Response:
    """Repeat an experiment without noise on a grid that is finer by `REFINEMENT`."""
    finer = np.linspace(0.0, t[-1], REFINEMENT * (t.size - 1) + 1)
    r, d = (
        np.broadcast_to(held[0], finer.size)
        if _check.is_constant(held)
        else np.append(np.repeat(held[:-1], REFINEMENT), held[-1])
        for held in (r, d)
    )
    return respond(loop, finer, r, d, [np.broadcast_to(0.0, finer.size)])[0]


def _speed(loop: Loop) -> float:
    from pidalab.simulation.realisation import fastest_pole

    return fastest_pole(loop)


def _superpose(unit: Array, signal: Array, t: Array) -> Array:
    """Add up unit step responses, one for each change of a held signal."""
    if _check.is_constant(signal):
        return unit if signal[0] == 1.0 else unit * signal[0]
    changes = np.diff(signal, prepend=0.0)
    from scipy.signal import fftconvolve

    # FFT convolution rounds relative to its largest value; damping a growing response first (and undoing it after)
    # makes that the largest value up to each time, so that an unstable loop keeps its digits from the start.
    growth = np.log(np.maximum.accumulate(np.max(np.abs(unit), axis=0)) + 1.0)
    middle = (t.size - 1) // 2
    rate = max(0.0, (growth[-1] - growth[middle]) / (t[-1] - t[middle]))
    rate = rate if rate * t[-1] > 20.0 else 0.0
    weight = np.exp(-rate * t)
    response = fftconvolve(unit * weight, (changes * weight)[None, :], axes=1)[:, : t.size] / weight
    response[:, : np.flatnonzero(changes)[0]] = 0.0  # at rest until the first change
    return response


def _require_within_limits(loop: Loop, response: Response) -> None:
    low, high = getattr(loop.controller, "limits", (-np.inf, np.inf))
    if low == -np.inf and high == np.inf:
        return
    outside = np.flatnonzero((response.u < low) | (response.u > high))
    if outside.size:
        i = int(outside[0])
        raise ValueError(
            f"the exact engine is linear, and the control signal leaves the controller's limits ({low:g}, {high:g}): "
            f"u = {response.u[i]:.4g} at t = {response.t[i]:.4g}"
        )


def step_response(loop: Loop, t: ArrayLike) -> Response:
    """Response to a unit step of the set point.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response
        As `simulate` with ``setpoint=1.0``.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.step_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), np.arange(4.0)).y.tolist()
    [0.0, 0.0, 0.5, 0.875]
    """
    return simulate(loop, t, setpoint=1.0)


def load_response(loop: Loop, t: ArrayLike) -> Response:
    """Response to a unit step of the load disturbance at the process input.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response
        As `simulate` with ``load=1.0``.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.load_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), np.arange(4.0)).y.tolist()
    [0.0, 0.0, 1.0, 1.75]
    """
    return simulate(loop, t, load=1.0)


def open_loop_step(process: Process, t: ArrayLike) -> Response:
    """Experiment for identification: the input of the process steps from 0 to 1 at t = 0, without feedback.

    Parameters
    ----------
    process : Process
        The process; a controller, a number or a system of python-control serves as well.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response
        With y the output and u = 1 the input; the final value of a stable process is its static gain.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> r = pidalab.open_loop_step(pidalab.fopdt(gain=2.0, lag=1.0, delay=0.5), np.arange(4) * 0.5)
    >>> r.y.round(4).tolist()
    [0.0, 0.0, 0.7869, 1.2642]
    """
    loop = Loop(process, 0.0)
    record = simulate(loop, t, load=1.0)
    stable = np.all(roots(loop.process.den).real < 0)
    final = loop.process.gain() if stable else None
    return _as_input(final, record)


def _as_input(final: float | None, record: Response) -> Response:
    """Return a load response as one to the input of the process."""
    finer = partial(apply_to_finer, record, partial(_as_input, final))
    return record._derived(finer, u=record.d, d=np.zeros_like(record.d), final=final)
