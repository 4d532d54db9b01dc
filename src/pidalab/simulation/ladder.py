"""Compute step responses of a loop with dead time, one dead time after the other (see `pidalab.simulation.exact`).

The *age* of a state is the number of dead times by which it precedes the present. A *stack* is a row of states with the
ages m - 1, ..., 1, 0. A *power* is E - I, where E is the matrix exponential of the loop over `step` * 2^p, and I
is the unit matrix. Here `step` is the time between requested times, p is an integer, and ``powers[i]`` has p = low + i,
where low is the smallest p. Powers are elements of the ring in `pidalab.simulation.ring`. The *reach* of a power is the
number of ages that the power reads.

Notes
-----
*Length of a stack.* A power of reach R computes the new state of age a from the old states of ages a to a + R - 1. So
the m youngest new states depend on the m + R - 1 youngest old states. Every stack is truncated to the number of ages
that the outputs read, plus R - 1 for each power that is still to be applied. States before t = 0 are left out as well,
because they are 0. This truncation adds no error.

*Error bound.* If one power of reach R were applied r times, the stack would need r (R - 1) more ages. Instead, one
higher power is applied for each binary digit 1 of r. Together the higher powers have the same effect. Their total reach
is smaller, because the negligible last coefficients of each power are dropped (see `ring.shortened`). Only the oldest
states of the stack become inexact, because they lack the terms of the dropped coefficients. In the same way, an output
ignores its oldest ages if their coefficients are at most `ring.DROPPED` times the largest coefficient of this output.
In the balanced units of the states, the total error is at most a product of five factors: `DROPPED`, the number of
powers, the largest coefficient of a power, the gain of the other applied powers, and the largest old state. This bound
is far below rounding errors if no coefficient or state is 1e10 times as large as the requested values. A larger
coefficient or state enlarges both the bound and the rounding errors, so the rounding errors still exceed the bound.
`checked_responses` detects rounding errors by a second computation in other units. Truncation changes both computations
equally, so `checked_responses` cannot detect an error of truncation.
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
    bit_is_set,
    derive,
    distance_after,
    first_time,
    nonzero,
    output_rows,
    summed,
)

MAX_STACK = 4000  # largest number of state variables in a stack
MAX_WORK = 4e9  # largest number of multiplications, which take a few seconds
MAX_ANCHORS = 1e7  # largest total number of state variables at the multiples of the dead time
LONGEST_RUN = 8  # usually at most 2**8 requested times are read from one stack
# When a stack is advanced, one Taylor series replaces the SERIES lowest powers, because the series is faster. The terms
# of the series are at most e^4 times the states, so that rounding costs less than two digits.
SERIES = 3
# Derivatives are stored for this number of multiples of the dead time, in addition to the multiples that a stack reads.
KEPT_INTERVALS = 64
DONE, TOO_DEEP, TOO_LARGE, TOO_MANY = range(4)


class ManyDeadTimes(ValueError):
    """Raised if the requested times span too many dead times to simulate one dead time after the other."""


def responses(cut: Cut, n: int, step: float, norm: float) -> Array:
    """Compute y, its running integral and u at n times from 0, for a unit step on each input. Shape: (inputs, 3, n).

    `norm` is the value of `norm_over` or a larger number. The lowest power spans less time if `norm` is larger.

    Raises
    ------
    ManyDeadTimes, ValueError
        If the times span too many dead times, the loop depends on too many past states, or the response overflows.
    """
    intervals = _intervals(cut, n, step)
    result, _, status = _responses(cut, step, n, intervals, norm)
    if status == TOO_LARGE:
        raise ValueError("the response of the unstable loop overflows; shorten t")
    if status == TOO_MANY:
        raise ManyDeadTimes(_too_many((n - 1) * step / cut.delay))
    if status == TOO_DEEP:
        raise ValueError(
            f"t must span at most {MAX_STACK // cut.x0.shape[0]} dead times for a loop with |L| near 1 at infinite "
            f"frequency, found {(n - 1) * step / cut.delay:.0f}; shorten t"
        )
    return result


def _intervals(cut: Cut, n: int, step: float) -> int:
    """Return the number of multiples of the dead time, without 0, within the n requested times."""
    spanned = (n - 1) * step / cut.delay if cut.delay else 0.0
    if not spanned * cut.x0.shape[0] < MAX_ANCHORS:
        raise ManyDeadTimes(_too_many(spanned))
    # A time that differs from a multiple of the dead time only by rounding counts as that multiple.
    return int(spanned * (1.0 + 8.0 * np.finfo(float).eps))


def norm_over(cut: Cut, n: int, step: float) -> float:
    """Return an upper bound of the norm of A(z), for all ages that n requested times span (see `simulation.exact`)."""
    intervals = _intervals(cut, n, step)
    through, power, ages = np.abs(cut.Cv), np.abs(cut.D), 1
    with np.errstate(over="ignore", invalid="ignore"):
        while ages < intervals and power.any():  # each pass doubles the number of ages in the sum
            through = through + power @ through
            power = power @ power
            ages *= 2
        bound = float((np.abs(cut.A) + np.abs(cut.B) @ through).sum(axis=0).max(initial=0.0))
    return bound if math.isfinite(bound) else math.inf


def _too_many(intervals: float) -> str:
    return (
        f"t spans {intervals:.3g} dead times, too many to simulate one after the other; shorten t, or neglect "
        "the dead time"
    )


@compiled
def _responses(cut, step, n, intervals, norm):
    """Compute step responses at n times. Return them with the number of ages that the outputs read, and a status.

    Notes
    -----
    Multiple k is the time k * delay, and interval k is the time from multiple k to multiple k + 1. For input i, state
    variable j at multiple k is states[i, k * size + j]. Its derivative of order m, times delta^m / m!, is terms[i, m,
    (k - start) * size + j]. Here `start` is the first multiple in `terms`, and `delta` is the time of the lowest power
    that advances stacks. The loop over k keeps these invariants:

    * When the pass for k begins, the outputs at all requested times before multiple k are computed, and `first` is the
      index of the next requested time.
    * `terms` holds all derivatives that are needed for a stack at multiple k with `deepest` ages. No stack has more
      ages.
    * The first requested time of an interval is (count + share) * delta after multiple k, with an integer `count`. A
      Taylor series advances the stack by share * delta. Then one power for each binary digit 1 of `count` advances the
      stack, in all by count * delta.
    * Each stack has only the ages that its own outputs and the later stacks of the interval need.

    A run is a group of successive requested times whose outputs are computed at once, as one product of a stack and
    `rows`.
    """
    A, B, Cv, D, delay = cut.A, cut.B, cut.Cv, cut.D, cut.delay
    size, inputs = cut.x0.shape
    result = np.zeros((inputs, 3, n))
    inside = n - 1  # number of steps in a dead time
    if delay > 0.0:
        inside = int(min(delay / step * (1.0 + 1e-12), 1e15))
    # A long run needs many `rows`, and short runs need many stacks. Runs of about sqrt(n / 3) times need the least
    # work.
    run_bits = 0
    while run_bits < LONGEST_RUN and 2.0 * 4.0**run_bits <= n / 3.0 + 1.0:
        run_bits += 1
    # Without dead time the highest power spans a run. With dead time it spans at most one dead time.
    top = run_bits
    if delay > 0.0:
        top = 0
        while 2.0 ** (top + 1) <= inside:
            top += 1
        while inside == 0 and step * 2.0**top > delay * (1.0 + 1e-12):
            top -= 1
    most = min(intervals + 1, MAX_STACK // size + 1)
    powers, low = ladder(A, B, Cv, D, norm, step, top, most)
    if len(powers) == 0:
        return result, 0, TOO_LARGE
    # The Taylor series that advances a stack ends where its terms are negligible.
    spanned = min(SERIES, -low)
    # Powers for longer times are not needed, because `distance` (below) exceeds neither one step nor one dead time.
    bits = min(-low, len(powers))
    delta = step * 2.0 ** (low + spanned)
    series, term = 1, norm * delta
    while term > 1e-18:
        series += 1
        term *= norm * delta / series
    aligned = True
    for k in range(1, intervals + 1):
        aligned = aligned and distance_after(k, first_time(k, step, delay), step, delay) == 0.0
    if aligned:  # every stack begins at a multiple of the dead time, so none has to be advanced
        series = 0
    for element in powers:
        if element.shape[1] == most * size and most < intervals + 1:
            return result, most, TOO_DEEP

    # `across` advances a state by one dead time. Each state contributes to the later states within the reach of
    # `across`.
    states = np.zeros((inputs, (intervals + 1) * size))
    for i in range(inputs):
        for j in range(size):
            states[i, j] = cut.x0[j, i]
    if intervals > 0:
        across = transition(powers, step, low, delay, most, A, B, Cv, D)
        reach = across.shape[1] // size
        if reach == most and most < intervals + 1:
            return result, most, TOO_DEEP
        if 1.0 * intervals * reach * size * size * inputs > MAX_WORK:
            return result, most, TOO_MANY
        for i in range(inputs):
            row = states[i]
            for place in range(0, intervals * size, size):
                for j in range(place, place + size):
                    row[j + size] += row[j]
                reached = row[place + size : min(row.size, place + size + across.shape[1])]
                add_rows(reached, row[place : place + size], across, 0, 0)

    # If an interval has at most 1.5 times as many requested times as a usual run, one run covers the interval.
    run = min(n, inside + 1) if 2 * min(n, inside + 1) <= 3 * 2**run_bits else 2**run_bits
    rows = output_rows(cut.C, cut.direct, Cv, D, cut.settled_u, most, run, powers, -low)
    outputs = rows.shape[1] // run
    read = rows.shape[0] // size
    if read == most and most < intervals + 1:
        return result, most, TOO_DEEP
    needed = ages_needed(read, powers, size, run_bits - low, inside // run)
    deepest = needed[needed.size - 1]
    for p in range(spanned, bits):
        deepest += powers[p].shape[1] // size - 1
    deepest = min(deepest, intervals + 1)

    room = min(intervals + 1, deepest + KEPT_INTERVALS)
    terms = np.zeros((inputs, series + 1, room * size))
    delayed = np.zeros((inputs, series + 1, B.shape[1]))
    places, numbers = nonzero(A)
    start = 0
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
                terms[i, 0, here + j] = states[i, k * size + j]
            derive(terms[i], here, delta, A, places, numbers, B, Cv, D, delayed[i])
        last = n if k == intervals else min(n, first_time(k + 1, step, delay))
        if first >= last:
            continue
        distance = distance_after(k, first, step, delay)
        count = np.floor(distance / delta)
        share = distance / delta - count
        runs = (last - first - 1) // run  # number of runs after the first one
        ages = needed[runs]
        for p in range(spanned, bits):
            if bit_is_set(count, p - spanned):
                ages += powers[p].shape[1] // size - 1
        ages = min(ages, k + 1)
        for i in range(inputs):
            ages_left, stack = ages, summed(terms[i], here + size - ages * size, here + size, share)
            for p in range(bits - 1, spanned - 1, -1):
                if bit_is_set(count, p - spanned):
                    ages_kept = min(k + 1, needed[runs])
                    for lower in range(spanned, p):
                        if bit_is_set(count, lower - spanned):
                            ages_kept = min(k + 1, ages_kept + powers[lower].shape[1] // size - 1)
                    work += 1.0 * ages_left * powers[p].shape[1] * size
                    stack, ages_left = advanced(stack, size, powers[p], ages_kept), ages_kept
            for begin in range(first, last, run):
                if begin > first:
                    ages_kept = min(ages_left, needed[(last - begin - 1) // run])
                    work += 1.0 * ages_left * powers[run_bits - low].shape[1] * size
                    stack, ages_left = advanced(stack, size, powers[run_bits - low], ages_kept), ages_kept
                used = min(read, ages_left)
                for j in range(out.size):
                    out[j] = 0.0
                add_rows(out, stack[(ages_left - used) * size :], rows, (read - used) * size, 0)
                for m in range(min(run, last - begin)):
                    for q in range(3):
                        result[i, q, begin + m] = out[outputs * m + q]
                    if outputs > 3 and distance + step * (begin + m - first) > cut.settling:
                        result[i, 2, begin + m] = out[outputs * m + 3]
                if outputs > 3 and distance == 0.0 and begin == first and k > 0:
                    # A jump that arrives at a multiple of the dead time has not yet passed the fast filters, which are
                    # kept out of the process (see `realisation`). So u still has the settled value from before the
                    # jump. The sum leaves out the state at t = 0, because that state contains the jump.
                    settled_u = 0.0
                    for j in range(size if ages_left == k + 1 else 0, ages_left * size):
                        place = j - ages_left * size + read * size
                        if place >= 0:
                            settled_u += stack[j] * rows[place, 3]
                    result[i, 2, begin] = settled_u
        if work > MAX_WORK:
            return result, most, TOO_MANY
        first = last
    return result, read, DONE
