"""Step responses of a loop with dead time, from dead time to dead time: see `pidalab.simulation.exact`.

A stack is a row of states, oldest first: the states now at its end, those of one dead time ago before them.

How much is remembered, and what bounds the rest. An element of reach R makes the states of age a out of those of the
ages a to a + R - 1, and of no others. So who wants the youngest m ages after it needs the youngest m + R - 1 before it,
and may forget the rest without any error. Every stack here is cut by this rule, backwards from what the outputs read:
each element that is still to be applied adds its reach less 1, up to the beginning of time, before which all states
are 0. A filter that remembers farther inside a dead time than across a whole one (its rungs reach 54 where the whole
reaches 16) makes long stacks, not wrong ones.

Where one rung is to be applied r times, its reach does not count r times. The binary digits of r say which higher rungs
have the same product, and the reaches of those count. They are shorter than r times the lower one, since each lost its
last coefficients when it was formed: those below `DROPPED` of its largest. So a stack that is cut by them lacks, at the
end, only what those coefficients would have made of its oldest states. Outputs leave out the same share of what they
read. In all, what is missing is at most `DROPPED`, times the number of rungs, times the largest coefficient of a rung,
times what the others make of it, times the largest old state, in the balanced units of the states. Where nothing is
much louder than what is asked for, that is far below rounding; where coefficients or states are 1e10 times as large,
rounding, 1e10 times as large as this share, takes the digits first, and `pidalab.simulation.exact` looks at what is
left. It does not see what is left out here, as other units leave out the same.
"""

from __future__ import annotations

import math

import numpy as np

from pidalab._check import Array
from pidalab._compiled import compiled
from pidalab.simulation.realisation import Cut
from pidalab.simulation.ring import add_rows, ladder, transition
from pidalab.simulation.stacks import (
    advanced,
    ages_needed,
    derive,
    distance_after,
    first_time,
    is_digit,
    nonzero,
    output_rows,
    summed,
)

MAX_STACK = 4000  # states in a stack: beyond, the simulation takes too long
MAX_WORK = 4e9  # multiplications from dead time to dead time beyond which it takes too long: seconds
MAX_ANCHORS = 1e7  # states at the multiples of the dead time that are kept
LONGEST_RUN = 8  # logarithm to base 2 of the requested times served from one stack, at most
# logarithm to base 2 of the lowest rungs that a series spans when a stack is carried: a longer series is cheaper than
# three rungs, and its terms, up to e^4 in units of the states, cost less than two digits
SERIES = 3
BLOCK = 64  # dead times whose derivatives are kept beside those that a stack reads
DONE, TOO_DEEP, TOO_LARGE, TOO_MANY = range(4)


class ManyDeadTimes(ValueError):
    """More dead times than can be followed one after the other."""


def responses(cut: Cut, n: int, step: float, norm: float) -> Array:
    """Values of y, its running integral and u at n times from 0, for a unit step on each input: (inputs, 3, n).

    The norm, that of `norm_over` or a larger one, says how short the lowest rung of the ladder is.
    """
    intervals = _intervals(cut, n, step)
    result, depth, status = _responses(*cut, step, n, intervals, norm)
    if status == TOO_LARGE:
        raise ValueError("the response of the unstable loop leaves the range of numbers; shorten t")
    if status == TOO_MANY:
        raise ManyDeadTimes(_too_many((n - 1) * step / cut.delay))
    if status == TOO_DEEP:
        raise ValueError(
            f"the loop still remembers what happened {depth} dead times ago (|L| is near 1 or above at "
            f"infinite frequency), which can be followed over {MAX_STACK // cut.x0.shape[0]} dead times and not "
            f"over {(n - 1) * step / cut.delay:.0f}; shorten t"
        )
    return result


