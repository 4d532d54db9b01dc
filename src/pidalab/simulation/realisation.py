"""Convert a loop that is opened at its dead time to state-space form.

A derivative filter that is much faster than the plant would compute s^2 y as a difference of nearly equal states. Each
state of such a filter is therefore replaced by its distance from a quasi-steady value, which is computed from the slow
states.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgebal, zgetrf, zgetrs

from pidalab._check import Array
from pidalab.controllers import Fraction
from pidalab.loop import BLOCKS, Loop, require_well_posed
from pidalab.roots import roots
from pidalab.statespace import Part, StateSpace, monic, numerator, parallel, realise

# A fast part of the controller reads the loop's states at this number of times, one dead time apart. Older states are
# negligible, since they have passed through the filter of the part at least this number of times.
AGES = 8


def without_slow_parts(
    slow: tuple[Part, ...], first: tuple[Array, Array], second: tuple[Array, Array], fast: tuple[Part, ...]
) -> tuple[Any, Any]:
    """Subtract slow parts from the product of two fractions. Return numerator and poles of the remainder.

    The slow parts are subtracted in the numerator, which is then divided by the polynomial of the slow poles. The
    division begins at the highest power, which belongs to the fast terms, so that no small difference of large numbers
    is formed.
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
    """Return row @ H(matrix) for a fraction H, by Horner's rule and one linear system for each pole of H."""
    value = np.zeros(row.size, dtype=complex)
    for coefficient in num:
        value = value @ matrix + coefficient * row
    for pole in poles:
        value = np.linalg.solve(matrix.T - pole * np.eye(row.size), value)
    return value.real


def times_ring_function(
    row: Array,
    direct: Array,
    delayed: tuple[Array, Array, Array, Array],
    num: Array,
    poles: Any,
    dead_time: bool,
) -> Array:
    r"""Return (row + direct W) H(A(z)) for a fraction H: one row of coefficients for each age of the state x.

    The input of H is the signal ``row @ x + direct @ W``, where W are the delayed signals. H is much faster than this
    signal. The algorithm of `times_function` is applied to the matrix of the loop,
    :math:`\mathcal A(z) = A + B (1 - z D)^{-1} z C_v`.
    """
    A, B, Cv, D = delayed
    if not dead_time:
        W = np.linalg.solve(np.eye(len(D)) - D, Cv)
        return times_function(row + direct @ W, A + B @ W, num, poles)[None]
    signal = np.vstack([row, _delayed_row(direct, Cv, D)])
    value = np.zeros(signal.shape, dtype=complex)
    for coefficient in num:
        late = np.zeros(len(D), dtype=complex)
        for age in range(AGES):
            now = value[age].copy()
            value[age] = now @ A + late @ Cv + coefficient * signal[age]
            late = late @ D + now @ B
    for pole in poles:
        factors, pivots, _ = zgetrf(A.T - pole * np.eye(len(A)))
        late = np.zeros(len(D), dtype=complex)
        for age in range(AGES):
            value[age] = zgetrs(factors, pivots, value[age] - late @ Cv)[0]
            late = late @ D + value[age] @ B
    return value.real


def _delayed_row(direct: Array, Cv: Array, D: Array) -> Array:
    """Return the coefficients of x(t - delay), x(t - 2 delay), ... in the signal direct W."""
    read = []
    for _ in range(AGES - 1):
        read.append(direct @ Cv)
        direct = direct @ D
    return np.array(read)


# Let w be the speed of the fastest state that drives a part of the controller. The part is decoupled (see `_cut`) if
# all its poles are faster than FASTER * w, and if the loop gain at w is below HIGH_GAIN. With a higher gain the closed
# loop would be much faster than w, so the states that drive the part would not be slow, and the plant would act as a
# chain of integrators. In a trial with FASTER = 100, a filter 50 times faster than its plant was not decoupled. The
# kick of this filter, a short signal of 1e5 times y, was then a difference of nearly equal states. After a step of the
# load, u had errors of up to 5e-8 of the largest u.
FASTER, HIGH_GAIN = 10.0, 100.0
# Consider the parts that are more than STIFF times as fast as the states that drive them. These parts are kept out of
# the process (see `_cut`) if all are more than VERY_STIFF times as fast as those states, and if their kicks change the
# process output by less than SENDS_LITTLE times the control error. All other parts then count as slow. Let q be the
# speed of a part that is kept out, divided by the speed of the states that drive this part. The rounding errors of the
# states of the part grow with q. So once the part has settled, u is computed from the past and present states that
# drive the part. This computation of u neglects the effect of the fast states on the process, which decreases with the
# square of q.
STIFF = 100.0
VERY_STIFF = 1e6
SENDS_LITTLE = 1e-5
# Number of time constants after which a mode is negligible, even if its initial value is 1e7 times u.
FADED_AWAY = 60.0


