"""Explicit ITAE rule: the proof of each correction, the break points, units, the range, refusals."""

import math
from collections.abc import Callable

import numpy as np
import pytest

import pidalab
from pidalab.reduction import to_fopdt, to_sopdt
from pidalab.rules import direct, itae
from pidalab.rules.models import integrator

EXAMPLE = pidalab.lags(3, delay=0.2)  # heo2023, (17)
RULES: dict[str, Callable] = {
    f.__name__: f
    for f in (itae.imc_pid, itae.pid_setpoint, itae.pid_load, itae.pida_setpoint, itae.pida_load)
}
RATIOS = np.linspace(0.1, 2.0, 39)
DAMPINGS = np.linspace(0.3, 2.0, 35)


def unit(r: float, xi: float) -> pidalab.Process:
    return pidalab.sopdt(1.0, 1.0, xi, r)


# Corrections. Each test computes the formula as printed, without the library, and shows what it does.


def test_derivative_time_for_short_dead_times():
    """A PID controller cancels two poles with tau_i = 2 xi tau and tau_d = tau/(2 xi); Table 2 comes near to that."""
    for xi in DAMPINGS:
        controller = itae.pid_setpoint(unit(0.1, xi))
        assert controller.tau_d == pytest.approx(1 / (2 * xi), rel=0.07)
        assert controller.tau_i == pytest.approx(2 * xi, rel=0.04)


def load_gains(r, xi):
    """The two formulas of Table 3 for the gain."""
    rest = 2.189 * xi * r**-0.766
    return -0.67 + 0.297 * r**-2.001 + rest, -0.365 + 0.26 * (r - 1.4) ** 2 + rest


def test_gain_of_table_3_changes_with_the_ratio():
    """At r = 0.9 the formulas meet. At a damping of 0.9, as printed, they do not, and the first may be negative."""
    low, high = load_gains(0.9, 0.5)
    assert high - low == pytest.approx(0.0033, abs=1e-4)
    low, high = load_gains(0.1, 0.9)
    assert low - high == pytest.approx(29.03, abs=0.01)
    assert load_gains(2.0, 0.3)[0] == pytest.approx(-0.21, abs=0.01)
    for xi in DAMPINGS:
        for r in RATIOS:
            kc = itae.pid_load(unit(r, xi)).kc
            assert kc == pytest.approx(load_gains(r, xi)[0 if round(r, 9) < 0.9 else 1], rel=1e-9)
            assert kc > 0


# Break points: value just after minus value just before, as a share of the latter.


@pytest.mark.parametrize(
    ("rule", "name", "variable", "at", "smallest", "largest"),
    [
        (itae.pid_setpoint, "tau_i", "r", 1.0, -0.0141, -0.0141),
        (itae.pid_load, "kc", "r", 0.9, 0.0007, 0.0081),
        (itae.pid_load, "tau_i", "r", 0.4, -0.0279, 0.0303),
        (itae.factors, "f_a", "r", 0.37, -0.0004, 0.0033),
        (itae.factors, "f_a", "r", 1.0, -0.0323, -0.0217),
        (itae.pid_setpoint, "kc", "xi", 0.9, -0.0752, 0.1330),
        (itae.factors, "f_d", "xi", 1.0, 0.0, 0.0),
        (itae.factors, "f_a", "xi", 1.0, -0.0014, 0.0028),
    ],
)
def test_jumps_at_break_points(rule, name, variable, at, smallest, largest):
    jumps = []
    for other in np.linspace(0.3, 2.0, 171) if variable == "r" else np.linspace(0.1, 2.0, 191):
        where = [(x, other) if variable == "r" else (other, x) for x in (at * (1 - 1e-9), at * (1 + 1e-9))]
        before, after = (getattr(rule(unit(*x)), name) for x in where)
        jumps.append(after / before - 1)
    assert (min(jumps), max(jumps)) == pytest.approx((smallest, largest), abs=1e-4)


