"""Check the explicit ITAE rule: tables, range, filters and given factors."""

from collections.abc import Callable

import numpy as np
import pytest

import pidalab
from pidalab.reduction import to_fopdt, to_sopdt
from pidalab.rules import itae

EXAMPLE = pidalab.lags(3, delay=0.2)  # heo2023, (17)
RULES: dict[str, Callable] = {
    f.__name__: f
    for f in (itae.imc_pid, itae.pid_setpoint, itae.pid_load, itae.pida_setpoint, itae.pida_load)
}
RATIOS = np.linspace(0.1, 2.0, 39)
DAMPINGS = np.linspace(0.3, 2.0, 35)


def unit(r: float, xi: float) -> pidalab.Process:
    return pidalab.sopdt(1.0, 1.0, xi, r)


def test_branches_that_no_example_reaches():
    """Compute Table 2 with damping above 0.9 and r > 1, Table 3 with r >= 0.9, Table 1 with damping above 1."""
    assert itae.pid_setpoint(unit(1.0, 1.0)).kc == pytest.approx(-0.544 + 0.308 + 1.408, rel=1e-12)
    assert itae.pid_setpoint(unit(2.0, 1.0)).tau_i == pytest.approx(1.768 + 2 * 0.329, rel=1e-12)
    assert itae.pid_load(unit(0.5, 1.0)).kc == pytest.approx(
        -0.67 + 0.297 * 0.5**-2.001 + 2.189 * 0.5**-0.766
    )
    assert itae.pid_load(unit(1.0, 1.0)).kc == pytest.approx(-0.365 + 0.26 * 0.16 + 2.189, rel=1e-12)
    assert itae.factors(unit(0.37, 2.0)) == pytest.approx((0.2981, -0.768 + 1.142 * 1.506), rel=1e-12)
    assert itae.factors(unit(1.0, 2.0)) == pytest.approx((0.2225, -0.768 + 0.26 * 7.255), rel=1e-12)
    assert itae.factors(unit(2.0, 2.0)) == pytest.approx((0.1025, -0.768 + 0.0975 * 20.0), rel=1e-12)
    assert itae.factors(unit(2.0, 1.0)) == pytest.approx((0.19, 0.273 + 0.09 * 8.407), rel=1e-12)


# The rule as a whole.


@pytest.mark.parametrize("rule", [name for name in RULES if name != "imc_pid"])
def test_models_in_the_range_have_a_controller(rule):
    """The loops are stable, except with the PIDA rule for loads and short dead times."""
    for xi in (0.3, 0.6, 1.0, 1.5, 2.0):
        for r in (0.1, 0.2, 0.4, 0.8, 1.3, 2.0):
            controller = RULES[rule](unit(r, xi))
            assert min(controller.kc, controller.tau_i, controller.tau_d) > 0
            assert (controller.tau_a > 0) == rule.startswith("pida")
            assert rule == "pida_load" or pidalab.is_stable(pidalab.Loop(unit(r, xi), controller))


def test_any_process_of_the_structure():
    """The coefficients are not normalised, and the poles are real."""
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


def test_imc_is_the_pid_of_rivera_with_a_quarter_of_the_dead_time():
    """kc (1 + 1/(tau_i s) + tau_d s) k = (tau s + 1)(theta s/2 + 1)/((lambda + theta) s) with lambda = theta/4."""
    controller, s = itae.imc_pid(pidalab.fopdt(3.0, 2.0, 0.8)), np.array([0.3j, 1.0 + 2.0j])
    ideal = controller.kc * (1 + 1 / (controller.tau_i * s) + controller.tau_d * s)
    assert 3 * ideal == pytest.approx((2 * s + 1) * (0.4 * s + 1) / (1.25 * 0.8 * s), rel=1e-12)


# Factors given by the user.


def test_given_factors():
    """The factors of Table 1 change nothing. With f_d = 0 the PID part follows the PID table."""
    model = unit(0.4, 0.7)
    for rule, pid in ((itae.pida_setpoint, itae.pid_setpoint), (itae.pida_load, itae.pid_load)):
        assert rule(model, factors=itae.factors(model)) == rule(model)
        changed, plain = rule(model, factors=(0.0, 0.6)), pid(model)
        assert (changed.kc, changed.tau_i, changed.tau_d) == (plain.kc, plain.tau_i, plain.tau_d)
        assert changed.tau_a == pytest.approx(0.6 * plain.tau_d, rel=1e-12)
