"""State-space form of a loop that is cut at its dead time.

The blocks are driven one by the other: process, integral of its output, prefilter, controller with output filter. A
derivative filter far faster than the plant would compute s^2 y as a difference of nearly equal states. Its states are
replaced by their distance from what the slow signal makes of them in the long run, so that its output is read off the
slow states directly: as the transfer function of the fast part, evaluated at the matrix of the slow states.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgebal

from pidalab._check import Array
from pidalab.controllers import Fraction
from pidalab.loop import Loop, require_well_posed
from pidalab.roots import roots
from pidalab.statespace import Part, StateSpace, monic, numerator, parallel, realise


def without_slow_parts(
    slow: tuple[Part, ...], first: tuple[Array, Array], second: tuple[Array, Array], fast: tuple[Part, ...]
) -> tuple[Any, Any]:
    """Return numerator and poles of two fractions in series without their slow parts.

    The division by the slow poles runs from the highest power down, where the fast terms are, so that no small
    difference of large numbers is formed.
    """
    num = np.convolve(first[0], second[0]) / (first[1][0] * second[1][0])
    poles = np.concatenate([part.poles for part in fast])
    taken: Any = np.zeros(1)
    under: Any = np.ones(1)
    for part in slow:
        den = np.array([1.0, *monic(part.poles.tolist())[::-1]])
        taken = np.polyadd(np.convolve(taken, den), np.convolve(numerator(part), under))
        under = np.convolve(under, den)
    fast_den = np.array([1.0, *monic(poles.tolist())[::-1]])
    remainder = [0.0] * (fast_den.size - 1 + under.size - num.size) + num.tolist()
    shared = np.convolve(taken, fast_den).tolist()
    for i in range(-len(shared), 0):
        remainder[i] -= shared[i]
    quotient = []
    for i in range(fast_den.size):
        quotient.append(remainder[i])
        for j, coefficient in enumerate(under.tolist()):
            remainder[i + j] -= quotient[i] * coefficient
    return np.array(quotient), poles


def times_function(row: Array, matrix: Array, num: Array, poles: Any) -> Array:
    """Return row @ H(matrix) for a fraction H, by Horner's rule and by its poles one by one."""
    value = np.zeros(row.size, dtype=complex)
    for coefficient in num:
        value = value @ matrix + coefficient * row
    for pole in poles:
        value = np.linalg.solve(matrix.T - pole * np.eye(row.size), value)
    return value.real


# A part of the controller is decoupled if its slowest pole is FASTER times as fast as all states that drive it and the
# loop gain there is below HIGH_GAIN; to a much faster loop the plant is a chain of integrators. With FASTER = 100, u
# after a step of the load was off by up to 5e-8 of its largest value: the kick of a filter 50 times faster than its
# plant, 1e5 times y, was a difference of nearly equal states.
FASTER, HIGH_GAIN = 10.0, 100.0


class Cut(NamedTuple):
    """The loop opened at the dead time, driven by w(t) = v(t - delay), the delayed process input.

    x' = A x + B w,  v = Cv x + D w,  outputs = C x + direct w, from x(0) = x0; the step inputs are states too.
    """

    A: Array  # (n, n)
    B: Array  # (n, 1)
    Cv: Array  # (1, n)
    D: Array  # (1, 1)
    C: Array  # (3, n), rows: y, running integral of y, u
    direct: Array  # (3, 1)
    x0: Array  # (n, inputs), the state just after a unit step on each input
    delay: float


class _Blocks(NamedTuple):
    """The fractions of a loop, in the units of a cut."""

    blocks: Mapping[str, Fraction]
    open_loop: Fraction
    delay: float


class _States:
    """States x of the cut loop, block by block: x' = A x + B w, with the signal w that comes out of the dead time.

    A signal of the loop is a row: its coefficients of x and w.
    """

    def __init__(self, size: int, inputs: int) -> None:
        self.size, self.moves = size, np.zeros((size, size + 1))
        self.A, self.B = self.moves[:, :size], self.moves[:, size:]
        self.x0 = np.eye(size, inputs)  # of the constants behind the step inputs
        self.used = inputs

    def signal(self, place: int) -> Array:
        """Return the signal that is one of x and w, or the signal 0 for -1."""
        row = np.zeros(self.moves.shape[1])
        if place >= 0:
            row[place] = 1.0
        return row

    def append_series(self, block: StateSpace | Part, source: Array, direct: float = 0.0) -> Array:
        """Append a block that is driven by a signal, and return its output."""
        if not block.b.size:
            return source if direct == 1.0 else direct * source
        places = slice(self.used, self.used + block.b.size)
        self.moves[places] = block.b[:, None] * source
        self.moves[places, places] = block.A
        self.used = places.stop
        row = direct * source
        row[places] = block.c
        return row

    def append_decoupled(self, part: Part, source: Array, driving: int) -> slice:
        """Append a fast part as the distance of its states from X x, with A X - X A_x = -b row; return their places.

        The states x are the first `driving` ones, which drive the part. The output of the part is c (X x + distance).

        Notes
        -----
        With q' = A q + b row x for the part, the distance q - X x moves by A alone if A X - X A_x = -b row, the
        Sylvester equation that is solved here. Only jumps and the signal out of the dead time then drive it.
        """
        x, places = slice(driving), slice(self.used, self.used + part.b.size)
        # one large linear system, since a Schur form would lose digits for speeds so far apart
        n = part.b.size
        sylvester = np.zeros((driving, n, driving, n))
        for i in range(driving):
            sylvester[i, :, i, :] = part.A
        for i in range(n):
            sylvester[:, i, :, i] -= self.A[x, x].T
        target = -np.outer(source[x], part.b)
        X: Any = np.linalg.solve(sylvester.reshape(target.size, -1), target.ravel()).reshape(target.shape).T
        self.A[places, places] = part.A
        self.B[places] = part.b[:, None] * source[self.size :] - X @ self.B[x]
        self.x0[places] = -X @ self.x0[x]
        self.used = places.stop
        return places


