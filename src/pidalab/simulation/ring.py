r"""Exponentials of the block Toeplitz matrix of a loop with dead time: see `pidalab.simulation.exact`.

An element of the ring is an array (order, powers of z times order): the transposed coefficients :math:`\Phi_k^T`
side by side, as far as they matter. States are rows, and elements act on them from the right; all are power series of
one matrix, so they commute. The number of its powers is the reach of an element: how many ages of states it reads.

Sums run in one order, term by term, whatever the processor: no library call, no reduction in several accumulators.
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain

# size, relative to its largest coefficient, below which the last coefficients of an element are left out
DROPPED = 1e-20
TERMS = 14  # of the Taylor series, for a norm of at most 1/2: the next one is 1e-17 of the first


def _add_row_by_row(out, factors, rows, first, column):
    """As `add_rows`."""
    for i in range(factors.size):
        out += factors[i] * rows[first + i, column : column + out.size]


@plain(_add_row_by_row)
def add_rows(out, factors, rows, first, column):
    """Add factors @ rows[first:, column:] to a row, as far as it goes.

    Four rows are added in one pass, left to right: the same sums as row by row, with a quarter of the traffic.
    """
    fours = factors.size - factors.size % 4
    for i in range(0, fours, 4):
        p, q, r, s = factors[i], factors[i + 1], factors[i + 2], factors[i + 3]
        at = first + i
        for j in range(out.size):
            k = column + j
            out[j] = (
                out[j] + p * rows[at, k] + q * rows[at + 1, k] + r * rows[at + 2, k] + s * rows[at + 3, k]
            )
    for i in range(fours, factors.size):
        p = factors[i]
        for j in range(out.size):
            out[j] = out[j] + p * rows[first + i, column + j]


def _largest_of_array(element, first, last):
    """As `largest`."""
    return float(np.max(np.abs(element[:, first:last]), initial=0.0))


@plain(_largest_of_array)
def largest(element, first, last):
    """Return the largest modulus in some columns."""
    size = 0.0
    for i in range(element.shape[0]):
        for j in range(first, last):
            size = max(size, abs(element[i, j]))
    return size


def _add_arrays(out, element):
    """As `add`."""
    wide = min(out.shape[1], element.shape[1])
    out[:, :wide] += element[:, :wide]


@plain(_add_arrays)
def add(out, element):
    """Add a ring element that is no longer than the other one, or the beginning of one that is."""
    for i in range(out.shape[0]):
        for j in range(min(out.shape[1], element.shape[1])):
            out[i, j] += element[i, j]


@compiled
def shortened(element, share):
    """Drop the last coefficients of a ring element once they no longer matter."""
    order, width = element.shape
    least = share * largest(element, 0, width)
    while width > order and largest(element, width - order, width) <= least:
        width -= order
    if width == element.shape[1]:
        return element
    out = np.zeros((order, width))
    add(out, element)
    return out


@compiled
def taylor(tau, most, A, B, Cv, D):
    """Power series of the exponential less 1, over a time that is no longer than the lowest rung."""
    order, channels = B.shape
    term = np.eye(order)  # transposed here: columns are states, since A has many zeros
    total = np.zeros((order, order))
    for n in range(1, TERMS + 1):
        share = tau / n
        reach = most if D.any() else min(most, term.shape[1] // order + 1)
        after = np.zeros((order, order * reach))
        for i in range(order):
            add_rows(after[i, : term.shape[1]], share * A[i], term, 0, 0)
        # the delayed signals of the next older states
        v, older = np.zeros((channels, order)), np.zeros((channels, order))
        for at in range(0, after.shape[1], order):
            for i in range(order):
                add_rows(after[i, at : at + order], share * B[i], v, 0, 0)
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
def product(first, second, most):
    """(1 + first) (1 + second) - 1, for ring elements."""
    order = first.shape[0]
    width = min(most * order, first.shape[1] + second.shape[1] - order)
    out = np.zeros((order, width))
    add(out, first)
    add(out, second)
    for at in range(0, min(width, first.shape[1]), order):
        wide = min(width - at, second.shape[1])
        for i in range(order):
            add_rows(out[i, at : at + wide], first[i, at : at + order], second, 0, 0)
    return shortened(out, DROPPED)


@compiled
def ladder(A, B, Cv, D, norm, step, top, most):
    """Exponentials less 1 over step 2^p, from a short one by doubling up to p = top, and the lowest p."""
    rungs = [np.zeros((1, 1)) for _ in range(0)]
    if not norm * step < 1e300:
        return rungs, 0
    low = min(top, 0)
    while norm * step * 2.0**low > 0.5:
        low -= 1
    rungs.append(taylor(step * 2.0**low, most, A, B, Cv, D))
    for _ in range(low, top):
        rungs.append(product(rungs[-1], rungs[-1], most))
    return rungs, low


@compiled
def transition(rungs, step, low, tau, most, A, B, Cv, D):
    """The exponential over tau, less 1."""
    out = np.zeros(A.shape)
    dust = 8.0 * 2.0**-52 * tau  # what rounding leaves of a multiple of the step
    for p in range(len(rungs) - 1, -1, -1):
        duration = step * 2.0 ** (low + p)
        if duration <= dust:  # so short a rung would take back dust without end
            break
        while tau > duration - dust:
            out = product(out, rungs[p], most)
            tau -= duration
    if tau > dust:
        out = product(out, taylor(tau, most, A, B, Cv, D), most)
    return out
