r"""MIGO: the largest integral gain whose loop keeps outside of a circle around -1.

The rule is that of Åström and Hägglund, Revisiting the Ziegler-Nichols step response method for PID control, J. Process
Control 14 (2004) 635-650, whose fit to 134 processes is AMIGO. One circle encloses those of Ms = M and Mt = M. It has
the ends -M/(M - 1) and -(M - 1)/M on the real axis, so that its centre is -c and its radius r, with

.. math:: c = \frac{2 M^2 - 2 M + 1}{2 M (M - 1)}, \qquad r = \frac{2 M - 1}{2 M (M - 1)}.

With derivative gain :math:`k_d` the integral gain is largest where the loop touches the circle and a little more
proportional gain changes that by nothing. With :math:`Q = 1/P(j\omega)` this is

.. math:: k_p = -c\,\mathrm{Re}\,Q, \quad k_i = \omega (k_d \omega - v), \quad v = r |Q| - c\,\mathrm{Im}\,Q, \quad
          k_d = \frac{1}{2 \omega} \frac{d (\omega v)}{d \omega},

one controller for each frequency at which a loop touches. For PI the derivative gain is 0. For PID the curve is
followed to larger gains, until the loop touches the circle at a second frequency. Beyond, the largest integral gain
would lie on an edge, where one touch presses against the other, and the loop would be hardly damped.

The paper was not at hand. That its PID controllers end there follows from its examples as we remember them: three PI
and three PID controllers for M = 1.4 come out within half a per cent, see the page of tables that others printed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.controllers import PIDA
from pidalab.loop import Loop
from pidalab.process import Process, require_no_zero_at_origin, sign_of_gain
from pidalab.reduction import ultimate_frequency
from pidalab.roots import border
from pidalab.rules._design import Design

MIGO_KINDS = ("PI", "PID")
BELOW, ABOVE = (
    1e-3,
    1e3,
)  # range of the frequencies, relative to that at which the phase of the process is -180 degrees
SWEEP_POINTS, SWEEP_TURN = (
    6000,
    0.02,
)  # number of frequencies, and largest phase of the dead time (rad) between two
MOST_TURNS = 400.0  # largest phase of the dead time, rad
SEARCHED = (1e-2, 2.0, 400)  # relative range and number of frequencies in the search for the PI controller
PACE, CLOSE = 1.01, 1e-9  # relative step along the curve, and tolerance at its end
STEP = 1e-4  # relative step of the numerical derivative of v
CIRCLE_TOUCH = 1e-6  # tolerance of a touch, relative to the radius; v' is about as exact
IDEAL = 1e6  # derivative filter ratio for a rule without filter


class _Ridge(NamedTuple):
    """The controllers whose loops touch the circle, by the frequency of the touch; for a process of positive gain."""

    process: Process
    centre: float
    radius: float
    w: Array  # frequencies
    P: Array  # values of the process

    def at(self, w: Any) -> tuple[Any, Any, Any]:
        """Return the gains ki, kp, kd of the loop that touches the circle at w."""
        Q = 1 / self.process(1j * w)
        kd = (self._wv(w * (1 + STEP)) - self._wv(w * (1 - STEP))) / (2 * STEP * w) / (2 * w)
        return w * kd * w - self._wv(w), -self.centre * Q.real, kd

    def _wv(self, w: Any) -> Any:
        Q = 1 / self.process(1j * w)
        return w * (self.radius * np.abs(Q) - self.centre * Q.imag)

    def room(self, w: float) -> float:
        """Return the least distance from the circle of the loop that touches it at w, relative to its radius."""
        ki, kp, kd = self.at(w)
        L = self.P * (kp + 1j * (kd * self.w - ki / self.w))
        return float(np.min(np.abs(L + self.centre))) / self.radius - 1

    def fits(self, w: float) -> bool:
        """Return True if the loop stays outside the circle and has positive integral action."""
        return bool(self.at(w)[0] > 0) and self.room(w) >= -CIRCLE_TOUCH


def tune(model: Process, kind: str = "PID", *, m: float = 1.4, n: float = 10) -> Design:
    """Return the PI or PID controller of MIGO.

    Parameters
    ----------
    model : Process
        Stable, or with one integrator; one that turns by half a turn.
    kind : {"PI", "PID"}, optional
        Which controller.
    m : float, optional
        M, above 1: without a derivative filter neither Ms nor Mt exceeds it.
    n : float, optional
        Ratio of derivative time and its filter, of which the rule knows nothing.

    Returns
    -------
    Design
        Its `info`: ``m``, and ``touch``, the frequency at which the loop touches the circle.

    Raises
    ------
    ValueError
        For a model that is unstable or never turns by half a turn, where no loop touches the circle as it should, and
        where the derivative filter makes the loop unstable.

    Examples
    --------
    >>> import pidalab
    >>> for kind in ("PI", "PID"):
    ...     C = pidalab.rules.migo.tune(pidalab.lags(4), kind).controller
    ...     print(f"{C.kp:.3f} {C.ti:.3f} {C.td:.3f}")
    0.432 2.428 0.000
    1.190 2.225 1.205
    """
    from pidalab.robustness.poles import is_stable

    _check.choice("kind", kind, MIGO_KINDS)
    m = _check.real("m", m, above=1.0)
    require_no_zero_at_origin("model", model)
    sign = sign_of_gain(model)
    upright = model if sign > 0 else Process(-model.num, model.den, model.delay)
    turned = ultimate_frequency(upright)
    ridge = _ridge(upright, m, turned)
    touch = _first(ridge, turned)
    if touch is not None and kind == "PID":
        touch = _last(ridge, touch)
    if touch is not None:
        ki, kp, kd = (float(gain) for gain in ridge.at(touch))
        times = kp / ki, kd / kp if kind == "PID" else 0.0
        if kp > 0 and is_stable(Loop(upright, PIDA(kp, *times, 0.0, IDEAL))):
            controller = PIDA(sign * kp, *times, 0.0, n)
            if not is_stable(Loop(model, controller)):
                raise ValueError(
                    f"n must be larger for this model, found {n:g}: with a derivative filter as slow as that, of which "
                    "the rule knows nothing, the loop is unstable"
                )
            source = "Åström and Hägglund (2004), MIGO"
            return Design(model, controller, source=source, info={"m": m, "touch": touch})
    raise ValueError(
        f"model must have a {kind} controller whose loop touches the circle of M = {m:g} where its integral gain is "
        f"largest, found none for {model!r}"
    )


def _ridge(process: Process, m: float, turned: float) -> _Ridge:
    """Return the circle of M, and a grid of frequencies fine enough for the dead time."""
    both = 2 * m * (m - 1)
    w = turned * np.geomspace(BELOW, ABOVE, SWEEP_POINTS)
    if process.delay:
        turns = np.arange(0.1, MOST_TURNS, SWEEP_TURN) / process.delay
        w = np.unique(np.append(w, turns))
    return _Ridge(process, (both + 1) / both, (2 * m - 1) / both, w, process(1j * w))


def _first(ridge: _Ridge, turned: float) -> float | None:
    """Return the frequency of the PI controller, at which the derivative gain rises through 0."""
    from scipy.optimize import brentq

    w = turned * np.geomspace(*SEARCHED)
    kd = ridge.at(w)[2]
    for i in np.flatnonzero((kd[:-1] < 0) & (kd[1:] >= 0)):
        found = float(brentq(lambda w: ridge.at(w)[2], w[i], w[i + 1], xtol=1e-14 * turned, rtol=1e-14))
        if ridge.fits(found):
            return found
    return None


def _last(ridge: _Ridge, first: float) -> float | None:
    """Return the frequency of the PID controller, the last one at which the loop still stays outside the circle."""
    good, bad = first, first * PACE
    while ridge.fits(bad):
        if ridge.at(bad)[2] <= ridge.at(good)[2] or bad > ridge.w[-1]:
            return None  # the loop does not touch the circle again
        good, bad = bad, bad * PACE
    return border(ridge.fits, inside=good, outside=bad, share=CLOSE)
