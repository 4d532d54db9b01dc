r"""Multiple real dominant pole tuning of PID_n^m for an integrator with dead time (huba2018).

PID_n^m denotes a controller with derivatives up to order m and a filter of order n: m = 0 is PI, 1 is PID and 2 is
PIDA. Without filter, the loop of the controller and the model :math:`K_s e^{-T_d s}/s` has the characteristic function

.. math:: s^2 e^{T_d s} + K_i K_s (1 + T_i s + T_i T_{D1} s^2 + \dots + T_i T_{Dm} s^{m+1}),

eq. (4). With :math:`x = T_d s`, this function times :math:`T_d^2` is :math:`x^2 e^x + N(x)`. A point :math:`x_o` is an
(m+2)-fold zero of the function if -N is the Taylor polynomial of degree m+1 of :math:`x^2 e^x` at :math:`x_o`. The zero
is (m+3)-fold if the derivative of order m+2 of :math:`x^2 e^x` is also 0 at :math:`x_o`. Of the two points for which
this is true, the rule chooses the one nearer to 0:

.. math:: x_o^2 + 2(m+2)x_o + (m+2)(m+1) = 0, \qquad x_o = \mu - \mu^2, \quad \mu = \sqrt{m+2}.

With :math:`a = -x_o` and the truncated exponential :math:`E_k(a) = \sum_{i \le k} a^i/i!`, the coefficient of
:math:`x^j` in N is

.. math:: c_j = \frac{e^{-a}}{j!}\left(\frac{(\mu + j - 1)\,a^{m+2-j}}{(m+1-j)!} - j(j-1)\,E_{m+1-j}(a)\right).

In particular, the dimensionless gain and integral time are :math:`K_o = c_1 = \mu\,a^{m+1}e^{-a}/m!` and :math:`\tau_i
= c_1/c_0 = (\mu + 1)/(\mu - 1)`. In double precision the formula for :math:`c_j` is accurate to 14 digits, at least for
m up to 24.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from pidalab import _check
from pidalab.controllers import HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process, ipdt
from pidalab.robustness.poles import is_stable
from pidalab.roots import border
from pidalab.rules._design import Design
from pidalab.rules.models import integrator

if TYPE_CHECKING:
    import control


HIGHEST_MRDP_ORDER = 100  # with controllers or filters of a higher order, factorials overflow


class Constants(NamedTuple):
    """Parameters of PID^m (without filter) for a model with unit velocity gain and unit dead time, eq. (6)."""

    pole: float
    gain: float
    integral_time: float
    derivative_times: tuple[float, ...]

    @property
    def numerator(self) -> list[float]:
        """Coefficients of N(x), highest power first.

        By eq. (4), the poles of the loop without filter solve x^2 e^x + N(x) = 0.

        Returns
        -------
        list of float
            m + 2 coefficients.

        Examples
        --------
        >>> import pidalab
        >>> [round(c, 4) for c in pidalab.rules.mrdp.constants(m=0).numerator]
        [0.4612, 0.0791]
        """
        return [self.gain * x for x in (*self.derivative_times[::-1], 1.0, 1 / self.integral_time)]


def constants(m: int) -> Constants:
    r"""Compute the dimensionless parameters of the controller without filter, eq. (6) and Table I.

    In the paper's symbols, ``pole`` is p_o, the dominant pole times T_d. ``gain`` is K_o = K_c K_s T_d,
    ``integral_time`` is τ_io = T_i/T_d, and ``derivative_times`` are τ_jo = T_Dj/T_d^j for j = 1 ... m.

    Parameters
    ----------
    m : int
        Order of the highest derivative, at least 0 (0 is PI, 1 is PID, 2 is PIDA).

    Returns
    -------
    Constants
        Pure numbers.

    Raises
    ------
    ValueError
        If m is negative or not a whole number.

    Examples
    --------
    >>> import pidalab
    >>> pidalab.rules.mrdp.constants(m=1)
    Constants(pole=-1.267949, gain=0.783612, integral_time=3.732051, derivative_times=(0.262892,))
    """
    m = _check.integer("m", m, at_least=0, at_most=HIGHEST_MRDP_ORDER)
    mu = math.sqrt(m + 2)
    c = [_coefficient(m, j) for j in range(m + 2)]
    return Constants(mu - mu**2, c[1], c[1] / c[0], tuple(value / c[1] for value in c[2:]))


def _coefficient(m: int, j: int) -> float:
    """Return the coefficient of x^j in N(x)."""
    mu, order = math.sqrt(m + 2), m + 1 - j
    a = mu**2 - mu
    head = (mu + j - 1) * a ** (order + 1) / math.factorial(order)
    tail = math.fsum(a**i / math.factorial(i) for i in range(order + 1))
    return math.exp(-a) / math.factorial(j) * (head - j * (j - 1) * tail)


def filter_ratio(m: int, n: int) -> float:
    r"""Compute T_f / T_e, the ratio of filter time constant and equivalent dead time, eq. (11) and Table II.

    The filter and the dead time T_e are equivalent if the loop of an integrator and the filter has the same dominant
    pole as the loop of an integrator and the dead time. The dominant pole is the place of m + 3 equal poles. For n = m
    the loop with the filter has only m + 2 poles. In this case eq. (9) gives the pole of the filter, -1/T_f, and T_f
    is chosen so that this pole equals the dominant pole of the loop with the dead time.

    Parameters
    ----------
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m and at least 1.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If an order is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> print(f"{pidalab.rules.mrdp.filter_ratio(m=2, n=3):.4f}")
    0.3000
    """
    m, n = _orders(m, _check.order("n", n, at_least=1))
    pole = (m + 2) * (n + 1) - math.sqrt((m + 2) * (n + 1) * (n - m))
    return pole / ((n + 1) * (n + 2) * -constants(m).pole)


def _orders(m: int, n: int) -> tuple[int, int]:
    m = _check.integer("m", m, at_least=0, at_most=HIGHEST_MRDP_ORDER)
    return m, _check.integer("n", n, at_least=m, at_most=HIGHEST_MRDP_ORDER)


def prefilter_weights(m: int, cancelled: int) -> tuple[float, ...]:
    r"""Compute the weights b_0, b_1, ... of the prefilter that cancels dominant poles, eq. (14) and Table III.

    Parameters
    ----------
    m : int
        Order of the highest derivative, at least 0.
    cancelled : int
        Number p of cancelled poles, from 1 to m + 1. The more poles are cancelled, the faster the response.

    Returns
    -------
    tuple of float
        p weights for eq. (13).

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> [round(b, 4) for b in pidalab.rules.mrdp.prefilter_weights(m=1, cancelled=2)]
    [0.4226, 0.634]
    """
    unit = constants(m)
    p = _check.integer("cancelled", cancelled, at_least=1, at_most=m + 1)
    scale = [unit.integral_time * time for time in (1.0, *unit.derivative_times)]
    return tuple(math.comb(p, k + 1) * (-1 / unit.pole) ** (k + 1) / scale[k] for k in range(p))


MRDP_SOURCES = {
    "m": "chosen",
    "n": "chosen",
    "te": "chosen, step 1 of the tuning procedure",
    "delay": "eq. (12)",
    "pole": "eq. (6)",
    "kc": "eq. (6), Table I",
    "ti": "eq. (6), Table I",
    "td": "eq. (6), Table I",
    "filter_time": "eq. (11), Table II",
    "weights": "eq. (14), Table III",
    "ie": "eq. (15), Table IV",
}


def tune(model: Process, m: int, n: int, te: float, cancelled: int | None = None) -> Design:
    r"""Tune PID_n^m and its prefilter for an integrator with dead time, sec. II.B.

    For m of 2 and more the loop is unstable if `te` is too short compared with the dead time (see `smallest_te`).

    Parameters
    ----------
    model : Process
        Integrator with dead time, see `ipdt`.
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m. ``n=0`` gives a PI controller without filter.
    te : float
        Dead time that represents the filter, above 0 (with ``n=0`` it must be 0). A larger value gives less noise
        in the control signal and a slower loop.
    cancelled : int, optional
        Number of dominant poles that the prefilter cancels, from 1 to m + 1 (the default).

    Returns
    -------
    Design
        Controller, eqs. (2) and (7), and prefilter, eq. (13). `info` has

        - ``m``, ``n``, ``te``: the arguments,
        - ``delay``: the total dead time,
        - ``pole``: the dominant pole, in 1/time,
        - ``kc``, ``ti``, ``td``: gain, integral time, and the tuple of T_D1 ... T_Dm with the units time, time², ...,
        - ``filter_time``: T_f,
        - ``weights``: b_0, b_1, ... of the prefilter,
        - ``ie``: the integral of the error after a unit step of the set point (the IAE if the error does not change its
          sign),
        - ``smallest_te``: the T_e above which the loop with the model is stable. It is the result of the function
          `smallest_te` times the dead time of the model.

    Raises
    ------
    TypeError, ValueError
        If the model is not an integrator with dead time, or if a number is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> print(pidalab.rules.mrdp.tune(pidalab.ipdt(0.01, delay=5.0), m=1, n=2, te=1.0))
    Design by huba2018, sec. II.B
      model          Process(num=[0.01], den=[1, 0], delay=5)
      controller     HighOrderPID(gains=[0.583245, 13.0602, 20.6005], filter_time=0.394338, filter_order=2)
      prefilter      [22.3923, 9.4641, 1] / [35.3205, 22.3923, 1]
      m              1                        chosen
      n              2                        chosen
      te             1                        chosen, step 1 of the tuning procedure
      delay          6                        eq. (12)
      pole           -0.211325                eq. (6)
      kc             13.0602                  eq. (6), Table I
      ti             22.3923                  eq. (6), Table I
      td             1.57735                  eq. (6), Table I
      filter_time    0.394338                 eq. (11), Table II
      weights        0.42265, 0.633975        eq. (14), Table III
      ie             12.9282                  eq. (15), Table IV
      smallest_te    0                        not in the paper; stable
    """
    velocity, dead_time = integrator(model)
    m, n = _orders(m, n)
    te = _check.real("te", te, at_least=0.0)
    if bool(n) != bool(te):
        raise ValueError(f"te must be above 0 with a filter and 0 without, found te = {te:g} with n = {n}")
    delay = dead_time + te
    if not delay:
        raise ValueError("model must have a dead time, or te must be above 0: both are 0")
    unit, weights = constants(m), prefilter_weights(m, m + 1 if cancelled is None else cancelled)
    controller = _controller(velocity, delay, m, n, te)
    kc, ti, *td = _standard(velocity, delay, m)
    info: dict[str, Any] = {
        "m": m,
        "n": n,
        "te": te,
        "delay": delay,
        "pole": unit.pole / delay,
        "kc": kc,
        "ti": ti,
        "td": tuple(td),
        "filter_time": controller.filter_time,
        "weights": weights,
        "ie": (1 - weights[0]) * ti,
        "smallest_te": smallest_te(m, n) * dead_time if n else 0.0,
    }
    stable = te > info["smallest_te"] or m < 2
    verdict = "stable" if stable else "unstable with the model; choose a longer te"
    sources = MRDP_SOURCES | {"smallest_te": f"not in the paper; {verdict}"}
    prefilter = _prefilter(weights, [ti * x for x in (1.0, *td)])
    return Design(model, controller, prefilter, None, "huba2018, sec. II.B", info, sources)


def _standard(velocity: float, delay: float, m: int) -> list[float]:
    """Return gain, integral and derivative times of the controller R^m (without filter), eq. (2)."""
    unit = constants(m)
    td = [time * delay**j for j, time in enumerate(unit.derivative_times, start=1)]
    return [unit.gain / (velocity * delay), unit.integral_time * delay, *td]


def _controller(velocity: float, delay: float, m: int, n: int, te: float) -> HighOrderPID:
    """Return the controller R_n^m with its filter, eqs. (2) and (7)."""
    kc, ti, *td = _standard(velocity, delay, m)
    return HighOrderPID([kc * x for x in (1 / ti, 1.0, *td)], filter_ratio(m, n) * te if n else 0.0, n)


def _prefilter(weights: Sequence[float], zeros: list[float]) -> control.TransferFunction:
    """Return the prefilter F_p, eq. (13). Its denominator 1 + zeros[0] s + ... cancels the zeros of the controller."""
    num = [1.0, *(b * x for b, x in zip(weights, zeros, strict=False))]
    import control

    return control.TransferFunction(num[::-1], [*zeros[::-1], 1.0])


@cache
def smallest_te(m: int, n: int) -> float:
    r"""Compute the shortest T_e, divided by the dead time of the model, for which the loop with the model is stable.

    For m = 0 and m = 1 every T_e is long enough: even without filter, \|L\| falls to 0 (m = 0) or to 0.21 (m = 1) at
    high frequencies. For m of 2 and more, \|L\| without filter rises without bound. With the filter, \|L\| has
    a maximum far above the crossover,

    .. math:: \kappa \left(\frac{T_d}{T_f}\right)^{m-1}
              \sqrt{\frac{(m-1)^{m-1}(n-m+1)^{n-m+1}}{n^n}}, \qquad \kappa = K_o \tau_{mo},

    and near this frequency the phase of the dead time passes through all values. Therefore the maximum is about 1 at
    the limit of stability. The function starts from this estimate and finds the exact limit by bisection.

    Parameters
    ----------
    m : int
        Order of the highest derivative, at least 0.
    n : int
        Order of the filter, at least m and at least 1.

    Returns
    -------
    float
        The ratio to at least 6 digits, or 0 for m = 0 and m = 1.

    Raises
    ------
    ValueError
        If an order is out of its range.

    Examples
    --------
    >>> import pidalab
    >>> print(f"{pidalab.rules.mrdp.smallest_te(m=2, n=2):.4f}")
    0.0477
    """
    ratio, unit = filter_ratio(m, n), constants(m)
    if m < 2:
        return 0.0
    # Compute the ratio T_e / T_d for which the maximum is 1.
    shape = math.sqrt((m - 1) ** (m - 1) * (n - m + 1) ** (n - m + 1) / n**n)
    share = (unit.gain * unit.derivative_times[-1] * shape) ** (1 / (m - 1)) / ratio
    estimate = share / (1 - share)

    def stable(te: float) -> bool:
        return is_stable(Loop(ipdt(1.0, delay=1.0), _controller(1.0, 1.0 + te, m, n, te)))

    low = high = estimate
    while stable(low):
        low *= 0.9
    while not stable(high):
        high *= 1.1
    return border(stable, inside=high, outside=low)