def test_branches_that_no_example_reaches():
    """By hand: Table 2 with damping above 0.9, and with r > 1; Table 3 with r >= 0.9; Table 1 with damping above 1."""
    assert itae.pid_setpoint(unit(1.0, 1.0)).kc == pytest.approx(-0.544 + 0.308 + 1.408, rel=1e-12)
    assert itae.pid_setpoint(unit(2.0, 1.0)).tau_i == pytest.approx(1.768 + 2 * 0.329, rel=1e-12)
    assert itae.pid_load(unit(1.0, 1.0)).kc == pytest.approx(-0.365 + 0.26 * 0.16 + 2.189, rel=1e-12)
    assert itae.factors(unit(0.37, 2.0)) == pytest.approx((0.2981, -0.768 + 1.142 * 1.506), rel=1e-12)
    assert itae.factors(unit(1.0, 2.0)) == pytest.approx((0.2225, -0.768 + 0.26 * 7.255), rel=1e-12)
    assert itae.factors(unit(2.0, 2.0)) == pytest.approx((0.1025, -0.768 + 0.0975 * 20.0), rel=1e-12)
    assert itae.factors(unit(2.0, 1.0)) == pytest.approx((0.19, 0.273 + 0.09 * 8.407), rel=1e-12)


# The rule as a whole.


@pytest.mark.parametrize("rule", [name for name in RULES if name != "imc_pid"])
def test_all_models_in_the_range_give_a_controller(rule):
    for controller in (RULES[rule](unit(r, xi)) for r in RATIOS for xi in DAMPINGS):
        assert min(controller.kc, controller.tau_i, controller.tau_d) > 0
        assert (controller.tau_a > 0) == rule.startswith("pida")


@pytest.mark.parametrize("rule", ["pid_setpoint", "pid_load", "pida_setpoint"])
def test_loops_with_the_model_are_stable(rule):
    for xi in (0.3, 0.6, 1.0, 1.5, 2.0):
        for r in (0.1, 0.2, 0.4, 0.8, 1.3, 2.0):
            assert pidalab.is_stable(pidalab.Loop(unit(r, xi), RULES[rule](unit(r, xi))))


@pytest.mark.parametrize(
    ("xi", "unstable", "stable"), [(0.3, 0.35, 0.4), (0.7, 0.2, 0.25), (1, 0.1, 0.15), (2, 1.8, 1.7)]
)
def test_pida_load_is_not_always_stable(xi, unstable, stable):
    assert not pidalab.is_stable(pidalab.Loop(unit(unstable, xi), itae.pida_load(unit(unstable, xi))))
    assert pidalab.is_stable(pidalab.Loop(unit(stable, xi), itae.pida_load(unit(stable, xi))))


def test_any_process_of_the_structure():
    """Coefficients that are not normalised, and real poles."""
    model = pidalab.Process([6.0], [12.0, 21.0, 3.0], delay=1.0)
    assert itae.pida_load(model) == itae.pida_load(pidalab.sopdt(2.0, 2.0, 1.75, 1.0))


def test_borders_of_the_range_and_break_points_survive_rounding():
    for tau in (0.7, 3.0, 11.3, 1e-4):
        for xi in (0.3, 2.0):
            for r in (0.1, 2.0):
                assert itae.pida_setpoint(pidalab.sopdt(1.0, tau, xi, r * tau)).kc > 0
        at = itae.pid_setpoint(pidalab.sopdt(1.0, tau, 0.9, tau)).kc
        assert at == pytest.approx(-0.04 + (0.333 + 0.949) * 0.9, rel=1e-10)


def test_filters():
    model = to_sopdt(EXAMPLE).process
    controller = itae.pida_load(model, alpha_d=0.1, alpha_a=0.2)
    assert (controller.alpha_d, controller.alpha_a) == (0.1, 0.2)
    assert controller.gains() == itae.pida_load(model).gains()
    for rule in (itae.pid_load, itae.pid_setpoint):
        assert rule(model, alpha_d=0.1).alpha_d == 0.1
    assert itae.imc_pid(to_fopdt(EXAMPLE).process, alpha_d=0.1).alpha_d == 0.1
    with pytest.raises(ValueError, match="alpha_a must be above 0"):
        itae.pida_setpoint(model, alpha_a=0.0)


@pytest.mark.parametrize(
    "rule",
    [
        *list(RULES.values())[1:],
        itae.factors,
        itae.setpoint_factors,
        itae.load_factors,
        direct.setpoint,
        direct.load,
    ],
)
@pytest.mark.parametrize(
    ("model", "message"),
    [
        (unit(0.0999, 1.0), r"delay/tau of the model must be from 0\.1 to 2, found 0\.0999"),
        (unit(2.001, 1.0), r"delay/tau of the model must be from 0\.1 to 2, found 2\.001"),
        (unit(1.0, 0.29), r"damping of the model must be from 0\.3 to 2, found 0\.29"),
        (pidalab.lags(3, delay=1.0), "model must have a constant numerator .* two stable poles"),
        (pidalab.Process([1.0, 1.0], [1.0, 1.0, 1.0], 1.0), "two stable poles"),
        (pidalab.Process([0.0], [1.0, 1.0, 1.0], 1.0), r"constant numerator \(not 0\)"),
        (pidalab.Process([1.0], [1.0, -1.0, 1.0], 1.0), "two stable poles"),
    ],
)
def test_models_that_are_refused(rule, model, message):
    with pytest.raises(ValueError, match=message):
        rule(model)


