"""Compare areas of models with closed forms and Taylor series in high precision."""

import math
from fractions import Fraction

import control
import mpmath
import numpy as np
import pytest

import pidalab
from pidalab import areas

G1, G2 = pidalab.lags(4), pidalab.lags(2, delay=0.5)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_lags(order):
    values = areas.from_process(pidalab.lags(order, lag=2.0, gain=-3.0), 12)
    assert values.tolist() == [-3.0 * math.comb(order + k - 1, k) * 2.0**k for k in range(12)]


def test_dead_time_zeros_and_a_common_factor():
    values = areas.from_process(pidalab.Process([2.0], [1.0], delay=0.75), 20)
    assert values.tolist() == [float(2 * Fraction(3, 4) ** k / math.factorial(k)) for k in range(20)]
    # (1 - 3 s)/(s + 1) = 4/(s + 1) - 3
    zero = areas.from_process(pidalab.Process([-3.0, 1.0], [1.0, 1.0]), 5)
    assert zero.tolist() == [1.0, 4.0, 4.0, 4.0, 4.0]
    common = areas.from_process(pidalab.Process([2.0, 0.0], [3.0, 1.0, 0.0]), 6)
    assert common.tolist() == [2 * 3.0**k for k in range(6)]


def test_damped_oscillation_without_loss_of_digits():
    """Recursion (7) in floats loses six digits at A_30. The exact fractions lose none."""
    process = pidalab.Process([1.3, 0.7], [0.9, 0.31, 1.7], delay=0.37)
    with mpmath.workdps(60):
        (b1, b0), (a2, a1, a0), delay = process.num.tolist(), process.den.tolist(), mpmath.mpf(0.37)
        series = mpmath.taylor(
            lambda s: (b1 * s + b0) / ((a2 * s + a1) * s + a0) * mpmath.exp(-s * delay), 0, 30
        )
        expected = [float((-1) ** k * c) for k, c in enumerate(series)]
    assert areas.from_process(process, 31) == pytest.approx(expected, rel=1e-15)


def test_filters_are_blocks_in_series():
    plain = areas.from_process(G2, 10)
    whole = areas.from_process(pidalab.Process([1.0], np.convolve([1, 2, 1], [0.09, 0.6, 1]), delay=0.5), 10)
    assert areas.with_binomial_filter(plain, 0.3, 2) == pytest.approx(whole, rel=1e-14)
    assert areas.with_filter(plain, control.tf([1.0], [0.09, 0.6, 1.0])) == pytest.approx(whole, rel=1e-14)
    assert areas.with_binomial_filter(plain, 0.3, 0).tolist() == plain.tolist()
    assert areas.with_binomial_filter(plain, 0.0, 3).tolist() == plain.tolist()
