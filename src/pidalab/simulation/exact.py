r"""Simulate linear loops with dead time exactly.

A loop that is opened at its dead time h has the equations x' = A x + b w, v = c_v x + d_v w and w(t) = v(t - h), where
v is the process input and w the delayed process input. Usually one signal is delayed. If a filter is very much faster
than the plant, three signals are delayed, and matrices replace b, c_v and d_v. Stack the present and the past states,
(x(t), x(t - h), x(t - 2h), ...). Between multiples of h this stack obeys an ordinary linear differential equation. The
matrix of this equation is block Toeplitz and is written as a power series in the shift z = e^{-hs}:

.. math:: \mathcal A(z) = A + b\,(c_v z + d_v c_v z^2 + d_v^2 c_v z^3 + \dots).

So :math:`x(t + \tau) = \sum_j \Phi_j(\tau)\, x(t - jh)` with :math:`\sum_j \Phi_j(\tau) z^j = e^{\mathcal A(z)\tau}`.
This equation is exact if no multiple of h lies strictly between t and t + tau. The simulation has four steps:

1. Compute the powers :math:`e^{\mathcal A(z)\tau} - 1` for tau = step * 2^p by squaring (see
   `pidalab.simulation.ring`).
2. Compute the states at the multiples of h, one after the other.
3. Advance the stack from each multiple of h to the next requested time by a short Taylor series and then by powers.
4. Compute the outputs at several successive requested times at once, as a product of a stack and a matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop, require_loop
from pidalab.process import Process
from pidalab.response import Response
from pidalab.roots import roots
from pidalab.signals import REFINEMENT, apply_to_finer
from pidalab.simulation.ladder import ManyDeadTimes, norm_over, responses
from pidalab.simulation.realisation import Cut, cut_at_delay, fastest_pole

# If the dead time and the simulated time both exceed this number of time constants of the fastest state, digits may
# cancel, so the response is checked. Without dead time, only the simulated time counts.
CHECKED_FROM = 3e3
# To check a response, it is computed again with the units of time and of u multiplied by one of these factors. The
# factors are tried in turn until the response is clearly accepted or rejected.
OTHER_UNITS = (1.3, 0.6, 2.2)
FEWEST_COMPARED = 64  # two responses are compared at this number of time steps or more
DENSE = 10_000  # before a response is rejected, its largest value is sought at this many times or more
# Allowed difference of two responses, divided by the largest value of the signal.
AGREEMENT = 1e-10
# If the relative difference of the first two responses is below CERTAIN, no third response is needed, since two
# computations are unlikely to have the same error.
CERTAIN = 1e-12
# A kick is a short, very large signal of a fast state. Outside kicks, two responses may differ by OUTSIDE_KICKS times
# the largest value outside kicks. At the requested times, they may differ by OUTSIDE_KICKS times the largest value at
# these times.
OUTSIDE_KICKS = 1e-6
KICK_DURATION = 60.0  # a kick lasts this number of time constants of its fast state
# After this number of time constants of the fastest state, times are rounded too coarsely (to 1e-16 of their value) to
# resolve a kick.
KICK_UNRESOLVED = 1e5


# For each loop, the inputs and grids with which a response has passed the check.
AGREED: WeakKeyDictionary[Loop, set[tuple[str, int, float]]] = WeakKeyDictionary()


def checked_responses(loop: Loop, inputs: str, n: int, step: float) -> Array:
    """Compute y, its running integral and u at n times from 0, for a unit step on each input, and check them.

    The shape of the result is (inputs, 3, n).

    Raises
    ------
    ValueError
        If too many digits were lost. Also as for `pidalab.simulation.ladder.responses`.

    Notes
    -----
    The time constants of a loop do not tell how many digits cancel. So the response of a stiff loop is computed again
    in other units. The ratio of the units is not a power of 2, and the first matrix exponential spans half as much time
    as before, so all numbers are rounded differently. If both responses agree to ten digits, each has lost at most
    about six of its sixteen digits.
    """
    cut, norm, may_cancel = _prepared(loop, inputs, n, step)
    if not may_cancel:
        return responses(cut, n, step, norm)
    # A coarse grid may miss the times at which digits are lost.
    finer = -(-FEWEST_COMPARED // (n - 1))
    steps, step = (n - 1) * finer, step / finer
    values = responses(cut, steps + 1, step, norm)
    if not _check.all_finite(values):  # the caller raises the error
        numbers = np.isfinite(values).all(axis=(0, 1))
        values[:, :, np.argmin(numbers) :] = np.nan
    elif (inputs, steps, step) not in (agreed := AGREED.setdefault(loop, set())):
        _require_agreement(loop, inputs, cut, norm, values, step, finer)
        agreed.add((inputs, steps, step))
    return values[:, :, ::finer]


@lru_cache(maxsize=64)
def _prepared(loop: Loop, inputs: str, n: int, step: float) -> tuple[Cut, float, bool]:
    """Return the cut loop, the bound by `norm_over`, and True if digits may cancel."""
    cut = cut_at_delay(loop, inputs)
    norm = norm_over(cut, n, step)
    # Without dead time, `cut` describes the closed loop, whose poles may be slower than the poles of a block.
    speed = max(norm, 0.0 if cut.delay else fastest_pole(loop))
    return cut, norm, speed * min(cut.delay or np.inf, (n - 1) * step) > CHECKED_FROM


def _require_agreement(
    loop: Loop, inputs: str, cut: Cut, norm: float, values: Array, step: float, finer: int
) -> None:
    """Raise an error if other units give other `values`. The caller requested every `finer`-th time of `values`."""
    steps = values.shape[2] - 1
    every = max(c for c in range(1, steps // FEWEST_COMPARED + 1) if steps % c == 0)
    size, all_seen = _sizes(cut, values, step, every), steps >= DENSE
    # If `finer` is 1, all times are requested. Otherwise `every` is 1, and all times are compared, also the
    # requested times.
    shown = _sizes(cut, values[:, :, ::finer], step * finer, every) if finer > 1 else size
    uncertain, beside_shown = np.zeros((len(inputs), 3)), np.zeros((len(inputs), 3))
    for unit in OTHER_UNITS:
        other = _in_other_units(loop, inputs, unit, steps // every + 1, step * every)
        difference = np.minimum(np.nan_to_num(np.abs(values[:, :, ::every] - other), nan=np.inf), 1e300)
        share = np.max(difference / size, axis=2)
        if share.max() > AGREEMENT and not all_seen:  # a coarse grid may miss the largest values
            more, all_seen = -(-DENSE // steps), True
            dense = responses(cut, steps * more + 1, step / more, norm)
            size = _sizes(cut, dense, step / more, every * more) if np.isfinite(dense).all() else size
            share = np.max(difference / size, axis=2)
        uncertain = np.maximum(uncertain, share)
        beside_shown = np.maximum(beside_shown, np.max(difference[:, :, ::finer] / shown, axis=2))
        if not CERTAIN <= uncertain.max() <= AGREEMENT:
            break
    # The difference may be small compared with values between the requested times, but large compared with the values
    # at the requested times.
    hidden = uncertain.max() <= AGREEMENT
    share, allowed = (beside_shown, OUTSIDE_KICKS) if hidden else (uncertain, AGREEMENT)
    if share.max() <= allowed:
        return
    where = " at the requested times" if hidden else ""
    remedy = "much larger values lie between these times; request more times, or shorten t"
    if not hidden:
        fastest = 1 / np.max(_speeds(cut))
        remedy = (
            f"the loop's fastest filter or lag has a time constant of {fastest:.3g}, much shorter than the others; "
            "take a longer time constant, or leave the filter or lag out"
        )
    _, signal = np.unravel_index(np.argmax(share), share.shape)
    raise ValueError(
        f"rounding makes {('y', 'the integral of y', 'u')[signal]} uncertain by "
        f"{min(1.0, share.max()):.1g} of its largest value{where}, and {allowed:.0e} is allowed: {remedy}"
    )


def _in_other_units(loop: Loop, inputs: str, unit: float, n: int, step: float) -> Array:
    """Compute the responses in other units, and convert them back."""
    cut = cut_at_delay(loop, inputs, unit)
    values = responses(cut, n, step / unit, 2.0 * norm_over(cut, n, step / unit))
    for i, key in enumerate(inputs):
        values[i] *= unit if key == "d" else 1.0  # the load has the unit of u
        values[i, 2] /= unit
    return values


def _sizes(cut: Cut, values: Array, step: float, every: int) -> Array:
    """Return the sizes by which differences are divided, at one of every `every` times.

    The shape of the result is (inputs, 3, times).

    Notes
    -----
    The size at a time is the largest value of the signal from t = 0 to one dead time after this time. So the first
    values of a growing response must be exact. Values near 0 before the response begins need not be exact. A kick may
    be 1e13 times as large as later values. Compared with such a kick, every later difference would be negligible. So
    differences outside kicks are also compared with the largest value outside kicks, with a larger tolerance. A kick of
    the fastest state begins at each multiple of the dead time. After `KICK_UNRESOLVED` time constants of this state,
    values during its kicks are not compared, because rounding of the time alone changes them.
    """
    t, speeds = step * np.arange(values.shape[2]), _speeds(cut)
    fastest = np.max(speeds)
    stiff = np.min(speeds[speeds * (cut.delay or t[-1]) > CHECKED_FROM], initial=fastest)
    offset, early = np.mod(t, cut.delay) if cut.delay else t, (t > 0.0) & (t < KICK_UNRESOLVED / fastest)
    compared, outside = (early | (offset > KICK_DURATION / speed) for speed in (fastest, stiff))
    later = np.minimum(np.searchsorted(t, t[::every] + (cut.delay or t[-1] / FEWEST_COMPARED)), t.size - 1)
    values = np.abs(values)
    with_kicks, without = (
        np.maximum.accumulate(sizes, axis=2)[:, :, later] for sizes in (values, values * outside)
    )
    after = np.where(outside[::every], without * (OUTSIDE_KICKS / AGREEMENT), np.inf)
    return np.where(compared[::every], np.maximum(np.minimum(with_kicks, after), 1e-300), np.inf)


def _speeds(cut: Cut) -> Array:
    return np.maximum(np.abs(np.linalg.eigvals(cut.A)), 1e-300)


def unit_step_responses(loop: Loop, t: Array, inputs: str) -> Array:
    """Compute exact responses of y, the running integral of y, and u to unit steps at t = 0.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    t : ndarray, shape (n,)
        Uniform times from 0. At a jump, the value just after the jump is returned.
    inputs : str
        Inputs that step, as letters out of "r", "d", "n". Each is simulated separately.

    Returns
    -------
    ndarray, shape (len(inputs), 3, n)
        Signals y, running integral of y, and u, for each input.

    Raises
    ------
    ValueError
        If the loop is ill-posed, if the response of an unstable loop overflows, if rounding makes the response of a
        stiff loop uncertain, or if the times span too many dead times. If \\|L\\| is near 1 or above at infinite
        frequency, fewer dead times are allowed, since the response then depends on all past states.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> from pidalab.simulation.exact import unit_step_responses
    >>> square = pidalab.Loop(pidalab.Process([1.0], [1.0], delay=1.0), 1.0)
    >>> unit_step_responses(square, np.arange(6) * 0.5, "r")[0, 0].tolist()
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    """
    unit = checked_responses(loop, inputs, t.size, t[-1] / (t.size - 1))
    if not _check.all_finite(unit):
        overflowed = ~np.isfinite(unit).all(axis=(0, 1))
        raise ValueError(f"the response of the unstable loop overflows before t = {t[overflowed][0]:.4g}")
    return unit


def simulate(
    loop: Loop, t: ArrayLike, setpoint: ArrayLike = 0.0, *, load: ArrayLike = 0.0, noise: ArrayLike = 0.0
) -> Response:
    """Simulate a linear loop exactly, including its dead time.

    The loop is at rest before t = 0. The values are those of the continuous-time loop, without Padé approximation or
    interpolation. The dead time need not be a multiple of the time step.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not.
    t : array_like, shape (n,)
        Uniform times that start at 0.
    setpoint, load, noise : float or array_like, shape (n,), optional
        A number is a step at t = 0. The values of an array are held from each sample to the next.

    Returns
    -------
    Response
        Signals at the times t. At a jump, the value just after the jump is returned.

    Raises
    ------
    ValueError
        If the times are not uniform from 0, if a signal differs in length from `t` or contains NaN, if the loop is
        ill-posed, or if the control signal leaves the limits of the controller. (Saturation is not simulated.)

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
    loop: Loop, t: ArrayLike, noise: ArrayLike, *, setpoint: ArrayLike = 0.0, load: ArrayLike = 0.0
) -> list[Response]:
    """Simulate an experiment with several records of noise, in little more time than with a single record.

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
        One response for each row of `noise`.

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
    """Simulate set point and load with each record of noise. The arrays must have been checked."""
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
        # Noise is defined only at its samples, so a response with noise is not repeated on a finer grid.
        finer = partial(_respond_finer, loop, t, r, d) if quiet else None
        speed = partial(fastest_pole, loop) if quiet else None
        responses.append(Response._of_engine(finer, speed, t=t, r=r, d=d, n=n, y=y, u=u, area=area))
        _require_within_limits(loop, responses[-1])
    return responses


def _acts(signal: Array) -> bool:
    """Return True if a held signal differs from 0 at any time."""
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


def _superpose(unit: Array, signal: Array, t: Array) -> Array:
    """Add up unit step responses, one for each change of a held signal."""
    if _check.is_constant(signal):
        return unit if signal[0] == 1.0 else unit * signal[0]
    changes = np.diff(signal, prepend=0.0)
    from scipy.signal import fftconvolve

    # The rounding errors of an FFT convolution are proportional to its largest value. A growing response is damped
    # before the convolution and restored afterwards, so that its early values keep their digits.
    growth = np.log(np.maximum.accumulate(np.max(np.abs(unit), axis=0)) + 1.0)
    middle = (t.size - 1) // 2
    rate = max(0.0, (growth[-1] - growth[middle]) / (t[-1] - t[middle]))
    rate = rate if rate * t[-1] > 20.0 else 0.0
    weight = np.exp(-rate * t)
    response = fftconvolve(unit * weight, (changes * weight)[None, :], axes=1)[:, : t.size] / weight
    response[:, : np.flatnonzero(changes)[0]] = 0.0  # the loop is at rest until the first change
    return response


def _require_within_limits(loop: Loop, response: Response) -> None:
    low, high = getattr(loop.controller, "limits", (-np.inf, np.inf))
    if low == -np.inf and high == np.inf:
        return
    outside = np.flatnonzero((response.u < low) | (response.u > high))
    if outside.size:
        i = int(outside[0])
        raise ValueError(
            f"u must stay within the controller's limits ({low:g}, {high:g}), found {response.u[i]:.4g} "
            f"at t = {response.t[i]:.4g}; use simulate_sampled"
        )


def step_response(loop: Loop, t: ArrayLike) -> Response:
    """Simulate a unit step of the set point.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.step_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), np.arange(4.0)).y.tolist()
    [0.0, 0.0, 0.5, 0.875]
    """
    return simulate(loop, t, setpoint=1.0)


def load_response(loop: Loop, t: ArrayLike) -> Response:
    """Simulate a unit step of the load disturbance at the process input.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.load_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), np.arange(4.0)).y.tolist()
    [0.0, 0.0, 1.0, 1.75]
    """
    return simulate(loop, t, load=1.0)


def open_loop_step(process: Process, t: ArrayLike) -> Response:
    """Simulate a step experiment for identification. The process input steps from 0 to 1, without feedback.

    Parameters
    ----------
    process : Process
        The process. A controller, a number or a system of python-control is also accepted.
    t : array_like, shape (n,)
        Uniform times that start at 0.

    Returns
    -------
    Response
        Output y and input u = 1. For a stable process, `final` is the static gain.

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
    """Relabel a load response: its load becomes the control signal u."""
    finer = partial(apply_to_finer, record, partial(_as_input, final))
    return record._derived(finer, u=record.d, d=np.zeros_like(record.d), final=final)


