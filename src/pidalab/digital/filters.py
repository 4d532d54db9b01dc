r"""Filters as difference equations: chains of discrete lags, and a prefilter of the set point.

With each method, every lag :math:`q(s) = 1/(1 + T_F s)` of a filter becomes a discrete lag of static gain 1,

.. math:: x_k = x_{k-1} + g_0\,(v_k - x_{k-1}) + g_1\,(v_{k-1} - x_{k-1}), \qquad
          q(z) = \frac{g_0 z + g_1}{z - 1 + g_0 + g_1},

where v is the input of the lag and x its state. In this form the static gain is exact even in single precision.
Derivatives are differences of the states along a chain of lags. Since :math:`s = (1 - q)/(T_F q)`, n equal lags give

.. math:: \frac{K_j s^j}{(1 + T_F s)^n} = \frac{K_j}{T_F^j}\,q^{n-j} (1 - q)^j,

which is the j-th difference of the last j + 1 states. Lags with different time constants also form one chain. The j-th
derivative then also needs gains on differences of orders below j. These formulas apply to the methods *backward* and
*tustin*, which substitute an expression for s. The method *zoh*, exact for a held input, uses other gains. In the
table, h is the sample time.

=========  =======================  =====================  =======================================
method     :math:`g_0`              :math:`g_1`            increment of the integral of e in a sample
=========  =======================  =====================  =======================================
backward   :math:`h/(T_F + h)`      0                      :math:`h\,e_k`
tustin     :math:`h/(2 T_F + h)`    :math:`h/(2 T_F + h)`  :math:`h\,(e_k + e_{k-1})/2`
zoh        0                        1 - exp(-h/T_F)        :math:`h\,e_{k-1}`
=========  =======================  =====================  =======================================

*Prefilter.* Let :math:`\tau` be the geometric mean of the time constants of the prefilter, and :math:`p = 1 + \tau s`.
The denominator is written as a polynomial of p, whose order is n, and the states are
:math:`x_i = p^i r / (d_0 + d_1 p + \dots + d_n p^n)` for i < n. At rest all states equal the set point r, so
:math:`\dot x = A (x - r)` with a constant matrix A. Each method moves the states in proportion to their distances from
a target :math:`v_k`,

.. math:: x_k = x_{k-1} + M\,(x_{k-1} - v_k), \qquad v_k = g_0\,r_k + g_1\,r_{k-1},

so the static gain is exactly 1, even in single precision.

=========  ====================================  =================================
method     M                                     target v_k
=========  ====================================  =================================
backward   :math:`(1 - hA)^{-1}\,hA`             :math:`r_k`
tustin     :math:`(1 - hA/2)^{-1}\,hA`           :math:`(r_k + r_{k-1})/2`
zoh        :math:`e^{hA} - 1`                    :math:`r_{k-1}`
=========  ====================================  =================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.forms import FilteredGains
from pidalab.roots import roots

METHODS = ("backward", "tustin", "zoh")
# Weights of e_k and e_{k-1} in the increment of the integral.
METHOD_WEIGHTS = {"backward": (1.0, 0.0), "tustin": (0.5, 0.5), "zoh": (0.0, 1.0)}
# Number of terms in the series of the matrix exponential. The remainder is less than 1/(50!).
SERIES_TERMS = 60


class FilterChain(NamedTuple):
    """A chain of lags driven by ``weight * r - y``, with gains on the differences between its states.

    Attributes
    ----------
    name : str
        Name of the chain in the comments of written code.
    weight : float
        Weight of the set point in the input of the chain.
    new, old : tuple of float
        g_0 and g_1 of each lag.
    gains : tuple of float
        The gain on the last state, then for m = 1, 2, ... the gain on the m-th difference of the last m + 1 states.
    """

    name: str
    weight: float
    new: tuple[float, ...]
    old: tuple[float, ...]
    gains: tuple[float, ...]

    @property
    def order(self) -> int:
        """Number of lags."""
        return len(self.new)

    def __call__(self, z: Any) -> Any:
        """Evaluate the transfer function from the input of the chain to its contribution to u, at complex z."""
        states: list[Any] = [np.ones_like(z)]
        for new, old in zip(self.new, self.old, strict=True):
            states.append(states[-1] * (new * z + old) / (z - 1 + new + old))
        # The first differences use 1 - q = (1 - g_0)(z - 1)/(z - 1 + g_0 + g_1), which loses no digits near z = 1.
        level: list[Any] = [
            x * (1 - new) * (z - 1) / (z - 1 + new + old)
            for x, new, old in zip(states, self.new, self.old, strict=False)
        ]
        total = self.gains[0] * states[-1]
        for gain in self.gains[1:]:
            total = total + gain * level[-1]
            level = [before - after for before, after in pairwise(level)]
        return total

    def num_den(self) -> tuple[Array, Array]:
        """Return numerator and denominator in descending powers of z."""
        poles = [np.array([1.0, new + old - 1.0]) for new, old in zip(self.new, self.old, strict=True)]
        lags = [np.array([new, old]) for new, old in zip(self.new, self.old, strict=True)]
        # Compute the numerators of the states for a common denominator, and then the numerators of their differences.
        level: list[Any] = [_product([*lags[:j], *poles[j:]]) for j in range(self.order + 1)]
        num: Any = np.zeros(1)
        for gain in self.gains:
            num = np.polyadd(num, gain * level[-1])
            level = [np.polysub(before, after) for before, after in pairwise(level)]
        return num, _product(poles)


def _product(factors: Sequence[Array]) -> Array:
    """Multiply polynomials."""
    result: Any = np.ones(1)
    for factor in factors:
        result = np.convolve(result, factor)
    return np.asarray(result)


def filter_chains(
    parts: tuple[FilteredGains, ...], behind: tuple[float, int], h: float, method: str, b: float, c: float
) -> tuple[FilterChain, ...]:
    """Discretise the parts of a controller, each in series with an output filter of equal lags.

    `behind` contains the time constant and the number of these lags.
    """
    _require_useful("filter after the controller", *behind, h, method)
    summed_gains: dict[tuple[float, tuple[float, ...]], tuple[str, Array]] = {}
    for part in parts:
        _require_useful(f"filter of the {part.name} part", part.filter_time, part.filter_order, h, method)
        # Sort the lags with the fastest first, so that all terms of the sums in `_on_differences` have the same sign.
        lags = tuple(sorted([part.filter_time] * part.filter_order + [behind[0]] * behind[1]))
        for suffix, weight, gains in _by_weight(part, bool(lags), b, c):
            name, before = summed_gains.get((weight, lags), (part.name + suffix, 0.0))
            summed_gains[weight, lags] = name, before + _on_differences(gains, np.array(lags))
    result = []
    for (weight, lags), (name, summed) in summed_gains.items():
        if np.any(summed):
            shares = [_lag_shares(time, h, method) for time in lags]
            new, old = (tuple(share[i] for share in shares) for i in (0, 1))
            held = held_gains(summed, np.array(lags), h) if lags and method == "zoh" else summed
            result.append(FilterChain(name, weight, new, old, tuple(held.tolist())))
    names = [path.name for path in result]
    return tuple(
        path._replace(name=f"{path.name}_{i}") if names.count(path.name) > 1 else path
        for i, path in enumerate(result)
    )


def _require_useful(what: str, time: float, order: int, h: float, method: str) -> None:
    """Raise an error if a filter is too fast for the sample time with this method."""
    most = {"backward": math.inf, "tustin": 2.0, "zoh": 1.0}[method]
    if order and h > most * time * (1 + 1e-9):
        because = {
            "tustin": "its lags would ring, with a pole at z below 0",
            "zoh": "the effect of a step on a filtered derivative would have decayed before the next sample",
        }[method]
        raise ValueError(
            f"sample_time must be at most {most * time:.6g} with method={method!r}, found {h:.6g}: the {what} has the "
            f"time constant {time:.6g}, and {because}; take method='backward', a shorter sample time or a longer time "
            "constant"
        )


def _lag_shares(time: float, h: float, method: str) -> tuple[float, float]:
    """Return g_0 and g_1 of a lag."""
    if method == "backward":
        return h / (time + h), 0.0
    if method == "tustin":
        return h / (2 * time + h), h / (2 * time + h)
    return 0.0, -math.expm1(-h / time)


def _by_weight(
    part: FilteredGains, filtered: bool, b: float, c: float
) -> list[tuple[str, float, tuple[float, ...]]]:
    """Group gains by set-point weight. Return a single group if b = c = 1 or there are no lags."""
    ki, kp, *derivatives = (*part.gains, 0.0, 0.0)[: max(2, len(part.gains))]
    if b == c == 1.0 or not filtered:
        return [("", b if kp and not filtered else 1.0, part.gains)]
    # If a weight differs from 1, the filtered integral is the pure integral plus the output of a separate chain of
    # lags.
    split = [
        ("_integral", 1.0, (ki,)),
        ("_proportional", b, (0.0, kp)),
        ("_derivative", c, (0.0, 0.0, *derivatives)),
    ]
    return [
        (suffix if part.name in ("filtered", "stabiliser") else "", w, g) for suffix, w, g in split if any(g)
    ]


def _on_differences(gains: tuple[float, ...], lags: Array) -> Array:
    """Convert gains on powers of s to equivalent gains on differences, without the pure integral K_-1/s."""
    ki, *others = gains
    n = lags.size
    result = np.zeros(n + 1)
    # The filtered integral K_-1/(s prod (1 + T_i s)) equals K_-1/s - K_-1 sum T_i x_i. The state x_i equals
    # (1 + difference)^(n - i) x_n.
    for i, time in enumerate(lags, start=1):
        result[: n - i + 1] -= ki * time * np.array([math.comb(n - i, m) for m in range(n - i + 1)])
    # Row i of `level` expresses (T_1 s)^k x_i by differences that end at x_i. The step from k to
    # k + 1 uses s x_i = (x_(i-1) - x_i)/T_i.
    level = np.eye(1, n + 1).repeat(n + 1, axis=0)
    for k, gain in enumerate(others):
        if gain:
            result += gain / (lags[0] ** k if n else 1.0) * level[-1]
        # Convert differences that end at x_(i-1) to differences that end at x_i.
        before = level[:-1] + np.pad(level[:-1, :-1], ((0, 0), (1, 0)))
        level = (before - level[1:]) * (lags[0] / lags[k:])[:, np.newaxis] if k < n else level
    return result


def held_gains(gains: Array, lags: Array, h: float) -> Array:
    r"""Convert gains on a continuous chain with a held input to equivalent gains on differences of discrete lags.

    At the samples both chains have the poles :math:`p_i = e^{-h/T_i}`. The states of the continuous chain are a matrix
    T times the states of the discrete chain. Column i + 1 of T is proportional to :math:`(A - p_i)` times column i,
    where A is the transition matrix for one sample.

    Parameters
    ----------
    gains : ndarray, shape (..., n + 1)
        Gains on the differences of the continuous chain.
    lags : ndarray, shape (..., n)
        Time constants.
    h : float
        Sample time.

    Returns
    -------
    ndarray, shape (..., n + 1)
        Gains on the differences of the discrete chain.
    """
    n = lags.shape[-1]
    rates = h / lags
    poles, shares = np.exp(-rates), -np.expm1(-rates)
    fastest = rates.max(axis=-1)[..., None]
    # Add a constant to the diagonal of the system matrix (the first row belongs to the held input, the others to the
    # states). Then no element is negative, and the exponential series has no cancellation.
    shifted = np.zeros((*lags.shape[:-1], n + 1, n + 1))
    diagonal, after = np.arange(n + 1), np.arange(1, n + 1)
    shifted[..., diagonal, diagonal] = fastest - np.insert(rates, 0, 0.0, axis=-1)
    shifted[..., after, after - 1] = rates
    transition = term = np.broadcast_to(np.eye(n + 1), shifted.shape)
    for k in range(1, SERIES_TERMS):
        term = shifted @ term / k
        transition = transition + term
    transition = transition * np.exp(-fastest)[..., None]
    to_states, column = np.zeros(shifted.shape), transition[..., 1:, 0]
    to_states[..., 0, 0] = 1.0
    for i in range(n):
        to_states[..., 1:, i + 1] = column / shares[..., i, None]
        # The diagonal elements p_j - p_i are computed with expm1, without cancellation. They are not negative for
        # j >= i, since faster lags come first.
        slower = np.tril(transition[..., 1:, 1:], -1)
        slower[..., diagonal[:n], diagonal[:n]] = -poles * np.expm1(rates - rates[..., i, None])
        column = (slower @ to_states[..., 1:, i + 1, None])[..., 0]
    # Convert the gains to gains on discrete states, then to gains on their differences.
    on_states = np.zeros(gains.shape)
    for m in range(n + 1):
        for j in range(m + 1):
            on_states[..., n - m + j] += (-1) ** j * math.comb(m, j) * gains[..., m]
    on_discrete = (on_states[..., None, :] @ to_states)[..., 0, :]
    result = np.zeros(gains.shape)
    for j in range(n + 1):
        for m in range(n - j + 1):
            result[..., m] += math.comb(n - j, m) * on_discrete[..., j]
    result[..., 0] = gains[..., 0]  # static gain
    return result


UNIT = 1e-9  # largest accepted deviation of the static gain from 1


class Prefilter(NamedTuple):
    """A filter of the set point as difference equations.

    Attributes
    ----------
    num, den : tuple of float
        Continuous filter, in descending powers of s.
    new, old : float
        Weights of the present and the previous set point in the target v_k.
    move : tuple of tuple of float
        The matrix M, row by row.
    out : tuple of float
        Gains on (state - set point). The output is the set point plus the sum of gain * (state - set point).
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    new: float
    old: float
    move: tuple[tuple[float, ...], ...]
    out: tuple[float, ...]

    def __call__(self, z: Any) -> Any:
        """Evaluate the transfer function from the set point to the filtered set point, at complex z."""
        n = len(self.out)
        result = np.ones_like(z, dtype=complex)
        move, out = np.array(self.move), np.array(self.out)
        driven = 1 + self.new * move.sum(axis=1)
        for where, less_one in np.ndenumerate(np.asarray(z) - 1.0):
            # The distances x - r from the set point solve (z - 1 - M)(x - r) = -(z - 1)(e + new M e) r, where every
            # element of the vector e is 1.
            result[where] -= less_one * (out @ np.linalg.solve(less_one * np.eye(n) - move, driven))
        return result[()]

    def __str__(self) -> str:
        num, den = (", ".join(f"{c:.10g}" for c in part) for part in (self.num, self.den))
        return f"[{num}] / [{den}]"