class Cut(NamedTuple):
    """The loop opened at the dead time, driven by w(t) = v(t - delay), the delayed process input.

    The equations are x' = A x + B w, v = Cv x + D w and outputs = C x + direct w, with x(0) = x0. Each step input is a
    constant state.
    """

    A: Array  # (n, n)
    B: Array  # (n, channels)
    Cv: Array  # (channels, n)
    D: Array  # (channels, channels)
    C: Array  # (3, n), rows: y, running integral of y, u
    direct: Array  # (3, channels)
    x0: Array  # (n, inputs), the state just after a unit step on each input
    delay: float
    # (ages, n), coefficients of x(t), x(t - delay), ... in u after the fast part of u has settled. There are no rows if
    # no fast part is kept out of the process.
    settled_u: Array
    settling: float  # after each multiple of the delay, the fast part settles within this time


class _Blocks(NamedTuple):
    """The fractions of a loop, in the units of a `Cut`."""

    blocks: Mapping[str, Fraction]
    open_loop: Fraction
    delay: float


# Channels of the dead time. INPUT is the process input. If fast parts of the controller are kept out of the process,
# INPUT lacks their contribution, and there are two more channels. ERROR is the control error, which drives the fast
# parts. RUSH is the contribution of the fast states to the process output.
INPUT, ERROR, RUSH = range(3)


class _States:
    """Equations of the cut loop, to which blocks are appended: x' = A x + B W.

    W are the signals at the end of the dead time. A signal of the loop is a row of coefficients of x and W.
    """

    def __init__(self, size: int, inputs: int, channels: int) -> None:
        self.size, self.moves = size, np.zeros((size, size + channels))
        self.A, self.B = self.moves[:, :size], self.moves[:, size:]
        self.x0 = np.eye(size, inputs)  # a step input is a constant state of 1
        self.used = inputs

    def signal(self, place: int) -> Array:
        """Return one element of (x, W) as a signal, or the signal 0 for the index -1."""
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

    def append_decoupled(self, part: Part, source: Array, driving: int) -> tuple[slice, Array]:
        """Append a fast part, whose states are stored as distances from their quasi-steady values X x.

        The first `driving` states of the loop, here called x, drive the part. Return the indices of the distances, and
        X. The output of the part is c (X x + distance).

        Notes
        -----
        The part is q' = A q + b row x, and x' = A_x x + delayed signals. If X solves the Sylvester equation
        A X - X A_x = -b row, the distance q - X x is driven only by jumps and by the delayed signals.
        """
        x, places = slice(driving), slice(self.used, self.used + part.b.size)
        # One large linear system is solved, because a Schur form would lose digits if the speeds differ so much.
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
        return places, X


