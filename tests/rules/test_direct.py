"""Compare the direct ITAE rules and the refitted factors with the optima of studies/itae_optima.py."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

import pidalab
from pidalab.rules import direct, itae

REFITTED = {
    "setpoint": (itae.pida_setpoint, itae.setpoint_factors),
    "load": (itae.pida_load, itae.load_factors),
}
RATIOS, DAMPINGS = np.linspace(0.1, 2.0, 20), np.linspace(0.3, 2.0, 18)


def unit(r: float, xi: float) -> pidalab.Process:
    return pidalab.sopdt(1.0, 1.0, xi, r)


with (Path(__file__).parents[2] / "book" / "data" / "itae_optima.csv").open(encoding="utf-8") as file:
    OPTIMA = list(csv.DictReader(file))


def itae_of(kind, r, xi, controller, end=100.0):
    run = pidalab.step_response if kind == "setpoint" else pidalab.load_response
    t = np.linspace(0.0, end, math.ceil(end / min(0.01, r / 20)) + 1)
    return run(pidalab.Loop(unit(r, xi), controller), t).itae()


def validation(kind, bound):
    """Yield ratio, damping, optimal controller and its ITAE for every fourth model that the fit did not use."""
    rows = [
        row for row in OPTIMA if (row["role"], row["kind"], row["ms_bound"]) == ("validation", kind, bound)
    ]
    for row in rows[::4]:
        r, xi, least, *optimal = (
            float(row[k]) for k in ("ratio", "damping", "itae", "kc", "tau_i", "tau_d", "tau_a")
        )
        yield r, xi, pidalab.NonInteractivePIDA(*optimal), least


@pytest.mark.parametrize(("kind", "bound"), [("setpoint", "inf"), ("load", "inf"), ("load", "2")])
def test_stored_optima(kind, bound):
    """The table has 80 and 40 models, the ITAE of its controllers, and keeps the bound on Ms."""
    roles = [row["role"] for row in OPTIMA if (row["kind"], row["ms_bound"]) == (kind, bound)]
    assert (roles.count("fit"), roles.count("validation")) == (80, 40)
    for r, xi, controller, least in validation(kind, bound):
        assert itae_of(kind, r, xi, controller) == pytest.approx(least, rel=1e-4)
        if bound == "2":
            assert pidalab.max_sensitivity(pidalab.Loop(unit(r, xi), controller))[0] < 2.002


def test_setpoint_is_near_the_optimum():
    """For models not used in the fit it is at most 12 % above, and always better than the paper's rule."""
    for r, xi, _, least in validation("setpoint", "inf"):
        direct_itae, printed = (
            itae_of("setpoint", r, xi, f(unit(r, xi))) for f in (direct.setpoint, itae.pida_setpoint)
        )
        assert 0.999 * least < direct_itae < 1.12 * least
        assert direct_itae < printed


def test_load_is_near_the_optimum_with_its_bound():
    """For models not used in the fit it is at most 30 % above, and at most 3 % below."""
    for r, xi, _, least in validation("load", "2"):
        assert 0.97 * least < itae_of("load", r, xi, direct.load(unit(r, xi))) < 1.3 * least


def refitted(kind):
    """Return the ITAE rule with its refitted factors."""
    rule, factors = REFITTED[kind]
    return lambda model: rule(model, factors=factors(model))


@pytest.mark.parametrize(
    ("rule", "bound"),
    [(direct.setpoint, 2.25), (direct.load, 2.03), (refitted("setpoint"), 2.5), (refitted("load"), 2.4)],
)
def test_rules_are_robust_in_the_whole_range(rule, bound):
    for xi in DAMPINGS:
        for r in RATIOS:
            loop = pidalab.Loop(unit(r, xi), rule(unit(r, xi)))
            assert pidalab.is_stable(loop)
            assert pidalab.max_sensitivity(loop)[0] < bound


@pytest.mark.parametrize("xi", [0.5, 1.0, 1.8])
def test_setpoint_cancels_the_poles(xi):
    """With a short filter L is near 0.722 (1 + 0.36 theta s) e^(-theta s)/(theta s)."""
    model, s = pidalab.sopdt(2.0, 3.0, xi, 1.5), np.array([0.1j, 1.0j])
    loop = model(s) * direct.setpoint(model, alpha_d=1e-6, alpha_a=1e-6)(s)
    assert loop == pytest.approx(0.722 * (1 + 0.36 * 1.5 * s) * np.exp(-1.5 * s) / (1.5 * s), rel=1e-4)


@pytest.mark.parametrize(("slower", "bound"), [(0.5, 2.03), (2, 2.3), (4, 2.95)])
@pytest.mark.parametrize("rule", [direct.setpoint, direct.load])
def test_rules_are_robust_with_other_filters(rule, slower, bound):
    """The lead of `setpoint` may be negative. With a lead of at least 0, Ms would be 5.8 and 397."""
    for xi in (0.3, 0.4, 0.7, 2.0):
        for r in (0.1, 0.14, 0.3, 2.0):
            loop = pidalab.Loop(unit(r, xi), rule(unit(r, xi), 0.05 * slower, 0.025 * slower))
            assert pidalab.is_stable(loop)
            assert pidalab.max_sensitivity(loop)[0] < bound


@pytest.mark.parametrize(("r", "xi"), [(0.1, 0.3), (0.1, 2.0), (2.0, 0.3), (2.0, 2.0)])
def test_load_by_hand(r, xi):
    """Compare with the matrix of the docstring, at the corners of the range."""
    matrix = [[0.040, 0.546, 0.455], [0.344, 1.852, 0.003], [0.790, 0.714, -0.076], [0.335, 0.058, -0.023]]
    ki, kp, kd, ka = np.array(matrix) @ [1.0, r * xi, r**2] / [r**3, r**2, r, 1.0]
    c = direct.load(unit(r, xi))
    assert (c.kc, c.tau_i, c.tau_d) == pytest.approx((kp, kp / ki, kd / kp), rel=1e-9)
    assert c.gains().ka - 0.05 * c.kc * c.tau_d**2 == pytest.approx(ka, rel=1e-9)


# The refitted factors of the ITAE rule.
