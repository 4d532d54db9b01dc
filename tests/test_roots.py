"""Check roots of polynomials and the search for borders."""

import math

import numpy as np
import pytest

import pidalab
from pidalab.roots import border, roots


@pytest.mark.parametrize(
    ("order", "lag"), [(2, 1.0), (5, 1e-3), (12, 7.0), (30, 60.0), (40, 1.0), (60, 1e-2)]
)
def test_equal_lags_give_one_multiple_root(order, lag):
    assert roots(pidalab.lags(order, lag=lag).den) == pytest.approx([-1 / lag] * order, rel=1e-13)


def test_two_chains_and_an_integrator():
    den = np.convolve(np.convolve(pidalab.lags(9, lag=0.01).den, pidalab.lags(4, lag=3.0).den), [1.0, 0.0])
    result = roots(den)
    assert result[0] == 0
    assert result[1:] == pytest.approx([-1 / 3] * 4 + [-100.0] * 9, rel=1e-9)


def test_a_multiple_real_root_beside_a_double_pair_stays_real():
    pair = [-0.7 + 0.3j, -0.7 - 0.3j]
    result = roots(np.poly([-0.5] * 3 + pair * 2).real)
    assert result == pytest.approx([-0.5] * 3 + pair * 2, rel=1e-6)
    assert result[:3].imag.tolist() == [0.0] * 3


@pytest.mark.parametrize("seed", range(8))
def test_simple_roots_are_those_of_numpy(seed):
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=2 + seed % 5)
    result = roots(coefficients)
    assert np.sort_complex(result) == pytest.approx(np.sort_complex(np.roots(coefficients)), rel=1e-10)
    assert np.all(np.diff(np.abs(result)) > -1e-12)
    assert np.array_equal(result[result.imag > 0].conj(), result[result.imag < 0])


def test_roots_on_the_axis_lie_on_it():
    result = roots(np.array([8.0, 4.0, 2.0, 1.0]))  # their moduli are equal up to rounding
    assert sorted(result.real.tolist()) == pytest.approx([-0.5, 0.0, 0.0], rel=1e-14)


def test_nearly_equal_roots_stay_apart():
    assert roots(np.poly([-1.0, -1.001])) == pytest.approx([-1.0, -1.001], rel=1e-10)
    assert roots(np.poly([-1.0, -1.1, -1.2, -5.0])) == pytest.approx([-1.0, -1.1, -1.2, -5.0], rel=1e-9)


@pytest.mark.parametrize(("inside", "outside"), [(0.0, 5.0), (-3.0, 4.0)])
def test_border_lies_where_the_property_holds(inside, outside):
    limit = border(lambda x: x < math.e, inside, outside)
    assert math.e * (1 - 2e-7) < limit < math.e
    mirrored = border(lambda x: x > -math.e, -inside, -outside)
    assert mirrored == -limit
