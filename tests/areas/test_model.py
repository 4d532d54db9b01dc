"""Compare areas of models with closed forms, Taylor series in high precision and Table 1 of vrancic2021."""

import math
from fractions import Fraction

import control
import mpmath
import numpy as np
import pytest

import pidalab
from pidalab import areas

G1, G2 = pidalab.lags(4), pidalab.lags(2, delay=0.5)
TABLE_1 = {  # process, order of controller and filter: A_0, A_1, ...
    (1, None): "1 4 10 20 35 56 84 120 165 220",
    (1, 1): "1 4.1 10.41 21.041 37.104 59.71",
    (1, 2): "1 4.2 10.83 22.124 39.317 63.64 96.34 138.63",
    (1, 3): "1 4.3 11.26 23.25 41.642 67.81 103.12 148.94 206.66 277.63",
    (2, None): "1 2.5 4.125 5.771 7.419 9.068 10.717 12.365 14.014 15.663",
    (2, 1): "1 2.6 4.385 6.209 8.040 9.872",
    (2, 2): "1 2.7 4.655 6.675 8.708 10.743 12.778 14.814",
    (2, 3): "1 2.8 4.935 7.168 9.425 11.685 13.947 16.208 18.470 20.732",
}


@pytest.mark.parametrize("key", TABLE_1)
def test_printed_areas(key):
    """Check all 68 numbers of Table 1 to the last digit. Ties, such as 39.3165, are printed rounded up."""
    process, order = {1: G1, 2: G2}[key[0]], key[1] or 0
    printed = TABLE_1[key].split()
    found = areas.with_binomial_filter(areas.from_process(process, len(printed)), 0.1, order)
    for value, text in zip(found, printed, strict=True):
        unit = 10.0 ** -len(text.partition(".")[2])
        assert value == pytest.approx(float(text), abs=(0.5 + 1e-9) * unit)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_lags(order):
    found = areas.from_process(pidalab.lags(order, lag=2.0, gain=-3.0), 12)
    assert found.tolist() == [-3.0 * math.comb(order + k - 1, k) * 2.0**k for k in range(12)]


def test_dead_time_zeros_and_a_common_factor():
    found = areas.from_process(pidalab.Process([2.0], [1.0], delay=0.75), 20)
    assert found.tolist() == [float(2 * Fraction(3, 4) ** k / math.factorial(k)) for k in range(20)]
    # (1 - 3 s)/(s + 1) = 4/(s + 1) - 3
    zero = areas.from_process(pidalab.Process([-3.0, 1.0], [1.0, 1.0]), 5)
    assert zero.tolist() == [1.0, 4.0, 4.0, 4.0, 4.0]
    common = areas.from_process(pidalab.Process([2.0, 0.0], [3.0, 1.0, 0.0]), 6)
    assert common.tolist() == [2 * 3.0**k for k in range(6)]


def test_damped_oscillation_without_loss_of_digits():
    """Recursion (7) in floats loses six digits at A_30 here. The exact fractions lose none."""
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