def discrete_prefilter(num: Array, den: Array, h: float, method: str) -> Prefilter | None:
    """Discretise a filter of the set point. Return None if the filter is only a gain of 1."""
    n = den.size - 1
    if den[-1] == 0 or abs(num[-1] / den[-1] - 1) > UNIT:
        raise ValueError(
            f"prefilter must have the static gain 1, found {num[-1] / den[-1] if den[-1] else np.inf:.10g}"
        )
    if not n:
        return None
    poles = roots(den)
    if np.any(poles.real >= 0):
        raise ValueError(f"prefilter must be stable, found a pole at {poles[np.argmax(poles.real)]:.4g}")
    fastest = float(np.abs(poles).max())
    if method == "tustin" and h * fastest > 2.0 * (1 + 1e-9):
        raise ValueError(
            f"sample_time must be at most {2 / fastest:.6g} with method='tustin', found {h:.6g}: the prefilter would "
            "ring; take method='backward' or a shorter sample time"
        )
    tau = float((den[0] / den[-1]) ** (1 / n))
    d, out = (_in_powers_of_p(part / part[-1], tau, n) for part in (den, num))
    A = (np.eye(n, k=1) - np.eye(n)) * (h / tau)
    A[-1] -= d[:-1] / d[-1] * (h / tau)
    if method == "zoh":
        # The upper right block of the exponential of (A A; 0 0) is e^A - 1, without cancellation.
        from scipy.linalg import expm

        move = expm(np.block([[A, A], [np.zeros((n, 2 * n))]]))[:n, n:]
    else:
        move = np.linalg.solve(np.eye(n) - A * METHOD_WEIGHTS[method][0], A)
    rows, out = tuple(map(tuple, move.tolist())), out[:-1] - out[-1] * d[:-1] / d[-1]
    return Prefilter(
        tuple(num.tolist()), tuple(den.tolist()), *METHOD_WEIGHTS[method], rows, tuple(out.tolist())
    )


def _in_powers_of_p(polynomial: Array, tau: float, n: int) -> Array:
    """Convert a polynomial in descending powers of s to coefficients of p^0 to p^n, where p = 1 + tau s."""
    result = np.zeros(n + 1)
    for coefficient in polynomial / tau ** np.arange(polynomial.size - 1.0, -1.0, -1.0):
        # Horner's rule multiplies by tau s = p - 1 and adds the next coefficient.
        result = np.concatenate([[0.0], result[:-1]]) - result
        result[0] += coefficient
    return result
