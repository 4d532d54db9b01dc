"""Exponentials of the block Toeplitz matrix of a loop with dead time: see `pidalab.simulation.exact`."""

from __future__ import annotations

import numpy as np

from pidalab._check import Array
from pidalab.simulation.realisation import Cut

LARGEST = 1500  # states in a stack: beyond, its matrices take too much memory
FORGOTTEN = 1e-20  # size, relative to the largest, below which the influence of a distant past is nothing in double


class Ladder:
    """Exponentials of the ring matrix A(z) over step * 2^p, cut off after `depth` powers of z."""

    def __init__(self, cut: Cut, depth: int, step: float, longest: float) -> None:
        self.cut, self.depth, self.order = cut, depth, cut.b.size
        delayed = np.abs(cut.b).sum() * np.abs(cut.c_v).max() * max(1.0, abs(cut.d_v)) ** depth
        norm = float(np.abs(cut.A).sum(axis=0).max()) + delayed
        low = -max(0, int(np.ceil(np.log2(2.0 * norm * step)))) if norm else 0
        high = max(low, int(np.floor(np.log2(longest / step))))
        self.steps = [step * 2.0**p for p in range(low, high + 1)]
        self.rungs = [self.toeplitz(self._series(self.steps[0]))]
        for _ in self.steps[1:]:
            self.rungs.append(self._doubled(self.rungs[-1]))

    def toeplitz(self, element: Array) -> Array:
        """Return the matrix by which a ring element acts on a stack (newest state first)."""
        n, d = self.depth + 1, self.order
        padded = np.concatenate([element, np.zeros((n, d, d))])
        shift = np.arange(n)[None, :] - np.arange(n)[:, None]  # negative entries pick the zeros
        return padded[shift].transpose(0, 2, 1, 3).reshape(n * d, n * d)

    def _series(self, tau: float) -> Array:
        """Taylor series of exp(A(z) tau) - 1 as a ring element, for small tau."""
        columns = np.zeros((self.depth + 1, self.order, self.order))
        columns[-1] = np.eye(self.order)
        flat = columns.reshape(-1, self.order)
        change = self._taylor(flat, np.full(self.order, tau)) - flat
        return change.reshape(columns.shape)[::-1]

    def _taylor(self, stacks: Array, tau: Array) -> Array:
        """Carry stacks over durations no longer than the lowest rung (norm * tau <= 1/2)."""
        total, term = stacks.copy(), stacks
        for k in range(1, 18):
            term = self._derivative(term) * (tau / k)
            total += term
        return total

    def _derivative(self, stacks: Array) -> Array:
        """Apply A(z): every state of the stack is driven by the delayed process input of the next older one."""
        states = stacks.reshape(self.depth + 1, self.order, -1)
        v = self.cut.c_v @ states
        if self.cut.d_v:
            for age in range(self.depth - 1, -1, -1):
                v[age] += self.cut.d_v * v[age + 1]
        change = self.cut.A @ states
        change[:-1] += self.cut.b[:, None] * v[1:, None, :]
        return change.reshape(stacks.shape)

    def _doubled(self, rung: Array) -> Array:
        """exp(2a) - 1 = 2 (exp(a) - 1) + (exp(a) - 1)^2; only the last block column is multiplied out."""
        last = rung[:, -self.order :]
        column = (2 * last + rung @ last).reshape(self.depth + 1, self.order, self.order)
        return self.toeplitz(column[::-1])

    def carry(self, stacks: Array, tau: Array) -> Array:
        """Carry stacks (columns) over durations tau, one for each column."""
        stacks, tau = stacks.copy(), tau.copy()
        for step, rung in zip(reversed(self.steps), reversed(self.rungs), strict=True):
            while np.any(due := tau >= step):
                stacks[:, due] += rung @ stacks[:, due]
                tau[due] -= step
        rest = tau > 0
        if np.any(rest):
            stacks[:, rest] = self._taylor(stacks[:, rest], tau[rest])
        return stacks

    def transition(self, tau: float) -> Array:
        """Return the Phi_j(tau) side by side, shape (order, (depth + 1) order)."""
        newest = np.zeros(((self.depth + 1) * self.order, self.order))
        newest[-self.order :] = np.eye(self.order)
        blocks = self.carry(newest, np.full(self.order, tau)).reshape(self.depth + 1, self.order, self.order)
        return blocks[::-1].transpose(1, 0, 2).reshape(self.order, -1)


def ladder_for(cut: Cut, delay: float, intervals: int, step: float, end: float) -> tuple[Ladder, Array]:
    """Return a ladder deep enough for the loop's memory, and its transition over one dead time."""
    if delay == 0.0:
        return Ladder(cut, 0, step, end), np.zeros((cut.b.size, cut.b.size))
    depth = min(intervals, 24)
    while True:
        if depth * cut.b.size > LARGEST:
            raise ValueError(
                f"the loop still remembers what happened {depth // 2} dead times ago (|L| is near 1 or above at infinite "
                f"frequency), which can be followed over {LARGEST // cut.b.size} dead times and not over {intervals}; "
                "shorten t"
            )
        ladder = Ladder(cut, depth, step, max(delay, step))
        transition = ladder.transition(delay)
        sizes = np.abs(transition).reshape(cut.b.size, depth + 1, cut.b.size).max(axis=(0, 2))
        if depth == intervals or sizes[-3:].max() < FORGOTTEN * sizes.max():
            return ladder, transition
        depth = min(2 * depth, intervals)
