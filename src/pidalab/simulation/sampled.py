r"""Simulation of loops with a digital controller that samples, holds and is limited.

At :math:`t_k = kh` the controller reads :math:`\varepsilon_k = F_r r - (y + n)`, where :math:`F_r` is the prefilter.
Then it sets the limited signal :math:`u_k`, which is held for the sample time h. The process input is v = u + d. If the
dead time :math:`L = mh + \lambda` is not a multiple of h, the delayed input w steps inside the sample intervals:

.. math:: w(t_k + s) = v_{k-m-1} \;\;(0 \le s < \lambda), \qquad v_{k-m} \;\;(\lambda \le s < h).

Each sample interval has one or two pieces with a constant input. A matrix exponential for each piece advances the plant
exactly. The controller is discretised for a held input as well. The only remaining difference from the continuous loop
is the delay of a real digital controller: half a sample for reading and half a sample for holding. So the difference is
proportional to h. Pulse width modulation is also simulated exactly.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import AutomaticReset, Controller
from pidalab.digital import DigitalController
from pidalab.digital.parameters import anti_windup_word
from pidalab.digital.program import program
from pidalab.loop import Loop, require_loop
from pidalab.process import AsymmetricPlant, Process, binomial
from pidalab.response import Response
from pidalab.robustness.poles import is_stable
from pidalab.roots import roots
from pidalab.simulation.operations import operations
from pidalab.simulation.sampled_step import Actuator, filtered, plant_steps, run
from pidalab.statespace import StateSpace, discretise

NO_BLOCK = StateSpace(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)


def simulate_sampled(
    loop: Loop,
    t: ArrayLike,
    setpoint: ArrayLike = 0.0,
    *,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    plant: Process | AsymmetricPlant | None = None,
    anti_windup: str | None = None,
    quanta: tuple[float, float] = (0.0, 0.0),
    pulse_widths: int = 0,
) -> Response:
    r"""Simulate a loop with a digital, limited controller exactly, for any dead time of the plant.

    Before t = 0 the loop, including its controller, rests at its working point. A `DigitalController` must have the
    step of `t` as its sample time. (By contrast, the first call of the method ``step`` of a `DigitalController` starts
    without a bump from the given signals. To start at rest, first call ``reset(r=y_offset, y=y_offset)``.) Any other
    controller, its output filter and every prefilter are discretised for held inputs with the step of `t`. All signals
    and limits are relative to the state of rest. An actuator from 0 to 80 that rests at 30 therefore has the limits
    (-30, 50).

    A `SeriesPIDA` runs its automatic reset, :math:`i_{k+1} = a\,i_k + (1 - a)\,u_k` with :math:`a = e^{-h/t_i}`. The
    limited signal is fed back positively (huba2024, Fig. 1, eqs. (3), (8)). Here the filter
    :math:`Q_n = 1/(T_f s + 1)^n` acts on the difference of prefiltered set point and measurement. The paper does not
    say if :math:`Q_n` filters the set point, too. To undo the effect of :math:`Q_n` on the set point, use a prefilter
    with :math:`(T_f s + 1)^n` in its numerator and enough fast lags in its denominator to be proper.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0. Their step is the sample time h of the controller.
    setpoint, load, noise : float or array_like, shape (n,), optional
        As for `simulate`.
    limits : tuple of float, optional
        Smallest (at most 0) and largest (at least 0) control signal. The limits of a `SeriesPIDA` or a
        `DigitalController` also apply.
    plant : Process or AsymmetricPlant, optional
        Plant to simulate instead of the loop's process.
    anti_windup : {None, "clamping", "conditioning"}, optional
        Action of the integral of a continuous controller at a limit. By default, or with "none", the integral
        continues. With *clamping* it stops while it would drive the control signal further beyond the limit. With
        *conditioning* it integrates :math:`\varepsilon + (u - w)/k_p`, where w is the control signal before the limits
        and u the limited signal. For a PI controller this sum is the error with which w would just equal u. In
        general :math:`k_p` is :math:`C(s) - k_i/s` at s = 0. ("reset" and "back-calculation" are options of
        ``controller.discretise``. A digital controller uses its own anti-windup.)
    quanta : tuple of float, optional
        Resolution of the measurement and of the control signal. 0 means unlimited. The deviation of a signal from the
        state of rest is rounded to the nearest multiple of its resolution, and halfway between two multiples to the
        even multiple. The limits are not rounded. An automatic reset or an integral uses the limited signal before
        rounding. With the rounded signal, the reset or the integral could stop too early.
    pulse_widths : int, optional
        Number of pulse widths for pulse width modulation, not counting the width 0. In each sample the actuator is at
        the upper limit during the pulse, and then at the lower limit. The width of the pulse is a multiple of
        ``h / pulse_widths``, chosen so that the mean output of the actuator in the sample is nearest to the control
        signal. With 0, the default, the actuator holds its value. Before t = 0 the plant rests as if its input were
        constant.

    Returns
    -------
    Response
        Signals at the times t. At a jump, the value just after the jump is returned. `u` is the limited and rounded
        control signal, which is held for a sample. With pulses, `u` is the mean output of the actuator in each sample.

    Raises
    ------
    TypeError, ValueError
        In each of these cases:

        * Times are not uniform from 0, or a signal differs in length from `t` or contains NaN.
        * Limits are out of order or do not contain 0, or quanta are negative.
        * The plant has direct feedthrough without dead time, or an unstable loop overflows.
        * A filter in or after a continuous controller has a time constant below the sample time.
        * The sample time of a digital controller differs from the step of `t`.
        * Anti-windup is requested for a controller without integral action or with a reset.
        * Conditioning is requested with kp/ki not above the sample time. The integral could then oscillate or diverge.
        * Pulses are requested without finite limits, with a quantum of the control signal, or for a plant that is not
          linear or has direct feedthrough.

    Notes
    -----
    A controller that is discretised for held inputs cannot use a filter whose time constant is below the sample time,
    because the filtered derivative of a step would decay too far before the next sample. Use a sample time well below
    the time constant, or backward differences, as most PLCs do: ``controller.discretise(sample_time)``.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=0.5), 0.5)
    >>> r = pidalab.simulate_sampled(loop, np.arange(5.0), setpoint=1.0, limits=(-0.25, 0.25))
    >>> r.u.tolist(), r.y.tolist()
    ([0.25, 0.25, 0.25, 0.1875, 0.078125], [0.0, 0.125, 0.375, 0.625, 0.84375])

    The overshoot shows the windup of a PI controller and the effect of two remedies:

    >>> loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=0.5), pidalab.PIDA(kp=0.6, ti=4.0)), 0.01 * np.arange(3001)
    >>> for anti_windup in (None, "clamping", "conditioning"):
    ...     r = pidalab.simulate_sampled(loop, t, setpoint=1.0, limits=(-0.1, 0.1), anti_windup=anti_windup)
    ...     print(f"{anti_windup}: overshoot {r.overshoot():.1f} %")
    None: overshoot 74.4 %
    clamping: overshoot 3.2 %
    conditioning: overshoot 12.4 %
    """
    require_loop(loop)
    t, *held = _check.signals(t, setpoint=setpoint, load=load, noise=noise)
    r, d, n = map(np.ascontiguousarray, held)  # kernels need contiguous arrays
    h = float(t[-1] / (t.size - 1))
    at_rest = limits_at_rest(loop.limits, limits)
    fineness, actuator = _conversion(*at_rest, quanta, pulse_widths)
    steps = plant_steps(loop.process if plant is None else plant, h, actuator)
    reference = filtered(discretise(*loop.blocks["prefilter"], h), r)
    if loop.digital is None:
        block, k = sampled_controller(loop, h, at_rest, anti_windup)
        step = program(k, block=True)
        code, _, numbers = operations(step, step.states)
    else:
        block, k = NO_BLOCK, _limited(loop.digital, h, at_rest, anti_windup)
        code, _, numbers = operations(program(k), k.at_rest())
    rest = k.y_offset, k.bias
    y, u, area = run(code, numbers[:, None], block, rest, steps, actuator, fineness, reference, d, n)
    overflowed = ~np.isfinite([y, u, area]).all(axis=0)
    if overflowed.any():
        raise ValueError(f"the response of the unstable loop overflows before t = {t[overflowed][0]:.4g}")
    return Response(t=t, r=r, d=d, n=n, y=y, u=u, area=area)


def _limited(
    k: DigitalController, h: float, limits: tuple[float, float], anti_windup: str | None
) -> DigitalController:
    """Check the sample time of a digital controller, and apply the limits, which are relative to the state of rest."""
    if abs(h - k.sample_time) > 1e-6 * k.sample_time:
        raise ValueError(
            f"t must have the step of the digital controller, {k.sample_time:.6g}, found {h:.6g}"
        )
    anti_windup_word(anti_windup, (None, k.anti_windup), "for this digital controller")
    low, high = (k.bias + limit for limit in limits)
    return replace(k, limits=(max(low, k.limits[0]), min(high, k.limits[1])))


def limits_at_rest(own: tuple[float, float], limits: tuple[float, float]) -> tuple[float, float]:
    """Intersect the limits with those of the controller, and check that the result contains the state of rest."""
    low, high = _check.limits(limits)
    low, high = max(low, own[0]), min(high, own[1])
    if not low <= 0 <= high or low == high:
        raise ValueError(
            f"limits must be lower < upper and contain 0, the control signal at rest, found {limits!r}"
            + (f" and {own!r} of the controller" if np.isfinite(own).any() else "")
        )
    return low, high


def _conversion(low: float, high: float, quanta: tuple[float, float], widths: int) -> tuple[float, Actuator]:
    """Check the resolution of the measurement and the data of the actuator."""
    numbers = _check.pair("quanta", "of measurement and control signal", quanta)
    measurement, control = (_check.real(f"quanta[{i}]", each, at_least=0.0) for i, each in enumerate(numbers))
    widths = _check.integer("pulse_widths", widths, at_least=0)
    if widths and control:
        raise ValueError(f"quanta[1] must be 0 with pulse_widths, found {control:g}")
    if widths and not math.isfinite(high - low):
        raise ValueError(f"limits must be finite with pulse_widths, found ({low:g}, {high:g})")
    return measurement, Actuator(low, high, control, widths)


def sampled_controller(
    loop: Loop, h: float, limits: tuple[float, float], anti_windup: str | None
) -> tuple[StateSpace, DigitalController]:
    """Discretise the controller of a loop, with its output filter, for held inputs and the sample time h.

    Return the discretised transfer function, and a digital controller in series with it, which adds the integral and
    applies the limits.
    """
    require_fine_enough(h, shortest_filter(loop))
    if loop.automatic_reset is not None:
        kind = type(loop.controller).__name__
        anti_windup_word(anti_windup, (None, "reset"), f"for a {kind}, which has an automatic reset")
        return _with_reset(loop, loop.automatic_reset, h, limits)
    available = (None, "clamping", "conditioning")
    anti_windup = anti_windup_word(anti_windup, available, "for a continuous controller")
    num, den = map(np.convolve, loop.blocks["controller"], loop.blocks["output_filter"])
    if anti_windup is None:
        return discretise(num, den, h), _behind(h, limits)
    if den.size < 2 or den[-1] != 0 or den[-2] == 0 or num[-1] == 0:
        raise ValueError(f"anti_windup={anti_windup!r} needs one pole at 0, found {loop.controller!r}")
    ki = num[-1] / den[-2]
    remainder, den = np.polysub(num, ki * den[:-1]), den[:-1]
    num = remainder[:-1] if remainder.size > 1 else np.zeros(1)
    tracking = _tracking(ki, num[-1] / den[-1], h) if anti_windup == "conditioning" else 0.0
    way = "clamping ahead" if anti_windup == "clamping" else None
    return discretise(num, den, h), _behind(h, limits, integral=ki * h, gain=tracking, anti_windup=way)


def _behind(
    h: float, limits: tuple[float, float], integral: float = 0.0, gain: float = 0.0, **more: Any
) -> DigitalController:
    """Return a digital controller that adds an integral to a given signal and limits the sum."""
    others: dict[str, Any] = {"from_signal": False, "tracking_gain": 0.0, "anti_windup": None}
    return DigitalController(
        sample_time=h,
        method="zoh",
        paths=(),
        integrates=integral != 0.0,
        growth=(0.0, integral),
        back_calculation_gain=gain,
        weights=(1.0, 1.0),
        limits=limits,
        **others | more,
    )


def _tracking(ki: float, kp: float, h: float) -> float:
    """Return the share of u - w (limited minus unlimited signal) that conditioning adds to the integral in a sample."""
    if kp == 0 or not 0 < ki * h / kp < 1:
        raise ValueError(
            f"anti_windup='conditioning' needs kp/ki above the sample time, {h:.4g}, found kp = {kp:.4g}, ki = {ki:.4g}"
        )
    return ki * h / kp


def require_fine_enough(h: float, filter_time: float) -> None:
    """Raise if the sample time exceeds the filter's time constant."""
    if h > filter_time * (1 + 1e-6):
        raise ValueError(
            f"the sample time must be at most the filter's time constant, {filter_time:.6g}, found {h:.6g}; sample "
            "faster, use a slower filter, or close the loop with controller.discretise(sample_time, 'backward')"
        )


