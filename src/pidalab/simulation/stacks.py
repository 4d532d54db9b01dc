"""Kernels that advance a stack of states and read outputs from the stack (see `pidalab.simulation.ladder`)."""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain
from pidalab.simulation.ring import DROPPED, add_product, add_rows, column_sizes, sizes


@compiled
def advanced(stack, order, power, keep):
    """Advance a stack by the time that belongs to `power`, and keep only the states of the `keep` youngest ages."""
    ages, reach = stack.size // order, power.shape[1] // order
    after = np.zeros(keep * order)
    before = stack.size - after.size
    for j in range(after.size):
        after[j] = stack[before + j]
    # Each old state, multiplied by the power, contributes to the new states of its own age and of younger ages.
    for age in range(ages - 1, -1, -1):
        least, end = max(0, age - keep + 1), min(reach, age + 1)
        if least < end:
            place, source = (keep - 1 - age + least) * order, (ages - 1 - age) * order
            add_rows(
                after[place : place + (end - least) * order],
                stack[source : source + order],
                power,
                0,
                least * order,
            )
    return after


@compiled
def _reads(rows, outputs, order, wide):
    """Return size[age, q], the largest modulus of the coefficients with which output q reads the state of an age.

    The last row holds the maxima over all ages.
    """
    ages = rows.shape[0] // order
    size = np.zeros((ages + 1, outputs))
    for age in range(ages):
        columns = column_sizes(rows[(ages - 1 - age) * order : (ages - age) * order, :wide])
        for m in range(0, wide, outputs):
            for q in range(outputs):
                size[age, q] = max(size[age, q], columns[m + q])
        for q in range(outputs):
            size[ages, q] = max(size[ages, q], size[age, q])
    return size


@compiled
def _read_ages(size):
    """Return the number of ages that the outputs need.

    Coefficients of at most `DROPPED` times the largest coefficient of the same output are ignored.
    """
    ages = size.shape[0] - 1
    largest = size[ages]
    while ages > 1:
        # Each output has its own limit, since coefficients of u may be much larger than those of y.
        for q in range(largest.size):
            if size[ages - 1, q] > DROPPED * largest[q]:
                return ages
        ages -= 1
    return ages


@compiled
def _longest(size, ages, power, order, most):
    """Return an upper bound of the ages that the outputs read after `output_rows` multiplies its matrix by a power.

    The product is not computed. Its coefficients are matrices. Their elements are bounded by sums of terms
    order * a * b, where a and b are the largest moduli of the elements of the two coefficients that are multiplied.
    """
    reach, largest = power.size, size[size.shape[0] - 1]
    new = min(most, ages + reach - 1)
    while new > ages:
        age = new - 1
        for q in range(size.shape[1]):
            total = 0.0
            for k in range(max(0, age - ages + 1), min(reach, age + 1)):
                total += order * power[k] * size[age - k, q]
            if not total <= DROPPED * largest[q]:
                return new
        new -= 1
    return new


@compiled
def output_rows(C, direct, Cv, D, settled, most, run, powers, base):
    """Return the matrix that reads the outputs at `run` successive times from a stack.

    Its shape is (size of the stack, run * outputs).

    Notes
    -----
    The columns of the earliest time are the coefficients of the outputs. Before each pass, `have` columns are complete.
    The pass multiplies these columns by the next power. The product gives the columns of the next times, up to `have`
    columns. The pass then drops the ages that no output reads.
    """
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
        for age in range(1, ages):  # through `direct` an output also reads older process inputs
            place = (ages - 1 - age) * order
            read, passed = np.zeros(order), np.zeros(reading.size)
            add_rows(read, reading, Cv, 0, 0)
            add_rows(passed, reading, D, 0, 0)
            for j in range(order):
                rows[place + j, q] = read[j]
            reading = passed
    for age in range(min(ages, settled.shape[0])):
        for j in range(order):
            rows[(ages - 1 - age) * order + j, 3] = settled[age, j]
    size = _reads(rows, outputs, order, outputs)
    kept = _read_ages(size)
    rows, ages = rows[(ages - kept) * order :], kept
    have, p = outputs, base
    while have < wide:
        power = powers[p]
        reach = power.shape[1] // order
        more = min(have, wide - have)
        new = _longest(size, ages, sizes(power), order, most)
        longer = np.zeros((new * order, wide))
        shift = (new - ages) * order
        for i in range(ages * order):
            for m in range(have):
                longer[shift + i, m] = rows[i, m]
            for m in range(more):
                longer[shift + i, have + m] = rows[i, m]
        for age in range(new):
            least, end = max(0, age - ages + 1), min(reach, age + 1)
            first = (ages - 1 - age + least) * order
            here, count = (new - 1 - age) * order, max(0, end - least) * order
            add_product(longer[here:], (have, more), power, least * order, count, rows, first)
        have, p = have + more, p + 1
        size = _reads(longer, outputs, order, have)
        ages = _read_ages(size)
        rows = longer[(new - ages) * order :]
    return rows