def _intervals(cut: Cut, n: int, step: float) -> int:
    """Return how many dead times end within n times."""
    spanned = (n - 1) * step / cut.delay if cut.delay else 0.0
    if not spanned * cut.x0.shape[0] < MAX_ANCHORS:
        raise ManyDeadTimes(_too_many(spanned))
    # a time as close to a multiple of the dead time as rounding is that multiple
    return int(spanned * (1.0 + 8.0 * np.finfo(float).eps))


def norm_over(cut: Cut, n: int, step: float) -> float:
    """Bound the block Toeplitz matrix, over as many ages as there are within n times."""
    intervals = _intervals(cut, n, step)
    through, power, ages = np.abs(cut.Cv), np.abs(cut.D), 1
    with np.errstate(over="ignore", invalid="ignore"):
        while ages < intervals and power.any():  # twice as many ages of the sum of all powers
            through = through + power @ through
            power = power @ power
            ages *= 2
        bound = float((np.abs(cut.A) + np.abs(cut.B) @ through).sum(axis=0).max(initial=0.0))
    return bound if math.isfinite(bound) else math.inf


def _too_many(intervals: float) -> str:
    return (
        f"t spans {intervals:.3g} dead times, too many to follow one after the other; shorten t, or leave out a dead "
        "time as short as that"
    )


