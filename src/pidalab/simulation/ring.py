r"""Exponentials of the block Toeplitz matrix of a loop with dead time: see `pidalab.simulation.exact`.

An element of the ring is an array (order, powers of z times order): the transposed coefficients :math:`\Phi_k^T`
side by side, as far as they matter. States are rows, and elements act on them from the right; all are power series of
one matrix, so they commute.
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain

FADED = 1e-20  # size, relative to the largest, below which a coefficient of an exponential is dropped
TERMS = 14  # of the Taylor series, for a norm of at most 1/2


def _add_product(out, factors, rows):
    """As `add_rows`, in one product."""
    out += factors @ rows[: factors.size, : out.size]


@plain(_add_product)
def add_rows(out, factors, rows):
    """Add factors @ rows to a row, as far as it goes."""
    for i in range(factors.size):
        factor = factors[i]
        if factor != 0.0:
            for j in range(out.size):
                out[j] += factor * rows[i, j]


@compiled
def add(out, element):
    """Add a ring element that is no longer than the other one, or the beginning of one that is."""
    wide = min(out.shape[1], element.shape[1])
    for i in range(out.shape[0]):
        for j in range(wide):
            out[i, j] += element[i, j]


@compiled
def shortened(element, share):
    """Drop the last coefficients of a ring element once they no longer matter."""
    order, width = element.shape
    size = np.zeros(width)
    for i in range(order):
        for j in range(width):
            size[j] = max(size[j], abs(element[i, j]))
    least = share * size.max()
    while width > order and size[width - order : width].max() <= least:
        width -= order
    return element if width == size.size else element[:, :width].copy()


@compiled
def taylor(tau, most, A, b, c, d):
    """Power series of the exponential less 1, over a time that is no longer than the lowest rung."""
    order = b.size
    term = np.eye(order)  # transposed here: columns are states, since A has many zeros
    total = np.zeros((order, order))
    for n in range(1, TERMS + 1):
        length = term.shape[1] // order
        after = np.zeros((order, order * (min(most, length + 1) if d == 0.0 else most)))
        for i in range(order):
            for k in range(order):
                factor = A[i, k] * tau / n
                if factor != 0.0:
                    for j in range(term.shape[1]):
                        after[i, j] += factor * term[k, j]
        # the delayed process input of the next older states
        v = np.zeros(order)
        for at in range(0, after.shape[1], order):
            for i in range(order):
                factor = b[i] * tau / n
                for j in range(order):
                    after[i, at + j] += factor * v[j]
            v *= d
            for k in range(order if at < term.shape[1] else 0):
                for j in range(order):
                    v[j] += c[k] * term[k, at + j]
        term = shortened(after, FADED)
        if term.shape[1] > total.shape[1]:
            longer = np.zeros(term.shape)
            add(longer, total)
            total = longer
        add(total, term)
    out = np.empty(total.shape)
    for at in range(0, total.shape[1], order):
        out[:, at : at + order] = total[:, at : at + order].T
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
            add_rows(out[i, at : at + wide], first[i, at : at + order], second)
    return shortened(out, FADED)


@compiled
def ladder(A, b, c, d, step, top, growth, most):
    """Exponentials less 1 over step 2^p, from a short one by doubling up to p = top, and the lowest p."""
    norm = np.max(np.sum(np.abs(A), axis=0)) + np.sum(np.abs(b)) * np.max(np.abs(c)) * growth
    rungs = [np.zeros((1, 1)) for _ in range(0)]
    if not norm * step < 1e300:
        return rungs, 0
    low = min(top, 0)
    while norm * step * 2.0**low > 0.5:
        low -= 1
    rungs.append(taylor(step * 2.0**low, most, A, b, c, d))
    for _ in range(low, top):
        rungs.append(product(rungs[-1], rungs[-1], most))
    return rungs, low


@compiled
def transition(rungs, step, low, tau, most, A, b, c, d):
    """The exponential over tau, less 1."""
    out = np.zeros((b.size, b.size))
    dust = 8.0 * np.finfo(np.float64).eps * tau  # what rounding leaves of a multiple of the step
    for p in range(len(rungs) - 1, -1, -1):
        duration = step * 2.0 ** (low + p)
        if duration <= dust:  # so short a rung would take back dust for ever
            break
        while tau > duration - dust:
            out = product(out, rungs[p], most)
            tau -= duration
    if tau > dust:
        out = product(out, taylor(tau, most, A, b, c, d), most)
    return out
