"""Compare processes with their formulas, named models and python-control."""

import control
import numpy as np
import pytest

import pidalab
from pidalab.process import quotient

RNG = np.random.default_rng(1)
POINTS = RNG.normal(size=20) + 1j * RNG.normal(size=20)  # random complex frequencies


def test_evaluates_rational_part_times_exact_dead_time():
    process = pidalab.Process([2.0, -3.0], [1.0, 4.0, 5.0], delay=0.7)
    expected = (2 * POINTS - 3) / (POINTS**2 + 4 * POINTS + 5) * np.exp(-0.7 * POINTS)
    np.testing.assert_allclose(process(POINTS), expected, rtol=1e-13)
    assert process(POINTS.reshape(4, 5)).shape == (4, 5)


@pytest.mark.parametrize(
    ("process", "formula"),
    [
        (pidalab.fopdt(-2.0, 3.0, 0.5), lambda s: -2 / (3 * s + 1) * np.exp(-0.5 * s)),
        (pidalab.sopdt(2.0, 3.0, 0.2, 0.5), lambda s: 2 / (9 * s**2 + 1.2 * s + 1) * np.exp(-0.5 * s)),
        (pidalab.sopdt(2.0, 3.0, 0.0, 0.5), lambda s: 2 / (9 * s**2 + 1) * np.exp(-0.5 * s)),
        (pidalab.ipdt(0.3, 2.0), lambda s: 0.3 / s * np.exp(-2 * s)),
        (pidalab.lags(5, lag=0.4, gain=3.0, delay=0.1), lambda s: 3 / (0.4 * s + 1) ** 5 * np.exp(-0.1 * s)),
    ],
)
def test_named_models(process, formula):
    np.testing.assert_allclose(process(POINTS), formula(POINTS), rtol=1e-12)


def test_coefficients_are_copied_and_read_only():
    den = np.array([2.0, 1.0])
    process = pidalab.Process([1.0], den)
    den[0] = 99.0
    assert process.den.tolist() == [2.0, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        process.den[0] = 3.0


def test_from_control_keeps_the_rational_part():
    tf = control.tf([1.0, 2.0], [1.0, 3.0, 5.0])
    process = pidalab.Process.from_control(tf, delay=0.3)
    np.testing.assert_allclose(process(POINTS), tf(POINTS) * np.exp(-0.3 * POINTS), rtol=1e-10)
    np.testing.assert_allclose(process.rational_part()(POINTS), tf(POINTS), rtol=1e-10)


def test_repr_makes_the_same_process():
    process = pidalab.Process([0.0, 0.5, 1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    again = eval(repr(process), {"Process": pidalab.Process})
    assert again == process
    assert process != pidalab.Process(process.num, process.den, delay=2.0)
    assert process.num.tolist() == [0.5, 1.0]  # leading zeros are dropped


def test_a_pole_is_infinite_without_a_warning():
    integrator = pidalab.ipdt(1.0, 1.0)
    assert integrator(0) == pidalab.Loop(integrator, 1.0).L(0) == np.inf
    assert np.isnan(pidalab.Process([1.0, 0.0], [1.0, 0.0])(0))
    assert np.abs(integrator([0.0, 1j])).tolist() == [np.inf, 1.0]


@pytest.mark.parametrize(
    ("num", "den", "expected"),
    [
        ([3.0, 6.0], [1.0, 4.0, 3.0], 2.0),
        ([3.0, 6.0, 0.0], [1.0, 4.0, 3.0, 0.0], 2.0),  # the common s is cancelled
        ([3.0, 6.0, 0.0], [1.0, 4.0, 3.0], 0.0),
        ([3.0, -6.0], [1.0, 4.0, 3.0, 0.0], -np.inf),
        ([3.0, 6.0, 0.0], [1.0, 4.0, 3.0, 0.0, 0.0], np.inf),
        ([3.0, -6.0, 0.0, 0.0], [-1.0, 4.0, 0.0, 0.0], -1.5),
        ([0.0], [1.0, 0.0], 0.0),
    ],
)
def test_static_gain_of_zeros_and_poles_at_rest(num, den, expected):
    assert pidalab.Process(num, den).gain() == expected


def test_quotients_at_poles_and_where_both_are_zero():
    values = quotient(np.array([1.0, 0.0, 3.0]), np.array([0.0, 0.0, 2.0]))
    assert (values[0], values[2]) == (np.inf, 1.5)
    assert np.isnan(values[1])
    assert quotient(1.0 + 1j, 2.0) == 0.5 + 0.5j