def shortest_filter(loop: Loop) -> float:
    """Return the shortest time constant of the filters in and after the controller. It is infinite without filters."""
    has_parts = isinstance(loop.controller, Controller)
    times = [part.filter_time for part in loop.controller.parts() if part.filter_order] if has_parts else []
    for block in ("output_filter",) if has_parts else ("output_filter", "controller"):
        # The poles of a transfer function belong to filters, except poles at 0, which are integrators.
        poles = roots(loop.blocks[block][1])
        times += (1 / np.abs(poles[poles != 0])).tolist()
    return float(min(times, default=math.inf))


def _with_reset(
    loop: Loop, reset: AutomaticReset, h: float, limits: tuple[float, float]
) -> tuple[StateSpace, DigitalController]:
    """Discretise the stabilising controller with its filters. The integral represents the automatic reset."""
    num, den = loop.blocks["output_filter"]
    filters = np.convolve(den, binomial(reset.filter_time, reset.filter_order))
    fraction = discretise(np.convolve(num, reset.stabiliser), filters, h)
    # In each sample the state of the reset moves towards the control signal by this share of their distance.
    share = -math.expm1(-h / reset.time)
    return fraction, _behind(h, limits, integral=share, from_signal=True)


TAIL_SAMPLES, LONGEST_TAIL = 4096, 1 << 20  # smallest and largest number of samples of a response to noise
# A response to noise is long enough if the sum of squares of its second half is at most FADED times the whole sum. If
# the rest of the response decays by a factor of e in N samples, the relative error of the gain is at most FADED * N /
# (2 * TAIL_SAMPLES): 1e-10 for N = 1e6, 1e-7 for N = 1e9.
FADED = 1e-12
# The response covers at least this number of dead times, since noise returns to the controller after one dead time.
ECHOES = 4


