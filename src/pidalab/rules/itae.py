r"""Explicit ITAE tuning of PID and PIDA controllers for a second-order model with dead time (heo2023).

The ITAE is the integral of time times absolute error after a step. The paper's :math:`k, \tau, \xi, \theta` are gain,
time constant, damping and dead time of `model`, and :math:`r` is :math:`\theta/\tau`. All functions except `imc_pid`
need a `sopdt` with 0.1 ≤ r ≤ 2 and 0.3 ≤ ξ ≤ 2. For other models they raise a ValueError. ITAE-2 is the paper's name
for a PID rule of Sung and others (1996). The following formulas differ from the paper as we read it. Either the print
or our reading is wrong:

* Tables 2 and 3: the two formulas for the derivative time give :math:`\tau/\tau_d`, not :math:`\tau_d/\tau`. With this
  correction and a short dead time, Table 2 gives about :math:`\tau_d = \tau/(2\xi)`, which cancels the poles.
* Table 2: the formula with 1.768, printed with :math:`\tau_d/\tau` on its left side, gives the integral time for r > 1.
  At r = 1 it differs from the formula for r ≤ 1 by only 1.4 %.
* Table 3: both exponentials have a negative argument, as in Table 2.
* Table 3: the formula of the gain changes at r = 0.9, not at ξ = 0.9. At r = 0.9 the gain jumps by 0.003. With a change
  at ξ = 0.9, the gain would jump by 29 for r = 0.1. For ξ = 0.3 and r = 2 it would have the wrong sign.
* Table 1: the last four lines belong to ξ > 1. At ξ = 1 they agree with the other lines to 0.3 %.
* Eq. (12): the acceleration time is :math:`\tau_d f_a`, as in step 5 of the procedure, not :math:`\tau_d f_d`.

The printed tunings confirm the corrections of the derivative times, of the exponentials and of eq. (12). They do not
test the other corrections. All constants are as printed. Where two cases of a formula meet, the jump is at most 13 %
(gain of Table 2 at ξ = 0.9 for r = 2).

`setpoint_factors` and `load_factors` return factors f_d and f_a from our own fits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pidalab import _check
from pidalab.controllers import NonInteractivePIDA
from pidalab.process import Process
from pidalab.rules._design import Design
from pidalab.rules.models import SecondOrder, lag_with_delay, second_order


class Factors(NamedTuple):
    """Factors f_a = tau_a / tau_d and f_d, the fraction of the dead time that the acceleration compensates."""

    f_d: float
    f_a: float


def pid_setpoint(model: Process, alpha_d: float = 0.05) -> NonInteractivePIDA:
    r"""Design the ITAE-2 PID controller for steps of the set point, Table 2.

    .. math::

       k k_c &= \begin{cases} -0.04 + (0.333 + 0.949\,r^{-0.983})\,\xi & \xi \le 0.9 \\
                              -0.544 + 0.308\,r + 1.408\,\xi\,r^{-0.832} & \xi > 0.9 \end{cases} \\
       \tau_i/\tau &= \begin{cases} (2.055 + 0.072\,r)\,\xi & r \le 1 \\ (1.768 + 0.329\,r)\,\xi & r > 1 \end{cases} \\
       \tau/\tau_d &= \left(1 - e^{-r^{1.06}\xi/0.87}\right)\left(0.55 + 1.683\,r^{-1.09}\right)

    The left sides of the last formula and of the integral time for r > 1 are corrected (see the top of this module).

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.
    alpha_d : float, optional
        Filter time constant divided by the derivative time, above 0.

    Returns
    -------
    NonInteractivePIDA

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.itae.pid_setpoint(pidalab.sopdt(gain=1.0, tau=3.098, damping=0.413, delay=1.381))
    NonInteractivePIDA(kc=0.965, tau_i=2.67, tau_d=3.68, tau_a=0.0, alpha_d=0.05, alpha_a=0.025)
    """
    return NonInteractivePIDA(*_setpoint(second_order(model)), 0.0, alpha_d)


def pid_load(model: Process, alpha_d: float = 0.05) -> NonInteractivePIDA:
    r"""Design the ITAE-2 PID controller for load disturbances, Table 3.

    .. math::

       k k_c &= 2.189\,\xi\,r^{-0.766} + \begin{cases} -0.67 + 0.297\,r^{-2.001} & r < 0.9 \\
                              -0.365 + 0.26\,(r - 1.4)^2 & r \ge 0.9 \end{cases} \\
       \tau_i/\tau &= \begin{cases} 2.2122\,r^{0.52} - 0.3 & r < 0.4 \\
                      -0.975 + 0.91\,(r - 1.845)^2 + \left(1 - e^{-\xi/(0.15 + 0.33 r)}\right)
                      \left(5.25 - 0.88\,(r - 2.8)^2\right) & r \ge 0.4 \end{cases} \\
       \tau/\tau_d &= -1.9 + 1.576\,r^{-0.53} + \left(1 - e^{-\xi/(-0.15 + 0.939\,r^{-1.121})}\right)
                      \left(1.45 + 0.969\,r^{-1.171}\right)

    Three things are corrected (see the top of this module): the conditions of the gain formula, the sign in both
    exponentials, and the left side of the last formula. In our copy of the paper, the constant 2.2122 has one digit
    more than the other constants. No printed tuning distinguishes it from 2.212.

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.
    alpha_d : float, optional
        Filter time constant divided by the derivative time, above 0.

    Returns
    -------
    NonInteractivePIDA

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.itae.pid_load(pidalab.sopdt(gain=1.0, tau=3.098, damping=0.413, delay=1.381))
    NonInteractivePIDA(kc=2.50, tau_i=3.37, tau_d=2.58, tau_a=0.0, alpha_d=0.05, alpha_a=0.025)
    """
    return NonInteractivePIDA(*_load(second_order(model)), 0.0, alpha_d)


def factors(model: Process) -> Factors:
    """Compute the factors of the PIDA rule by Table 1, from the given model (not from the changed model of eq. (9)).

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.

    Returns
    -------
    Factors

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.itae.factors(pidalab.sopdt(gain=1.0, tau=2.0, damping=1.0, delay=1.0))
    Factors(f_d=0.3700, f_a=0.8509)
    """
    m = second_order(model)
    r, xi = m.ratio, m.damping
    row = 0 if r <= 0.37 else 1 if r <= 1 else 2
    if xi <= 1:
        a, b, c = ((0.105, 0.949, 0.149), (0.024, 0.216, 1.908), (0.009, 0.081, 6.407))[row]
        return Factors(0.3425 + 0.0875 * xi - 0.12 * r, 0.273 + (a + b * xi) * (r + c))
    a, b, c = ((0.966, 0.088, 1.136), (0.22, 0.02, 6.255), (0.0825, 0.0075, 18.0))[row]
    return Factors(0.5175 - 0.0875 * xi - 0.12 * r, -0.768 + (a + b * xi) * (r + c))


def pida_setpoint(
    model: Process,
    alpha_d: float = 0.05,
    alpha_a: float = 0.025,
    factors: tuple[float, float] | None = None,
) -> NonInteractivePIDA:
    r"""Design a PIDA controller for steps of the set point, by Table 2 for the changed model of eq. (9).

    .. math:: k_n = k_m, \quad \xi_n = \xi_m, \quad \theta_n = \theta_m - \theta_m f_d, \quad
              \tau_n = \tau_m + 0.5\,\theta_m f_d, \qquad \tau_a = \tau_d f_a

    The subscript m denotes the given model, and n the changed model. The ratio r of the changed model may be as small
    as 0.057, which is outside the range of Table 2. Like the paper, we still use Table 2. The last formula is corrected
    (see the top of this module).

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.
    alpha_d, alpha_a : float, optional
        Factors above 0. The filter time constants are ``alpha_d * tau_d`` and ``alpha_a * tau_a``.
    factors : tuple of float, optional
        Factors f_d and f_a. By default those of Table 1 for the given model (function `factors`).

    Returns
    -------
    NonInteractivePIDA

    Raises
    ------
    TypeError, ValueError
        If the model is out of range, if the factors are not two numbers, if f_a is below 0, if the changed model has no
        dead time or no time constant, or if a setting from the table is not positive.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> pidalab.rules.itae.pida_setpoint(model.process)
    NonInteractivePIDA(kc=3.778, tau_i=2.900, tau_d=0.940, tau_a=0.718, alpha_d=0.05, alpha_a=0.025)
    """
    return _pida(model, _setpoint, alpha_d, alpha_a, factors)


def pida_load(
    model: Process,
    alpha_d: float = 0.05,
    alpha_a: float = 0.025,
    factors: tuple[float, float] | None = None,
) -> NonInteractivePIDA:
    r"""Design a PIDA controller for load disturbances, by Table 3 for the changed model of eq. (9).

    The paper found the factors of Table 1 for set-point steps, and also uses them for load disturbances. With these
    factors, even the loop with the model itself is unstable for ξ = 0.3 with r ≤ 0.35, for ξ = 0.7 with r ≤ 0.2, for
    ξ = 1 with r = 0.1, and for ξ = 2 with r ≥ 1.75. Check `pidalab.margins`.

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.
    alpha_d, alpha_a : float, optional
        As for `pida_setpoint`.
    factors : tuple of float, optional
        As for `pida_setpoint`.

    Returns
    -------
    NonInteractivePIDA

    Raises
    ------
    TypeError, ValueError
        As for `pida_setpoint`.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> pidalab.rules.itae.pida_load(model.process)
    NonInteractivePIDA(kc=10.87, tau_i=1.167, tau_d=0.593, tau_a=0.453, alpha_d=0.05, alpha_a=0.025)
    """
    return _pida(model, _load, alpha_d, alpha_a, factors)


def tune(
    model: Process, test: str = "setpoint", kind: str = "PIDA", alpha_d: float = 0.05, alpha_a: float = 0.025
) -> Design:
    """Design a controller with `pida_setpoint`, `pida_load`, `pid_setpoint` or `pid_load`.

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.
    test : {"setpoint", "load"}, optional
        Kind of step for which the controller is designed.
    kind : {"PIDA", "PID"}, optional
        Kind of controller.
    alpha_d, alpha_a : float, optional
        As for `pida_setpoint`. PID ignores `alpha_a`.

    Returns
    -------
    Design
        For a PIDA, `info` contains the factors ``f_d`` and ``f_a``.

    Raises
    ------
    TypeError, ValueError
        As for the four functions, and if test or kind is unknown.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> pidalab.rules.itae.tune(model.process, test="load").controller
    NonInteractivePIDA(kc=10.87, tau_i=1.167, tau_d=0.593, tau_a=0.453, alpha_d=0.05, alpha_a=0.025)
    """
    _check.choice("test", test, ("setpoint", "load"))
    _check.choice("kind", kind, ("PIDA", "PID"))
    pid, pida, table = pid_setpoint, pida_setpoint, "Table 2"
    if test == "load":
        pid, pida, table = pid_load, pida_load, "Table 3"
    if kind == "PID":
        return Design(model, pid(model, alpha_d), source=f"heo2023, {table}")
    controller = pida(model, alpha_d, alpha_a)
    info, source = factors(model)._asdict(), f"heo2023, eqs. (9) and (12), Table 1 and {table}"
    return Design(model, controller, source=source, info=info, sources=dict.fromkeys(info, "Table 1"))


def setpoint_factors(model: Process) -> Factors:
    r"""Compute factors for `pida_setpoint`, fitted by us to the ITAE of set-point steps. Not from the paper.

    .. math::

       f_d &= 0.390 - 0.016\,\ell + 0.268\,x + 0.082\,\ell x, & f_a &= 0.944 + 0.211\,\ell + 0.442\,x + 0.158\,\ell x
       && \xi \le 0.9 \\
       f_d &= 0.345 - 0.050\,\ell - 0.459\,x - 0.188\,\ell x, & f_a &= 0.989 + 0.231\,\ell - 0.262\,x - 0.237\,\ell x
       && \xi > 0.9

    with :math:`\ell = \ln r` and :math:`x = \ln \xi`. We compared the ITAE with the least ITAE of any PIDA controller
    of this form, on 40 models that were not used in the fit. The ITAE divided by the least ITAE is on average 1.68
    (geometric mean) and at most 2.52. With the factors of Table 1 the ratio is on average 1.74 and at most 3.25. For ξ
    just above 0.9 and r near 2, Ms is up to 2.9. For all other models it is at most 2.5. `direct.setpoint` is much
    closer to the least ITAE.

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.

    Returns
    -------
    Factors

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.rules import itae
    >>> model = pidalab.sopdt(gain=1.0, tau=2.0, damping=0.5, delay=1.0)
    >>> itae.pida_setpoint(model, factors=itae.setpoint_factors(model))
    NonInteractivePIDA(kc=1.457, tau_i=2.213, tau_d=2.118, tau_a=1.202, alpha_d=0.05, alpha_a=0.025)
    """
    m = second_order(model)
    log_r, log_xi = math.log(m.ratio), math.log(m.damping)
    terms = (1.0, log_r, log_xi, log_r * log_xi)
    if m.damping <= 0.9:
        f_d, f_a = (0.390, -0.016, 0.268, 0.082), (0.944, 0.211, 0.442, 0.158)
    else:
        f_d, f_a = (0.345, -0.050, -0.459, -0.188), (0.989, 0.231, -0.262, -0.237)
    return Factors(float(np.dot(f_d, terms)), float(np.dot(f_a, terms)))


def load_factors(model: Process) -> Factors:
    r"""Compute factors for `pida_load`, fitted by us to the ITAE of load steps, for Ms up to about 2. Not in the paper.

    .. math:: f_d = 0, \qquad
              f_a = 0.717 - 0.088\,\ell + 0.190\,x + 0.065\,\ell x - 0.058\,\ell^2 + 0.009\,x^2,
              \qquad \ell = \ln r, \quad x = \ln \xi

    Since f_d = 0, the gain, integral time and derivative time equal those of `pid_load`. The acceleration makes the
    loop robust. For all models of the range the loop is stable, with Ms up to 2.4. We compared the ITAE with the least
    ITAE of a PIDA controller with Ms up to 2, on 40 models that were not used in the fit. The ITAE divided by the least
    ITAE is on average 1.53 (geometric mean) and at most 1.91. With the factors of Table 1 the loop is unstable for
    seven of these models. `direct.load` is closer to the least ITAE.

    Parameters
    ----------
    model : Process
        `sopdt` within the range at the top of this module.

    Returns
    -------
    Factors

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.rules import itae
    >>> model = pidalab.sopdt(gain=1.0, tau=2.0, damping=0.5, delay=1.0)
    >>> itae.pida_load(model, factors=itae.load_factors(model))
    NonInteractivePIDA(kc=2.380, tau_i=2.289, tau_d=1.641, tau_a=1.073, alpha_d=0.05, alpha_a=0.025)
    """
    m = second_order(model)
    log_r, log_xi = math.log(m.ratio), math.log(m.damping)
    terms = (1.0, log_r, log_xi, log_r * log_xi, log_r**2, log_xi**2)
    return Factors(0.0, float(np.dot((0.717, -0.088, 0.190, 0.065, -0.058, 0.009), terms)))


def imc_pid(model: Process, alpha_d: float = 0.05) -> NonInteractivePIDA:
    r"""Design a PID controller by internal model control for a first-order model with dead time.

    .. math:: k k_c = \frac{\tau + \theta/2}{1.25\,\theta}, \qquad \tau_i = \tau + \frac{\theta}{2}, \qquad
              \tau_d = \frac{\tau\theta}{2\tau + \theta}

    The paper does not print the rule. These formulas, with an IMC filter time of :math:`\theta/4`, give the
    tunings in the paper's Tables 4 to 6.

    Parameters
    ----------
    model : Process
        Stable `fopdt` with dead time above 0.
    alpha_d : float, optional
        Filter time constant divided by the derivative time, above 0.

    Returns
    -------
    NonInteractivePIDA

    Raises
    ------
    TypeError, ValueError
        If the model is not a `fopdt` or has no dead time.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.itae.imc_pid(pidalab.fopdt(gain=2.0, lag=3.0, delay=1.0))
    NonInteractivePIDA(kc=1.400, tau_i=3.500, tau_d=0.429, tau_a=0.0, alpha_d=0.05, alpha_a=0.025)
    """
    gain, tau, theta = lag_with_delay(model)
    tau_i, tau_d = tau + theta / 2, tau * theta / (2 * tau + theta)
    return NonInteractivePIDA(tau_i / (1.25 * theta * gain), tau_i, tau_d, 0.0, alpha_d)


def _pida(
    model: Process,
    table: Callable[[SecondOrder], tuple[float, ...]],
    alpha_d: float,
    alpha_a: float,
    pair: tuple[float, float] | None,
) -> NonInteractivePIDA:
    m = second_order(model)
    f_d, f_a = factors(model) if pair is None else _check.pair("factors", "f_d and f_a", pair)
    f_d, f_a = _check.real("f_d", f_d), _check.real("f_a", f_a, at_least=0.0)
    if not -2 / m.ratio < f_d < 1:
        raise ValueError(f"f_d must be between {-2 / m.ratio:.4g} and 1, found {f_d!r}")
    changed = m._replace(delay=m.delay * (1 - f_d), tau=m.tau + 0.5 * m.delay * f_d)
    try:
        kc, tau_i, tau_d = table(changed)
    except ArithmeticError:  # a formula overflows or divides by 0
        kc = tau_i = tau_d = math.nan
    if not min(kc * m.gain, tau_i, tau_d) > 0:
        raise ValueError(f"f_d = {f_d:g} leads to r = {changed.ratio:g}, for which the table fails")
    return NonInteractivePIDA(kc, tau_i, tau_d, tau_d * f_a, alpha_d, alpha_a)


def _setpoint(model: SecondOrder) -> tuple[float, float, float]:
    """Return gain, integral and derivative time by Table 2."""
    (gain, tau, xi, _), r = model, model.ratio
    low, high = -0.04 + (0.333 + 0.949 * r**-0.983) * xi, -0.544 + 0.308 * r + 1.408 * xi * r**-0.832
    integral = (2.055 + 0.072 * r) * xi if r <= 1 else (1.768 + 0.329 * r) * xi
    inverse = (1 - math.exp(-(r**1.06) * xi / 0.87)) * (0.55 + 1.683 * r**-1.09)
    return (low if xi <= 0.9 else high) / gain, integral * tau, tau / inverse


def _load(model: SecondOrder) -> tuple[float, float, float]:
    """Return gain, integral and derivative time by Table 3."""
    (gain, tau, xi, _), r = model, model.ratio
    product = 2.189 * xi * r**-0.766 + (
        -0.67 + 0.297 * r**-2.001 if r < 0.9 else -0.365 + 0.26 * (r - 1.4) ** 2
    )
    if r < 0.4:
        integral = 2.2122 * r**0.52 - 0.3
    else:
        share = 1 - math.exp(-xi / (0.15 + 0.33 * r))
        integral = -0.975 + 0.91 * (r - 1.845) ** 2 + share * (5.25 - 0.88 * (r - 2.8) ** 2)
    share = 1 - math.exp(-xi / (-0.15 + 0.939 * r**-1.121))
    inverse = -1.9 + 1.576 * r**-0.53 + share * (1.45 + 0.969 * r**-1.171)
    return product / gain, integral * tau, tau / inverse
