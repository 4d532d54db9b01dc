"""Exponentials of the block Toeplitz matrix of a loop with dead time: see `pidalab.simulation.exact`."""

from __future__ import annotations

import numpy as np

from pidalab._check import Array
from pidalab.simulation.realisation import Cut

LARGEST = 4000  # states in a stack: beyond, the simulation takes too long
FADED = 1e-24  # size, relative to the largest, below which a coefficient of a short exponential is dropped
FORGOTTEN = 1e-20  # size, relative to the largest, below which the influence of a distant past is nothing in double


class Ladder:
    """Exponentials of the ring matrix A(z) over step * 2^p, cut off after `depth` powers of z.

    A rung is the array of its coefficients, (powers of z, order, order), without the 1 of the exponential and as long
    as the coefficients matter. Stacks are arrays (order, depth + 1, columns), the newest state first.
    """

    def __init__(self, cut: Cut, depth: int, step: float, longest: float) -> None:
        self.cut, self.depth, self.order = cut, depth, cut.b.size
        delayed = np.abs(cut.b).sum() * np.abs(cut.c_v).max() * np.float64(max(1.0, abs(cut.d_v))) ** depth
        norm = float(np.abs(cut.A).sum(axis=0).max()) + delayed
        if not norm * step < 1e300:
            raise ValueError("the response of the unstable loop leaves the range of numbers; shorten t")
        low = -max(0, int(np.ceil(np.log2(2.0 * norm * step)))) if norm else 0
        high = max(low, int(np.floor(np.log2(longest / step))))
        self.steps = [step * 2.0**p for p in range(low, high + 1)]
        self.rungs = [self._series(self.steps[0])]
        for _ in self.steps[1:]:
            self.rungs.append(self._doubled(self.rungs[-1]))

    def _oldest(self) -> Array:
        """Return the stacks with a unit state in the oldest place: what becomes of them are the coefficients."""
        stacks = np.zeros((self.order, self.depth + 1, self.order))
        stacks[:, -1] = np.eye(self.order)
        return stacks

    def _series(self, tau: float) -> Array:
        """Taylor series of exp(A(z) tau) - 1, for small tau."""
        oldest = self._oldest()
        change = self._taylor(oldest, np.full(self.order, tau)) - oldest
        return _shortened(change.transpose(1, 0, 2)[::-1])

    def _taylor(self, stacks: Array, tau: Array) -> Array:
        """Carry stacks over durations no longer than the lowest rung (norm * tau <= 1/2)."""
        total, term = stacks.copy(), stacks
        for k in range(1, 18):
            term = self._derivative(term) * (tau / k)
            total += term
        return total

    def _derivative(self, stacks: Array) -> Array:
        """Apply A(z): every state of the stack is driven by the delayed process input of the next older one."""
        flat = stacks.reshape(self.order, -1)
        v = (self.cut.c_v @ flat).reshape(self.depth + 1, -1)
        if self.cut.d_v:
            for age in range(self.depth - 1, -1, -1):
                v[age] += self.cut.d_v * v[age + 1]
        change = (self.cut.A @ flat).reshape(stacks.shape)
        change[:, :-1] += self.cut.b[:, None, None] * v[1:]
        return change

    def _doubled(self, rung: Array) -> Array:
        """exp(2a) - 1 = 2 (exp(a) - 1) + (exp(a) - 1)^2."""
        count = min(2 * len(rung) - 1, self.depth + 1)
        square = np.zeros((self.order, count * self.order))
        strip = rung.transpose(1, 0, 2).reshape(self.order, -1)
        for j, coefficient in enumerate(rung):
            width = min(strip.shape[1], (count - j) * self.order)
            square[:, j * self.order : j * self.order + width] += coefficient @ strip[:, :width]
        element = square.reshape(self.order, count, self.order).transpose(1, 0, 2)
        element[: len(rung)] += 2 * rung
        return _shortened(element)

    def advanced(self, stacks: Array, rung: Array) -> Array:
        """Carry stacks over the duration of one rung."""
        columns = stacks.shape[2]
        before = stacks.reshape(self.order, -1)
        after = before.copy()
        for j, coefficient in enumerate(rung):
            after[:, : before.shape[1] - j * columns] += coefficient @ before[:, j * columns :]
        return after.reshape(stacks.shape)

    def continued(self, rows: Array, rung: Array) -> Array:
        """Let rows (rows, depth + 1, order) read the stack one rung later."""
        after = rows.copy()
        for j, coefficient in enumerate(rung):
            after[:, j:] += (rows.reshape(-1, self.order) @ coefficient).reshape(rows.shape)[:, : self.depth + 1 - j]
        return after

    def carry(self, stacks: Array, tau: Array) -> Array:
        """Carry stacks over durations tau, one for each column."""
        stacks, tau = stacks.copy(), tau.copy()
        for step, rung in zip(reversed(self.steps), reversed(self.rungs), strict=True):
            while np.any(due := tau >= step):
                stacks[:, :, due] = self.advanced(stacks[:, :, due], rung)
                tau[due] -= step
        rest = tau > 0
        if np.any(rest):
            stacks[:, :, rest] = self._taylor(stacks[:, :, rest], tau[rest])
        return stacks

    def transition(self, tau: float) -> Array:
        """Return the Phi_j(tau) side by side, shape (order, (depth + 1) order)."""
        return self.carry(self._oldest(), np.full(self.order, tau))[:, ::-1].reshape(self.order, -1)


def _shortened(element: Array) -> Array:
    """Drop the last coefficients of a ring element once they no longer matter."""
    size = np.abs(element).max(axis=(1, 2))
    return element[: np.flatnonzero(size > FADED * size.max()).max(initial=0) + 1]


def ladder_for(cut: Cut, delay: float, intervals: int, step: float, end: float) -> tuple[Ladder, Array]:
    """Return a ladder deep enough for the loop's memory, and its transition over one dead time."""
    if delay == 0.0:
        return Ladder(cut, 0, step, end), np.zeros((cut.b.size, cut.b.size))
    depth = min(intervals, 24)
    while True:
        if depth * cut.b.size > LARGEST:
            raise ValueError(
                f"the loop still remembers what happened {depth // 2} dead times ago (|L| is near 1 or above at "
                f"infinite frequency), which can be followed over {LARGEST // cut.b.size} dead times and not "
                f"over {intervals}; shorten t"
            )
        ladder = Ladder(cut, depth, step, max(delay, step))
        transition = ladder.transition(delay)
        sizes = np.abs(transition).reshape(cut.b.size, depth + 1, cut.b.size).max(axis=(0, 2))
        if depth == intervals or sizes[-3:].max() < FORGOTTEN * sizes.max():
            return ladder, transition
        depth = min(2 * depth, intervals)
