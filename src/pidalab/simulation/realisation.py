"""State-space form of a loop that is cut at its dead time.

The blocks are driven one by the other: process, integral of its output, prefilter, controller with output filter. A
derivative filter far faster than the plant would compute s^2 y as a difference of nearly equal states. Its states are
replaced by their distance from what the slow signal makes of them in the long run, so that its output is read off the
slow states directly: as the transfer function of the fast part, evaluated at the matrix of the slow states.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop, require_well_posed
from pidalab.roots import roots
from pidalab.statespace import Part, StateSpace, numerator, parallel, realise

# A part of the controller is decoupled if its slowest pole is so many times faster than all states that drive it,
# and if the loop is not louder than this there: to a far faster loop the plant is a chain of integrators.
STIFF, LOUD = 100.0, 100.0


class Cut(NamedTuple):
    """The loop opened at the dead time, driven by w(t) = v(t - delay), the delayed process input.

    x' = A x + b w,  v = c_v x + d_v w,  outputs = C x + d w, from x(0) = x0; the step inputs are states too.
    """

    A: Array  # (n, n)
    b: Array  # (n,)
    c_v: Array  # (n,)
    d_v: float
    C: Array  # (3, n), rows: y, running integral of y, u
    d: Array  # (3,)
    x0: Array  # (n, inputs), the state just after a unit step on each input
    delay: float


INTEGRATOR = StateSpace(np.zeros((1, 1)), np.ones(1), np.ones(1), 0.0)


class Signal(NamedTuple):
    """A signal of the cut loop: row x + direct w."""

    row: Array
    direct: float


class _States:
    """States of the cut loop, block by block."""

    def __init__(self, size: int, inputs: int) -> None:
        self.A, self.b, self.x0 = np.zeros((size, size)), np.zeros(size), np.zeros((size, inputs))
        self.x0[:inputs] = np.eye(inputs)  # the constants behind the step inputs
        self.used = inputs

    def through(self, block: StateSpace | Part, source: Signal, direct: float = 0.0) -> Signal:
        """Append a block that is driven by a signal, and return its output."""
        own = slice(self.used, self.used + block.b.size)
        self.A[own] = block.b[:, None] * source.row
        self.A[own, own] = block.A
        self.b[own] = block.b * source.direct
        self.used = own.stop
        row = direct * source.row
        row[own] = block.c
        return Signal(row, direct * source.direct)

    def aside(self, part: Part, source: Signal, driving: int) -> Signal:
        """Append a fast part as the distance of its states from X x, with A X - X A_x = -b row; return c times it.

        The states x are the first `driving` ones, which drive the part.
        """
        x, own = slice(driving), slice(self.used, self.used + part.b.size)
        # by one large system, since a Schur form of parts as far apart as these would lose digits
        sylvester = np.kron(np.eye(driving), part.A) - np.kron(self.A[x, x].T, np.eye(part.b.size))
        X = np.linalg.solve(sylvester, -np.kron(source.row[x], part.b)).reshape(driving, -1).T
        self.A[own, own] = part.A
        self.b[own] = part.b * source.direct - X @ self.b[x]
        self.x0[own] = -X @ self.x0[x]
        self.used = own.stop
        row = np.zeros(self.b.size)
        row[own] = part.c
        return Signal(row, 0.0)


@lru_cache(maxsize=64)
def cut_at_delay(loop: Loop, inputs: str) -> Cut:
    """Open the loop at its dead time; `inputs` names the step inputs to keep, out of "r", "d", "n".

    Raises
    ------
    ValueError
        For a loop that is ill-posed, and one whose coefficients leave the range of numbers.
    """
    require_well_posed(loop)
    process, prefilter = realise(*loop.blocks["process"]), realise(*loop.blocks["prefilter"])
    control = loop.blocks["controller"], loop.blocks["output_filter"]
    parts, direct = parallel(*control)
    size = len(inputs) + process.b.size + 1 + prefilter.b.size + sum(part.b.size for part in parts)
    states = _States(size, len(inputs))
    r, d, n = (np.eye(1, size, inputs.find(key))[0] for key in "rdn")  # zeros for what is not there

    y = states.through(process, Signal(np.zeros(size), 1.0), process.d)
    area = states.through(INTEGRATOR, y)
    filtered = states.through(prefilter, Signal(r, 0.0), prefilter.d)
    error, driving = Signal(filtered.row - y.row - n, -y.direct), states.used
    slow = _slow_parts(loop, parts)
    u_row = direct * error.row
    if slow < len(parts):
        u_row = np.zeros(size)
        rest = _without(parts[:slow], *control, parts[slow:])
        u_row[:driving] = _times_function(error.row[:driving], states.A[:driving, :driving], *rest)
    for part in parts[:slow]:
        u_row = u_row + states.through(part, error).row
    for part in parts[slow:]:
        u_row = u_row + states.aside(part, error, driving).row

    A, b, C = states.A, states.b, np.stack([y.row, area.row, u_row])
    shares = np.array([y.direct, area.direct, direct * error.direct])
    v, v_direct = u_row + d, float(shares[2])
    if not loop.process.delay:  # close the loop at once: w = v
        w = v / (1.0 - v_direct)
        A, C = A + np.outer(b, w), C + np.outer(shares, w)
        b, v, v_direct, shares = np.zeros(size), np.zeros(size), 0.0, np.zeros(3)
    if not all(np.isfinite(x).all() for x in (A, b, C)):
        raise ValueError("the coefficients of the loop lie too far apart: they leave the range of numbers")
    return Cut(A, b, v, v_direct, C, shares, states.x0, loop.process.delay)


def _slow_parts(loop: Loop, parts: tuple[Part, ...]) -> int:
    """Count the parts of the controller that are not far faster than all that drives them."""
    driving = [roots(loop.blocks[name][1]) for name in ("process", "prefilter")]
    fastest = max(np.abs(np.concatenate(driving)), default=0.0)
    num, den = loop.open_loop
    loud = not abs(np.polyval(num, 1j * fastest)) < LOUD * abs(np.polyval(den, 1j * fastest))
    return len(parts) if loud else sum(abs(part.poles[0]) <= STIFF * fastest for part in parts)


def _without(
    slow: tuple[Part, ...], first: tuple[Array, Array], second: tuple[Array, Array], fast: tuple[Part, ...]
) -> tuple[Any, Any]:
    """Return numerator and poles of two fractions in series without their slow parts.

    The division by the slow poles runs from the highest power down, where the fast terms are: no small difference is
    formed.
    """
    num = np.convolve(first[0], second[0]) / (first[1][0] * second[1][0])
    poles = np.concatenate([part.poles for part in fast])
    taken: Any = np.zeros(1)
    under: Any = np.ones(1)
    for part in slow:
        own = np.poly(part.poles).real
        taken = np.polyadd(np.convolve(taken, own), np.convolve(numerator(part), under))
        under = np.convolve(under, own)
    rest = np.polysub(num, np.convolve(taken, np.poly(poles).real))
    return np.polydiv(np.pad(rest, (poles.size + under.size - rest.size, 0)), under)[0], poles


def _times_function(row: Array, matrix: Array, num: Array, poles: Any) -> Array:
    """Return row @ H(matrix) for a fraction H, by Horner's rule and by its poles one by one."""
    value = np.zeros(row.size, dtype=complex)
    for coefficient in num:
        value = value @ matrix + coefficient * row
    for pole in poles:
        value = np.linalg.solve(matrix.T - pole * np.eye(row.size), value)
    return value.real
