r"""Prove absolute stability of a loop with a limited control signal: circle and Popov criterion with exact dead time.

A controller with automatic reset computes the unlimited signal :math:`u_L`, and the actuator receives the limited
signal :math:`u = \mathrm{sat}(u_L)`. With constant set point and load, :math:`u_L` depends on u through

.. math:: u_L = -G\,u + \text{const}, \qquad G = F - F_r, \qquad F = R_p Q_n S, \qquad F_r = \frac{1}{1 + T_i s}.

Here :math:`R_p` is the stabilising controller, :math:`Q_n` its filter, S the process and :math:`F_r` the reset (symbols
of huba2024, Fig. 1). F_r is part of G because the input of F_r is the *limited* signal. F_r has a minus sign because
the reset is positive feedback. Suppose that the loop has an equilibrium with u strictly between the limits. Then the
deviation of u from equilibrium is a function of the deviation of u_L from equilibrium. This function lies in the sector
from 0 to 1: its slope is at most 1, and its value is 0 only at 0. The criterion of Popov with the multiplier
:math:`\theta \ge 0` is

.. math:: \inf_{\omega > 0} \operatorname{Re}\left[1 + (1 + j\omega\theta)\,G(j\omega)\right] > 0.

With θ = 0 this is the circle criterion. For the sector from 0 to 1, the circle that G must avoid becomes the half plane
left of -1. If the Popov or the circle criterion holds, the loop comes to rest from every initial state. This theorem
makes three assumptions:

- F is strictly proper. Its poles lie left of the imaginary axis. The only exception is a simple pole at 0, such as that
  of an integrating process. With this pole (Popov's particular case) the sector excludes the gain 0, because the loop
  with this gain would not be stable. The residue of the pole must be positive, so that every small positive gain
  stabilises the loop. In this case the theorem requires θ > 0. Nevertheless, the circle criterion is sufficient: ωG is
  bounded, so a margin that is positive with θ = 0 remains positive with a small θ.
- The limits do not change with time. (The circle criterion alone would not need this assumption.)
- The inequality is strict, also in the limits for ω → 0 and ω → ∞.

A dead time is allowed (Popov and Halanay, 1962). Both criteria are sufficient, not necessary: a loop that meets neither
may still come to rest from every state.

If F has the pole at 0, write :math:`F = E/s`. Since :math:`F_r(0) = 1`, the real part in the criterion then tends to
:math:`E'(0) + \theta E(0)` for ω → 0. For the controllers of huba2024 this limit is
:math:`K_s (K_d - K_p (T_{dp} + n T_f)) + \theta K_s K_p`. Here :math:`K_s` and :math:`T_{dp}` are gain and dead time of
the process, and n and :math:`T_f` are order and time constant of the filter. With :math:`K_d = 0` and θ = 0 the limit
is negative, so without derivative the circle criterion never holds. If F has at least two more poles than zeros, the
limit for ω → ∞ is :math:`1 - \theta/T_i`. Therefore only θ below :math:`T_i` are tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab.loop import Loop, open_loop
from pidalab.process import Process, binomial
from pidalab.robustness.axis import Samples, lowest, most_between
from pidalab.robustness.in_s import from_factors, from_roots
from pidalab.roots import border, roots

# A value counts as lower than `best` if it is below best - NO_LOWER * max(1, |best|).
NO_LOWER = 1e-10
GRID_STEPS = 60  # largest number of grid steps that are divided at a time
TOLERANCE = 1e-6  # a criterion certainly holds if its margin is above this value
LARGEST_MULTIPLIER = 1e3  # (largest multiplier without a reset) / (longest time constant or dead time)
BELOW_RESET = 1 - 1e-6  # largest multiplier with a reset, divided by T_i
# The search for a multiplier ends if it can raise the margin by at most this relative amount.
MARGIN_RTOL = 1e-9
# At most MOST_MULTIPLIERS multipliers are tried. Each is at most FURTHER times the largest multiplier before it, except
# as described in `popov`.
MOST_MULTIPLIERS, FURTHER = 60, 4.0


class LinearPart(NamedTuple):
    """Linear part of a loop with a limited control signal, G = F - F_r.

    Attributes
    ----------
    forward : Process
        F, the transfer function of process, filter and controller in series, without the reset.
    zeros, poles : ndarray of complex
        Zeros and poles of F. A pole at 0 is left out of `poles`.
    reset_time : float
        T_i of the reset F_r = 1/(1 + T_i s). Infinite if there is no reset.
    """

    forward: Process
    zeros: Any
    poles: Any
    reset_time: float

    def __call__(self, s: ArrayLike) -> Any:
        """Evaluate G at complex s."""
        rate = 1 / self.reset_time
        return self.forward(s) - rate / (rate + np.asarray(s))

    @property
    def integrates(self) -> bool:
        """True if F has a pole at 0."""
        return bool(self.forward.den[-1] == 0)

    @property
    def gain(self) -> float:
        """Leading coefficient of the numerator of F, divided by the leading coefficient of the denominator."""
        return float(self.forward.num[0] / self.forward.den[0])


class Criterion(NamedTuple):
    """Result of a criterion of absolute stability.

    Attributes
    ----------
    margin : float
        Infimum of Re[1 + (1 + jωθ) G(jω)], accurate to nine digits.
    frequency : float
        Frequency of the infimum, in rad per time unit. 0 or infinity if the infimum is only approached there.
    multiplier : float
        Multiplier θ, a time. 0 for the circle criterion.
    """

    margin: float
    frequency: float
    multiplier: float

    @property
    def holds(self) -> bool:
        """True if the margin is above 1e-6, and therefore certainly positive."""
        return self.margin > TOLERANCE


def linear_part(loop: Loop) -> LinearPart:
    r"""Return the linear part G of a loop: the transfer function from the limited control signal u to -u_L.

    The reset of a `pidalab.SeriesPIDA` acts on the limited signal, so G = F - F_r (see the text at the head of this
    module, which also defines the unlimited signal u_L). With any other controller, G is the loop transfer function L.

    Parameters
    ----------
    loop : Loop
        The loop. Its prefilter and the limits of its controller have no influence.

    Returns
    -------
    LinearPart
        G, a function of complex s.

    Raises
    ------
    ValueError
        If F is not strictly proper or has a pole on or right of the imaginary axis. A simple pole at 0 with a positive
        residue is allowed.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.SeriesPIDA(kp=0.4, kd=0.0, ka=0.0, ti=6.0, filter_time=0.1, filter_order=1)
    >>> G = pidalab.robustness.linear_part(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), C))
    >>> print(f"{G(0.5j):.4f}")
    -0.5176-0.3812j
    """
    open_loop(loop)  # raises an error for a sampled loop
    reset = loop.automatic_reset
    if reset is None:
        ti, controller = math.inf, loop.blocks["controller"]
    else:  # without the reset, only the stabilising controller remains
        ti, controller = reset.time, (reset.stabiliser, binomial(reset.filter_time, reset.filter_order))
    num, den, zeros, poles = np.ones(1), np.ones(1), [], []
    for own_num, own_den in (controller, loop.blocks["process"], loop.blocks["output_filter"]):
        num, den = np.convolve(num, own_num), np.convolve(den, own_den)
        zeros.append(roots(own_num))
        poles.append(roots(own_den))
    all_poles = np.concatenate(poles)
    part = LinearPart(
        Process(num, den, loop.process.delay), np.concatenate(zeros), all_poles[all_poles != 0], ti
    )
    _check_assumptions(part, int(np.sum(all_poles == 0)))
    return part


def _check_assumptions(part: LinearPart, integrators: int) -> None:
    if len(part.forward.num) >= len(part.forward.den):
        raise ValueError("the forward path must be strictly proper: u must not act on itself instantly")
    bad = part.poles[part.poles.real >= 0]
    if bad.size or integrators > 1:
        offending = f"one at {bad[0]:.4g}" if bad.size else f"{integrators} at 0"
        raise ValueError(f"poles of the forward path must be stable, except one at 0; found {offending}")
    if integrators:
        residue = float(part.forward.num[-1] / part.forward.den[-2])
        if residue <= 0:
            raise ValueError(f"the pole at 0 must have a positive residue, found {residue:.4g}")


def circle(loop: Loop) -> Criterion:
    r"""Evaluate the circle criterion for the sector [0, 1]: Re[1 + G(jω)] > 0 at all frequencies.

    Parameters
    ----------
    loop : Loop
        The loop (see `linear_part`).

    Returns
    -------
    Criterion
        Criterion with the multiplier 0.

    Raises
    ------
    ValueError
        If the loop violates an assumption of the criterion (see `linear_part`).
    ArithmeticError
        If the dead time turns the phase so often that the frequency grid would have too many points.

    Examples
    --------
    With a third-order lag, the loop meets the criterion up to a controller gain of 4. It is stable up to a gain of 8.

    >>> import pidalab
    >>> result = pidalab.robustness.circle(pidalab.Loop(pidalab.lags(3), 3.0))
    >>> print(f"{result.margin:.6f} at {result.frequency:.4f}, {result.holds}")
    0.250000 at 1.0000, True
    """
    return Criterion(*infimum(linear_part(loop), 0.0), 0.0)


def popov(loop: Loop) -> Criterion:
    r"""Evaluate the Popov criterion for the sector [0, 1], with the multiplier θ ≥ 0 that gives the largest margin.

    With a reset, θ must be below T_i. Without a reset, θ is searched up to 1000 times the longest time constant or dead
    time of the loop.

    Parameters
    ----------
    loop : Loop
        The loop (see `linear_part`).

    Returns
    -------
    Criterion

    Raises
    ------
    ValueError, ArithmeticError
        As for `circle`.

    Notes
    -----
    The margin for a given θ is the infimum over frequency of an expression that is linear in θ. At a fixed frequency,
    the expression is therefore a straight line over θ, and the margin is nowhere above this line. Each computed infimum
    adds the line at the frequency of the infimum. The minimum of all lines is an upper bound of the margin, for each θ.
    The next infimum is computed at the θ at which this bound is largest. The search ends when the best margin reaches
    the largest value of the bound.

    Examples
    --------
    With a third-order lag, the loop meets the criterion up to a controller gain of 8, the limit of stability.

    >>> import pidalab
    >>> pidalab.robustness.popov(pidalab.Loop(pidalab.lags(3), 7.9)).holds
    True
    >>> pidalab.robustness.popov(pidalab.Loop(pidalab.lags(3), 8.1)).holds
    False
    """
    part = linear_part(loop)
    slowest = max(part.forward.delay, *(1 / np.abs(part.poles)), 0.0) or 1 / abs(part.gain)
    most = part.reset_time * BELOW_RESET if math.isfinite(part.reset_time) else LARGEST_MULTIPLIER * slowest
    tried: list[Criterion] = []
    lines: list[tuple[float, float]] = []
    theta = 0.0
    for _ in range(MOST_MULTIPLIERS):
        tried.append(Criterion(*infimum(part, theta), theta))
        lines.append(line(part, tried[-1].frequency))
        best = max(tried, key=lambda each: each.margin)
        bound = _best_multiplier(lines, most)[1]
        if bound - best.margin <= MARGIN_RTOL * max(1.0, abs(bound)):
            break
        # With a large θ the grid must follow many turns of the phase. So θ is at most `slowest` or FURTHER times the
        # largest θ so far, whichever is larger.
        reach = max(slowest, FURTHER * max(each.multiplier for each in tried))
        theta = _best_multiplier(lines, min(reach, most))[0]
    return best


def _best_multiplier(lines: list[tuple[float, float]], most: float) -> tuple[float, float]:
    """Return the θ from 0 to `most` at which the minimum of some lines is largest, and this largest minimum.

    A line is given by its value at 0 and its slope.
    """
    start, slope = np.transpose(lines)
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = np.subtract.outer(start, start) / -np.subtract.outer(slope, slope)
    places = np.unique(np.append([0.0, most], meet[(meet > 0) & (meet < most)]))
    least = np.min(start + np.outer(places, slope), axis=1)
    k = int(np.argmax(least))  # argmax selects the smallest of equally good multipliers
    return float(places[k]), float(least[k])


def smallest_filter_time(
    family: Callable[[float], Loop],
    holds: Callable[[Loop], bool],
    longest: float,
    shortest: float | None = None,
) -> float:
    """Return the shortest filter time with which a loop still has a property.

    `family` decides what else changes with the filter time: for example, the gains may be constant or tuned again.
    Starting at `longest`, the filter time is repeatedly reduced by a tenth until the property fails. Bisection then
    finds the border.

    Parameters
    ----------
    family : callable
        Function that returns the loop with a given time constant of the filter.
    holds : callable
        Function that returns True if a loop has the property, such as ``lambda loop: circle(loop).holds`` or
        `pidalab.is_stable`.
    longest : float
        Longest filter time, above 0, at which the property must hold.
    shortest : float, optional
        Filter time at which the search stops, by default a thousandth of `longest`.

    Returns
    -------
    float
        The shortest filter time, to 6 digits. The property holds at this value. 0 if the property holds down to
        `shortest`.

    Raises
    ------
    ValueError
        If the property does not hold at `longest`, or if `shortest` is not below `longest`.

    Examples
    --------
    How short may the filter time become if the gains remain tuned for a filter time of 0.2?

    >>> import dataclasses, pidalab
    >>> from pidalab import robustness
    >>> from pidalab.rules import automatic_reset
    >>> model = pidalab.ipdt(1.0, delay=1.0)
    >>> C = automatic_reset.tune(model, automatic_reset.PIDA_2, n=4, filter_time=0.2).controller
    >>> def family(filter_time):
    ...     return pidalab.Loop(model, dataclasses.replace(C, filter_time=filter_time))
    >>> def holds(loop):
    ...     return robustness.circle(loop).holds
    >>> print(f"{robustness.smallest_filter_time(family, holds, longest=0.2):.4f}")
    0.0695
    """
    longest = _check.real("longest", longest, above=0.0)
    shortest = 1e-3 * longest if shortest is None else _check.real("shortest", shortest, above=0.0)
    if shortest >= longest:
        raise ValueError(f"shortest must be below longest = {longest:g}, found {shortest:g}")
    high = low = longest
    if not holds(family(longest)):
        raise ValueError(f"holds must be true at longest = {longest:g}, found false")
    while holds(family(low)):
        if low == shortest:
            return 0.0
        high, low = low, max(0.9 * low, shortest)
    return border(lambda filter_time: holds(family(filter_time)), inside=high, outside=low)


# --- the infimum ------------------------------------------------------------------------------------------------------


def ends(part: LinearPart, theta: float) -> tuple[float, float]:
    """Return the limits of Re[1 + (1 + jωθ) G] at ω = 0 and at infinity (with dead time, the limit inferior)."""
    forward = part.forward
    den = forward.den[:-1] if part.integrates else forward.den
    (n1, n0), (d1, d0) = (np.append([0.0, 0.0], p)[-2:] for p in (forward.num, den))
    e = n0 / d0
    slope = (n1 - e * d1) / d0 - e * forward.delay
    at_zero = (slope + theta * e if part.integrates else e) - float(math.isfinite(part.reset_time))
    constant = part.gain * theta if len(forward.den) == len(forward.num) + 1 else 0.0
    at_infinity = -abs(constant) if forward.delay else constant
    return float(1 + at_zero), 1 + at_infinity - theta / part.reset_time


def _reset(part: LinearPart, w: Any, theta: float) -> Any:
    """Return the real part of (1 + jωθ) F_r. It is monotonic in ω."""
    if math.isinf(part.reset_time):
        return 0.0 * w
    share = theta / part.reset_time
    return share + (1 - share) / (1 + (w * part.reset_time) ** 2)


def infimum(part: LinearPart, theta: float) -> tuple[float, float]:
    """Return the infimum of Re[1 + (1 + jωθ) G(jω)] and its frequency (0 or inf if the infimum is only approached).

    Notes
    -----
    `best` is the smallest value so far. The dead time changes only the phase of (1 + jωθ) F(jω). So the modulus of this
    product gives a lower bound of the values within each step of the grid. A step is divided only if this bound is
    below `best`. If F has a pole at 0, the real part of F would be a small difference of large numbers at low
    frequencies. Therefore F is then written as E/s, where E has no pole at 0. The real part of F is Im E/ω.
    """
    # If F has a pole at 0, these are the factors of E = s F.
    axis = from_factors(from_roots(part.gain, part.zeros, part.poles, part.forward.delay))

    def function(samples: Samples) -> Any:
        e = samples.num / samples.den
        real = e.imag / samples.w + theta * e.real if part.integrates else e.real - samples.w * theta * e.imag
        return 1 + real - _reset(part, samples.w, theta)

    at_zero, at_infinity = ends(part, theta)
    grid = axis.on_grid
    best = min(at_zero, at_infinity, float(function(grid).min()))
    size = axis.size * np.abs(1 + 1j * theta * grid.w) / (grid.w if part.integrates else 1.0)
    reset = _reset(part, grid.w, theta)
    bound = 1 - most_between(size[:-1], size[1:]) - np.fmax(reset[:-1], reset[1:])
    followed = np.zeros(bound.size, dtype=bool)
    while axis.delay:
        steps = ~followed & (bound < _below(best))
        steps &= np.cumsum(steps) <= GRID_STEPS
        if not steps.any():
            break
        followed |= steps
        best = min(best, float(function(axis.at(axis.points(steps))).min()))
    samples = axis.at(axis.points(followed))
    values = function(samples)
    change = np.abs(np.diff(values))
    inner = values[1:-1]
    dips = (inner <= values[:-2]) & (inner <= values[2:]) & (inner - np.fmax(change[:-1], change[1:]) <= best)
    places, least = lowest(lambda w: function(axis.at(w)), samples.w, 1 + np.flatnonzero(dips))
    i = int(np.argmin(values))
    low, where = min(
        [(float(values[i]), float(samples.w[i])), *zip(least.tolist(), places.tolist(), strict=True)]
    )
    for value, end in ((at_zero, 0.0), (at_infinity, math.inf)):
        if _below(value) <= low:
            return value, end
    return low, where


def line(part: LinearPart, w: float) -> tuple[float, float]:
    """Return the value at θ = 0 of Re[1 + (1 + jωθ) G(jω)] at one frequency, and its constant slope over θ."""
    if 0 < w < math.inf:
        value = complex(part(1j * w))
        return 1 + value.real, -w * value.imag
    # At the ends of the axis, the line passes through the limits for θ = 1 and θ = 2.
    one, two = (ends(part, theta)[int(w > 0)] for theta in (1.0, 2.0))
    return 2 * one - two, two - one


def _below(best: float) -> float:
    return best - NO_LOWER * max(1.0, abs(best))
