r"""Simulation of loops with a digital controller that samples, holds and is limited.

At :math:`t_k = kh` the controller reads :math:`\varepsilon_k = F_r r - (y + n)` and sets :math:`u_k`, limited, which is
held for the sample time h. Seen from the plant its input is a staircase, also after a dead time, whose stairs then
begin inside a sample interval if the dead time :math:`L = mh + \lambda` is no multiple of h:

.. math:: w(t_k + s) = v_{k-m-1} \;\;(0 \le s < \lambda), \qquad v_{k-m} \;\;(\lambda \le s < h), \qquad v = u + d.

So each sample interval has one or two pieces in which the input is constant, and one matrix exponential for each takes
the plant across without any error. The controller is discretised for a held input as well. What is left of
discretisation is what a digital controller does to a loop: it delays by half a sample in reading and half a sample in
holding, and the response approaches that of the continuous loop with the first power of h.

An actuator that is switched within the sample (pulse width modulation) is no exception: the pulses have a finite number
of widths, and what each of them adds to the state of the plant is worked out before.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab.digital import DigitalController
from pidalab.digital.parameters import anti_windup_word
from pidalab.digital.program import program
from pidalab.loop import Loop, require_loop
from pidalab.plants import AsymmetricPlant
from pidalab.process import Process
from pidalab.response import Response
from pidalab.simulation.operations import operations
from pidalab.simulation.sampled_controller import sampled_controller
from pidalab.simulation.sampled_plant import Actuator, plant_steps
from pidalab.simulation.sampled_step import filtered, run
from pidalab.statespace import StateSpace, discretise

NO_BLOCK = StateSpace(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)


def simulate_sampled(
    loop: Loop,
    t: ArrayLike,
    setpoint: ArrayLike = 0.0,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    plant: Process | AsymmetricPlant | None = None,
    anti_windup: str | None = None,
    quanta: tuple[float, float] = (0.0, 0.0),
    pulse_widths: int = 0,
) -> Response:
    r"""Simulate a loop whose controller is digital and limited; exact for the plant, whatever its dead time.

    The loop, its controller included, rests at its working point before t = 0. A `DigitalController` runs as it is: its
    sample time must be the step of `t`. (Called by its own ``step``, a new one starts without a bump instead; call
    ``reset(r=y_offset, y=y_offset)`` for this start.) Otherwise controller and output filter are discretised for held
    inputs with the step of `t` as sample time. A prefilter is discretised so in any case. All signals, and the limits,
    count from the state of rest: an actuator from 0 to 80 that rests at 30 has the limits (-30, 50).

    A `SeriesPIDA` runs its automatic reset, :math:`i_{k+1} = a\,i_k + (1 - a)\,u_k` with :math:`a = e^{-h/t_i}`, fed
    back positively from the limited signal (huba2024, Fig. 1, eqs. (3), (8)). Its filter :math:`Q_n` acts on the
    difference of filtered set point and measurement, here as everywhere. The paper does not say whether it filters the
    set point too; a prefilter with :math:`(T_f s + 1)^n` in its numerator, and a fast lag that keeps it proper, undoes
    that.

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0; their step is the sample time h of the controller.
    setpoint, load, noise : float or array_like, shape (n,), optional
        A number is a step at t = 0; an array is held from each sample to the next.
    limits : tuple of float, optional
        Smallest and largest control signal, with 0 between them or on one of them. Those of a `SeriesPIDA` hold too.
    plant : Process or AsymmetricPlant, optional
        What the controller meets in place of the loop's process.
    anti_windup : {None, "clamping", "conditioning"}, optional
        What the integral of a continuous controller does at a limit; "none" means None. By default it integrates on.
        *Clamping*: it rests while it would drive the control signal further beyond the limit. *Conditioning*: it
        integrates :math:`\varepsilon + (u - w)/k_p`, the error that would have made the limited signal u out of w; k_p
        is the value of :math:`C(s) - k_i/s` at s = 0. ("reset" and "back-calculation" are options of
        ``controller.discretise``; a digital controller has its own.)
    quanta : tuple of float, optional
        Resolution of the measurement and of the control signal, counted from the state of rest; 0 for none. Values go
        to the nearest multiple, halves to the even one, and the limits stay. A reset or an integral sees the limited
        signal before it is rounded: it would stick otherwise.
    pulse_widths : int, optional
        Pulse width modulation: in each sample the actuator is at the upper limit first and then at the lower one, and
        the width of the pulse is the nearest of 0, 1, …, `pulse_widths` parts of the sample. 0, the default, is an
        actuator that holds. Before t = 0 the plant rests as if its input were constant.

    Returns
    -------
    Response
        Signals at the times t, at a jump the value just after it; `u` is the limited, rounded control signal, held from
        each sample to the next, with pulses its mean over the sample.

    Raises
    ------
    TypeError, ValueError
        For times that are not uniform from 0, signals of another length or with NaN, limits out of order or without the
        0 of the state of rest, a plant that answers within the sample (direct feedthrough without dead time), an
        unstable loop that overflows; a continuous controller or output filter with a filter that is faster than the
        sample time, for which ``controller.discretise(sample_time)`` serves; a digital controller with another sample
        time; anti-windup for a controller without integral action, for one that has a reset, or, as conditioning, with
        kp/ki below the sample time, where it is unstable; negative quanta; pulses without finite limits, with a quantum
        of the control signal, or into a plant that is not linear or answers at once.

    Notes
    -----
    A filter faster than the sample time is of no use to a controller that is discretised for held inputs: a derivative
    behind it sees steps only, and has forgotten each at the next sample. Take a sample time well below the time
    constant of the filter, or backward differences, ``controller.discretise(sample_time)``, as most PLCs do.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=0.5), 0.5)
    >>> r = pidalab.simulate_sampled(loop, np.arange(5.0), setpoint=1.0, limits=(-0.25, 0.25))
    >>> r.u.tolist(), r.y.tolist()
    ([0.25, 0.25, 0.25, 0.1875, 0.078125], [0.0, 0.125, 0.375, 0.625, 0.84375])

    Windup of a PI controller, and two ways to prevent it:

    >>> loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=0.5), pidalab.PIDA(kp=0.6, ti=4.0)), 0.01 * np.arange(3001)
    >>> for way in (None, "clamping", "conditioning"):
    ...     r = pidalab.simulate_sampled(loop, t, setpoint=1.0, limits=(-0.1, 0.1), anti_windup=way)
    ...     print(f"{way}: overshoot {r.overshoot():.1f} %")
    None: overshoot 74.4 %
    clamping: overshoot 3.2 %
    conditioning: overshoot 12.4 %
    """
    require_loop(loop)
    t, *held = _check.signals(t, setpoint=setpoint, load=load, noise=noise)
    r, d, n = map(np.ascontiguousarray, held)  # as kernels read them
    h = float(t[-1] / (t.size - 1))
    at_rest = limits_at_rest(loop.limits, limits)
    fineness, actuator = _conversion(*at_rest, quanta, pulse_widths)
    steps = plant_steps(loop.process if plant is None else plant, h, actuator)
    reference = filtered(discretise(*loop.blocks["prefilter"], h), r)
    if loop.digital is None:
        block, own = sampled_controller(loop, h, at_rest, anti_windup)
        made = program(own, block=True)
        code, _, numbers = operations(made, made.states)
    else:
        block, own = NO_BLOCK, _limited(loop.digital, h, at_rest, anti_windup)
        code, _, numbers = operations(program(own), own.at_rest())
    rest = own.y_offset, own.bias
    y, u, area = run(code, numbers[:, None], block, rest, steps, actuator, fineness, reference, d, n)
    lost = ~np.isfinite([y, u, area]).all(axis=0)
    if lost.any():
        raise ValueError(
            f"the response of the unstable loop leaves the range of numbers before t = {t[lost][0]:.4g}"
        )
    return Response(t=t, r=r, d=d, n=n, y=y, u=u, area=area)


def _limited(
    k: DigitalController, h: float, limits: tuple[float, float], anti_windup: str | None
) -> DigitalController:
    """Check that a digital controller fits the step of time, and give it the limits, which count from rest."""
    if abs(h - k.sample_time) > 1e-6 * k.sample_time:
        raise ValueError(
            f"t must have the sample time of the digital controller, {k.sample_time:.6g}, as its step, found {h:.6g}; "
            "discretise the controller for the step of t"
        )
    anti_windup_word(anti_windup, (None, k.anti_windup), "for this digital controller")
    low, high = (k.bias + limit for limit in limits)
    return replace(k, limits=(max(low, k.limits[0]), min(high, k.limits[1])))


def limits_at_rest(own: tuple[float, float], limits: tuple[float, float]) -> tuple[float, float]:
    """Check limits, which may be infinite, against the state of rest; the controller's own hold too."""
    low, high = _check.limits(limits)
    low, high = max(low, own[0]), min(high, own[1])
    if not low <= 0 <= high or low == high:
        raise ValueError(
            "limits must be (lower, upper) with lower < upper, and hold 0, the control signal at rest "
            f"(give them as distances from the state of rest); found {limits!r}"
            + (f" and {own!r} of the controller" if np.isfinite(own).any() else "")
        )
    return low, high


def _conversion(low: float, high: float, quanta: tuple[float, float], widths: int) -> tuple[float, Actuator]:
    """Check what is between controller and plant: the resolution of the measurement, and the actuator."""
    found = _check.pair("quanta", "of measurement and control signal", quanta)
    measurement, control = (_check.real(f"quanta[{i}]", each, at_least=0.0) for i, each in enumerate(found))
    widths = _check.integer("pulse_widths", widths, at_least=0)
    if widths and control:
        raise ValueError(
            f"pulse_widths = {widths} is a resolution already: quanta[1] must be 0, found {control:g}"
        )
    if widths and not math.isfinite(high - low):
        raise ValueError(
            f"pulse_widths needs finite limits to switch between, found limits ({low:g}, {high:g})"
        )
    return measurement, Actuator(low, high, control, widths)
