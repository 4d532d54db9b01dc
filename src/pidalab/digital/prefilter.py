r"""A filter of the set point as difference equations of states that move towards the set point.

With the time constant :math:`\tau` that is the geometric mean of those of the filter, and :math:`p = 1 + \tau s`, its
denominator is a polynomial of p. The states :math:`x_i = p^i r / (d_0 + d_1 p + \dots + d_n p^n)`, i < n, rest at the
set point, and :math:`\dot x = A (x - r)`. So each method moves them by their distances from the set point,

.. math:: x_k = x_{k-1} + M\,(x_{k-1} - v_k), \qquad v_k = g_0\,r_k + g_1\,r_{k-1},

and the filter keeps its static gain of 1 in single precision, too.

=========  ====================================  =================================
method     M                                     what they move towards, v_k
=========  ====================================  =================================
backward   :math:`(1 - hA)^{-1}\,hA`             :math:`r_k`
tustin     :math:`(1 - hA/2)^{-1}\,hA`           :math:`(r_k + r_{k-1})/2`
zoh        :math:`e^{hA} - 1`                    :math:`r_{k-1}`
=========  ====================================  =================================
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.digital.paths import METHOD_WEIGHTS
from pidalab.roots import roots

UNIT = 1e-9  # how near to 1 a static gain is 1


class Prefilter(NamedTuple):
    """A filter of the set point with its differences.

    Attributes
    ----------
    num, den : tuple of float
        What was discretised, descending powers of s.
    new, old : float
        Shares of the set point now and one sample ago in what the states move towards.
    move : tuple of tuple of float
        How they move with their distances from it.
    out : tuple of float
        What their distances from the set point add to it.
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    new: float
    old: float
    move: tuple[tuple[float, ...], ...]
    out: tuple[float, ...]

    def __call__(self, z: Any) -> Any:
        """Evaluate from the set point to the filtered one, at complex z."""
        n = len(self.out)
        result = np.ones_like(z, dtype=complex)
        move, out = np.array(self.move), np.array(self.out)
        driven = 1 + self.new * move.sum(axis=1)
        for where, less_one in np.ndenumerate(np.asarray(z) - 1.0):
            # (z - 1 - M) x = -M v z, for the distances x - r
            result[where] -= less_one * (out @ np.linalg.solve(less_one * np.eye(n) - move, driven))
        return result[()]

    def __str__(self) -> str:
        num, den = (", ".join(f"{c:.10g}" for c in part) for part in (self.num, self.den))
        return f"[{num}] / [{den}]"


def discrete(num: Array, den: Array, h: float, method: str) -> Prefilter | None:
    """Discretise a filter of the set point; none for a gain of 1."""
    n = den.size - 1
    if den[-1] == 0 or abs(num[-1] / den[-1] - 1) > UNIT:
        raise ValueError(
            "prefilter must have the static gain 1, or the output would rest beside the set point, found "
            f"{num[-1] / den[-1] if den[-1] else np.inf:.10g}"
        )
    if not n:
        return None
    poles = roots(den)
    if np.any(poles.real >= 0):
        raise ValueError(f"prefilter must be stable, found a pole at {poles[np.argmax(poles.real)]:.4g}")
    fastest = float(np.abs(poles).max())
    if method == "tustin" and h * fastest > 2.0 * (1 + 1e-9):
        raise ValueError(
            f"sample_time must be at most {2 / fastest:.6g} with method='tustin', found {h:.6g}: the prefilter has the "
            f"time constant {1 / fastest:.6g}, and would ring, with a pole at z below 0; take method='backward' or "
            "sample faster"
        )
    tau = float((den[0] / den[-1]) ** (1 / n))
    d, out = (_in_powers_of_p(part / part[-1], tau, n) for part in (den, num))
    A = (np.eye(n, k=1) - np.eye(n)) * (h / tau)
    A[-1] -= d[:-1] / d[-1] * (h / tau)
    if method == "zoh":
        # the exponential of (A A; 0 0) has e^A - 1 at the upper right, without cancellation
        from scipy.linalg import expm

        move = expm(np.block([[A, A], [np.zeros((n, 2 * n))]]))[:n, n:]
    else:
        move = np.linalg.solve(np.eye(n) - A * METHOD_WEIGHTS[method][0], A)
    return of_arrays(num, den, *METHOD_WEIGHTS[method], move, out[:-1] - out[-1] * d[:-1] / d[-1])


def of_arrays(num: Array, den: Array, new: float, old: float, move: Array, out: Array) -> Prefilter:
    """Return a prefilter of plain numbers."""
    fraction, rows = (tuple(num.tolist()), tuple(den.tolist())), tuple(map(tuple, move.tolist()))
    return Prefilter(*fraction, new, old, rows, tuple(out.tolist()))


def _in_powers_of_p(polynomial: Array, tau: float, n: int) -> Array:
    """Return coefficients of p^0 to p^n, p = 1 + tau s, of a polynomial of s in descending powers."""
    result = np.zeros(n + 1)
    for coefficient in polynomial / tau ** np.arange(polynomial.size - 1.0, -1.0, -1.0):
        # by Horner's rule: times tau s = p - 1, and one more coefficient
        result = np.concatenate([[0.0], result[:-1]]) - result
        result[0] += coefficient
    return result
