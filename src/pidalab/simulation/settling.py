"""A response over a horizon that is long enough for the loop at hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.response import Response

SETTLING_POINTS = 4001  # of the response
# of the horizon: a loop that is ten thousand times slower than expected still comes to rest
HORIZON_DOUBLINGS = 13


def settled(simulate: Callable[[Loop, Array], Response], loop: Loop, horizon: float) -> Response:
    """Simulate a step until the response has settled, so that its integrals are those to infinity.

    Parameters
    ----------
    simulate : callable
        `load_response` or `step_response`.
    loop : Loop
        A stable loop.
    horizon : float
        The first end of the simulation that is tried, above 0. It is doubled until the error has died away; ends
        within twice the dead time are passed over, as nothing of what the loop does can be seen there.

    Returns
    -------
    Response
        One whose ``iae(horizon=math.inf)`` exists.

    Raises
    ------
    ValueError
        For a horizon that is not above 0, if the response has not settled after all doublings, and if it needs too many
        dead times for that.

    Examples
    --------
    >>> import math, pidalab
    >>> from pidalab.simulation.settling import settled
    >>> loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))
    >>> print(f"{settled(pidalab.load_response, loop, 4.0).iae(horizon=math.inf):.4f}")
    1.2500
    """
    from pidalab.simulation.ladder import ManyDeadTimes  # compiled code: loaded when it is needed

    horizon = _check.real("horizon", horizon, above=0.0)
    while horizon <= 2 * loop.process.delay:
        horizon *= 2
    for doubling in range(HORIZON_DOUBLINGS + 1):
        end = horizon * 2.0**doubling
        try:
            response = simulate(loop, np.linspace(0.0, end, SETTLING_POINTS))
        except ManyDeadTimes:
            raise ValueError(
                f"the loop needs {end:.3g} to come to rest, {end / loop.process.delay:.3g} times the dead time of its "
                "process: too many to follow one after the other; leave out a dead time as short as that"
            ) from None
        try:
            response.iae(horizon=math.inf)
        except ValueError:
            continue
        return response
    raise ValueError(f"the response does not settle within {horizon * 2**HORIZON_DOUBLINGS:.3g}")


def load_iae(loop: Loop) -> float:
    """IAE of a unit step of the load, over a horizon that fits the loop.

    Parameters
    ----------
    loop : Loop
        A stable loop.

    Returns
    -------
    float
        Until infinity, in units of y times time.

    Raises
    ------
    ValueError
        As `settled`.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.simulation.settling import load_iae
    >>> loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))
    >>> print(f"{load_iae(loop):.4f}")
    1.2500
    """
    from pidalab.robustness.poles import rightmost_poles
    from pidalab.simulation.exact import load_response

    slowest = -float(np.max(rightmost_poles(loop).real))
    return settled(load_response, loop, 12.0 / slowest + 10.0 * loop.process.delay).iae(horizon=math.inf)
