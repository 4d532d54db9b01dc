r"""Filtered gains as difference equations: chains of discrete lags, and gains on their differences.

Every lag :math:`q(s) = 1/(1 + T_F s)` of a filter becomes, with any of the methods, a lag of static gain 1,

.. math:: x_k = x_{k-1} + g_0\,(v_k - x_{k-1}) + g_1\,(v_{k-1} - x_{k-1}), \qquad
          q(z) = \frac{g_0 z + g_1}{z - 1 + g_0 + g_1},

which keeps its static gain in single precision, too. Derivatives are differences along the chain: with
:math:`s = (1 - q)/(T_F q)`, n equal lags give

.. math:: \frac{K_j s^j}{(1 + T_F s)^n} = \frac{K_j}{T_F^j}\,q^{n-j} (1 - q)^j,

the j-th difference of the last states. Lags of different time constants, as of a part behind an output filter, make the
same chain, with differences of lower order beside it. That holds for a substitution of s, which is what *backward* and
*tustin* are. *zoh*, exact for an input that is held, has the same differences with other gains.

=========  =======================  =====================  =======================================
method     :math:`g_0`              :math:`g_1`            integral of e over a sample
=========  =======================  =====================  =======================================
backward   :math:`h/(T_F + h)`      0                      :math:`h\,e_k`
tustin     :math:`h/(2 T_F + h)`    :math:`h/(2 T_F + h)`  :math:`h\,(e_k + e_{k-1})/2`
zoh        0                        1 - exp(-h/T_F)        :math:`h\,e_{k-1}`
=========  =======================  =====================  =======================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.forms import FilteredGains

METHODS = ("backward", "tustin", "zoh")
# of e_k and e_{k-1} in the integral
METHOD_WEIGHTS = {"backward": (1.0, 0.0), "tustin": (0.5, 0.5), "zoh": (0.0, 1.0)}
# of the series for what a held input makes of a chain in a sample; what is left out is below 1/50!
SERIES_TERMS = 60


class Path(NamedTuple):
    """A chain of lags driven by ``weight * r - y``, and what its differences add to the control signal.

    Attributes
    ----------
    name : str
        What it is called in code.
    weight : float
        Weight of the set point.
    new, old : tuple of float
        g_0 and g_1 of each lag.
    gains : tuple of float
        Gains on the last state and on the differences of order 1 to n that end there; n lags.
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
        """Evaluate from the path's input to its share of the control signal, at complex z."""
        states: list[Any] = [np.ones_like(z)]
        for new, old in zip(self.new, self.old, strict=True):
            states.append(states[-1] * (new * z + old) / (z - 1 + new + old))
        # a first difference without cancellation at low frequencies: 1 - q = (1 - g_0)(z - 1)/(z - 1 + g_0 + g_1)
        level: list[Any] = [
            x * (1 - new) * (z - 1) / (z - 1 + new + old)
            for x, new, old in zip(states, self.new, self.old, strict=False)
        ]
        total = self.gains[0] * states[-1]
        for gain in self.gains[1:]:
            total = total + gain * level[-1]
            level = [before - after for before, after in pairwise(level)]
        return total

    def fraction(self) -> tuple[Array, Array]:
        """Return numerator and denominator, descending powers of z."""
        poles = [np.array([1.0, new + old - 1.0]) for new, old in zip(self.new, self.old, strict=True)]
        lags = [np.array([new, old]) for new, old in zip(self.new, self.old, strict=True)]
        # numerators of the states over the common denominator, then of their differences
        level: list[Any] = [product([*lags[:j], *poles[j:]]) for j in range(self.order + 1)]
        num: Any = np.zeros(1)
        for gain in self.gains:
            num = np.polyadd(num, gain * level[-1])
            level = [np.polysub(before, after) for before, after in pairwise(level)]
        return num, product(poles)


def product(factors: Sequence[Array]) -> Array:
    """Multiply polynomials."""
    result: Any = np.ones(1)
    for factor in factors:
        result = np.convolve(result, factor)
    return np.asarray(result)


def paths(
    parts: tuple[FilteredGains, ...], behind: tuple[float, int], h: float, method: str, b: float, c: float
) -> tuple[Path, ...]:
    """Discretise parts; integral, error and derivatives see the set point with the weights 1, b and c.

    All of them are behind so many more lags of one time constant.
    """
    require_useful("filter behind the controller", *behind, h, method)
    found: dict[tuple[float, tuple[float, ...]], tuple[str, Array]] = {}
    for part in parts:
        require_useful(f"filter of the {part.name} part", part.filter_time, part.filter_order, h, method)
        # the fastest lag first: what is added up below has one sign then
        lags = tuple(sorted([part.filter_time] * part.filter_order + [behind[0]] * behind[1]))
        for suffix, weight, gains in _by_weight(part, bool(lags), b, c):
            name, before = found.get((weight, lags), (part.name + suffix, 0.0))
            found[weight, lags] = name, before + _on_differences(gains, np.array(lags))
    result = []
    for (weight, lags), (name, summed) in found.items():
        if np.any(summed):
            shares = [lag_shares(time, h, method) for time in lags]
            new, old = (tuple(share[i] for share in shares) for i in (0, 1))
            held = held_gains(summed, np.array(lags), h) if lags and method == "zoh" else summed
            result.append(Path(name, weight, new, old, tuple(held.tolist())))
    names = [path.name for path in result]
    return tuple(
        path._replace(name=f"{path.name}_{i}") if names.count(path.name) > 1 else path
        for i, path in enumerate(result)
    )


