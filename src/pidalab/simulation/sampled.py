r"""Simulation of loops with a digital controller that samples, holds and is limited.

At :math:`t_k = kh` the controller reads :math:`\varepsilon_k = F_r r - (y + n)` and sets :math:`u_k`, limited, which is
held for the sample time h. Seen from the plant its input is a staircase, also after a dead time, whose stairs then
begin inside a sample interval if the dead time :math:`L = mh + \lambda` is no multiple of h:

.. math:: w(t_k + s) = v_{k-m-1} \;\;(0 \le s < \lambda), \qquad v_{k-m} \;\;(\lambda \le s < h), \qquad v = u + d.

So each sample interval has one or two pieces in which the input is constant, and one matrix exponential for each takes
the plant across without any error. The controller is discretised for a held input as well. What is left of
discretisation is what a digital controller does to a loop: it delays by half a sample in reading and half a sample in
holding, and the response approaches that of the continuous loop with the first power of h.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import SeriesPIDA
from pidalab.loop import Loop, open_loop
from pidalab.process import Process
from pidalab.response import Response
from pidalab.simulation.plants import AsymmetricPlant, StateSpace, digital, held, plant_states

ALIGNED = 1e-9  # share of a sample by which a dead time may miss a multiple and still be taken as one: rounding


class Steps(NamedTuple):
    """The plant across a sample interval, piece by piece, each for both of its systems."""

    phi: Array  # (pieces, 2, n, n)
    gamma: Array  # (pieces, 2, n)
    ago: Array  # (pieces,), how many samples ago the input of the piece was set
    c: Array  # (n,)
    d: float


def simulate_sampled(
    loop: Loop,
    t: ArrayLike,
    setpoint: ArrayLike = 1.0,
    load: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    limits: tuple[float, float] = (-math.inf, math.inf),
    plant: Process | AsymmetricPlant | None = None,
) -> Response:
    """Simulate a loop whose controller is digital and limited; exact for the plant, whatever its dead time.

    The loop is at rest before t = 0. Controller, output filter and prefilter are discretised for held inputs with the
    step of `t` as sample time; there is no anti-windup. All signals, and the limits, count from the state of rest: an
    actuator from 0 to 80 that rests at 30 has the limits (-30, 50).

    Parameters
    ----------
    loop : Loop
        The loop.
    t : array_like, shape (n,)
        Uniform times that start at 0; their step is the sample time of the controller.
    setpoint, load, noise : float or array_like, shape (n,), optional
        A number is a step at t = 0; an array is held from each sample to the next.
    limits : tuple of float, optional
        Smallest and largest control signal, with 0 between them or on one of them.
    plant : Process or AsymmetricPlant, optional
        What the controller meets in place of the loop's process.

    Returns
    -------
    Response
        Signals at the times t, at a jump the value just after it; `u` is the limited control signal, held from each
        sample to the next.

    Raises
    ------
    TypeError, ValueError
        For times that are not uniform from 0, signals of another length or with NaN, limits out of order or without
        the 0 of the state of rest, a plant that answers within the sample (direct feedthrough without dead time), an
        unstable loop that overflows, and a `SeriesPIDA` with limits, whose reset is fed by the limited signal.

    Notes
    -----
    A filter faster than the sample time is allowed and of no use: a derivative behind it sees steps only, and has
    forgotten each at the next sample. Take a sample time well below the time constant of the filter.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=0.5), 0.5)
    >>> r = pidalab.simulate_sampled(loop, np.arange(5.0), setpoint=1.0, limits=(-0.25, 0.25))
    >>> r.u.tolist(), r.y.tolist()
    ([0.25, 0.25, 0.25, 0.1875, 0.078125], [0.0, 0.125, 0.375, 0.625, 0.84375])
    """
    open_loop(loop)  # complains about what is not a loop
    t = _check.uniform_time("t", t)
    r, d, n = (_check.signal(*item, t.size) for item in (("setpoint", setpoint), ("load", load), ("noise", noise)))
    low, high = _limits(loop, limits)
    h = float(t[-1] / (t.size - 1))
    blocks = loop.blocks
    num, den = (np.convolve(a, b) for a, b in zip(blocks["controller"], blocks["output_filter"], strict=True))
    filtered = _filtered(digital(*blocks["prefilter"], h), r)
    controller = digital(num, den, h)
    y, u, area = _run(controller, _steps(loop.process if plant is None else plant, h), filtered - n, d, low, high)
    lost = ~np.isfinite(y + u + area)
    if lost.any():
        raise ValueError(f"the response of the unstable loop leaves the range of numbers before t = {t[lost][0]:.4g}")
    return Response(t=t, r=r, d=d, n=n, y=y, u=u, area=area)


def _limits(loop: Loop, limits: tuple[float, float]) -> tuple[float, float]:
    """Check limits, which may be infinite, against the state of rest and the controller."""
    low, high = _check.limits(limits)
    if not low <= 0 <= high:
        raise ValueError(
            "limits must be (lower, upper) with lower < upper, and hold 0, the control signal at rest "
            f"(give them as distances from the state of rest); found {limits!r}"
        )
    if isinstance(loop.controller, SeriesPIDA):
        own = loop.controller.limits
        if any(map(math.isfinite, (low, high, *own))):
            raise ValueError(
                "limits: the reset of a SeriesPIDA is fed by the limited control signal, and this engine has its "
                f"linear transfer function only; found limits {limits!r} and {own!r} of the controller"
            )
    return low, high


def _steps(plant: Process | AsymmetricPlant, h: float) -> Steps:
    """Discretise the plant over the one or two pieces of a sample interval in which its delayed input is constant."""
    if not isinstance(plant, (Process, AsymmetricPlant)):
        raise TypeError(f"plant must be a Process or an AsymmetricPlant, found {type(plant).__name__}")
    states = plant_states(plant)
    if states.d and plant.delay < h * ALIGNED:
        raise ValueError(
            "the plant answers within the sample (direct feedthrough without dead time): the controller would read "
            f"what it has not set yet; found {plant!r}"
        )
    samples = plant.delay / h
    whole = math.floor(samples + ALIGNED)
    part = h * (samples - whole)
    pieces = [(h, whole)] if part < h * ALIGNED else [(part, whole + 1), (h - part, whole)]
    across = [[held(A, b, time) for A, b in zip(states.A, states.b, strict=True)] for time, _ in pieces]
    return Steps(
        phi=np.array([[phi for phi, _ in both] for both in across]),
        gamma=np.array([[gamma for _, gamma in both] for both in across]),
        ago=np.array([ago for _, ago in pieces]),
        c=states.c,
        d=states.d,
    )


@njit(cache=True)
def _advance(phi: Array, gamma: Array, x: Array, w: float, new: Array) -> None:
    """Write phi x + gamma w into `new`; in plain loops, for small matrices faster than a library call."""
    for i in range(x.size):
        total = gamma[i] * w
        for j in range(x.size):
            total += phi[i, j] * x[j]
        new[i] = total


@njit(cache=True)
def _output(c: Array, d: float, x: Array, w: float) -> float:
    """Return c x + d w."""
    total = d * w
    for i in range(x.size):
        total += c[i] * x[i]
    return total


@njit(cache=True)
def _filtered(block: StateSpace, signal: Array) -> Array:
    """Pass a held signal through a discretised block."""
    x, new, out = np.zeros(block.b.size), np.zeros(block.b.size), np.empty(signal.size)
    for k in range(signal.size):
        out[k] = _output(block.c, block.d, x, signal[k])
        _advance(block.A, block.b, x, signal[k], new)
        x, new = new, x
    return out


@njit(cache=True)
def _run(
    controller: StateSpace, plant: Steps, reference: Array, load: Array, low: float, high: float
) -> tuple[Array, Array, Array]:
    """Run the loop; `reference` is the filtered set point less the noise. Returns y, u and the integral of y."""
    n, before = reference.size, plant.ago[0]
    y, u, area = np.empty(n), np.empty(n), np.empty(n)
    v = np.zeros(n + before)  # input of the plant, with its rest before t = 0 in front
    x, x_new = np.zeros(plant.c.size), np.zeros(plant.c.size)
    z, z_new = np.zeros(controller.b.size), np.zeros(controller.b.size)
    for k in range(n):
        y[k] = _output(plant.c, plant.d, x, v[k])
        area[k] = x[-1]
        error = reference[k] - y[k]
        u[k] = min(max(_output(controller.c, controller.d, z, error), low), high)
        v[k + before] = u[k] + load[k]
        _advance(controller.A, controller.b, z, error, z_new)
        z, z_new = z_new, z
        for piece in range(plant.ago.size):
            w = v[k + before - plant.ago[piece]]
            system = 1 if w > x[0] else 0  # a store that moves towards w does not pass it while w is held
            _advance(plant.phi[piece, system], plant.gamma[piece, system], x, w, x_new)
            x, x_new = x_new, x
    return y, u, area