def uniform_noise(t: ArrayLike, amplitude: float, seed: int, hold: float | None = None) -> Array:
    """Return uniformly distributed noise in [-amplitude, amplitude], held for a fixed time.

    Parameters
    ----------
    t : array_like, shape (n,)
        Uniform times that start at 0.
    amplitude : float
        Largest absolute value, not negative.
    seed : int
        Seed of the generator.
    hold : float, optional
        Time for which a value is held: a multiple of the step of t, by default one step.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    ValueError
        If the amplitude is negative, or the hold is not a multiple of the step.

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
    r"""Return the ratio of the standard deviations of control signal and white measurement noise, in the sampled loop.

    The noise n is held for a sample, and the controller is digital as in `simulate_sampled`. Limits, a rate limit and a
    deadband are ignored. The ratio is the H2 norm from n to u. By Parseval's theorem this norm is the square root of
    the sum of :math:`u_k^2` after a single noise sample of 1.

    Parameters
    ----------
    loop : Loop
        The loop. It must be stable, also when the controller samples with `sample_time`.
    sample_time : float
        Sample time of controller and noise, above 0.

    Returns
    -------
    float
        The ratio, in units of u per unit of y. vrancic2021, eq. (35), calls it σ_rel.

    Raises
    ------
    TypeError, ValueError
        As for `simulate_sampled`. Also if the loop is unstable, or if four dead times or the response to a pulse of
        noise last longer than a million samples.

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
        f"loop must be stable with sample_time = {h:g}, and u must decay within {samples // 2} samples after a pulse "
        f"of noise, but {100 * late / total:.3g} % of the sum of squares of u comes later"
    )


