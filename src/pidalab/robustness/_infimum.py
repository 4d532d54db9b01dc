r"""The smallest value of Re[1 + (1 + jωθ) G(jω)] over all frequencies, with exact dead time.

The part of the function that the dead time turns is (1 + jωθ) F(jω). Its turns are followed wherever its size allows a
value below the smallest that is known. A pole of F at 0 would make its real part a small difference of large numbers at
low frequencies. But with :math:`F = E/s` it is :math:`\operatorname{Im} E/\omega`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab.process import Process
from pidalab.robustness._arrays import lowest, most_between
from pidalab.robustness.loops import from_factors, together
from pidalab.robustness.peaks_and_crossovers import Seen

NO_LOWER = 1e-10  # by how much a value must be lower to be sought, relative to it if it is beyond 1
GRID_STEPS = 60  # of the grid that are followed at a time


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
        rate = 1 / self.reset_time
        return self.forward(s) - rate / (rate + np.asarray(s))

    @property
    def integrates(self) -> bool:
        """Whether F has a pole at 0."""
        return bool(self.forward.den[-1] == 0)

    @property
    def gain(self) -> float:
        """Ratio of the leading coefficients of F."""
        return float(self.forward.num[0] / self.forward.den[0])


def ends(part: LinearPart, theta: float) -> tuple[float, float]:
    """Limits of Re[1 + (1 + jωθ) G] at zero and at infinite frequency, there with dead time the lower limit."""
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
    """Real part of (1 + jωθ) F_r, which falls or rises without turning."""
    if math.isinf(part.reset_time):
        return 0.0 * w
    share = theta / part.reset_time
    return share + (1 - share) / (1 + (w * part.reset_time) ** 2)


def infimum(part: LinearPart, theta: float) -> tuple[float, float]:
    """Return the infimum of Re[1 + (1 + jωθ) G(jω)] and the frequency where it lies: 0 or inf where approached there.

    F must be strictly proper, without poles on the axis but one at 0.
    """
    # of F, or of E where F = E/s
    looked = from_factors(together(part.gain, part.zeros, part.poles, part.forward.delay))

    def function(seen: Seen) -> Any:
        e = seen.num / seen.den
        real = e.imag / seen.w + theta * e.real if part.integrates else e.real - seen.w * theta * e.imag
        return 1 + real - _reset(part, seen.w, theta)

    at_zero, at_infinity = ends(part, theta)
    grid = looked.on_grid
    best = min(at_zero, at_infinity, float(function(grid).min()))
    size = looked.size * np.abs(1 + 1j * theta * grid.w) / (grid.w if part.integrates else 1.0)
    reset = _reset(part, grid.w, theta)
    bound = 1 - most_between(size[:-1], size[1:]) - np.fmax(reset[:-1], reset[1:])
    followed = np.zeros(bound.size, dtype=bool)
    while looked.delay:
        steps = ~followed & (bound < _below(best))
        steps &= np.cumsum(steps) <= GRID_STEPS
        if not steps.any():
            break
        followed |= steps
        best = min(best, float(function(looked.at(looked.points(steps))).min()))
    seen = looked.at(looked.points(followed))
    values = function(seen)
    change = np.abs(np.diff(values))
    inner = values[1:-1]
    dips = (inner <= values[:-2]) & (inner <= values[2:]) & (inner - np.fmax(change[:-1], change[1:]) <= best)
    at, least = lowest(lambda w: function(looked.at(w)), seen.w, 1 + np.flatnonzero(dips))
    i = int(np.argmin(values))
    found, where = min([(float(values[i]), float(seen.w[i])), *zip(least.tolist(), at.tolist(), strict=True)])
    for value, end in ((at_zero, 0.0), (at_infinity, math.inf)):
        if _below(value) <= found:
            return value, end
    return found, where


def line(part: LinearPart, w: float) -> tuple[float, float]:
    """Value at θ = 0 and slope of Re[1 + (1 + jωθ) G(jω)], linear in θ; of its limits where ω is 0 or infinite."""
    if 0 < w < math.inf:
        value = complex(part(1j * w))
        return 1 + value.real, -w * value.imag
    # at infinity θ = 0 is another function, whose limit is that of the line all the same
    one, two = (ends(part, theta)[int(w > 0)] for theta in (1.0, 2.0))
    return 2 * one - two, two - one


def _below(best: float) -> float:
    """What a value must not exceed to be lower."""
    return best - NO_LOWER * max(1.0, abs(best))