@compiled
def nonzero(matrix):
    """Return the column indices of the nonzero elements of each row of a matrix, and their number."""
    places = np.zeros(matrix.shape, dtype=np.int64)
    numbers = np.zeros(matrix.shape[0], dtype=np.int64)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if matrix[i, j] != 0.0:
                places[i, numbers[i]] = j
                numbers[i] += 1
    return places, numbers


@compiled
def derive(terms, place, delta, A, places, numbers, B, Cv, D, delayed):
    """Compute derivatives of the states at one multiple of the dead time. Derivative m is (delta A(z))^m / m! x.

    `delayed` stores, for each derivative, the signals that leave the dead time at the next multiple.
    """
    order, channels = B.shape
    after = np.zeros(channels)
    for m in range(1, terms.shape[0]):
        before, now = terms[m - 1, place : place + order], terms[m, place : place + order]
        share = delta / m
        for i in range(order):
            total = 0.0
            for p in range(numbers[i]):
                total += A[i, places[i, p]] * before[places[i, p]]
            for q in range(channels):
                total += B[i, q] * delayed[m, q]
            now[i] = share * total
        for q in range(channels):  # a signal that enters the dead time now leaves it at the next multiple
            total = 0.0
            for i in range(channels):
                total += D[q, i] * delayed[m, i]
            for j in range(order):
                total += Cv[q, j] * before[j]
            after[q] = total
        for q in range(channels):
            delayed[m, q] = after[q]


def _summed_arrays(terms, start, end, share):
    """Do the same as `summed`, without compilation."""
    stack = terms[-1, start:end].copy()
    for m in range(terms.shape[0] - 2, -1, -1):
        stack = stack * share + terms[m, start:end]
    return stack


@plain(_summed_arrays)
def summed(terms, start, end, share):
    """Sum the Taylor series of all states of a stack."""
    stack = np.zeros(end - start)
    if share == 0.0:
        for j in range(end - start):
            stack[j] = terms[0, start + j]
        return stack
    m, x = terms.shape[0], share
    while m >= 4:
        m -= 4
        a, b, c, d = terms[m + 3, start:], terms[m + 2, start:], terms[m + 1, start:], terms[m, start:]
        for j in range(end - start):
            stack[j] = (((stack[j] * x + a[j]) * x + b[j]) * x + c[j]) * x + d[j]
    while m > 0:
        m -= 1
        a = terms[m, start:]
        for j in range(end - start):
            stack[j] = stack[j] * x + a[j]
    return stack


@compiled
def ages_needed(read, powers, order, base, most):
    """Return the numbers of ages that a stack needs.

    Element n (n = 0, 1, ..., `most`) is enough for the outputs of the present run and of the next n runs.

    The binary digits of the number of runs select the powers that advance the stack. Each power adds its reach minus 1
    to the ages that the outputs read.
    """
    needed = np.full(most + 1, read)
    for runs in range(1, most + 1):
        ages, p, digits = read, base, runs
        while digits > 0:
            # If there is no dead time, a digit may select a power that is not stored. One age is then enough.
            if digits % 2 == 1 and p < len(powers):
                ages += powers[p].shape[1] // order - 1
            digits //= 2
            p += 1
        needed[runs] = max(needed[runs - 1], ages)
    return needed


@compiled
def first_time(k, step, delay):
    """Return the index of the first requested time at or after a multiple of the dead time."""
    grown = 1.0 + 8.0 * 2.0**-52
    i = int(k * delay / step)
    while i > 0 and step * i * grown >= k * delay:
        i -= 1
    while step * i * grown < k * delay:
        i += 1
    return i


@compiled
def distance_after(k, i, step, delay):
    """Return the time from multiple k of the dead time to requested time i.

    A distance as small as the rounding error counts as 0.
    """
    distance = step * i - k * delay
    return distance if distance > 8.0 * 2.0**-52 * step * i else 0.0


@compiled
def bit_is_set(count, power):
    """Return True if the binary form of a count contains 2^power. The count may be an integer of any size."""
    return np.floor(count * 2.0**-power) % 2.0 == 1.0
