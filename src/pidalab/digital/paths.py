r"""Filtered gains as difference equations: chains of equal discrete lags, and gains on their differences.

Every lag :math:`q(s) = 1/(1 + T_F s)` of a filter becomes, with any of the methods, a lag of static gain 1,

.. math:: x_k = x_{k-1} + g_0\,(v_k - x_{k-1}) + g_1\,(v_{k-1} - x_{k-1}), \qquad
          q(z) = \frac{g_0 z + g_1}{z - 1 + g_0 + g_1},

which keeps its static gain in single precision, too. Derivatives are differences along the chain: with
:math:`s = (1 - q)/(T_F q)`,

.. math:: \frac{K_j s^j}{(1 + T_F s)^n} = \frac{K_j}{T_F^j}\,q^{n-j} (1 - q)^j,

the j-th difference of the last states. That holds for a substitution of s, which is what *backward* and *tustin* are.
*zoh*, exact for an input that is held, has the same differences with other gains.

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
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.forms import FilteredGains

METHODS = ("backward", "tustin", "zoh")
SHARES = {
    "backward": (1.0, 0.0),
    "tustin": (0.5, 0.5),
    "zoh": (0.0, 1.0),
}  # of e_k and e_{k-1} in the integral
TERMS = 60  # of the series for what a held input fills into a chain; what is left out is below 1/60!


class Path(NamedTuple):
    """A chain of lags driven by ``weight * r - y``, and what its differences add to the control signal.

    Attributes
    ----------
    name : str
        What it is called in code.
    weight : float
        Weight of the set point.
    new, old : float
        g_0 and g_1 of the lags.
    gains : tuple of float
        Gains on the last state and on the differences of order 1 to n that end there; n lags.
    """

    name: str
    weight: float
    new: float
    old: float
    gains: tuple[float, ...]

    @property
    def order(self) -> int:
        """Number of lags."""
        return len(self.gains) - 1

    def __call__(self, z: Any) -> Any:
        """Evaluate from the path's input to its share of the control signal, at complex z."""
        q = (self.new * z + self.old) / (z - 1 + self.new + self.old)
        # 1 - q = (1 - g_0)(z - 1)/(z - 1 + g_0 + g_1), without cancellation at low frequencies
        one_less_q = (1 - self.new) * (z - 1) / (z - 1 + self.new + self.old)
        return sum(gain * q ** (self.order - k) * one_less_q**k for k, gain in enumerate(self.gains))

    def fraction(self) -> tuple[Array, Array]:
        """Return numerator and denominator, descending powers of z."""
        lag, rest = np.array([self.new, self.old]), (1 - self.new) * np.array([1.0, -1.0])
        den: Any = np.ones(1)
        for _ in range(self.order):
            den = np.convolve(den, [1.0, self.new + self.old - 1.0])
        num: Any = np.zeros(1)
        for k, gain in enumerate(self.gains):
            term = np.array([gain])
            for factor in [lag] * (self.order - k) + [rest] * k:
                term = np.convolve(term, factor)
            num = np.polyadd(num, term)
        return num, den


def paths(parts: tuple[FilteredGains, ...], h: float, method: str, b: float, c: float) -> tuple[Path, ...]:
    """Discretise parts; integral, error and derivatives see the set point with the weights 1, b and c."""
    found: dict[tuple[float, float, int], tuple[str, Array]] = {}
    for part in parts:
        require_useful(part, h, method)
        for suffix, weight, gains in _by_weight(part, b, c):
            key = (weight, part.filter_time if part.filter_order else 0.0, part.filter_order)
            name, before = found.get(key, (part.name + suffix, 0.0))
            found[key] = name, before + _on_states(gains, part.filter_time, part.filter_order)
    result = []
    for (weight, time, order), (name, on_states) in found.items():
        if np.any(on_states):
            new, old = lag_shares(time, h, method) if order else (0.0, 0.0)
            held = _held(on_states, h / time) if order and method == "zoh" else on_states
            result.append(Path(name, weight, new, old, tuple(_on_differences(held).tolist())))
    names = [path.name for path in result]
    return tuple(
        path._replace(name=f"{path.name}_{i}") if names.count(path.name) > 1 else path
        for i, path in enumerate(result)
    )