def _linear(loop: Loop) -> Loop:
    """Return the loop without limits, rate limit and deadband."""
    require_loop(loop)
    k, none = loop.controller, (-math.inf, math.inf)
    if loop.digital is not None:
        k = replace(loop.digital, limits=none, rate_limit=math.inf, deadband=0.0)
    elif loop.limits != none:
        k = replace(k, limits=none)
    return loop if k is loop.controller else Loop(loop.process, k, loop.output_filter, loop.prefilter)


def _lengths(loop: Loop, h: float) -> list[int]:
    """Return the numbers of samples to try. Raise if the loop is unstable or its dead time is too long."""
    if not is_stable(loop):
        border = "in the closed right half-plane, or arbitrarily near it"
        where = border if loop.digital is None else "on or outside the unit circle"
        raise ValueError(f"loop must be stable, found poles {where}")
    shortest = ECHOES * loop.process.delay / h
    if shortest > LONGEST_TAIL:
        raise ValueError(
            f"sample_time must be at least {ECHOES * loop.process.delay / LONGEST_TAIL:.3g}, found {h:g}"
        )
    lengths = [max(TAIL_SAMPLES, math.ceil(shortest))]
    while 4 * lengths[-1] <= LONGEST_TAIL:
        lengths.append(4 * lengths[-1])
    return lengths
