r"""Continuous controllers in a sampled loop: a fraction for held inputs, and an integral that reacts to the limits.

Every controller here computes, from its difference :math:`\varepsilon_k`,

.. math:: w_k = p_k + i_k, \qquad u_k = \operatorname{sat}(w_k), \qquad
          i_{k+1} = i_k + \alpha\,\varepsilon_k + \beta\,(u_k - i_k) + \gamma\,(u_k - w_k),

where p is the output of the fraction for :math:`\varepsilon`. The rest is what the controller feeds to its integral:

==========================  =========================  ===============================================================
controller                  fraction                   :math:`\alpha,\ \beta,\ \gamma`
==========================  =========================  ===============================================================
without anti-windup         the controller             0, 0, 0: the integral is a state of the fraction
clamping                    :math:`C - k_i/s`          :math:`k_i h`, 0, 0, and the integral rests while it would
                                                       drive w further beyond a limit
conditioning                :math:`C - k_i/s`          :math:`k_i h`, 0, :math:`k_i h/k_p`
automatic reset             :math:`R_p Q_n`            0, :math:`1 - e^{-h/t_i}`, 0: the integral is a lag behind the
                                                       limited control signal
==========================  =========================  ===============================================================
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pidalab.controllers import AutomaticReset, Controller
from pidalab.digital import DigitalController
from pidalab.digital.parameters import anti_windup_word
from pidalab.loop import Loop
from pidalab.process import binomial
from pidalab.roots import roots
from pidalab.statespace import StateSpace, discretise


def sampled_controller(
    loop: Loop, h: float, limits: tuple[float, float], anti_windup: str | None
) -> tuple[StateSpace, DigitalController]:
    """Discretise the controller of a loop, its output filter included, for held inputs and the sample time h.

    Returns the fraction, and what is behind it: the integral and the limits.
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
        raise ValueError(
            f"anti_windup={anti_windup!r} needs a controller with integral action (one pole at 0), found "
            f"{loop.controller!r}"
        )
    ki = num[-1] / den[-2]
    rest, den = np.polysub(num, ki * den[:-1]), den[:-1]
    num = rest[:-1] if rest.size > 1 else np.zeros(1)
    tracking = _tracking(ki, num[-1] / den[-1], h) if anti_windup == "conditioning" else 0.0
    way = "clamping ahead" if anti_windup == "clamping" else None
    return discretise(num, den, h), _behind(h, limits, integral=ki * h, gain=tracking, anti_windup=way)


def _behind(
    h: float, limits: tuple[float, float], integral: float = 0.0, gain: float = 0.0, **more: Any
) -> DigitalController:
    """Return the digital controller that adds an integral, where it grows, to a given signal, and limits the sum."""
    rest: dict[str, Any] = {"from_signal": False, "tracking_gain": 0.0, "anti_windup": None}
    return DigitalController(
        sample_time=h,
        method="zoh",
        paths=(),
        integrates=integral != 0.0,
        growth=(0.0, integral),
        back_calculation_gain=gain,
        weights=(1.0, 1.0),
        limits=limits,
        **rest | more,
    )


def _tracking(ki: float, kp: float, h: float) -> float:
    """Return how much of u - w the integral of a conditioned controller takes up in a sample."""
    if kp == 0 or not 0 < ki * h / kp < 1:
        raise ValueError(
            "anti_windup='conditioning' is unstable unless kp/ki is above the sample time: found ki = "
            f"{ki:.4g}, kp = {kp:.4g} (what C(s) - ki/s is at s = 0) and a sample time of {h:.4g}"
        )
    return ki * h / kp


def require_fine_enough(h: float, filter_time: float) -> None:
    """Raise for a sample time above the filter's time constant: derivatives would see single steps only."""
    if h > filter_time * (1 + 1e-6):
        raise ValueError(
            f"the sample time must be at most the time constant of the controller's filter ({filter_time:.6g}), found "
            f"{h:.6g}: between two samples such a filter forgets, and a derivative behind it acts on single steps; "
            "sample faster, filter longer, or close the loop with controller.discretise(sample_time, 'backward'), "
            "which serves at any sample time"
        )


def shortest_filter(loop: Loop) -> float:
    """Shortest time constant of the filters in the controller and behind it, infinite without any."""
    own = isinstance(loop.controller, Controller)
    found = [part.filter_time for part in loop.controller.parts() if part.filter_order] if own else []
    for block in ("output_filter",) if own else ("output_filter", "controller"):
        # the poles of a transfer function are its filters, but for those at 0, the integrators
        poles = roots(loop.blocks[block][1])
        found += (1 / np.abs(poles[poles != 0])).tolist()
    return float(min(found, default=math.inf))


def _with_reset(
    loop: Loop, reset: AutomaticReset, h: float, limits: tuple[float, float]
) -> tuple[StateSpace, DigitalController]:
    """Discretise the stabilising controller with its filters; the reset is the integral."""
    num, den = loop.blocks["output_filter"]
    filters = np.convolve(den, binomial(reset.filter_time, reset.filter_order))
    fraction = discretise(np.convolve(num, reset.stabiliser), filters, h)
    # share of the control signal that the lag of the reset takes up in a sample
    share = -math.expm1(-h / reset.time)
    return fraction, _behind(h, limits, integral=share, from_signal=True)
