"""A loop as its factors, its limits, and the frequencies at which it has to be looked at."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop, open_loop
from pidalab.process import static_gain
from pidalab.roots import roots


class Factors(NamedTuple):
    """L(s) = gain * prod(s - zeros) / prod(s - poles) * e^{-s delay}, as the compiled scans take it."""

    gain: float
    zeros: Any
    poles: Any
    reference: Array  # speeds that the factors of the poles are compared with
    delay: float


def factors(loop: Loop) -> Factors:
    """Factor a loop block by block; nothing is cancelled.

    Raises
    ------
    ValueError
        For a gain beyond the range of numbers, and for roots that cannot be found.
    """
    open_loop(loop)  # complains about what is not a loop
    gain, zeros, poles = 1.0, [], []
    with np.errstate(over="ignore"):
        for name in ("process", "controller", "output_filter"):
            num, den = loop.blocks[name]
            gain *= float(num[0]) / float(den[0])
            zeros.append(roots(num))
            poles.append(roots(den))
    if not math.isfinite(gain):
        raise ValueError("the gain of the loop leaves the range of numbers (about 1e308)")
    z, p = np.concatenate(zeros), np.concatenate(poles)
    reference, delay = np.abs(p), float(loop.process.delay)
    moving = reference[reference > 0]
    reference[reference == 0] = moving.min() if moving.size else 1 / delay if delay else 1.0
    return Factors(gain, z, p, reference, delay)


class Scan(NamedTuple):
    """A loop and its magnitude on the grid."""

    factors: Factors
    w: Array
    size: Array

    def parts(self, loud: float, turn: float = 0.25, size: Array | None = None) -> Any:
        """Into how many pieces the steps of the grid are divided, so that they follow L wherever it is this large.

        The dead time turns the phase in each by `turn`, in rad, at most. Another `size` says where to look.
        """
        from pidalab.robustness import _scan

        parts, total = _scan.pieces(
            self.w, self.size if size is None else size, loud, self.factors.delay, turn
        )
        if not total <= _scan.MOST_POINTS:
            raise ArithmeticError(
                f"the dead time turns the phase more than {total * turn / (2 * np.pi):.2g} times while |L| is "
                "large: too often to follow; is the loop far from stable?"
            )
        return parts


def scan(loop: Loop) -> Scan:
    """Look at a loop all along the axis."""
    from pidalab.robustness import _scan  # compiled code: loaded when it is needed

    found = factors(loop)
    w = _scan.frequencies(found.zeros, found.poles, found.delay)
    return Scan(found, w, _scan.gains(w, *found[:4]))


def grid(loop: Loop, loud: float) -> Array:
    """Frequencies that follow L everywhere, and the turns of its dead time wherever |L| >= loud."""
    looked = scan(loop)
    return divided(looked.w, looked.parts(loud))


def divided(w: Array, parts: Any) -> Array:
    """Divide each step between frequencies into so many parts."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
    return np.append(np.repeat(w[:-1], parts) + share * np.repeat(np.diff(w), parts), w[-1])


def ends(loop: Loop) -> tuple[float, float]:
    """Limits of L(s) e^{s delay}, a real number, at s = 0 (infinite for integral action) and at infinity."""
    num, den = open_loop(loop)
    return static_gain(num, den), float(num[0] / den[0]) if len(num) == len(den) else 0.0
