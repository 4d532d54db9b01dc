r"""Frequencies at which a loop has to be looked at.

The magnitude of L(jw) is that of its rational part: smooth on a logarithmic grid. Its phase also turns by the dead
time, without end. So the grid is logarithmic, and is divided further where the dead time turns the phase quickly *and*
L is large enough for it to matter.
"""

from __future__ import annotations

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop, open_loop
from pidalab.process import static_gain

PER_DECADE = 120  # points of the logarithmic grid
MOST_POINTS = 20_000_000  # of a grid: more would fill the memory
TURN = 0.25  # largest turn of the phase by the dead time between two points, in rad


def _roots(loop: Loop) -> Array:
    return np.concatenate([np.roots(p) for p in open_loop(loop)])


def log_gain(loop: Loop, w: Array) -> Array:
    """Return log |L(jw)|, on which the dead time has no influence; -inf and inf at zeros and poles on the axis."""
    num, den = open_loop(loop)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.abs(np.polyval(num, 1j * w))) - np.log(np.abs(np.polyval(den, 1j * w)))


def grid(loop: Loop, loud: float) -> Array:
    """Frequencies that follow L everywhere, and the turns of its dead time wherever |L| >= loud."""
    roots = _roots(loop)
    delay = loop.process.delay
    corners = np.abs(roots[roots != 0])
    scale = np.concatenate([corners, [1 / delay] if delay else [], [1.0] if not corners.size and not delay else []])
    low, high = np.log10(scale.min()) - 4, np.log10(scale.max()) + 4
    w = np.logspace(low, high, int(PER_DECADE * (high - low)) + 1)
    # lightly damped roots are narrower than the grid: add points around each at the scale of its damping
    near = np.concatenate([-np.logspace(3, -2, 40), np.logspace(-2, 3, 40)])
    sharp = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.2 * np.abs(roots))]
    local = [abs(root.imag) + np.maximum(abs(root.real), 1e-9 * abs(root)) * near for root in sharp]
    w = np.unique(np.concatenate([w, *local]))
    w = w[(w > 10**low) & (w < 10**high)]
    if delay:
        size = log_gain(loop, w)
        heard = np.maximum(size[:-1], size[1:]) >= np.log(loud)
        pieces = np.where(heard, np.ceil(np.diff(w) * delay / TURN), 1).astype(int)
        if pieces.sum() > MOST_POINTS:
            raise ArithmeticError(
                f"the dead time turns the phase {pieces.sum() * TURN / (2 * np.pi):.2g} times while |L| is large: "
                "too often to follow; is the loop far from stable?"
            )
        first = np.repeat(np.cumsum(pieces) - pieces, pieces)
        share = (np.arange(pieces.sum()) - first) / np.repeat(pieces, pieces)
        w = np.append(np.repeat(w[:-1], pieces) + share * np.repeat(np.diff(w), pieces), w[-1])
    return w


def ends(loop: Loop) -> tuple[float, float]:
    """Limits of L(s) e^{s delay}, a real number, at s = 0 (infinite for integral action) and at infinity."""
    num, den = open_loop(loop)
    return static_gain(num, den), float(num[0] / den[0]) if len(num) == len(den) else 0.0
