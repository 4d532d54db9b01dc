"""A loop transfer function from its factors, for `pidalab.robustness._scan`."""

from __future__ import annotations

import numpy as np

from pidalab._compiled import plain


def _fraction_by_products(s, gain, zeros, poles, reference):
    """As `fraction`, with the factors as arrays."""
    size = s + reference
    num = np.prod((s - zeros) / size[: zeros.size]) / np.prod(size[zeros.size :])
    return gain * num, np.prod((s - poles) / size)


@plain(_fraction_by_products)
def fraction(s, gain, zeros, poles, reference):
    """Numerator and denominator of L without its dead time, both over the product of all s + reference."""
    num, den = complex(gain), 1.0 + 0.0j
    for i in range(poles.size):
        re, im = s.real + reference[i], s.imag
        size = 1.0 / (re * re + im * im)
        small = complex(re * size, -im * size)
        den *= (s - poles[i]) * small
        num *= (s - zeros[i]) * small if i < zeros.size else small
    return num, den