def test_models_that_imc_refuses():
    for model in (unit(1.0, 1.0), pidalab.ipdt(1.0, 1.0), pidalab.Process([1.0], [1.0, -1.0], 1.0)):
        with pytest.raises(ValueError, match="one stable pole"):
            itae.imc_pid(model)
    with pytest.raises(ValueError, match="model must have a dead time above 0"):
        itae.imc_pid(pidalab.fopdt(1.0, 1.0, 0.0))
    with pytest.raises(
        TypeError, match=r"model must be a pidalab\.Process, found SecondOrderModel; pass its \.process"
    ):
        itae.pid_load(to_sopdt(EXAMPLE))


def test_imc_is_the_pid_of_rivera_with_a_quarter_of_the_dead_time():
    """kc (1 + 1/(tau_i s) + tau_d s) k = (tau s + 1)(theta s/2 + 1)/((lambda + theta) s) with lambda = theta/4."""
    controller, s = itae.imc_pid(pidalab.fopdt(3.0, 2.0, 0.8)), np.array([0.3j, 1.0 + 2.0j])
    ideal = controller.kc * (1 + 1 / (controller.tau_i * s) + controller.tau_d * s)
    assert 3 * ideal == pytest.approx((2 * s + 1) * (0.4 * s + 1) / (1.25 * 0.8 * s), rel=1e-12)


# Factors given by the user.


def test_given_factors():
    """Those of Table 1 change nothing; with f_d = 0 the PID part is the one of the PID table."""
    model = unit(0.4, 0.7)
    for rule, pid in ((itae.pida_setpoint, itae.pid_setpoint), (itae.pida_load, itae.pid_load)):
        assert rule(model, factors=itae.factors(model)) == rule(model)
        own, plain = rule(model, factors=(0.0, 0.6)), pid(model)
        assert (own.kc, own.tau_i, own.tau_d) == (plain.kc, plain.tau_i, plain.tau_d)
        assert own.tau_a == pytest.approx(0.6 * plain.tau_d, rel=1e-12)


@pytest.mark.parametrize(
    ("factors", "error", "message"),
    [
        ((0.3,), TypeError, "factors must be two numbers, f_d and f_a, found"),
        (itae.factors, TypeError, "factors must be two numbers, f_d and f_a, found"),
        ((1.0, 0.6), ValueError, "f_d must be between"),
        ((-2.0, 0.6), ValueError, "f_d must be between"),
        ((math.nan, 0.6), ValueError, "f_d must be finite"),
        ((0.3, -0.1), ValueError, "f_a must be at least 0"),
    ],
)
def test_factors_that_are_refused(factors, error, message):
    with pytest.raises(error, match=message):
        itae.pida_setpoint(unit(1.0, 1.0), factors=factors)


@pytest.mark.parametrize(
    ("rule", "r", "gain"),
    [
        (itae.pida_load, 0.01, 1.0),  # the integral time is below 0
        (itae.pida_load, 7.0, -2.0),  # the derivative time is below 0
    ],
)
def test_factors_that_lead_out_of_the_tables(rule, r, gain):
    f_d = (1 - r) / (1 + r / 2)  # for a model with ratio 1
    with pytest.raises(ValueError, match=r"f_d = .* leads to r = .*, where the table does not hold"):
        rule(pidalab.sopdt(gain, 1.0, 1.0, 1.0), factors=(f_d, 0.6))


def test_an_integrator_with_dead_time_and_no_other_model():
    assert integrator(pidalab.Process([1.0], [2.0, 0.0], 3.0)) == (0.5, 3.0)
    for num, den in (([1.0], [2.0]), ([1.0], [2.0, 1.0]), ([1.0, 1.0], [2.0, 0.0]), ([1.0], [1.0, 2.0, 0.0])):
        with pytest.raises(ValueError, match="model must be an integrator with dead time"):
            integrator(pidalab.Process(num, den, 3.0))
