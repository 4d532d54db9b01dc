r"""The smallest value of Re[1 + (1 + jωθ) G(jω)] over all frequencies, with a proof that nothing smaller was missed.

On a stretch from a to b a function f is nowhere below :math:`\min(f(a), f(b)) - (b - a)^2 \max|f''| / 8`. The bound of
f'' comes from the factors of F: for :math:`a \le \omega \le b` the power series of each factor around :math:`j\omega`
has, coefficient by coefficient, the majorant

.. math:: j\omega - z: \; |z - jb'| + x, \qquad \frac{1}{j\omega - p}: \; \frac{1}{d} + \frac{x}{d^2} + \dots, \qquad
          e^{-j\omega L}: \; 1 + Lx + \tfrac12 (Lx)^2 + \dots

with b' the farther end and d the distance of the stretch from p, and the product of the majorants is one of the
product. A pole at 0 would spoil this at low frequencies, where Re[F] is a small difference of large numbers. But with
:math:`F = E/s` it is :math:`\operatorname{Im} E/\omega = \int_0^1 \operatorname{Im} E'(\tau j\omega)\,d\tau`, whose
second derivative is at most a third of the largest third derivative of E.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.process import Process
from pidalab.robustness.explorer import lowest

# the true infimum is at most this far below what is returned, relative to it if that is beyond 1
TOLERANCE = 1e-6
SLACK = 1.1  # multiple roots of a polynomial are found to a few digits only: the bounds are taken larger
PER_DECADE = 30  # stretches to begin with
MOST_STRETCHES = 1_000_000  # at a time: more would fill the memory


class LinearPart(NamedTuple):
    """What a limited control signal drives on its way back: G = F - F_r.

    Attributes
    ----------
    forward : Process
        F, from the limited control signal through process, filter and controller, without the reset.
    zeros, poles : ndarray of complex
        Of its rational part; a pole at 0 is left out.
    reset_time : float
        T_i of the reset F_r = 1/(1 + T_i s); infinite where there is none.
    """

    forward: Process
    zeros: Any
    poles: Any
    reset_time: float

    def __call__(self, s: ArrayLike) -> Any:
        """Evaluate G at complex s."""
        at, rate = _check.complex_array("s", s), 1 / self.reset_time
        return self.forward(at) - rate / (rate + at)

    @property
    def integrates(self) -> bool:
        """Whether F has a pole at 0."""
        return bool(self.forward.den[-1] == 0)

    @property
    def gain(self) -> float:
        """Ratio of the leading coefficients of F."""
        return float(self.forward.num[0] / self.forward.den[0])


class _Function:
    """f(ω) = Re[1 + (1 + jωθ) G(jω)], its limits, and the bounds of its curvature and of its tail."""

    def __init__(self, part: LinearPart, theta: float) -> None:
        self.part, self.theta, self.share = part, theta, theta / part.reset_time
        self.delay = part.forward.delay
        self.num = part.forward.num
        self.den = part.forward.den[:-1] if part.integrates else part.forward.den
        # the factors of (1 + θs) F, all of them
        self.zeros = [*part.zeros, *([-1 / theta] if theta else [])]
        self.poles = [*part.poles, *([0.0] if part.integrates else [])]
        self.gain = part.gain * (theta or 1.0)

    def __call__(self, w: Array) -> Array:
        s = 1j * w
        e = np.polyval(self.num, s) / np.polyval(self.den, s) * np.exp(-s * self.delay)
        forward = (
            e.imag / w + self.theta * e.real if self.part.integrates else e.real - w * self.theta * e.imag
        )
        return 1 + forward - self._reset(w)

    def _reset(self, w: ArrayLike) -> Any:
        """Real part of (1 + jωθ) F_r, which falls or rises without turning."""
        return self.share + (1 - self.share) / (1 + (np.asarray(w) * self.part.reset_time) ** 2)

    def at_zero(self) -> float:
        """Limit at ω = 0."""
        (n1, n0), (d1, d0) = (np.append([0.0, 0.0], p)[-2:] for p in (self.num, self.den))
        e = n0 / d0
        slope = (n1 - e * d1) / d0 - e * self.delay
        forward = slope + self.theta * e if self.part.integrates else e
        return float(1 + forward - (1.0 if math.isfinite(self.part.reset_time) else 0.0))

    def at_infinity(self) -> float:
        """Limit, or with dead time lower limit, at infinite frequency."""
        constant = self.gain if len(self.zeros) == len(self.poles) else 0.0
        return 1 - self.share + (-abs(constant) if self.delay else constant)

    def curvature(self, a: Array, b: Array) -> Array:
        """Bound of |f''| between a and b."""
        forward = 2 * _majorant(self.zeros, self.poles, self.gain, self.delay, a, b)[2]
        if self.part.integrates:
            factors = self.part.zeros, self.part.poles, self.part.gain, self.delay
            slow = (
                2 * _majorant(*factors, np.zeros_like(a), b)[3]
                + 2 * self.theta * _majorant(*factors, a, b)[2]
            )
            forward = np.fmin(forward, slow)
        return SLACK * (forward + self._reset_curvature(a))

    def _reset_curvature(self, a: Array) -> Any:
        """Bound of |f''| of the reset from a on: the second derivative of 1/(1 + x²) is at most 2, and 6/(1 + x²)²."""
        time = self.part.reset_time
        if not math.isfinite(time):
            return 0.0
        return abs(1 - self.share) * time**2 * np.minimum(2.0, 6 / (1 + (a * time) ** 2) ** 2)

    def tail(self, w: float) -> float:
        """Bound of f from below for all frequencies above w, which must lie above all poles."""
        zeros, poles = np.abs(self.zeros), np.abs(self.poles)
        reset = max(self.share, float(self._reset(w))) if math.isfinite(self.part.reset_time) else 0.0
        if not self.delay and len(zeros) == len(poles):  # the forward path approaches a constant
            off = np.prod(1 + zeros / w) / np.prod(1 - poles / w) - 1
            return float(1 + self.gain - SLACK * abs(self.gain) * off - reset)
        top, bottom = np.sum(np.log1p((zeros / w) ** 2)), np.sum(np.log1p(-((poles / w) ** 2)))
        size = abs(self.gain) * math.exp(0.5 * (top - bottom)) * w ** float(len(zeros) - len(poles))
        return float(1 - size - reset)

    def scales(self) -> Array:
        """Frequencies at which something happens."""
        roots = np.abs(np.array([*self.zeros, *self.poles, 1 / self.part.reset_time]))
        found = np.append(roots[roots > 0], [1 / self.delay] if self.delay else [])
        return found if found.size else np.array([abs(self.part.gain)])  # nothing but an integrator


def _majorant(
    zeros: Sequence[complex], poles: Sequence[complex], gain: float, delay: float, a: Array, b: Array
) -> list[Array]:
    """Bounds of |g|, |g'|, |g''|/2 and |g'''|/6 between a and b, for g with these factors."""
    bound = [np.full_like(a, abs(gain)), *np.zeros((3, a.size))]
    for zero in zeros:
        far = np.maximum(np.abs(1j * a - zero), np.abs(1j * b - zero))
        bound = [x * far + before for x, before in zip(bound, [0.0, *bound[:3]], strict=True)]
    with np.errstate(divide="ignore"):
        for pole in poles:
            near = np.abs(1j * np.clip(np.imag(pole), a, b) - pole)
            rising: Any = 0.0
            for k in range(4):
                bound[k] = rising = (bound[k] + rising) / near
    series = [delay**k / math.factorial(k) for k in range(4)]
    return [np.sum([series[i] * bound[k - i] for i in range(k + 1) if series[i]], axis=0) for k in range(4)]


def infimum(part: LinearPart, theta: float) -> tuple[float, float]:
    """Return the infimum of Re[1 + (1 + jωθ) G(jω)] and the frequency where it lies: 0 or inf where approached there.

    The value is at most `TOLERANCE` too high, relative to it if it is beyond 1. F must be strictly proper,
    without poles on the axis but one at 0.
    """
    f = _Function(part, theta)
    at_infinity = f.at_infinity()
    scales = f.scales()
    low, high = 1e-2 * scales.min(), 10 * scales.max()
    w = np.append(
        [0.0], np.logspace(np.log10(low), np.log10(high), 1 + int(PER_DECADE * np.log10(high / low)))
    )
    values = np.append([f.at_zero()], f(w[1:]))
    best = min(float(values.min()), at_infinity)
    while f.tail(w[-1]) < _below(best):
        if w[-1] > 1e12 * high:
            raise ArithmeticError("the tail of the frequency response does not come to an end")
        further = w[-1] * np.linspace(1.0, 2.0, 11)[1:]
        w, values = np.append(w, further), np.append(values, f(further))
        best = min(best, float(values.min()))
    where, best = _descend(f, w, values, best)
    return (best, where) if best < at_infinity else (at_infinity, math.inf)


def line(part: LinearPart, w: float) -> tuple[float, float]:
    """Value at θ = 0 and slope of Re[1 + (1 + jωθ) G(jω)], linear in θ; of its limits where ω is 0 or infinite."""
    if 0 < w < math.inf:
        value = complex(part(1j * w))
        return 1 + value.real, -w * value.imag
    # at infinity θ = 0 is another function, whose limit is that of the line all the same
    one, two = (
        f.at_zero() if w == 0 else f.at_infinity() for f in (_Function(part, 1.0), _Function(part, 2.0))
    )
    return 2 * one - two, two - one


def _below(best: float) -> float:
    """What a stretch must not fall short of."""
    return best - TOLERANCE * max(1.0, abs(best))


def _descend(f: _Function, w: Array, values: Array, best: float) -> tuple[float, float]:
    """Halve every stretch that could hide a value below the best one; return the lowest and its frequency."""
    points, heights = [w], [values]
    a, b, fa, fb = w[:-1], w[1:], values[:-1], values[1:]
    while True:
        suspect = np.minimum(fa, fb) - (b - a) ** 2 / 8 * f.curvature(a, b) < _below(best)
        if not suspect.any():
            break
        if suspect.sum() > MOST_STRETCHES:
            raise ArithmeticError(
                "the dead time turns the phase too often to follow: is the filter very short?"
            )
        a, b, fa, fb = a[suspect], b[suspect], fa[suspect], fb[suspect]
        middle = 0.5 * (a + b)
        fm = f(middle)
        best = min(best, float(fm.min()))
        points.append(middle)
        heights.append(fm)
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        fa, fb = np.concatenate([fa, fm]), np.concatenate([fm, fb])
    w, first = np.unique(np.concatenate(points), return_index=True)
    values = np.concatenate(heights)[first]
    i = int(np.argmin(values))
    if 0 < i < w.size - 1:
        (where,), (polished,) = lowest(lambda x: f(np.atleast_1d(x)).item(), w, np.array([i]))
        if polished < values[i]:
            return float(where), float(polished)
    return float(w[i]), float(values[i])