def require_useful(what: str, time: float, order: int, h: float, method: str) -> None:
    """Raise for a filter that is too fast for the sample time and the method."""
    most = {"backward": math.inf, "tustin": 2.0, "zoh": 1.0}[method]
    if order and h > most * time * (1 + 1e-9):
        because = {
            "tustin": "its lags would ring, with a pole at z below 0",
            "zoh": "a derivative behind it would have forgotten each step at the next sample",
        }[method]
        raise ValueError(
            f"sample_time must be at most {most * time:.6g} with method={method!r}, found {h:.6g}: the {what} has the "
            f"time constant {time:.6g}, and {because}; take method='backward', sample faster or filter longer"
        )


def lag_shares(time: float, h: float, method: str) -> tuple[float, float]:
    """Return g_0 and g_1 of a lag."""
    if method == "backward":
        return h / (time + h), 0.0
    if method == "tustin":
        return h / (2 * time + h), h / (2 * time + h)
    return 0.0, -math.expm1(-h / time)


def _by_weight(
    part: FilteredGains, filtered: bool, b: float, c: float
) -> list[tuple[str, float, tuple[float, ...]]]:
    """Split gains by the weight that the set point has with them; one entry where all are 1."""
    ki, kp, *rest = (*part.gains, 0.0, 0.0)[: max(2, len(part.gains))]
    if b == c == 1.0 or not filtered:
        return [("", b if kp and not filtered else 1.0, part.gains)]
    # the integral beside a filter needs lags of its own: what it has not seen yet
    split = [
        ("_integral", 1.0, (ki,)),
        ("_proportional", b, (0.0, kp)),
        ("_derivative", c, (0.0, 0.0, *rest)),
    ]
    return [
        (suffix if part.name in ("filtered", "stabiliser") else "", w, g) for suffix, w, g in split if any(g)
    ]


def _on_differences(gains: tuple[float, ...], lags: Array) -> Array:
    """Return the gains on the differences that make the gains on powers of s, but for a pure integral K_-1/s."""
    ki, *rest = gains
    n = lags.size
    result = np.zeros(n + 1)
    # K_-1/(s prod (1 + T_i s)) is K_-1/s less K_-1 times the sum of T_i x_i; and x_i is (1 + difference)^(n - i) x_n
    for i, time in enumerate(lags, start=1):
        result[: n - i + 1] -= ki * time * np.array([math.comb(n - i, m) for m in range(n - i + 1)])
    # s x_i = (x_(i-1) - x_i)/T_i, with times in units of the first; rows: (T_1 s)^k x_i as differences that end at x_i
    level = np.eye(1, n + 1).repeat(n + 1, axis=0)
    for k, gain in enumerate(rest):
        if gain:
            result += gain / (lags[0] ** k if n else 1.0) * level[-1]
        before = level[:-1] + np.pad(level[:-1, :-1], ((0, 0), (1, 0)))  # that end at x_(i-1) end at x_i
        level = (before - level[1:]) * (lags[0] / lags[k:])[:, np.newaxis] if k < n else level
    return result


def held_gains(gains: Array, lags: Array, h: float) -> Array:
    r"""Return gains on differences of *discrete* lags that make what a held input makes of those of the chain.

    Both chains have the poles :math:`p_i = e^{-h/T_i}`. The states x of the one at the samples are T times those of the
    other: the columns of T follow from each other by what the held input does to a state in a sample, less p.

    Parameters
    ----------
    gains : ndarray, shape (..., n + 1)
        On the differences of the continuous chain.
    lags : ndarray, shape (..., n)
        Time constants.
    h : float
        Sample time.

    Returns
    -------
    ndarray, shape (..., n + 1)
        On the differences of the discrete one.
    """
    n = lags.shape[-1]
    rates = h / lags
    poles, shares = np.exp(-rates), -np.expm1(-rates)
    fastest = rates.max(axis=-1)[..., None]
    # generator of the states and the input; with its diagonal lifted to 0 or above, the series has no cancellation
    lifted = np.zeros((*lags.shape[:-1], n + 1, n + 1))
    own, after = np.arange(n + 1), np.arange(1, n + 1)
    lifted[..., own, own] = fastest - np.insert(rates, 0, 0.0, axis=-1)
    lifted[..., after, after - 1] = rates
    transition = term = np.broadcast_to(np.eye(n + 1), lifted.shape)
    for k in range(1, SERIES_TERMS):
        term = lifted @ term / k
        transition = transition + term
    transition = transition * np.exp(-fastest)[..., None]
    to_states, column = np.zeros(lifted.shape), transition[..., 1:, 0]
    to_states[..., 0, 0] = 1.0
    for i in range(n):
        to_states[..., 1:, i + 1] = column / shares[..., i, None]
        # the differences of the other poles to that of a faster lag are not negative
        rest = np.tril(transition[..., 1:, 1:], -1)
        rest[..., own[:n], own[:n]] = -poles * np.expm1(rates - rates[..., i, None])
        column = (rest @ to_states[..., 1:, i + 1, None])[..., 0]
    # gains on the states of the chain, on those of discrete lags, on differences of these
    on_states = np.zeros(gains.shape)
    for m in range(n + 1):
        for j in range(m + 1):
            on_states[..., n - m + j] += (-1) ** j * math.comb(m, j) * gains[..., m]
    on_discrete = (on_states[..., None, :] @ to_states)[..., 0, :]
    result = np.zeros(gains.shape)
    for j in range(n + 1):
        for m in range(n - j + 1):
            result[..., m] += math.comb(n - j, m) * on_discrete[..., j]
    result[..., 0] = gains[..., 0]  # the static gain
    return result
