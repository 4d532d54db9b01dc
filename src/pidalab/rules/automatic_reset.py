r"""Series PI, PID and PIDA controllers with automatic reset for an integrator with dead time (huba2024).

The module `pidalab.rules.mrdp` computes PI, PID and PIDA controllers in parallel form. They place m + 3 poles of the
loop at one point, where m is the order of the highest derivative. This module writes these controllers in series form,
as a stabilising P, PD or PDA controller and an automatic reset. The reset is the integral action, made by positive
feedback of the limited control signal. With :math:`x = T_d s`, where :math:`T_d` is the dead time, the numerator N(x)
of `mrdp` is factored:

.. math:: N(x) = \frac{\kappa}{\tau_i} (1 + \tau_D x + \tau_A x^2)(1 + \tau_i x).

The gain κ and the first bracket belong to the stabilising controller. The second bracket belongs to the reset, whose
time constant is :math:`\tau_i T_d`. The second bracket contains the real zero that is farthest from 0, because this
zero gives the shortest reset time. PI has one zero, and PID has two real zeros. PIDA has one real zero,

.. math:: -\tfrac{1}{\tau_i} = y - 3, \qquad y = \sqrt[3]{5 + 2\sqrt 6} + \sqrt[3]{5 - 2\sqrt 6},

and a complex pair of zeros with the real part :math:`-3 - y/2`. This controller, MRDP-PIDA, has a slow reset
(:math:`\tau_i = 2.58`). The paper gives three PIDA controllers with a faster reset. In PIDA_1 the imaginary part of the
complex pair is set to 0. The pair becomes a double zero with the time constant :math:`\tau_2 = 1/(3 + y/2) = 0.2322`,
in units of :math:`T_d`. The reset contains one of the two equal zeros, eqs. (27)-(29). PIDA_2 has a double zero with
the time constant 1.5 τ_2. The paper found the gains of PPM-PIDA, eq. (25), by a search with performance portraits (see
`pidalab.portrait`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pidalab import _check
from pidalab.controllers import SeriesPIDA
from pidalab.process import Process, binomial
from pidalab.roots import roots
from pidalab.rules import mrdp
from pidalab.rules._design import Design
from pidalab.rules.models import integrator

if TYPE_CHECKING:
    import control


class Setting(NamedTuple):
    """Parameters of a series controller, made dimensionless with the velocity gain K_s and the total dead time T_d.

    Attributes
    ----------
    name : str
        Name of the setting in the paper.
    source : str
        Equations of huba2024.
    lag : float
        τ_0 = T_0/T_d, where T_0 is the dominant time constant of the loop. PIDA_1, PIDA_2 and PPM-PIDA use the value
        of MRDP-PIDA.
    kp, kd, ka : float
        Gains of the stabilising controller: K_p K_s T_d, K_d K_s and K_a K_s / T_d.
    ti : float
        τ_i = T_i/T_d, time constant of the automatic reset.
    """

    name: str
    source: str
    lag: float
    kp: float
    kd: float
    ka: float
    ti: float

    @property
    def times(self) -> tuple[float, float]:
        """Constants τ_D = T_D/T_d and τ_A = T_A²/T_d² of the stabilising controller, eq. (19)."""
        return self.kd / self.kp, self.ka / self.kp

    def __str__(self) -> str:
        return self.name


def multiple_pole(m: int) -> Setting:
    """Return the setting of PI, PID or PIDA that gives the unfiltered loop m + 3 equal poles, eqs. (14)-(19).

    Parameters
    ----------
    m : int
        Order of the highest derivative: 0, 1 or 2.

    Returns
    -------
    Setting
        Setting, computed from `pidalab.rules.mrdp.constants` (the paper's Table 1). If there are several real zeros,
        the reset contains the one with the shortest time constant.

    Raises
    ------
    ValueError
        If m is not 0, 1 or 2.

    Examples
    --------
    >>> import pidalab
    >>> setting = pidalab.rules.automatic_reset.multiple_pole(1)
    >>> print(f"{setting.kp:.4f} {setting.kd:.4f} {setting.ti:.4f}")
    0.0598 0.2060 0.2846
    """
    m = _check.integer("m", m, at_least=0, at_most=2)
    unit = mrdp.constants(m)
    zeros = roots(unit.numerator)
    zero = float(np.min(zeros.real[zeros.imag == 0]))
    stabiliser = np.polydiv(unit.numerator, [-1 / zero, 1.0])[0] * (-1 / zero)
    ka, kd, kp = (0.0,) * (2 - m) + tuple(stabiliser.tolist())
    return Setting(
        ("PI", "PID", "MRDP-PIDA")[m], f"eq. ({(15, 16, 18)[m]})", -1 / unit.pole, kp, kd, ka, -1 / zero
    )


def double_zero(ratio: float = 1.0) -> Setting:
    """Return the setting of a PIDA with two equal real zeros, of which the reset contains one, eqs. (26)-(31).

    Parameters
    ----------
    ratio : float, optional
        Time constant of the double zero, divided by `TAU_2` (0.2322). The ratio must be above 0. The value 1 gives
        PIDA_1, and 1.5 gives PIDA_2. The paper's Fig. 2 shows ``ratio * TAU_2`` from 0.16 to 0.42.

    Returns
    -------
    Setting
        Setting, computed from the exact zeros instead of the zeros printed in the paper.

    Raises
    ------
    ValueError
        If the ratio is not above 0.

    Examples
    --------
    >>> import pidalab
    >>> setting = pidalab.rules.automatic_reset.double_zero(1.5)
    >>> print(f"{setting.kp:.3f} {setting.kd:.3f} {setting.ka:.3f} {setting.ti:.3f}")
    0.126 0.369 0.113 0.348
    """
    ratio = _check.real("ratio", ratio, above=0.0)
    base, short = MRDP_PIDA, ratio * TAU_2
    kp = base.kp * short / base.ti
    name = {1.0: "PIDA_1", 1.5: "PIDA_2"}.get(ratio, f"PIDA with {ratio:g} tau_2")
    return Setting(name, "eq. (29)", base.lag, kp, kp * (base.ti + short), kp * base.ti * short, short)


PI, PID, MRDP_PIDA = (multiple_pole(m) for m in range(3))
# The complex zeros of MRDP_PIDA have the real part -kd/(2 ka). TAU_2 is -1/(real part).
TAU_2 = 2 * MRDP_PIDA.ka / MRDP_PIDA.kd
PIDA_1, PIDA_2 = double_zero(), double_zero(1.5)
PPM_PIDA = Setting("PPM-PIDA", "eq. (25), printed", MRDP_PIDA.lag, kp=0.17, kd=0.45, ka=0.1157, ti=0.36)
SETTINGS = {setting.name: setting for setting in (PI, PID, MRDP_PIDA, PPM_PIDA, PIDA_1, PIDA_2)}


def tune(
    model: Process,
    setting: Setting,
    n: int,
    filter_time: float,
    weight: float = 1.0,
    cancelled: int = 0,
    limits: tuple[float, float] = (-math.inf, math.inf),
) -> Design:
    r"""Design a series controller and its prefilter for an integrator with dead time, from a dimensionless setting.

    The controller is computed for the total dead time :math:`T_d = T_{dp} + T_e`. Here :math:`T_{dp}` is the dead time
    of the model, and the dead time :math:`T_e = n N T_f` represents the filter, eqs. (10) and (11).

    ============  ====================
    huba2024      argument
    ============  ====================
    K_sp, T_dp    `model`
    T_f           `filter_time`
    N             `weight`
    U_min, U_max  `limits`
    ============  ====================

    Parameters
    ----------
    model : Process
        Integrator with dead time, see `ipdt`.
    setting : Setting
        PI, PID, MRDP_PIDA, PPM_PIDA, PIDA_1 or PIDA_2 of this module (also in the dictionary SETTINGS), or the result
        of `multiple_pole` or `double_zero`.
    n : int
        Order of the filter, at least 1 for PI and PID, at least 2 for PIDA.
    filter_time : float
        Time constant of the filter, above 0.
    weight : float, optional
        N, the ratio of T_e to the sum n T_f of the filter time constants. It is from 0.5 (half rule) to 1 (average
        residence time, the default). Use 0 if the model was identified from the filtered output, because such a model
        already includes the delay of the filter (sec. 3.1).
    cancelled : int, optional
        Number of dominant poles (at -1/T_0) that the prefilter cancels: 0 or 1. The default 0 gives eq. (21). The value
        1 gives eq. (22) and a faster response.
    limits : tuple of float, optional
        Lower and upper limit of the control signal.

    Returns
    -------
    Design
        Controller (Fig. 1, eqs. (3), (4), (7) and (9)) and prefilter (eq. (20)). `pidalab.simulate_sampled` and
        `pidalab.portrait` apply the limits. Functions for linear loops, such as `pidalab.margins`, ignore the limits.
        The filter is part of the controller and therefore also filters the set point. The paper does not say whether
        the set point should be filtered. `info` has

        - ``setting``, ``n``, ``filter_time``: the arguments,
        - ``te``: the dead time that represents the filter, or 0 if the model includes the filter,
        - ``delay``: the total dead time,
        - ``kp``, ``kd``, ``ka``, ``ti``: parameters of controller and reset,
        - ``lead``: the coefficient b_1 of s in the numerator of the prefilter.

    Raises
    ------
    TypeError, ValueError
        If the model is not an integrator with dead time, `setting` is not a `Setting`, or a number is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.rules import automatic_reset
    >>> print(automatic_reset.tune(pidalab.ipdt(1.0, delay=1.0), automatic_reset.PIDA_1, n=4, filter_time=0.2))
    Design by huba2024, eqs. (10) to (22)
      model          Process(num=[1], den=[1, 0], delay=1)
      controller     SeriesPIDA(kp=0.0465574, kd=0.235943, ka=0.0904853, ti=0.417978, filter_time=0.2, filter_order=4,
                     limits=(-inf, inf))
      prefilter      [1] / [0.81235, 4.06175, 5.48577, 1]
      setting        PIDA_1                   chosen
      n              4                        chosen
      filter_time    0.2                      chosen
      te             0.8                      eq. (11)
      delay          1.8                      eq. (10)
      kp             0.0465574                eq. (29)
      kd             0.235943                 eq. (29)
      ka             0.0904853                eq. (29)
      ti             0.417978                 eq. (29)
      lead           0                        eq. (21)
    """
    velocity, dead_time = integrator(model)
    if not isinstance(setting, Setting):
        raise TypeError(f"setting must be a Setting, such as automatic_reset.PIDA_1, found {setting!r}")
    n = _check.order("n", n, at_least=2 if setting.ka else 1)
    filter_time = _check.real("filter_time", filter_time, above=0.0)
    weight = _check.real("weight", weight)
    if weight != 0 and not 0.5 <= weight <= 1:
        raise ValueError(f"weight must be 0, or from 0.5 to 1, found {weight:g}")
    cancelled = _check.integer("cancelled", cancelled, at_least=0, at_most=1)
    te = n * weight * filter_time
    delay = dead_time + te
    if not delay:
        raise ValueError("model must have a dead time if weight is 0: the total dead time is 0")
    gains = (setting.kp / (velocity * delay), setting.kd / velocity, setting.ka * delay / velocity)
    controller = SeriesPIDA(*gains, setting.ti * delay, filter_time, n, limits)
    lead = cancelled * setting.lag * delay
    info = {"setting": setting, "n": n, "filter_time": filter_time, "te": te, "delay": delay}
    info |= {"kp": controller.kp, "kd": controller.kd, "ka": controller.ka, "ti": controller.ti, "lead": lead}
    sources = {
        "setting": "chosen",
        "n": "chosen",
        "filter_time": "chosen",
        "te": "eq. (11)" if te else "in the dead time of the model, sec. 3.1",
        "delay": "eq. (10)",
        **dict.fromkeys(("kp", "kd", "ka", "ti"), setting.source),
        "lead": "eq. (22)" if cancelled else "eq. (21)",
    }
    prefilter = _prefilter(controller, lead)
    return Design(model, controller, prefilter, None, "huba2024, eqs. (10) to (22)", info, sources)


def _prefilter(controller: SeriesPIDA, lead: float) -> control.TransferFunction:
    """Return the prefilter F_p, eq. (20), which cancels the zeros of the controller."""
    stabiliser = [controller.ka / controller.kp, controller.kd / controller.kp, 1.0]
    den = np.convolve(_check.polynomial("gains", stabiliser), [controller.ti, 1.0])
    import control

    return control.TransferFunction(binomial(lead, 1) if lead else [1.0], den)