def require_useful(part: FilteredGains, h: float, method: str) -> None:
    """Raise for a filter that is too fast for the sample time and the method."""
    most = {"backward": math.inf, "tustin": 2.0, "zoh": 1.0}[method]
    if part.filter_order and h > most * part.filter_time * (1 + 1e-9):
        what = {
            "tustin": "its lags would ring, with a pole at z below 0",
            "zoh": "a derivative behind it would have forgotten each step at the next sample",
        }[method]
        raise ValueError(
            f"sample_time must be at most {most * part.filter_time:.6g} with method={method!r}, found {h:.6g}: the "
            f"filter of the {part.name} part has the time constant {part.filter_time:.6g}, and {what}; take "
            "method='backward', sample faster or filter longer"
        )


def lag_shares(time: float, h: float, method: str) -> tuple[float, float]:
    """Return g_0 and g_1 of a lag."""
    if method == "backward":
        return h / (time + h), 0.0
    if method == "tustin":
        return h / (2 * time + h), h / (2 * time + h)
    return 0.0, -math.expm1(-h / time)


def _by_weight(part: FilteredGains, b: float, c: float) -> list[tuple[str, float, tuple[float, ...]]]:
    """Split gains by the weight that the set point has with them; one entry where all are 1."""
    ki, kp, *rest = (*part.gains, 0.0, 0.0)[: max(2, len(part.gains))]
    if part.derivative:
        return [("", c, part.gains)]
    if b == c == 1.0 or part.filter_order == 0:
        return [("", b if kp and not part.filter_order else 1.0, part.gains)]
    # the integral beside a filter needs lags of its own: what it has not seen yet
    split = [
        ("_integral", 1.0, (ki,)),
        ("_proportional", b, (0.0, kp)),
        ("_derivative", c, (0.0, 0.0, *rest)),
    ]
    return [
        (suffix if part.name in ("filtered", "stabiliser") else "", w, g) for suffix, w, g in split if any(g)
    ]


def _on_states(gains: tuple[float, ...], time: float, n: int) -> Array:
    """Return the weights of the states 0 (the input) to n that make the gains, but for a pure integral K_-1/s."""
    ki, *rest = gains
    weights = np.zeros(n + 1)
    # K_-1/(s (1 + T s)^n) is K_-1/s less T K_-1 times the sum of all states
    weights[1:] -= ki * time
    # K_k s^k: the k-th difference that ends at the last state
    for k, gain in enumerate(rest):
        if gain:
            for i in range(k + 1):
                weights[n - k + i] += gain / time**k * (-1) ** i * math.comb(k, i) if k else gain
    return weights


def _on_differences(weights: Array) -> Array:
    """Turn weights of the states 0 to n into gains on the differences of order 0 to n that end at state n.

    From q^j = q^j (q + (1 - q))^(n - j).
    """
    n = weights.size - 1
    gains = np.zeros(n + 1)
    for j, weight in enumerate(weights):
        for i in range(n - j + 1):
            gains[i] += weight * math.comb(n - j, i)
    return gains


def _held(weights: Array, tau: float) -> Array:
    """Return weights of the states of a chain of *discrete* lags that make what a held input makes of the weights.

    With N one below the diagonal the chain has the transition p exp(tau N), p = exp(-tau), and p is all its poles: so
    its transfer function is a sum of powers of 1/(z - p), and (1 - p)/(z - p) is the discrete lag.
    """
    n, p = weights.size - 1, math.exp(-tau)
    # what a held input of 1 makes of state j in a sample: an incomplete gamma function, by its series
    poisson = [p * tau**k / math.factorial(k) for k in range(TERMS)]
    filling = np.array([math.fsum(poisson[j:]) for j in range(1, n + 1)])
    # transition less p: strictly below the diagonal
    rest = np.zeros((n, n))
    for j in range(n):
        for k in range(1, n - j):
            rest[j + k, j] = poisson[k]
    held, share = weights.copy(), -math.expm1(-tau)
    for i in range(1, n + 1):
        held[i] = weights[1:] @ filling / share**i
        filling = rest @ filling
    return held
