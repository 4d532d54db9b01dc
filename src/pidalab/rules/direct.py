"""PIDA controllers for a second-order model with dead time, by formulas fitted to the least ITAE. Not from a paper.

The ITAE is the integral of time times absolute error after a step. Symbols, controllers and range of models are the
same as in `itae`, but the ITAE is closer to the least ITAE. For set-point steps, most of the optimal controllers have
zeros that cancel the poles of the model. For overdamped models with long dead time, cancelling the poles raises the
ITAE by up to 11 % above the least ITAE.
"""

from __future__ import annotations

import math

from pidalab import _check
from pidalab.controllers import NonInteractivePIDA
from pidalab.process import Process
from pidalab.rules._design import Design
from pidalab.rules.models import second_order


def setpoint(model: Process, alpha_d: float = 0.05, alpha_a: float = 0.025) -> NonInteractivePIDA:
    r"""Design a PIDA controller for set-point steps, with zeros at the poles of the model. Not from a paper.

    .. math:: k_i = \frac{0.722}{k\theta}, \quad k_p = k_i (2\xi\tau + b), \quad k_d = k_i (\tau^2 + 2\xi\tau b), \quad
              k_a = k_i \tau^2 b, \qquad
              b = 0.36\,\theta - \frac{0.391}{\theta} \left(\frac{\alpha_d \tau}{2\xi}\right)^2

    Without filters the open loop is :math:`0.722\,(1 + b s)\,e^{-\theta s}/(\theta s)` for every model. In two thirds
    of the range the PIDA controllers of least ITAE give nearly this open loop. The second term of b compensates the
    derivative filter. In the acceleration time, given by :math:`\tau_a^2 = 2(k_a/k_p + \alpha_d \tau_d^2)`, the term
    :math:`\alpha_d \tau_d^2` also compensates this filter.

    The constants are fitted to the optima for 80 models of the range, with the default filters. The table shows by how
    much the ITAE exceeds the least ITAE (the average is a geometric mean):

    ========================================================  =======  =======
    rule                                                      average  largest
    ========================================================  =======  =======
    `setpoint`, on the 80 models                              4.5 %    18 %
    `setpoint`, on 40 other models                            4 %      10 %
    `itae.pida_setpoint` with Table 1 of the paper            84 %     330 %
    `itae.pida_setpoint` with the best factors of each model  64 %     257 %
    ========================================================  =======  =======

    Ms is 1.76 to 2.21. With twice the default `alpha_d` and `alpha_a`, Ms is up to 2.3, and with four times the default
    up to 3.4. Check `pidalab.margins` if you use slower filters.

    These numbers apply if the process equals the model. In the three examples of heo2023 the process differs from the
    model. In these examples the ITAE of `setpoint` is 138 %, 110 % and 74 % of the ITAE with Table 1, and 1.8 to 4.5
    times the least ITAE for the process.

    Parameters
    ----------
    model : Process
        `sopdt` with damping from 0.3 to 2, and dead time divided by tau from 0.1 to 2.
    alpha_d, alpha_a : float, optional
        Factors above 0. The filter time constants are ``alpha_d * tau_d`` and ``alpha_a * tau_a``.

    Returns
    -------
    NonInteractivePIDA

    Raises
    ------
    TypeError, ValueError
        If the model is out of range, or if `alpha_d` is so large that a gain has the wrong sign. A value up to 0.2 is
        never too large.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> pidalab.rules.direct.setpoint(model.process)
    NonInteractivePIDA(kc=3.478, tau_i=2.819, tau_d=0.981, tau_a=0.653, alpha_d=0.05, alpha_a=0.025)
    """
    m = second_order(model)
    lag = _check.real("alpha_d", alpha_d, above=0.0) * m.tau / (2 * m.damping)
    # `lead` is negative for slow filters. Limiting it to 0 would make Ms large.
    lead = 0.36 * m.delay - 0.391 * lag * lag / m.delay
    ki, a1 = 0.722 / (m.gain * m.delay), 2 * m.damping * m.tau
    return _from_gains(
        ki, ki * (a1 + lead), ki * (m.tau**2 + a1 * lead), ki * m.tau**2 * lead, alpha_d, alpha_a
    )


