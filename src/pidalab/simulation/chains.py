"""Partial fractions over chains of poles, for `pidalab.simulation.realisation`.

A numerator is written over 1, s - p_1, (s - p_1)(s - p_2), ..., so that poles may coincide. A complex pair is one link
of the chain with two real states.
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled


@compiled
def _monic(poles):
    """Coefficients of the real monic polynomial with these roots, descending."""
    out = np.zeros(poles.size + 1)
    out[0] = 1.0
    i = 0
    while i < poles.size:
        re, im = poles[i].real, poles[i].imag
        if im == 0.0:
            for k in range(i + 1, 0, -1):
                out[k] -= re * out[k - 1]
            i += 1
        else:
            size = re * re + im * im
            for k in range(i + 2, 1, -1):
                out[k] += size * out[k - 2] - 2.0 * re * out[k - 1]
            out[1] -= 2.0 * re
            i += 2
    return out


@compiled
def _half(poles):
    """Polynomial of a chain that ends between the two states of a pair: the last factor is s - re."""
    front, re = _monic(poles[:-1]), poles[-1].real
    out = np.zeros(front.size + 1)
    for k in range(front.size):
        out[k] += front[k]
        out[k + 1] -= re * front[k]
    return out


@compiled
def _times(poles, value):
    """Multiply by s, modulo the polynomial of the poles: value are coefficients over the chain's polynomials."""
    i = value.size - 1
    while i >= 0:
        re, im = poles[i].real, poles[i].imag
        if im == 0.0:
            value[i] = re * value[i] + (value[i - 1] if i > 0 else 0.0)
            i -= 1
        else:  # the pair i - 1, i
            first, second = value[i - 1], value[i]
            value[i] = first + re * second
            value[i - 1] = re * first - im * im * second + (value[i - 2] if i > 1 else 0.0)
            i -= 2


@compiled
def _divided(poles, value, p):
    """Divide by s - p, modulo the polynomial of the poles."""
    i, before = 0, 0.0j
    while i < value.size:
        re, im = poles[i].real, poles[i].imag
        if im == 0.0:
            value[i] = before = (value[i] - before) / (re - p)
            i += 1
        else:
            top, bottom, gap = value[i] - before, value[i + 1], re - p
            size = gap * gap + im * im
            value[i] = (gap * top + im * im * bottom) / size
            value[i + 1] = before = (gap * bottom - top) / size
            i += 2


@compiled
def fractions(num, lead, poles, group):
    """Realise the partial fractions over all groups, one chain each: A and b; c is 1 at the end of each chain."""
    n = poles.size
    A, b = np.zeros((n, n)), np.zeros(n)
    lo = 0
    while lo < n:
        hi = lo
        while hi < n and group[hi] == group[lo]:
            hi += 1
        # the chain counts in the speed of its fastest pole, so that its numbers are near 1
        unit = abs(poles[hi - 1])
        if unit == 0.0:
            unit = 1.0
        own = poles[lo:hi] / unit
        # numerator modulo the own denominator, by Horner's rule, then divided by all other factors
        value = np.zeros(hi - lo, dtype=np.complex128)
        for k in range(num.size):
            _times(own, value)
            value[0] += num[k] * unit ** (num.size - 1.0 - k)
        for k in range(n):
            if k < lo or k >= hi:
                _divided(own, value, poles[k] / unit)
                for i in range(hi - lo):
                    value[i] /= unit
        for i in range(hi - lo):
            b[lo + i] = value[i].real * unit ** (1.0 - (hi - lo)) / lead
        # multiplication by s as a matrix
        i = lo
        while i < hi:
            width = 1 if poles[i].imag == 0.0 else 2
            A[i, i] = poles[i].real
            if i > lo:
                A[i, i - 1] = unit
            if width == 2:
                A[i + 1, i + 1] = poles[i].real
                A[i, i + 1] = -(poles[i].imag ** 2) / unit
                A[i + 1, i] = unit
            i += width
        lo = hi
    return A, b


@compiled
def _convolve(a, b):
    out = np.zeros(a.size + b.size - 1)
    for i in range(a.size):
        for j in range(b.size):
            out[i + j] += a[i] * b[j]
    return out


@compiled
def _sum(a, b):
    out = np.zeros(max(a.size, b.size))
    for k in range(a.size):
        out[out.size - a.size + k] += a[k]
    for k in range(b.size):
        out[out.size - b.size + k] += b[k]
    return out


@compiled
def without_slow(num, lead, poles, slow, A, b):
    """Numerator of what is left when the first `slow` poles are taken out as partial fractions.

    The division runs from the highest power down, where the fast terms are: no small difference is formed.
    """
    slow_num, slow_den = np.zeros(1), np.ones(1)
    lo = 0
    while lo < slow:
        hi = lo + 1  # a chain ends where no link leads on
        while hi < slow and A[hi, hi - 1] != 0.0:
            hi += 1
        unit = A[lo + 1, lo] if hi > lo + 1 else 1.0
        own = np.zeros(hi - lo)
        for i in range(hi - lo):
            link = (
                _monic(poles[lo : lo + i])
                if i == 0 or poles[lo + i - 1].imag <= 0.0
                else _half(poles[lo : lo + i])
            )
            for k in range(link.size):
                own[hi - lo - link.size + k] += b[lo + i] * unit ** (hi - lo - 1.0 - i) * link[k]
        den = _monic(poles[lo:hi])
        slow_num = _sum(_convolve(slow_num, den), _convolve(own, slow_den))
        slow_den = _convolve(slow_den, den)
        lo = hi
    rest = np.zeros(poles.size + 1)
    for k in range(num.size):
        rest[rest.size - num.size + k] = num[k]
    taken = _convolve(slow_num, _monic(poles[slow:]))
    for k in range(1, min(rest.size, taken.size) + 1):
        rest[rest.size - k] -= lead * taken[taken.size - k]
    quotient = np.zeros(rest.size - slow)
    for k in range(quotient.size):
        quotient[k] = rest[k]
        for j in range(slow_den.size):
            rest[k + j] -= quotient[k] * slow_den[j]
    return quotient
