"""Step responses of a loop with dead time, from dead time to dead time: see `pidalab.simulation.exact`.

A stack is an array (ages, states), oldest first: the states now in its last row, those of one dead time ago above.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgebal

from pidalab._check import Array
from pidalab._compiled import compiled
from pidalab.simulation.realisation import Cut
from pidalab.simulation.ring import FADED, add_rows, ladder, shortened, taylor, transition

LARGEST = 4000  # states in a stack: beyond, the simulation takes too long
WORK = 5e8  # multiplications from dead time to dead time beyond which it takes too long
STORED = 1e7  # states at the multiples of the dead time that are kept at most
# size, relative to the largest, below which the influence of a distant past is nothing in double
FORGOTTEN = 1e-20
LONGEST_RUN = 6  # logarithm to base 2 of the requested times served from one stack, at most
DONE, TOO_DEEP, TOO_LARGE, TOO_MANY = range(4)


class ManyDeadTimes(ValueError):
    """More dead times than can be followed one after the other."""


def responses(cut: Cut, n: int, step: float) -> Array:
    """Values of y, its running integral and u at n times from 0, for a unit step on each input: (inputs, 3, n)."""
    intervals = (n - 1) * step / cut.delay if cut.delay else 0.0
    if not intervals * cut.x0.size < STORED:
        raise ManyDeadTimes(_too_many(intervals))
    result, depth, status = _responses(*_balanced(cut), step, n)
    if status == TOO_LARGE:
        raise ValueError("the response of the unstable loop leaves the range of numbers; shorten t")
    if status == TOO_MANY:
        raise ManyDeadTimes(_too_many(intervals))
    if status == TOO_DEEP:
        raise ValueError(
            f"the loop still remembers what happened {depth} dead times ago (|L| is near 1 or above at "
            f"infinite frequency), which can be followed over {LARGEST // cut.b.size} dead times and not "
            f"over {intervals:.0f}; shorten t"
        )
    return result


def _balanced(cut: Cut) -> Cut:
    """Change the units of the states by powers of 2, so that rows and columns of |A| + |b c| are alike."""
    A, b, c, d, C, direct, x0, delay = cut
    scale = dgebal(np.abs(A) + np.abs(np.outer(b, c)), scale=1)[3]
    return Cut(
        A * scale / scale[:, None], b / scale, c * scale, d, C * scale, direct, x0 / scale[:, None], delay
    )


def _too_many(intervals: float) -> str:
    return (
        f"t spans {intervals:.3g} dead times, too many to follow one after the other; shorten t, or leave out a dead "
        "time as short as that"
    )


@compiled
def _carried(stack, tau, rungs, step, low, A, b, c, d):
    """Carry a stack over a duration: by the rungs that are its binary digits, and a Taylor series at the end."""
    ages = stack.shape[0]
    for p in range(len(rungs) - 1, -1, -1):
        duration = step * 2.0 ** (low + p)
        while tau >= duration:
            stack = _advanced(stack, rungs[p])
            tau -= duration
    if tau > 0.0:
        stack = _advanced(stack, taylor(tau, ages, A, b, c, d))
    return stack


@compiled
def _advanced(stack, rung):
    """Carry a stack over the duration of a rung: each state adds a row of it to its own age and to all younger ones."""
    ages, order = stack.shape
    after = stack.copy()
    flat = after.reshape(ages * order)
    for age in range(ages):
        add_rows(flat[age * order : min(flat.size, age * order + rung.shape[1])], stack[age], rung)
    return after


@compiled
def _rows(C, direct, c, d, levels, run, rungs, base):
    """What the outputs at `run` times in succession read of a stack: (its states, times and outputs)."""
    order, wide = C.shape[1], 3 * run
    ages = 1 if not direct.any() else min(levels, 2 if d == 0.0 else levels)
    rows = np.zeros((ages * order, wide))
    for q in range(3):
        rows[(ages - 1) * order :, q] = C[q]
        for age in range(1, ages):  # the direct part of an output reads all older process inputs
            rows[(ages - 1 - age) * order : (ages - age) * order, q] = direct[q] * d ** (age - 1) * c
    have, p = 3, base
    while have < wide:  # as many again, one rung later
        rung = rungs[p]
        reach = rung.shape[1] // order
        more = min(have, wide - have)
        new = min(levels, ages + reach - 1)
        longer = np.zeros((new * order, wide))
        longer[(new - ages) * order :, :have] = rows[:, :have]
        longer[(new - ages) * order :, have : have + more] = rows[:, :more]
        for age in range(new):
            least, most = max(0, age - ages + 1), min(reach, age + 1)  # ages that the rung adds
            read = rows[(ages - 1 - age + least) * order :]
            for i in range(order):
                out = longer[(new - 1 - age) * order + i, have : have + more]
                add_rows(out, rung[i, least * order : most * order], read)
        # drop ages that do not matter
        size = np.zeros(new)
        for age in range(new):
            for i in range((new - 1 - age) * order, (new - age) * order):
                for m in range(have + more):
                    size[age] = max(size[age], abs(longer[i, m]))
        ages = new
        while ages > 1 and size[ages - 1] <= FADED * size.max():
            ages -= 1
        rows, have, p = longer[(new - ages) * order :], have + more, p + 1
    return rows


@compiled
def _responses(A, b, c, d, C, direct, x0, delay, step, n):
    """Step responses at n times, the number of dead times that matter, and whether all went well."""
    size, channels = x0.shape
    result = np.zeros((channels, 3, n))
    # a time as close to a multiple of the dead time as rounding is that multiple
    eps = 8.0 * np.finfo(np.float64).eps
    interval = np.zeros(n, dtype=np.intp)
    if delay > 0.0:
        interval[:] = np.floor(step * np.arange(n) * (1.0 + eps) / delay)
    intervals = interval[n - 1]
    # rungs up to a run of times, or to the dead time if that is shorter
    top = LONGEST_RUN
    if delay > 0.0:
        top = int(np.floor(np.log2(delay / step) + 1e-12))
    growth = max(1.0, abs(d)) ** intervals if intervals > 0 else 0.0
    rungs, low = ladder(A, b, c, d, step, top, growth, min(intervals + 1, LARGEST // size + 1))
    if len(rungs) == 0:
        return result, 0, TOO_LARGE

    # the stack must reach as far back as the loop remembers
    levels = 1
    anchors = np.zeros((channels, (intervals + 1) * size))  # states at the multiples of the dead time
    anchors[:, :size] = x0.T
    if intervals > 0:
        most = min(intervals + 1, LARGEST // size + 1)
        whole = transition(rungs, step, low, delay, most, A, b, c, d)
        short = shortened(whole, FORGOTTEN)
        reach = short.shape[1] // size
        levels = min(intervals + 1, max(reach, 2))
        if reach == most and most < intervals + 1:
            return result, levels, TOO_DEEP
        if 1.0 * intervals * reach * size * size * channels > WORK:
            return result, levels, TOO_MANY
        for i in range(channels):
            own = anchors[i]
            for at in range(0, intervals * size, size):  # each adds to all that remember it
                for j in range(at, at + size):
                    own[j + size] += own[j]
                reached = own[at + size : min(own.size, at + size + short.shape[1])]
                add_rows(reached, own[at : at + size], short)

    # a long run makes its rows dear, a short one asks for many stacks: in all least near the root of n / 3
    power = min(LONGEST_RUN, int(np.rint(0.5 * np.log2(n / 3.0 + 1.0))))
    run = min(np.bincount(interval).max(), 2**power)
    rows = _rows(C, direct, c, d, levels, run, rungs, -low)

    out = np.zeros(3 * run)
    first = 0
    while first < n:
        k = interval[first]
        last = np.searchsorted(interval, k + 1)
        # from the multiple of the dead time to the first time asked for
        distance = step * first - k * delay
        if distance <= eps * step * first:
            distance = 0.0
        for i in range(channels):
            stack = np.zeros((levels, size))
            for age in range(min(levels, k + 1)):
                for j in range(size):
                    stack[levels - 1 - age, j] = anchors[i, (k - age) * size + j]
            stack = _carried(stack, distance, rungs, step, low, A, b, c, d)
            for start in range(first, last, run):
                if start > first:
                    stack = _advanced(stack, rungs[power - low])
                out[:] = 0.0
                add_rows(out, stack.reshape(levels * size)[levels * size - len(rows) :], rows)
                for m in range(min(run, last - start)):
                    for q in range(3):
                        result[i, q, start + m] = out[3 * m + q]
        first = last
    return result, levels, DONE