def load(model: Process, alpha_d: float = 0.05, alpha_a: float = 0.025) -> NonInteractivePIDA:
    r"""Design a PIDA controller for load disturbances, with small ITAE and Ms about 2. Not from a paper.

    .. math:: \begin{pmatrix} k\,k_i\,\theta\,r^2 \\ k\,k_p\,r^2 \\ k\,k_d\,r^2/\theta \\ k\,k_a\,r^2/\theta^2
              \end{pmatrix} = \begin{pmatrix} 0.040 & 0.546 & 0.455 \\ 0.344 & 1.852 & 0.003 \\
              0.790 & 0.714 & -0.076 \\ 0.335 & 0.058 & -0.023 \end{pmatrix}
              \begin{pmatrix} 1 \\ r\,\xi \\ r^2 \end{pmatrix}, \qquad
              \tau_a^2 = 2\left(\frac{k_a}{k_p} + \alpha_d \tau_d^2\right)

    The constants are fitted to the optima with Ms ≤ 2 and default filters, for 42 models of a grid of 80. On this grid
    the ITAE exceeds the ITAE of the optima by 9 % on average (geometric mean) and at most 34 %. On 40 other models the
    excess is 9 % on average and at most 29 %. Ms is 1.66 to 2.02. Without the limit on Ms, the least ITAE would be 63 %
    smaller on average, but with an Ms of up to 7.3.

    With `itae.pida_load` (heo2023, Tables 1 and 3), the loop is unstable for 18 of the 80 models. For 30 models
    `itae.pida_load` gives a smaller ITAE than `load`, but an Ms of 2.09 or more. In the paper's three examples the ITAE
    of `itae.pida_load` is 14 % to 24 % smaller, but Ms is 3.0 to 4.8 instead of 1.9.

    Parameters
    ----------
    model : Process
        As for `setpoint`.
    alpha_d, alpha_a : float, optional
        As for `setpoint`.

    Returns
    -------
    NonInteractivePIDA

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> pidalab.rules.direct.load(model.process)
    NonInteractivePIDA(kc=6.363, tau_i=1.927, tau_d=0.610, tau_a=0.531, alpha_d=0.05, alpha_a=0.025)
    """
    m = second_order(model)
    r, x, theta = m.ratio, m.ratio * m.damping, m.delay
    ki = (0.040 + 0.546 * x + 0.455 * r**2) / (r**2 * theta)
    kp = (0.344 + 1.852 * x + 0.003 * r**2) / r**2
    kd = (0.790 + 0.714 * x - 0.076 * r**2) / r**2 * theta
    ka = (0.335 + 0.058 * x - 0.023 * r**2) / r**2 * theta**2
    return _from_gains(ki / m.gain, kp / m.gain, kd / m.gain, ka / m.gain, alpha_d, alpha_a)


def tune(model: Process, test: str = "setpoint", alpha_d: float = 0.05, alpha_a: float = 0.025) -> Design:
    """Design a PIDA controller for set-point or load steps, with `setpoint` or `load`.

    Parameters
    ----------
    model : Process
        As for `setpoint`.
    test : {"setpoint", "load"}, optional
        Kind of step for which the controller is designed.
    alpha_d, alpha_a : float, optional
        As for `setpoint`.

    Returns
    -------
    Design

    Raises
    ------
    TypeError, ValueError
        As for the two functions, and if the test is unknown.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> design = pidalab.rules.direct.tune(model.process, test="load")
    >>> print(f"{pidalab.margins(design.loop()).ms:.2f}")
    2.01
    """
    _check.choice("test", test, ("setpoint", "load"))
    controller = (setpoint if test == "setpoint" else load)(model, alpha_d, alpha_a)
    source = f"pidalab.rules.direct.{test}: fitted to optima, not from a paper"
    return Design(model, controller, source=source)


def _from_gains(
    ki: float, kp: float, kd: float, ka: float, alpha_d: float, alpha_a: float
) -> NonInteractivePIDA:
    """Return the controller with these gains. The acceleration compensates the derivative filter up to order s^2."""
    alpha_d = _check.real("alpha_d", alpha_d, above=0.0)
    tau_d = kd / kp if kp / ki > 0 else math.nan
    acceleration = ka / kp + alpha_d * tau_d**2 if tau_d > 0 else math.nan
    if not acceleration > 0:
        raise ValueError(f"alpha_d must be smaller for this model, found {alpha_d:g}")
    return NonInteractivePIDA(kp, kp / ki, tau_d, math.sqrt(2 * acceleration), alpha_d, alpha_a)
