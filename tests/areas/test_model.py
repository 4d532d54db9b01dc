"""Areas of models: closed forms, the Taylor series in high precision, Table 1 of vrancic2021, filters, refusals."""

import math
from fractions import Fraction

import control
import mpmath
import numpy as np
import pytest

import pidalab
from pidalab import areas
from pidalab.areas import power_series

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
    """All 68 numbers of Table 1 to the last digit; 39.3165 and others are ties in decimals, printed rounded up."""
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


def test_dead_time():
    found = areas.from_process(pidalab.Process([2.0], [1.0], delay=0.75), 20)
    assert found.tolist() == [float(2 * Fraction(3, 4) ** k / math.factorial(k)) for k in range(20)]


def test_zero_in_the_right_half_plane():
    """(1 - 3 s)/(s + 1) = 4/(s + 1) - 3."""
    assert areas.from_process(pidalab.Process([-3.0, 1.0], [1.0, 1.0]), 5).tolist() == [
        1.0,
        4.0,
        4.0,
        4.0,
        4.0,
    ]


def test_damped_oscillation_without_loss_of_digits():
    """The recursion (7) cancels here, in floats by six digits at A_30; the fractions lose none."""
    process = pidalab.Process([1.3, 0.7], [0.9, 0.31, 1.7], delay=0.37)
    with mpmath.workdps(60):
        (b1, b0), (a2, a1, a0), delay = process.num.tolist(), process.den.tolist(), mpmath.mpf(0.37)
        series = mpmath.taylor(
            lambda s: (b1 * s + b0) / ((a2 * s + a1) * s + a0) * mpmath.exp(-s * delay), 0, 30
        )
        expected = [float((-1) ** k * c) for k, c in enumerate(series)]
    assert areas.from_process(process, 31) == pytest.approx(expected, rel=1e-15)


def test_common_factor_s_is_cancelled():
    twice = pidalab.Process([2.0, 0.0], [3.0, 1.0, 0.0])
    assert areas.from_process(twice, 6).tolist() == [2 * 3.0**k for k in range(6)]


def test_filters_are_blocks_in_series():
    plain = areas.from_process(G2, 10)
    whole = areas.from_process(pidalab.Process([1.0], np.convolve([1, 2, 1], [0.09, 0.6, 1]), delay=0.5), 10)
    assert areas.with_binomial_filter(plain, 0.3, 2) == pytest.approx(whole, rel=1e-14)
    assert areas.with_filter(plain, control.tf([1.0], [0.09, 0.6, 1.0])) == pytest.approx(whole, rel=1e-14)
    assert areas.with_binomial_filter(plain, 0.3, 0).tolist() == plain.tolist()
    assert areas.with_binomial_filter(plain, 0.0, 3).tolist() == plain.tolist()


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (
            lambda: areas.from_process(pidalab.ipdt(1.0, 1.0), 4),
            ValueError,
            "process must have a static gain",
        ),
        (
            lambda: areas.from_process(pidalab.Process([1], [1, -1]), 4),
            ValueError,
            "stable, found a pole at 1",
        ),
        (
            lambda: areas.from_process(pidalab.Process([1], [1, 0, 1]), 4),
            ValueError,
            "process must be stable",
        ),
        (lambda: areas.from_process(control.tf([1], [1, 1]), 4), TypeError, "found TransferFunction"),
        (lambda: areas.from_process(pidalab.lags(1, lag=1e200), 3), ValueError, "overflow"),
        (lambda: areas.from_process(G1, 0), ValueError, "count must be a whole number, at least 1"),
        (
            lambda: areas.with_binomial_filter([1.0, 2.0], -0.1, 1),
            ValueError,
            "filter_time must be at least 0",
        ),
        (
            lambda: areas.with_binomial_filter([1.0, 2.0], 0.1, 1.5),
            ValueError,
            "filter_order must be a whole number",
        ),
        (lambda: areas.with_binomial_filter([[1.0]], 0.1, 1), ValueError, "areas must be one-dimensional"),
        (
            lambda: areas.with_filter([1.0], control.tf([1.0], [1.0, 0.0])),
            ValueError,
            "block must have a static gain",
        ),
        (
            lambda: areas.with_filter([1.0], control.tf([1.0], [1.0, -2.0])),
            ValueError,
            "block must be stable",
        ),
        (lambda: areas.with_filter([1.0], "filter"), TypeError, "block must be a number"),
    ],
)
def test_refusals(call, error, text):
    with pytest.raises(error, match=text):
        call()


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_systems_are_solved_exactly(size):
    """A matrix whose first elements are 0, so that rows have to change places."""
    rng = np.random.default_rng(size)
    whole = rng.integers(-9, 10, (size, size))
    whole[0, 0] = 0 if size > 1 else 3
    exact = [Fraction(int(x)) for x in rng.integers(-9, 10, size)]
    matrix = [[Fraction(int(x)) for x in row] for row in whole]
    right = [sum((a * x for a, x in zip(row, exact, strict=True)), Fraction(0)) for row in matrix]
    assert abs(np.linalg.det(whole)) > 0.5
    assert power_series.solve(matrix, right) == exact


def test_a_singular_system_has_no_solution():
    rows = [[Fraction(x) for x in row] for row in ([1, 2, 3], [2, 4, 6], [1, 1, 1])]
    assert power_series.solve(rows, [Fraction(1)] * 3) is None