SETTLING_POINTS = 4001
HORIZON_DOUBLINGS = 13  # enough for a loop that is 8,000 times slower than expected


def simulate_until_settled(
    simulate: Callable[[Loop, Array], Response], loop: Loop, horizon: float
) -> Response:
    """Simulate a step until the response has settled, so that its integrals extend to infinity.

    Parameters
    ----------
    simulate : callable
        `load_response` or `step_response`.
    loop : Loop
        A stable loop.
    horizon : float
        Duration to begin with, above 0. The duration is doubled until it exceeds twice the dead time, and then until
        the control error has decayed.

    Returns
    -------
    Response
        A response for which ``iae(horizon=math.inf)`` exists.

    Raises
    ------
    ValueError
        If the horizon is not above 0, if the response does not settle within 8192 horizons, or if settling takes too
        many dead times.

    Examples
    --------
    >>> import math, pidalab
    >>> from pidalab.simulation.exact import simulate_until_settled
    >>> loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))
    >>> print(f"{simulate_until_settled(pidalab.load_response, loop, 4.0).iae(horizon=math.inf):.4f}")
    1.2500
    """
    horizon = _check.real("horizon", horizon, above=0.0)
    while horizon <= 2 * loop.process.delay:
        horizon *= 2
    for doubling in range(HORIZON_DOUBLINGS + 1):
        end = horizon * 2.0**doubling
        try:
            response = simulate(loop, np.linspace(0.0, end, SETTLING_POINTS))
        except ManyDeadTimes:
            raise ValueError(
                f"the loop needs {end / loop.process.delay:.3g} dead times to settle, too many; neglect the dead time"
            ) from None
        try:
            response.iae(horizon=math.inf)
        except ValueError:
            continue
        return response
    raise ValueError(f"the response does not settle within {horizon * 2**HORIZON_DOUBLINGS:.3g}")


def load_iae(loop: Loop) -> float:
    """Return the IAE of the response to a unit step of the load, integrated to infinity.

    Parameters
    ----------
    loop : Loop
        A stable loop.

    Returns
    -------
    float
        IAE in units of y times time.

    Raises
    ------
    ValueError
        As for `simulate_until_settled`.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.simulation.exact import load_iae
    >>> loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))
    >>> print(f"{load_iae(loop):.4f}")
    1.2500
    """
    from pidalab.robustness.poles import rightmost_poles

    slowest = -float(np.max(rightmost_poles(loop).real))
    return simulate_until_settled(load_response, loop, 12.0 / slowest + 10.0 * loop.process.delay).iae(
        horizon=math.inf
    )
