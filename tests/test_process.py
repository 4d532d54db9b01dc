"""Process: evaluation against the factorised formula, the named models, python-control, and every complaint."""

import control
import numpy as np
import pytest

import pidalab
from pidalab.process import quotient, require_no_zero_at_origin

RNG = np.random.default_rng(1)
POINTS = RNG.normal(size=20) + 1j * RNG.normal(
    size=20
)  # complex frequencies that have nothing to do with any pole


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


def test_leading_zeros_are_no_degrees():
    process = pidalab.Process([0.0, 0.0, 1.0], [0.0, 2.0, 1.0])
    assert process.num.tolist() == [1.0]
    assert process.den.tolist() == [2.0, 1.0]


def test_keeps_its_own_copy_of_the_coefficients():
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


TWO = control.tf([[[1.0], [1.0]]], [[[1.0, 1.0], [1.0, 2.0]]])


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (control.tf([1.0], [1.0, 0.5], 0.1), r"sys must be continuous in time, found sample time 0\.1"),
        (TWO, "sys must have one input and output, found"),
        (
            control.tf([1.0, 0.0], [1.0]),
            "sys must be proper, found degrees 1 and 0; add a filter of order 1",
        ),
        (control.ss([], [], [], [[2.0]]), "sys must be a transfer function"),
        ("1/s", "sys must be a number, a controller or a transfer function, found str"),
    ],
)
def test_from_control_complains(system, message):
    with pytest.raises((TypeError, ValueError), match=message):
        pidalab.Process.from_control(system)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (([1.0, 0.0], [1.0]), ValueError, "must be proper, found degrees 1 and 0"),
        (([1.0], [0.0, 0.0]), ValueError, "den must not be the zero polynomial"),
        (([1.0], [1.0, 1.0], np.inf), ValueError, "delay must be finite and at least 0, found inf"),
        (([1.0], [1.0, np.nan]), ValueError, "den must be finite, found nan at index 1"),
        (([[1.0]], [1.0, 1.0]), ValueError, r"num must be one-dimensional .* found shape \(1, 1\)"),
        (([1.0 + 1.0j], [1.0, 1.0]), TypeError, "num must be an array of real numbers"),
    ],
)
def test_process_complains(arguments, error, message):
    with pytest.raises(error, match=message):
        pidalab.Process(*arguments)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pidalab.fopdt(1.0, 0.0, 1.0), "lag must be above 0, found 0"),
        (lambda: pidalab.sopdt(1.0, -1.0, 0.5, 1.0), r"tau must be above 0, found -1\.0"),
        (lambda: pidalab.sopdt(1.0, 1.0, -0.5, 1.0), r"damping must be at least 0, found -0\.5"),
        (lambda: pidalab.lags(2.5), r"order must be a whole number, at least 1, found 2\.5"),
        (lambda: pidalab.lags(2, lag=-1.0), r"lag must be above 0, found -1\.0"),
    ],
    ids=lambda value: value.split(",")[0].replace(" ", "-") if isinstance(value, str) else "",
)
def test_named_models_complain(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_repr_makes_the_same_process():
    process = pidalab.Process([0.5, 1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    again = eval(repr(process), {"Process": pidalab.Process})
    assert again.num.tolist() == process.num.tolist()
    assert again.den.tolist() == process.den.tolist()
    assert again.delay == process.delay


def test_a_pole_is_infinite_without_a_warning():
    integrator = pidalab.ipdt(1.0, 1.0)
    assert integrator(0) == pidalab.Loop(integrator, 1.0).L(0) == np.inf
    assert np.isnan(pidalab.Process([1.0, 0.0], [1.0, 0.0])(0))
    assert np.abs(integrator([0.0, 1j])).tolist() == [np.inf, 1.0]


def test_processes_are_equal_or_not_either_way_round():
    one, other = pidalab.lags(2, delay=1.0), pidalab.lags(2, delay=2.0)
    assert one == pidalab.lags(2, delay=1.0)
    assert one != other
    assert other != one


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


def test_a_process_needs_a_static_gain_to_hold_anything():
    for process in (pidalab.lags(2), pidalab.ipdt(1.0, 1.0), pidalab.lags(2, gain=-3.0)):
        require_no_zero_at_origin("model", process)
    with pytest.raises(ValueError, match="model must have a static gain other than 0, or an integrator"):
        require_no_zero_at_origin("model", pidalab.Process([1.0, 0.0], [1.0, 2.0, 1.0]))
    with pytest.raises(TypeError, match=r"model must be a pidalab\.Process, found float"):
        require_no_zero_at_origin("model", 1.0)


def test_quotients_at_poles_and_where_both_are_zero():
    found = quotient(np.array([1.0, 0.0, 3.0]), np.array([0.0, 0.0, 2.0]))
    assert (found[0], found[2]) == (np.inf, 1.5)
    assert np.isnan(found[1])
    assert quotient(1.0 + 1j, 2.0) == 0.5 + 0.5j