@lru_cache(maxsize=64)
def cut_at_delay(loop: Loop, inputs: str, unit: float = 1.0) -> Cut:
    """Open the loop at its dead time; `inputs` names the step inputs to keep, out of "r", "d", "n".

    The unit of time of the cut is `unit` times that of the loop, and its u is `unit` times as large.

    Raises
    ------
    ValueError
        For a loop that is ill-posed, and one whose coefficients leave the range of numbers.
    """
    require_well_posed(loop)
    return _cut(_in_unit(loop, unit), inputs, unit)


def fastest_pole(loop: Loop) -> float:
    """Return the speed of the fastest pole of all blocks."""
    return max(float(np.max(np.abs(roots(den)), initial=0.0)) for _, den in loop.blocks.values())


def _in_unit(loop: Loop, unit: float) -> _Blocks:
    if unit == 1.0:
        return _Blocks(loop.blocks, loop.open_loop, loop.process.delay)

    def scaled(block: Fraction, factor: float = 1.0) -> Fraction:
        num, den = (part * unit ** np.arange(1.0 - part.size, 1.0) for part in block)
        return factor * num, den

    factors = {"controller": unit, "process": 1.0 / unit}
    blocks = {name: scaled(block, factors.get(name, 1.0)) for name, block in loop.blocks.items()}
    return _Blocks(blocks, scaled(loop.open_loop), loop.process.delay / unit)


def _cut(loop: _Blocks, inputs: str, unit: float) -> Cut:
    """Realise a loop that is cut at its dead time.

    Notes
    -----
    States are appended in the order in which they drive each other: step inputs, process, integral of y, prefilter,
    slow parts of the controller, fast parts. Each signal is a row over states and delayed signals, so that what is
    appended next can read it.

    Fast parts of the controller, those whose poles are much faster than all that drives them, are decoupled. Their
    states are the distances from X x, and u reads the rest at once, as the transfer function of the fast parts at the
    matrix of the slow states, H(A_x). Without fast parts u is the direct part of the error and the sum of all parts.

    Without dead time the loop is closed at the end: w = Cv x + D w.
    """
    process, prefilter = realise(*loop.blocks["process"]), realise(*loop.blocks["prefilter"])
    control = loop.blocks["controller"], loop.blocks["output_filter"]
    parts, direct = parallel(*control)
    driving_poles = _poles(loop, "prefilter").tolist() + _poles(loop, "process").tolist()
    fastest = max(map(abs, driving_poles), default=0.0)
    above, below = (abs(_value(p, 1j * fastest)) for p in loop.open_loop)
    slow = len(parts)
    if above < HIGH_GAIN * below:
        slow = sum(abs(part.poles[0]) <= FASTER * fastest for part in parts)
    fast = parts[slow:]
    size = len(inputs) + process.b.size + 1 + prefilter.b.size + sum(part.b.size for part in parts)
    states = _States(size, len(inputs))
    r, d, n = (inputs.find(key) for key in "rdn")

    y = states.append_series(process, states.signal(size), process.d)
    area = states.append_series(StateSpace(np.zeros((1, 1)), np.array([unit]), np.ones(1), 0.0), y)
    filtered = states.append_series(prefilter, states.signal(r), prefilter.d)
    error, driving = filtered - y - states.signal(n), states.used
    u, A, B = direct * error, states.A, states.B
    if fast:  # the direct effect of the error is read from the slow states, below
        u[:size] = 0.0
    for part in parts[:slow]:
        u += states.append_series(part, error)
    if fast:
        fraction = without_slow_parts(parts[:slow], *control, fast)
        u[:driving] += times_function(error[:driving], A[:driving, :driving], *fraction)
        for part in fast:
            u[states.append_decoupled(part, error, driving)] = part.c
    rows, v = np.array([y, area, u]), (u + states.signal(d))[None]
    C, direct_C, Cv, D = rows[:, :size], rows[:, size:], v[:, :size], v[:, size:]
    if not loop.delay:  # close the loop at once: w = Cv x + D w
        W = Cv / (1 - D)
        A, C = A + B @ W, C + direct_C @ W
        B, Cv, D, direct_C = (np.zeros_like(x) for x in (B, Cv, D, direct_C))
    if not (np.isfinite(A).all() and np.isfinite(B).all() and np.isfinite(C).all()):
        raise ValueError("the coefficients of the loop lie too far apart: they leave the range of numbers")
    return _balanced(Cut(A, B, Cv, D, C, direct_C, states.x0, loop.delay))


def _balanced(cut: Cut) -> Cut:
    """Change the units of the states so that rows and columns of |A| + |B| |Cv| are of similar size.

    The units are powers of 2, so that nothing is rounded. With similar sizes a share of the largest coefficient is
    negligible for every state.
    """
    scale = dgebal(np.abs(cut.A) + np.abs(cut.B) @ np.abs(cut.Cv), scale=1)[3]
    return cut._replace(
        A=cut.A * scale / scale[:, None],
        B=cut.B / scale[:, None],
        Cv=cut.Cv * scale,
        C=cut.C * scale,
        direct=np.ascontiguousarray(cut.direct),
        x0=cut.x0 / scale[:, None],
    )


def _poles(loop: _Blocks, block: str) -> Array:
    return roots(loop.blocks[block][1])


def _value(polynomial: Array, s: complex) -> Any:
    """Return the value of a polynomial; for one number Python is faster than array operations."""
    value = 0j
    for coefficient in polynomial.tolist():
        value = value * s + coefficient
    return np.complex128(value)
