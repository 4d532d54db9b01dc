"""Simulated stand-ins for plants of the papers whose records are not published.

A twin has an assumed structure. It gives the printed model when it is identified as the paper identifies its plant, and
proves nothing about the plant beyond that: what it shows is what a plausible plant of that kind would do.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab.identification import ipdt_tangent
from pidalab.loop import Loop
from pidalab.plants import AsymmetricPlant
from pidalab.process import Process, binomial
from pidalab.response import Response
from pidalab.simulation.exact import open_loop_step
from pidalab.simulation.sampled import simulate_sampled

RECORD = 15.0  # length of the step record in apparent dead times; the steepest point comes long before
FINENESS = 400  # its samples in an apparent dead time; the tangent is then right to six digits
MOST_LAGS = 20  # more are a dead time, and their coefficients lose accuracy
LAMP = (0.0, 80.0)  # limits of the lamp power of the thermal plant in per cent (huba2018, sec. V.B)


def thermal_plant(
    velocity_gain: float = 0.01,
    apparent_delay: float = 5.56,
    rise: float = 30.0,
    fall: float = 60.0,
    conduction: float = 200.0,
    share: float = 0.3,
    dip: float = 0.05,
    lags: int = 3,
    delay: float = 0.1,
) -> AsymmetricPlant:
    r"""Twin of the thermal plant of huba2018, sec. V: from lamp power in per cent to temperature in K above ambient.

    Radiation heats a body with the time constant `rise`; losing heat, it has only the slower `fall`. A share of the
    temperature arrives by conduction. Sensor and electronics add equal lags, and the lamp current pulls the reading
    down a little: it first moves the wrong way.

    .. math:: T\,\dot x = w - x, \quad T = T_{rise} \text{ where } w > x, \text{ otherwise } T_{fall}; \qquad
              y = \frac{K}{(T_l s + 1)^k}\left[\left(1 - \sigma + \frac{\sigma}{T_c s + 1}\right) x - \kappa\,w\right];
              \qquad w(t) = u(t - L)

    ==============  ==================
    equation        argument
    ==============  ==================
    T_c             `conduction`
    σ               `share`
    κ               `dip`
    k               `lags`
    L               `delay`
    ==============  ==================

    The gain K and the lag T_l are worked out such that `pidalab.identification.ipdt_tangent` finds the printed model in
    the response to a step upwards, eq. (17). Everything else is assumed: no record was published.

    Parameters
    ----------
    velocity_gain : float, optional
        K_sm of the model, in K/(% s), not 0.
    apparent_delay : float, optional
        T_dm of the model in seconds, above 0.
    rise, fall : float, optional
        Time constants of the body in seconds, above 0, while it is heated and while it cools.
    conduction : float, optional
        Time constant of the conduction in seconds, above 0.
    share : float, optional
        Share of the temperature that arrives by conduction, from 0 to 1.
    dip : float, optional
        Share of the static gain by which the lamp current pulls the reading down, from 0 to below 1.
    lags : int, optional
        Number of equal lags, at least 1.
    delay : float, optional
        True dead time in seconds, not negative.

    Returns
    -------
    AsymmetricPlant
        The twin. It starts at ambient temperature with the lamp off; the lamp has the limits 0 and 80 %.

    Raises
    ------
    ValueError
        For arguments outside their ranges, and where no lag gives the apparent dead time: dead time and dip alone
        exceed it, or the body is too fast.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> twin = pidalab.twins.thermal_plant()
    >>> t = 0.02 * np.arange(5000)
    >>> pidalab.identification.ipdt_tangent(t, pidalab.open_loop_step(twin.rising, t).y)
    Process(num=[0.0100], den=[1, 0], delay=5.5600)
    """
    rise, fall = _check.real("rise", rise, above=0.0), _check.real("fall", fall, above=0.0)
    if _check.real("velocity_gain", velocity_gain) == 0:
        raise ValueError("velocity_gain must not be 0, found 0")
    apparent_delay = _check.real("apparent_delay", apparent_delay, above=0.0)
    conduction = _check.real("conduction", conduction, above=0.0)
    lags = _check.order("lags", lags, at_least=1)
    if lags > MOST_LAGS:
        raise ValueError(f"lags must be at most {MOST_LAGS}, found {lags}")
    for name, value, top in (("share", share, 1.0), ("dip", dip, np.nextafter(1.0, 0.0))):
        if not 0 <= _check.real(name, value) <= top:
            raise ValueError(f"{name} must be from 0 to {'1' if top == 1 else 'below 1'}, found {value!r}")

    from control import TransferFunction

    def plant(gain: float, lag: float) -> AsymmetricPlant:
        under = binomial(lag, lags)
        main = TransferFunction(
            [gain * (1 - share) * conduction, gain], np.convolve([conduction, 1.0], under)
        )
        return AsymmetricPlant(main, rise, fall, TransferFunction([-gain * dip], under), delay)

    t = np.linspace(0.0, RECORD * apparent_delay, round(RECORD * FINENESS) + 1)

    def model(lag: float) -> Process:
        rising = plant(1.0, lag).rising
        return ipdt_tangent(
            t, open_loop_step(Process(rising.num, rising.den), t).y
        )  # true dead time just adds to it

    def excess(lag: float) -> float:
        return delay + model(lag).delay - apparent_delay

    shortest = 1e-3 * apparent_delay
    if excess(shortest) > 0:
        raise ValueError(
            f"apparent_delay = {apparent_delay:g} is exceeded without any lag, through the dead time {delay:g} and the "
            f"dip {dip:g}"
        )
    if excess(apparent_delay) < 0:
        raise ValueError(
            f"apparent_delay = {apparent_delay:g} is not reached by lags of that size: rise = {rise:g} is too short "
            "against it"
        )
    lag = brentq(excess, shortest, apparent_delay, xtol=1e-9 * apparent_delay)
    return plant(velocity_gain / float(model(lag).num[0]), lag)


def thermal_experiment(
    loop: Loop,
    plant: AsymmetricPlant | Process,
    level: float = 10.0,
    step: float = 5.0,
    hold: float = 200.0,
    sample_time: float = 0.02,
) -> Response:
    """Warm the thermal plant up from ambient temperature, then step its set point up and down again: huba2018, sec. V.

    The sample time, the limits of the lamp and the absence of anti-windup and bumpless transfer are the paper's. The
    temperatures are assumed; the paper's text does not name them.

    Parameters
    ----------
    loop : Loop
        Controller and prefilter.
    plant : AsymmetricPlant or Process
        What they meet, such as a `thermal_plant`.
    level, step : float, optional
        First set point, and change of the second, in K above ambient.
    hold : float, optional
        How long each of the three set points stays, in seconds.
    sample_time : float, optional
        Sample time of the controller in seconds.

    Returns
    -------
    Response
        With set-point changes at 0, `hold` and 2 `hold`; it ends at 3 `hold`. `Response.between` takes one of them out.

    Raises
    ------
    ValueError
        For a time that is not above 0, and a `hold` that is no multiple of the sample time.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.rules.mrdp.tune(pidalab.ipdt(0.01, delay=5.0), m=1, n=3, te=0.2)
    >>> r = pidalab.twins.thermal_experiment(design.loop(), pidalab.twins.thermal_plant())
    >>> print(f"{r.y[9999]:.2f} {r.y[19999]:.2f} {r.y[-1]:.2f}")
    10.00 15.00 10.00
    """
    sample_time, hold = (
        _check.real("sample_time", sample_time, above=0.0),
        _check.real("hold", hold, above=0.0),
    )
    level, step = _check.real("level", level), _check.real("step", step)
    samples = round(hold / sample_time)
    if samples < 1 or abs(samples * sample_time - hold) > 1e-6 * sample_time:
        raise ValueError(f"hold must be a multiple of sample_time = {sample_time:g}, found {hold:g}")
    r = np.repeat([level, level + step, level], samples)
    return simulate_sampled(loop, sample_time * np.arange(r.size), r, limits=LAMP, plant=plant)
