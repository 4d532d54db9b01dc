"""What outputs read of a stack of states, and how a stack moves on: see `pidalab.simulation.ladder`."""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain
from pidalab.simulation.ring import DROPPED, add_rows


@compiled
def advanced(stack, order, rung, keep):
    """Carry a stack over the duration of a rung, and keep its youngest ages."""
    ages, reach = stack.size // order, rung.shape[1] // order
    after = np.zeros(keep * order)
    before = stack.size - after.size
    for j in range(after.size):
        after[j] = stack[before + j]
    # the states of each age add a row of the rung to their own age and to all younger ones
    for age in range(ages - 1, -1, -1):
        least, end = max(0, age - keep + 1), min(reach, age + 1)
        if least < end:
            at, source = (keep - 1 - age + least) * order, (ages - 1 - age) * order
            add_rows(
                after[at : at + (end - least) * order],
                stack[source : source + order],
                rung,
                0,
                least * order,
            )
    return after


def _reads_of_array(rows, outputs, order, age, last, wide):
    """As `_reads`."""
    block = rows[(last - age) * order : (last - age + 1) * order, :wide]
    return np.max(np.abs(block).reshape(-1, outputs), axis=0)


@plain(_reads_of_array)
def _reads(rows, outputs, order, age, last, wide):
    """Return the largest number by which each output reads the states of an age."""
    size = np.zeros(outputs)
    for i in range((last - age) * order, (last - age + 1) * order):
        for m in range(0, wide, outputs):
            for q in range(outputs):
                size[q] = max(size[q], abs(rows[i, m + q]))
    return size


@compiled
def _read_ages(rows, outputs, order, wide):
    """Return the number of ages that an output reads: the oldest ones count for nothing in any."""
    ages = rows.shape[0] // order
    largest = np.zeros(outputs)
    for age in range(ages):
        size = _reads(rows, outputs, order, age, ages - 1, wide)
        for q in range(outputs):
            largest[q] = max(largest[q], size[q])
    while ages > 1:
        size = _reads(rows, outputs, order, ages - 1, rows.shape[0] // order - 1, wide)
        # of each output its own share: u may be read by numbers far larger than those of y
        for q in range(outputs):
            if size[q] > DROPPED * largest[q]:
                return ages
        ages -= 1
    return ages


@compiled
def output_rows(C, direct, Cv, D, settled, most, run, rungs, base):
    """What the outputs at `run` times in succession read of a stack: (its states, times and outputs)."""
    order, outputs = C.shape[1], 3 + (settled.shape[0] > 0)
    wide = outputs * run
    ages = min(most, max(1, settled.shape[0]))
    if direct.any():
        ages = most if D.any() else max(ages, min(most, 2))
    rows = np.zeros((ages * order, wide))
    for q in range(3):
        for j in range(order):
            rows[(ages - 1) * order + j, q] = C[q, j]
        reading = direct[q].copy()
        for age in range(1, ages):  # the direct part of an output reads all older process inputs
            at = (ages - 1 - age) * order
            read, on = np.zeros(order), np.zeros(reading.size)
            add_rows(read, reading, Cv, 0, 0)
            add_rows(on, reading, D, 0, 0)
            for j in range(order):
                rows[at + j, q] = read[j]
            reading = on
    for age in range(min(ages, settled.shape[0])):
        for j in range(order):
            rows[(ages - 1 - age) * order + j, 3] = settled[age, j]
    kept = _read_ages(rows, outputs, order, outputs)
    rows, ages = rows[(ages - kept) * order :], kept
    have, p = outputs, base
    while have < wide:  # as many again, one rung later
        rung = rungs[p]
        reach = rung.shape[1] // order
        more = min(have, wide - have)
        new = min(most, ages + reach - 1)
        longer = np.zeros((new * order, wide))
        shift = (new - ages) * order
        for i in range(ages * order):
            for m in range(have):
                longer[shift + i, m] = rows[i, m]
            for m in range(more):
                longer[shift + i, have + m] = rows[i, m]
        for age in range(new):
            least, end = max(0, age - ages + 1), min(reach, age + 1)  # ages that the rung adds
            first = (ages - 1 - age + least) * order
            for i in range(order):
                out = longer[(new - 1 - age) * order + i, have : have + more]
                add_rows(out, rung[i, least * order : end * order], rows, first, 0)
        have, p = have + more, p + 1
        ages = _read_ages(longer, outputs, order, have)
        rows = longer[(new - ages) * order :]
    return rows


@compiled
def derive(terms, at, delta, A, B, Cv, D, delayed):
    """Fill in the derivatives of the states at one multiple of the dead time: (delta A(z))^m / m! of them.

    `delayed` holds, for each derivative, the delayed signals on their way to the next multiple.
    """
    order, channels = B.shape
    for m in range(1, terms.shape[0]):
        before, now = terms[m - 1, at : at + order], terms[m, at : at + order]
        share = delta / m
        for i in range(order):
            total = 0.0
            for j in range(order):
                total += A[i, j] * before[j]
            for q in range(channels):
                total += B[i, q] * delayed[m, q]
            now[i] = share * total
        _delay(delayed[m], before, Cv, D)


@compiled
def _delay(signals, states, Cv, D):
    """Let states enter the dead time, whose signals leave it one dead time later."""
    channels = signals.size
    after = np.zeros(channels)
    for q in range(channels):
        total = 0.0
        for i in range(channels):
            total += D[q, i] * signals[i]
        for j in range(states.size):
            total += Cv[q, j] * states[j]
        after[q] = total
    for q in range(channels):
        signals[q] = after[q]


def _summed_arrays(terms, start, end, share):
    """As `_summed`."""
    stack = terms[-1, start:end].copy()
    for m in range(terms.shape[0] - 2, -1, -1):
        stack = stack * share + terms[m, start:end]
    return stack


@plain(_summed_arrays)
def summed(terms, start, end, share):
    """Sum the Taylor series of a stack."""
    stack = np.zeros(end - start)
    if share == 0.0:
        for j in range(end - start):
            stack[j] = terms[0, start + j]
        return stack
    top = terms.shape[0] - 1
    for j in range(end - start):
        stack[j] = terms[top, start + j]
    for m in range(top - 1, -1, -1):
        for j in range(end - start):
            stack[j] = stack[j] * share + terms[m, start + j]
    return stack


@compiled
def first_time(k, step, delay):
    """Return the number of the first requested time that is not before a multiple of the dead time."""
    grown = 1.0 + 8.0 * 2.0**-52
    i = int(k * delay / step)
    while i > 0 and step * i * grown >= k * delay:
        i -= 1
    while step * i * grown < k * delay:
        i += 1
    return i
