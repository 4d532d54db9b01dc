r"""Compute exponentials of the block Toeplitz matrix of a loop with dead time (see `pidalab.simulation.exact`).

An element of the ring is a power series in z whose coefficients are matrices :math:`\Phi_k`. The coefficient
:math:`\Phi_k` multiplies the state of k dead times ago. The *age* of this state and of its coefficient is k. The
*reach* of an element is the number of its coefficients. An element is stored as an array of shape (order, reach *
order), with the transposed coefficients :math:`\Phi_k^T` side by side. States are rows, and are multiplied by elements
from the right. All elements commute, because each is a function of the same matrix A(z).

Notes
-----
Elements represent exponentials minus 1, because the exponential for a slow state is so near 1 that digits would be lost
in the sum with 1. `product` therefore computes :math:`(1 + a)(1 + b) - 1 = a + b + a b`. Coefficients are dropped from
the end of an element while they are at most `DROPPED` times its largest coefficient. Scaling and squaring follows
Higham, *Functions of Matrices*, 2008, ch. 10, with a Taylor series for a norm of at most 1/2.

All sums are formed term by term in a fixed order, with one accumulator and without library calls, so that the results
are the same on every processor.
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain

# Relative size of the coefficients that are dropped from the end of an element. DROPPED is so small because one element
# holds the coefficients of the plant and of a kick (a short, very large signal). With 1e-20, a kick of 1e22 caused an
# error of 4e-9 in y.
DROPPED = 1e-26
TAYLOR_TERMS = 14  # for a norm of at most 1/2, the next term is about 1e-17 times the first term


def _add_row_by_row(out, factors, rows, first, column):
    """Do the same as `add_rows`, without compilation."""
    for i in range(factors.size):
        out += factors[i] * rows[first + i, column : column + out.size]


@plain(_add_row_by_row)
def add_rows(out, factors, rows, first, column):
    """Add factors @ rows[first:, column:] to the whole array `out`.

    Each pass adds four rows in ascending order. The result is the same as with one row in each pass, but `out` is read
    and written only a quarter as often.
    """
    size, fours = out.size, factors.size - factors.size % 4
    for i in range(0, fours, 4):
        p, q, r, s = factors[i], factors[i + 1], factors[i + 2], factors[i + 3]
        k = first + i
        # Use views, which begin at index 0. With an offset, compiled code would test the sign of each index.
        a, b, c, d = rows[k, column:], rows[k + 1, column:], rows[k + 2, column:], rows[k + 3, column:]
        for j in range(size):
            out[j] = out[j] + p * a[j] + q * b[j] + r * c[j] + s * d[j]
    for i in range(fours, factors.size):
        p, a = factors[i], rows[first + i, column:]
        for j in range(size):
            out[j] = out[j] + p * a[j]


def _add_product_row_by_row(out, place, factors, column, count, rows, first):
    """Do the same as `add_product`, without compilation."""
    (at, size), order = place, factors.shape[0]
    for i in range(count):
        out[:order, at : at + size] += (
            factors[:, column + i : column + i + 1] * rows[first + i : first + i + 1, :size]
        )


@plain(_add_product_row_by_row)
def add_product(out, place, factors, column, count, rows, first):
    """Add factors[:, column : column + count] @ rows[first : first + count] to some columns of `out`.

    `place` holds the first of these columns, and their number. The sums are the same as in `add_rows`.
    """
    at, size = place
    pairs = factors.shape[0] - factors.shape[0] % 2
    for k in range(0, pairs, 2):
        upper, lower = out[k, at:], out[k + 1, at:]
        f, g = factors[k, column:], factors[k + 1, column:]
        for i in range(0, count - count % 4, 4):
            p, q, r, s = f[i], f[i + 1], f[i + 2], f[i + 3]
            t, u, v, w = g[i], g[i + 1], g[i + 2], g[i + 3]
            a, b, c, d = rows[first + i], rows[first + i + 1], rows[first + i + 2], rows[first + i + 3]
            for j in range(size):
                upper[j] = upper[j] + p * a[j] + q * b[j] + r * c[j] + s * d[j]
                lower[j] = lower[j] + t * a[j] + u * b[j] + v * c[j] + w * d[j]
        for i in range(count - count % 4, count):
            p, t, a = f[i], g[i], rows[first + i]
            for j in range(size):
                upper[j] = upper[j] + p * a[j]
                lower[j] = lower[j] + t * a[j]
    if pairs < factors.shape[0]:
        add_rows(out[pairs, at : at + size], factors[pairs, column : column + count], rows, first, 0)


def _column_sizes_of_array(block):
    """Do the same as `column_sizes`, without compilation."""
    return np.fmax.reduce(np.abs(block), axis=0, initial=0.0)


@plain(_column_sizes_of_array)
def column_sizes(block):
    """Return the largest modulus in each column.

    The inner loop runs along a row, so that it compiles to vector instructions.
    """
    result = np.zeros(block.shape[1])
    for i in range(block.shape[0]):
        row = block[i]
        for j in range(result.size):
            size = abs(row[j])
            result[j] = size if size > result[j] else result[j]
    return result


@compiled
def sizes(element):
    """Return the largest modulus in each coefficient of a ring element."""
    order = element.shape[0]
    columns, result = column_sizes(element), np.zeros(element.shape[1] // order)
    for j in range(columns.size):
        result[j // order] = max(result[j // order], columns[j])
    return result


@compiled
def largest(values):
    """Return the largest of some sizes, or 0 if there are none."""
    result = 0.0
    for j in range(values.size):
        result = max(result, values[j])
    return result


@compiled
def add(out, element):
    """Add a ring element to `out`, without the coefficients beyond the width of `out`."""
    wide = min(out.shape[1], element.shape[1])
    out[:, :wide] += element[:, :wide]


@compiled
def shortened(element, share):
    """Drop coefficients from the end of a ring element while each is at most `share` times the largest coefficient."""
    order, width = element.shape
    size = sizes(element)
    least = share * largest(size)
    while width > order and size[width // order - 1] <= least:
        width -= order
    if width == element.shape[1]:
        return element
    out = np.zeros((order, width))
    add(out, element)
    return out


@compiled
def taylor(tau, most, A, B, Cv, D):
    """Return the exponential minus 1 for a time `tau`, by its Taylor series.

    `tau` times the norm of A(z) must be at most 1/2.

    Notes
    -----
    After pass n, `term` is (tau A(z))^n / n!, where A(z) = A + B z (1 - D z)^-1 Cv, and `total` is the sum of the terms
    1 to n. If D is 0, each term reaches one age further than the preceding term. If D is not 0, each term reaches as
    many ages as `most` allows, because D feeds a part of the delayed signal `v` back into the dead time.
    """
    order, channels = B.shape
    term = np.eye(order)  # not transposed in this function, so that zeros of A can be skipped
    total = np.zeros((order, order))
    for n in range(1, TAYLOR_TERMS + 1):
        share = tau / n
        reach = most if D.any() else min(most, term.shape[1] // order + 1)
        after = np.zeros((order, order * reach))
        for i in range(order):
            for j in range(order):
                if A[i, j] != 0.0:
                    add_rows(after[i, : term.shape[1]], share * A[i, j : j + 1], term, j, 0)
        # `v` holds the delayed signals that act on the coefficient at column `at`.
        v, older = np.zeros((channels, order)), np.zeros((channels, order))
        for at in range(0, after.shape[1], order):
            for i in range(order):
                for q in range(channels):
                    if B[i, q] != 0.0:
                        add_rows(after[i, at : at + order], share * B[i, q : q + 1], v, q, 0)
            for q in range(channels):
                for j in range(order):
                    older[q, j] = 0.0
                add_rows(older[q], D[q], v, 0, 0)
                if at < term.shape[1]:
                    add_rows(older[q], Cv[q], term, 0, at)
            v, older = older, v
        term = shortened(after, DROPPED)
        if term.shape[1] > total.shape[1]:
            longer = np.zeros(term.shape)
            add(longer, total)
            total = longer
        add(total, term)
    out = np.zeros(total.shape)
    for at in range(0, total.shape[1], order):
        for i in range(order):
            for j in range(order):
                out[i, at + j] = total[j, at + i]
    return out


@compiled
def _width(first, second, most):
    """Return an upper bound for the number of columns that `shortened` keeps of a product.

    Let a and b be the largest moduli in two coefficients. No element of their product exceeds order * a * b in modulus,
    so a sum of such terms is a bound for each coefficient of the result. Coefficients at the end are left out while
    their bounds are at most `DROPPED` times the largest modulus in the first coefficient of the result. `shortened`
    would drop these coefficients as well, because the largest coefficient is at least as large as the first
    coefficient.
    """
    order = first.shape[0]
    ages, width = first.shape[1] // order, min(most * order, first.shape[1] + second.shape[1] - order)
    if ages == 1 or width == order:
        return width
    start = np.zeros((order, order))
    add(start, first)
    add(start, second)
    add_product(start, (0, order), first, 0, order, second, 0)
    least = DROPPED * largest(sizes(start))
    others = second.shape[1] // order
    left, right = sizes(first), sizes(second)
    while width > order:
        age = width // order - 1
        size = (left[age] if age < ages else 0.0) + (right[age] if age < others else 0.0)
        for k in range(max(0, age - others + 1), min(ages, age + 1)):
            size += order * left[k] * right[age - k]
        if not size <= least:
            return width
        width -= order
    return width


@compiled
def product(first, second, most):
    """Return (1 + first)(1 + second) - 1 for two elements, cut to at most `most` coefficients."""
    order, width = first.shape[0], _width(first, second, most)
    out = np.zeros((order, width))
    add(out, first)
    add(out, second)
    for at in range(0, min(width, first.shape[1]), order):
        wide = min(width - at, second.shape[1])
        add_product(out, (at, wide), first, at, order, second, 0)
    return shortened(out, DROPPED)


@compiled
def ladder(A, B, Cv, D, norm, step, top, most):
    """Return the powers (the exponentials minus 1 for the times step * 2^p, p = low, ..., top), and `low`.

    The list of powers is empty if they would overflow.

    Notes
    -----
    `low` is the largest integer with low <= 0, low <= top and norm * step * 2^low <= 1/2, so that the Taylor series
    converges fast. Each further power is the square of the preceding power.
    """
    powers = [np.zeros((1, 1)) for _ in range(0)]
    if not norm * step < 1e300:
        return powers, 0
    low = min(top, 0)
    while norm * step * 2.0**low > 0.5:
        low -= 1
    powers.append(taylor(step * 2.0**low, most, A, B, Cv, D))
    for _ in range(low, top):
        powers.append(product(powers[-1], powers[-1], most))
    return powers, low


@compiled
def transition(powers, step, low, tau, most, A, B, Cv, D):
    """Return the exponential minus 1 for a time `tau`, as a product of powers and one Taylor series.

    Notes
    -----
    `powers[p]` is applied `times[p]` times. Each application reduces `tau` by step * 2^(low + p). Invariant: `tau` plus
    the sum of times[p] * step * 2^(low + p) is the given time. The Taylor series spans the remaining `tau`, which is
    shorter than the time of the shortest power. A remainder no larger than rounding errors counts as 0.
    """
    dust = 8.0 * 2.0**-52 * tau  # the rounding error of a multiple of the step
    times = np.zeros(len(powers), dtype=np.int64)
    for p in range(len(powers) - 1, -1, -1):
        duration = step * 2.0 ** (low + p)
        if duration <= dust:
            break
        while tau > duration - dust:
            times[p] += 1
            tau -= duration
    # The product is formed from the shortest power up, so that it has few coefficients for as long as possible.
    begun = tau > dust
    out = taylor(tau, most, A, B, Cv, D) if begun else np.zeros(A.shape)
    for p in range(len(powers)):
        for _ in range(times[p]):
            out = product(powers[p], out, most) if begun else powers[p]
            begun = True
    return out