@compiled
def _responses(A, B, Cv, D, C, direct, x0, delay, settled, settling, step, n, intervals, norm):
    """Step responses at n times, the number of dead times that matter, and whether all went well."""
    size, inputs = x0.shape
    result = np.zeros((inputs, 3, n))
    inside = n - 1  # steps in a dead time
    if delay > 0.0:
        inside = int(min(delay / step * (1.0 + 1e-12), 1e15))
    # a long run makes its rows dear, a short one asks for many stacks: in all least near the root of n / 3
    power = 0
    while power < LONGEST_RUN and 2.0 * 4.0**power <= n / 3.0 + 1.0:
        power += 1
    # rungs up to a run of times, or to the dead time, which is more or less
    top = power
    if delay > 0.0:
        top = 0
        while 2.0 ** (top + 1) <= inside:
            top += 1
        while inside == 0 and step * 2.0**top > delay * (1.0 + 1e-12):
            top -= 1
    most = min(intervals + 1, MAX_STACK // size + 1)
    rungs, low = ladder(A, B, Cv, D, norm, step, top, most)
    if len(rungs) == 0:
        return result, 0, TOO_LARGE
    # the series that carries a stack: the time that it spans, and the number of its terms
    spanned = min(SERIES, -low)
    bits = min(-low, len(rungs))  # no distance is longer than a step, or than a dead time
    delta = step * 2.0 ** (low + spanned)
    series, term = 1, norm * delta
    while term > 1e-18:
        series += 1
        term *= norm * delta / series
    aligned = True
    for k in range(1, intervals + 1):
        aligned = aligned and distance_after(k, first_time(k, step, delay), step, delay) == 0.0
    if aligned:  # every stack begins at a multiple of the dead time: there is nothing to carry
        series = 0
    for rung in rungs:
        if rung.shape[1] == most * size and most < intervals + 1:
            return result, most, TOO_DEEP

    # states at the multiples of the dead time, from each to all that remember it
    anchors = np.zeros((inputs, (intervals + 1) * size))
    for i in range(inputs):
        for j in range(size):
            anchors[i, j] = x0[j, i]
    if intervals > 0:
        whole = transition(rungs, step, low, delay, most, A, B, Cv, D)
        reach = whole.shape[1] // size
        if reach == most and most < intervals + 1:
            return result, most, TOO_DEEP
        if 1.0 * intervals * reach * size * size * inputs > MAX_WORK:
            return result, most, TOO_MANY
        for i in range(inputs):
            own = anchors[i]
            for at in range(0, intervals * size, size):
                for j in range(at, at + size):
                    own[j + size] += own[j]
                reached = own[at + size : min(own.size, at + size + whole.shape[1])]
                add_rows(reached, own[at : at + size], whole, 0, 0)

    # what the outputs read of a stack, and the ages that are needed on the way to it
    # one run if that is but little longer, and spares a second stack
    run = min(n, inside + 1) if 2 * min(n, inside + 1) <= 3 * 2**power else 2**power
    rows = output_rows(C, direct, Cv, D, settled, most, run, rungs, -low)
    outputs = rows.shape[1] // run
    read = rows.shape[0] // size
    if read == most and most < intervals + 1:
        return result, most, TOO_DEEP
    needed = ages_needed(read, rungs, size, power - low, inside // run)
    deepest = needed[needed.size - 1]
    for p in range(spanned, bits):
        deepest += rungs[p].shape[1] // size - 1
    deepest = min(deepest, intervals + 1)

    # derivatives of the states at the multiples, as far back as a stack reads
    room = min(intervals + 1, deepest + BLOCK)
    terms = np.zeros((inputs, series + 1, room * size))
    delayed = np.zeros((inputs, series + 1, B.shape[1]))
    places, numbers = nonzero(A)
    start = 0  # the multiple at the beginning of `terms`
    out = np.zeros(rows.shape[1])
    work = 0.0
    first = 0
    for k in range(intervals + 1):
        if k - start == room:
            older = (deepest - 1) * size
            for i in range(inputs):
                for m in range(series + 1):
                    for j in range(older):
                        terms[i, m, j] = terms[i, m, (room - deepest + 1) * size + j]
            start = k - deepest + 1
        here = (k - start) * size
        for i in range(inputs):
            for j in range(size):
                terms[i, 0, here + j] = anchors[i, k * size + j]
            derive(terms[i], here, delta, A, places, numbers, B, Cv, D, delayed[i])
        last = n if k == intervals else min(n, first_time(k + 1, step, delay))
        if first >= last:
            continue
        # from the multiple to the first time asked for: so many spans of the series, by rungs, and a share of one
        distance = distance_after(k, first, step, delay)
        count = np.floor(distance / delta)
        share = distance / delta - count
        runs = (last - first - 1) // run  # to go on by
        ages = needed[runs]
        for p in range(spanned, bits):
            if is_digit(count, p - spanned):
                ages += rungs[p].shape[1] // size - 1
        ages = min(ages, k + 1)
        for i in range(inputs):
            left, stack = ages, summed(terms[i], here + size - ages * size, here + size, share)
            for p in range(bits - 1, spanned - 1, -1):
                if is_digit(count, p - spanned):
                    keep = min(k + 1, needed[runs])
                    for lower in range(spanned, p):
                        if is_digit(count, lower - spanned):
                            keep = min(k + 1, keep + rungs[lower].shape[1] // size - 1)
                    work += 1.0 * left * rungs[p].shape[1] * size
                    stack, left = advanced(stack, size, rungs[p], keep), keep
            for begin in range(first, last, run):
                if begin > first:
                    keep = min(left, needed[(last - begin - 1) // run])
                    work += 1.0 * left * rungs[power - low].shape[1] * size
                    stack, left = advanced(stack, size, rungs[power - low], keep), keep
                used = min(read, left)
                for j in range(out.size):
                    out[j] = 0.0
                add_rows(out, stack[(left - used) * size :], rows, (read - used) * size, 0)
                for m in range(min(run, last - begin)):
                    for q in range(3):
                        result[i, q, begin + m] = out[outputs * m + q]
                    if outputs > 3 and distance + step * (begin + m - first) > settling:
                        result[i, 2, begin + m] = out[outputs * m + 3]
                if outputs > 3 and distance == 0.0 and begin == first and k > 0:
                    # what jumps at a multiple moves the fast part only after it: the oldest states count just then
                    settled_u = 0.0
                    for j in range(size if left == k + 1 else 0, left * size):
                        at = j - left * size + read * size
                        if at >= 0:
                            settled_u += stack[j] * rows[at, 3]
                    result[i, 2, begin] = settled_u
        if work > MAX_WORK:
            return result, most, TOO_MANY
        first = last
    return result, read, DONE