@lru_cache(maxsize=64)
def cut_at_delay(loop: Loop, inputs: str, unit: float = 1.0) -> Cut:
    """Open the loop at its dead time. `inputs` names the step inputs: letters out of "r", "d" and "n".

    In the cut loop, the unit of time is `unit` times as long, and the values of u are `unit` times as large.

    Raises
    ------
    ValueError
        If the loop is ill-posed, or if its coefficients overflow.
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
    """Realise a loop that is opened at its dead time.

    Notes
    -----
    States are appended in this order: step inputs, process, integral of y, prefilter, slow parts of the controller,
    fast parts.

    The poles of a fast part of the controller are much faster than all states that drive the part. There are two cases:

    * A fast part is usually decoupled. Its states are stored as distances from X x (see `append_decoupled`). Then u
      contains the slow states times H(A_x), the transfer function of the fast part evaluated at the matrix of the slow
      states.
    * A very stiff part is kept out of the process. Its kicks are up to 1e8 times as large as their effect on the
      process output, so that large numbers would cancel in the process. The dead time then has three channels. The
      channel ERROR drives the process with the quasi-steady effect of the part, and the channel RUSH adds the effect of
      the fast states to the process output.
    """
    process, prefilter = realise(*loop.blocks["process"]), realise(*loop.blocks["prefilter"])
    control = loop.blocks["controller"], loop.blocks["output_filter"]
    parts, direct = parallel(*control)
    driving_poles = _poles(loop, "prefilter").tolist() + _poles(loop, "process").tolist()
    fastest = max(map(abs, driving_poles), default=0.0)
    above, below = (abs(_value(p, 1j * fastest)) for p in loop.open_loop)
    slow, apart = len(parts), False
    if above < HIGH_GAIN * below:
        speeds = [abs(part.poles[0]) for part in parts]
        slow = sum(speed <= STIFF * fastest for speed in speeds)
        apart = slow < len(parts) and _sends_little(loop, parts[slow:], direct, fastest)
        if not apart:
            slow = sum(speed <= FASTER * fastest for speed in speeds)
    fast = parts[slow:]
    size = len(inputs) + process.b.size + 1 + prefilter.b.size + sum(part.b.size for part in parts)
    channels = 3 if apart else 1
    states = _States(size, len(inputs), channels)
    r, d, n = (inputs.find(key) for key in "rdn")

    y = states.append_series(process, states.signal(size + INPUT), process.d)
    fast_fraction: tuple[Any, Any] = (
        without_slow_parts(parts[:slow], *control, fast) if fast else (np.zeros(1), np.zeros(0))
    )
    if apart:
        # The quasi-steady effect of the fast parts is their transfer function, evaluated at the matrix of the process.
        states.B[len(inputs) : states.used, ERROR] = times_function(process.b, process.A.T, *fast_fraction)
        y[size + RUSH] = 1.0
    area = states.append_series(StateSpace(np.zeros((1, 1)), np.array([unit]), np.ones(1), 0.0), y)
    filtered = states.append_series(prefilter, states.signal(r), prefilter.d)
    error, driving = filtered - y - states.signal(n), states.used
    u = direct * error
    if fast:  # the transfer function of the fast parts contains the direct feedthrough, and is added below
        u[:size] = 0.0
    for part in parts[:slow]:
        u += states.append_series(part, error)
    rows, A, B, slow_states = np.array([y, area, u]), states.A, states.B, states.used
    if fast:
        u_row, rush = rows[2, :size], np.zeros(size)  # `u_row` is a view of `rows`
        u_row[:driving] += times_function(error[:driving], A[:driving, :driving], *fast_fraction)
        num, poles = loop.blocks["process"][0] / loop.blocks["process"][1][0], _poles(loop, "process")
        for part in fast:
            place, X = states.append_decoupled(part, error, driving)
            u_row[place] = part.c
            if apart:
                rush[place] = times_function(part.c, part.A, num, poles)
                rush[:driving] += rush[place] @ X
    v = (u if apart else rows[2]) + states.signal(d)
    Cv, D, settled, settling = v[None, :size], v[None, size:], np.zeros((0, size)), np.inf
    if apart:
        Cv, D = np.stack([v[:size], error[:size], rush]), np.zeros((channels, channels))
        D[ERROR] = error[size:]
        slow_places = slice(slow_states)
        settled = np.zeros((AGES if loop.delay else 1, size))
        settled[:, slow_places] = times_ring_function(
            error[slow_places],
            error[size:],
            (A[slow_places, slow_places], B[slow_places], Cv[:, slow_places], D),
            *fast_fraction,
            bool(loop.delay),
        )
        settled[0] += u[:size]
        settling = FADED_AWAY / float(np.min(np.abs(fast[0].poles)))
    C, direct_C = rows[:, :size], rows[:, size:]
    if not loop.delay:  # close the loop by W = Cv x + D W
        W = np.linalg.solve(np.eye(channels) - D, Cv)
        A, C = A + B @ W, C + direct_C @ W
        B, Cv, D, direct_C = (np.zeros_like(x) for x in (B, Cv, D, direct_C))
    if not (np.isfinite(A).all() and np.isfinite(B).all() and np.isfinite(C).all()):
        raise ValueError("the coefficients of the loop differ too much in size: their products overflow")
    return _balanced(Cut(A, B, Cv, D, C, direct_C, states.x0, loop.delay, settled, settling))


def _balanced(cut: Cut) -> Cut:
    """Change the units of the states so that rows and columns of |A| + |B| |Cv| are of similar size.

    The units are powers of 2, so that nothing is rounded. A coefficient that is much smaller than the largest
    coefficient is then negligible for every state.
    """
    scale = dgebal(np.abs(cut.A) + np.abs(cut.B) @ np.abs(cut.Cv), scale=1)[3]
    return cut._replace(
        A=cut.A * scale / scale[:, None],
        B=cut.B / scale[:, None],
        Cv=cut.Cv * scale,
        C=cut.C * scale,
        direct=np.ascontiguousarray(cut.direct),
        x0=cut.x0 / scale[:, None],
        settled_u=cut.settled_u * scale,
    )


def _sends_little(loop: _Blocks, fast: tuple[Part, ...], direct: float, driving: float) -> bool:
    """Return True if the kicks of very fast parts have almost no effect on the output of the process.

    The height of a kick is the direct feedthrough or, if larger, the gain of controller and output filter at the speed
    of a part. `driving` is the speed of the fastest state that drives the parts.
    """
    speeds = [float(np.abs(pole)) for part in fast for pole in part.poles]
    process, control, output_filter = (loop.blocks[name] for name in BLOCKS[:3])
    if not min(speeds) > VERY_STIFF * driving or len(process[0]) == len(process[1]):
        return False
    kick = max(abs(direct), *(abs(_ratio(control, 1j * x) * _ratio(output_filter, 1j * x)) for x in speeds))
    return bool(abs(_ratio(process, 1j * min(speeds))) * kick < SENDS_LITTLE)


def _ratio(block: tuple[Array, Array], s: complex) -> Any:
    return _value(block[0], s) / _value(block[1], s)


def _poles(loop: _Blocks, block: str) -> Array:
    return roots(loop.blocks[block][1])


def _value(polynomial: Array, s: complex) -> Any:
    """Return the value of a polynomial."""
    value = 0j
    for coefficient in polynomial.tolist():
        value = value * s + coefficient
    return np.complex128(value)
