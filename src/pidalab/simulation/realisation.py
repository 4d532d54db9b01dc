"""State-space form of a loop that is cut at its dead time.

A derivative filter a hundred thousand times faster than the plant computes s^2 y as a difference of nearly equal
states, divided by 1e-10: in double precision nothing is left. So the states are sorted by speed into groups, and groups
of different speed are decoupled exactly: what a fast block makes of a slow signal is then a row over the slow states
(the block's transfer function, evaluated at their matrix), and only its own fast transient stays a state.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_sylvester

from pidalab._check import Array
from pidalab.loop import Loop, require_well_posed

GAP = 10.0  # poles whose speeds differ by more than this factor go to different groups


class Cut(NamedTuple):
    """The loop opened at the dead time, driven by w(t) = v(t - delay), the delayed process input.

    x' = A x + b w,  v = c_v x + d_v w,  outputs = C x + d w, from x(0) = x0; the step inputs are states too.
    """

    A: Array  # (d, d)
    b: Array  # (d,)
    c_v: Array  # (d,)
    d_v: float
    C: Array  # (3, d), rows: y, running integral of y, u
    d: Array  # (3,)
    x0: Array  # (d, inputs), the state just after a unit step on each input


class Signal(NamedTuple):
    """A signal as a row over the states of each group, plus its direct share of w."""

    rows: list[Array]
    direct: float


def _monic(roots: Array) -> Array:
    """Return the real monic polynomial with these roots; 1 where there are none."""
    return np.atleast_1d(np.poly(roots)).real


class Block:
    """A proper rational function num/den, split into partial fractions by the speed of its poles."""

    def __init__(self, num: Array, den: Array, edges: Array) -> None:
        self.num, self.lead = num, den[0]
        self.poles = np.roots(den)
        self.group = np.searchsorted(edges, np.abs(self.poles))
        self.direct = num[0] / den[0] if len(num) == len(den) else 0.0
        self.fractions = [self._fraction(g) for g in range(edges.size + 1)]

    def _fraction(self, g: int) -> tuple[Array, Array, Array]:
        """Realise the partial fraction of group g as (A, b, c), worked out in the group's own time unit."""
        own, others = self.poles[self.group == g], self.poles[self.group != g]
        n = own.size
        unit = np.max(np.abs(own), initial=0.0) or 1.0
        M = np.eye(n, k=-1)  # multiplication by x = s/unit, modulo the group's own denominator
        M[:, -1:] = -_monic(own / unit)[:0:-1, None]
        numerator = np.zeros(n, dtype=complex)  # ascending powers of x
        for coefficient in self.num * unit ** np.arange(len(self.num) - 1.0, -1.0, -1.0):
            numerator = M @ numerator
            numerator[:1] += coefficient
        for p in others:
            numerator = np.linalg.solve(unit * M - p * np.eye(n), numerator)
        return unit * M, numerator.real * unit ** (1.0 - n) / self.lead, np.eye(1, n, n - 1)[0]

    def faster_numerator(self, g: int) -> Array:
        """Numerator of what is left when the groups up to g are taken out as partial fractions.

        The division runs from the highest power down, where the fast terms are: no small difference is formed.
        """
        slow_num, slow_den = np.zeros(1), np.ones(1)
        for k in range(g + 1):
            A, b, _ = self.fractions[k]
            den = _monic(self.poles[self.group == k])
            unit = A[1, 0] if b.size > 1 else 1.0
            num = (b * unit ** (b.size - 1.0 - np.arange(b.size)))[::-1]
            slow_num = np.polyadd(np.convolve(slow_num, den), np.convolve(num, slow_den) if b.size else [0.0])
            slow_den = np.convolve(slow_den, den)
        fast_den = self.lead * _monic(self.poles[self.group > g])
        return np.polydiv(np.polysub(self.num, np.convolve(slow_num, fast_den)), slow_den)[0]

    def without_group(self, g: int, row: Array, A: Array) -> Array:
        """Return row @ H(A) for the partial fractions of all groups but g: what they make of a signal of group g."""
        if not np.any(row):
            return np.zeros(row.size)
        value = np.zeros(row.size, dtype=complex)
        for coefficient in self.faster_numerator(g):
            value = value @ A + coefficient * row
        for p in self.poles[self.group > g]:
            value = np.linalg.solve((A - p * np.eye(row.size)).T, value)
        value /= self.lead
        for k in range(g):
            a, b, c = self.fractions[k]
            value += c @ solve_sylvester(a, -A, -np.outer(b, row)) if b.size else 0.0
        return value.real


