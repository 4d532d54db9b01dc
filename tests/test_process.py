"""Process: evaluation against the factorised formula, the named models, python-control."""

import control
import numpy as np
import pytest

import pidalab
from pidalab.process import quotient

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


def in_state_space(rng, tf):
    """Return a system in state space with its states mixed, as a linearised model has them."""
    system = control.ss(tf)
    turn, _ = np.linalg.qr(rng.normal(size=(system.nstates, system.nstates)))
    return control.ss(turn @ system.A @ turn.T, turn @ system.B, system.C @ turn.T, system.D)


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("zeros", [[1.0], [2.0, 1.0], [-0.5, 1.0], [3.0, 0.0], [1.0, 0.2, 1.0]])
@pytest.mark.parametrize("integrators", [0, 1, 2])
@pytest.mark.parametrize("unit", [1e-5, 1.0, 3600.0])
def test_state_space_keeps_degree_integrators_and_zeros(unit, integrators, zeros, mixed):
    den = np.poly([-0.02, -0.5, -1.0, -2.0, -30.0])
    wanted = pidalab.Process(zeros, np.append(den, np.zeros(integrators)))
    system = control.tf(wanted.num, wanted.den)
    system = in_state_space(np.random.default_rng(integrators), system) if mixed else control.ss(system)
    slowed = control.ss(system.A / unit, system.B / unit, system.C, system.D)
    found = pidalab.Process.from_control(slowed)
    for ours, theirs in ((found.num, wanted.num), (found.den, wanted.den)):
        assert np.array_equal(np.flatnonzero(ours == 0), np.flatnonzero(theirs == 0))
        assert ours.size == theirs.size
    np.testing.assert_allclose(found(POINTS / unit), wanted(POINTS), rtol=1e-7)


def test_state_space_without_a_way_from_input_to_output_is_zero():
    apart = control.ss(np.diag([-1.0, -2.0]), [[1.0], [0.0]], [[0.0, 1.0]], [[0.0]])
    assert pidalab.Process.from_control(apart) == pidalab.Process([0.0], [1.0, 3.0, 2.0])


def test_repr_makes_the_same_process():
    process = pidalab.Process([0.0, 0.5, 1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    again = eval(repr(process), {"Process": pidalab.Process})
    assert again == process
    assert process != pidalab.Process(process.num, process.den, delay=2.0)
    assert process.num.tolist() == [0.5, 1.0]  # leading zeros are no degrees


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
    found = quotient(np.array([1.0, 0.0, 3.0]), np.array([0.0, 0.0, 2.0]))
    assert (found[0], found[2]) == (np.inf, 1.5)
    assert np.isnan(found[1])
    assert quotient(1.0 + 1j, 2.0) == 0.5 + 0.5j
