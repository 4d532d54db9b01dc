r"""What may be limited at all frequencies: \|S\|, \|C S\|, \|T\| and half of \|S - T\|, by one formula.

Each is the modulus of t/(1 + L), with t = 1, C, L or (1 - L)/2. Where the logarithms of C and P change by c and p, that
of L changes by their sum, so that of the height by :math:`\operatorname{Re}(a c + b p)`, with

=================  =========  ==========  =========  =====================
height             \|S\|      \|C S\|     \|T\|      half of \|S - T\|
=================  =========  ==========  =========  =====================
a                  -T         S           S          -2 L/(1 - L²)
b                  -T         -T          S          -2 L/(1 - L²)
=================  =========  ==========  =========  =====================

The slopes by the gains, where P stays, and by the frequency are both of this form.
"""

from __future__ import annotations

from typing import Any

import numpy as np

HEIGHTS = ("ms", "mks", "mt", "inverse_disk")  # half of |S - T| is one over the disk margin
MS, MKS, MT, HALF = range(4)  # kinds of heights


def top(kind: int, controller: Any, L: Any) -> Any:
    """Numerator over 1 + L of a kind of height."""
    return (1.0, controller, L)[kind] if kind != HALF else 0.5 * (1 - L)


def weights(kind: int, L: Any) -> tuple[Any, Any]:
    """What changes of ln C and ln P count for in that of the logarithm of a height: a and b of the table above."""
    if kind == HALF:
        both = -2 * L / (1 - L * L)
        return both, both
    S = 1 / (1 + L)
    T = L * S
    return -T if kind == MS else S, S if kind == MT else -T


def turned(f: Any) -> float:
    """Angle by which a function turns from point to point: the argument principle, where points lie close enough."""
    return float(np.angle(f[1:] / f[:-1]).sum())


def with_turns(w: Any, delay: float, angles: Any, end: float | None = None) -> Any:
    """Frequencies, and those at which a dead time has turned the phase by some angles, up to an end, in order."""
    turns = angles / delay if delay else np.zeros(0)
    return np.sort(np.append(w, turns[turns < (w[-1] if end is None else end)]))