class _Assembly:
    """States collected group by group while signals pass from block to block."""

    def __init__(self, groups: int, inputs: int) -> None:
        self.A = [np.zeros((0, 0)) for _ in range(groups)]
        self.b = [np.zeros(0) for _ in range(groups)]
        self.x0 = [np.zeros((0, inputs)) for _ in range(groups)]

    def pad(self, signal: Signal) -> Signal:
        """Lengthen the rows of an earlier signal to the states there are now."""
        rows = [np.append(row, np.zeros(b.size - row.size)) for row, b in zip(signal.rows, self.b, strict=True)]
        return Signal(rows, signal.direct)

    def add(self, first: Signal, second: Signal, sign: float = 1.0) -> Signal:
        """Return first + sign * second."""
        first, second = self.pad(first), self.pad(second)
        rows = [a + sign * b for a, b in zip(first.rows, second.rows, strict=True)]
        return Signal(rows, first.direct + sign * second.direct)

    def constant(self, index: int) -> Signal:
        """Append the constant behind step input number `index` (a state of the slowest group)."""
        self.A[0] = block_diag(self.A[0], 0.0)
        self.b[0] = np.append(self.b[0], 0.0)
        self.x0[0] = np.vstack([self.x0[0], np.eye(self.x0[0].shape[1])[index]])
        rows = [np.zeros(b.size) for b in self.b]
        rows[0][-1] = 1.0
        return Signal(rows, 0.0)

    def through(self, block: Block, source: Signal) -> Signal:
        """Append `block` driven by `source`; returns its output."""
        source = self.pad(source)
        groups = range(len(self.A))
        rows = [block.without_group(g, source.rows[g], self.A[g]) if self.b[g].size else np.zeros(0) for g in groups]
        fresh = []
        for g in groups:
            a, b, c = block.fractions[g]
            drive, start = b * source.direct, np.zeros((b.size, self.x0[g].shape[1]))
            for k in groups:
                if k != g and b.size and self.b[k].size:  # decoupled: the new state is x - X z
                    X = solve_sylvester(a, -self.A[k], -np.outer(b, source.rows[k]))
                    drive, start = drive - X @ self.b[k], start - X @ self.x0[k]
            fresh.append((a, np.outer(b, source.rows[g]), drive, start, c))
        for g, (a, coupling, drive, start, c) in enumerate(fresh):
            old = self.b[g].size
            self.A[g] = np.block([[self.A[g], np.zeros((old, c.size))], [coupling, a]])
            self.b[g] = np.append(self.b[g], drive)
            self.x0[g] = np.vstack([self.x0[g], start])
            rows[g] = np.append(rows[g], c)
        return Signal(rows, block.direct * source.direct)


def cut_at_delay(loop: Loop, inputs: str) -> Cut:
    """Open the loop at its dead time; `inputs` names the step inputs to keep, out of "r", "d", "n"."""
    require_well_posed(loop)
    (c_num, c_den), (f_num, f_den) = loop.blocks["controller"], loop.blocks["output_filter"]
    ratios = {
        "process": loop.blocks["process"],
        "control": (np.convolve(c_num, f_num), np.convolve(c_den, f_den)),
        "prefilter": loop.blocks["prefilter"],
        "integral": (np.ones(1), np.array([1.0, 0.0])),
    }
    speeds = np.sort(np.abs(np.concatenate([np.roots(den) for _, den in ratios.values()])))
    edges = np.array([np.sqrt(a * b) for a, b in pairwise(speeds) if b > GAP * a])
    blocks = {name: Block(num, den, edges) for name, (num, den) in ratios.items()}

    states = _Assembly(edges.size + 1, len(inputs))
    unit = {name: states.constant(i) for i, name in enumerate(inputs)}
    nothing = Signal([np.zeros(b.size) for b in states.b], 0.0)
    y = states.through(blocks["process"], nothing._replace(direct=1.0))
    area = states.through(blocks["integral"], y)
    setpoint = states.through(blocks["prefilter"], unit["r"]) if "r" in inputs else nothing
    measured = states.add(y, unit.get("n", nothing))
    u = states.through(blocks["control"], states.add(setpoint, measured, -1.0))
    v = states.add(u, unit.get("d", nothing))

    outputs = [states.pad(signal) for signal in (y, area, u)]
    cut = Cut(
        A=block_diag(*states.A),
        b=np.concatenate(states.b),
        c_v=np.concatenate(v.rows),
        d_v=v.direct,
        C=np.stack([np.concatenate(signal.rows) for signal in outputs]),
        d=np.array([signal.direct for signal in outputs]),
        x0=np.vstack(states.x0),
    )
    return cut if loop.process.delay else _closed_at_once(cut)


def _closed_at_once(cut: Cut) -> Cut:
    """Close a loop without dead time: w = v."""
    w = cut.c_v / (1 - cut.d_v)
    nothing = np.zeros_like(cut.b)
    return cut._replace(
        A=cut.A + np.outer(cut.b, w), b=nothing, c_v=nothing, d_v=0.0, C=cut.C + np.outer(cut.d, w), d=np.zeros(3)
    )
