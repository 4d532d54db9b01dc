"""Compare controllers with their printed formulas at random complex frequencies, and convert them back and forth."""

import dataclasses
import math
import re

import numpy as np
import pytest

import pidalab
from pidalab.forms import IdealGains

RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=20) + 1j * RNG.normal(size=20)


GOOD = {
    pidalab.PIDA: {"kp": np.float64(2.0), "ti": 4.0, "td": 1.0, "ta": 0.5},
    pidalab.NonInteractivePIDA: {"kc": 2.0, "tau_i": 4.0, "tau_d": 1.0, "tau_a": 1.0},
    pidalab.HighOrderPID: {"gains": [0.5, 2.0, 1.0, 0.25], "filter_time": 0.1, "filter_order": 2},
    pidalab.SeriesPIDA: {"kp": 2.0, "kd": 1.0, "ka": 0.5, "ti": 4.0, "filter_time": 0.1, "filter_order": 2},
}
MADE = [kind(**good) for kind, good in GOOD.items()]


def ideal(gains, s=POINTS):
    return gains.ki / s + gains.kp + gains.kd * s + gains.ka * s**2


def pida_formula(kp, ti, td, ta, n, m, s=POINTS):  # haalman2024, eq. (2)
    integral = 1 / (ti * s) if math.isfinite(ti) else 0.0
    return kp * (1 + integral + td * s / (td / n * s + 1) + ta * s**2 / (ta / m * s + 1) ** 2)


@pytest.mark.parametrize(
    "values",
    [(1.31, 3.37, 0.938, 0.269, 10, 10), (-2.0, 4.0, 1.0, 0.5, 3, 700), (2.0, 4.0, 0.0, 0.5, 3, 7),
     (2.0, 4.0, 1.0, 0.0, 3, 7), (2.0, 4.0, 0.0, 0.0, 3, 7), (2.0, math.inf, 1.0, 0.5, 3, 7),
     (2.0, math.inf, 0.0, 0.0, 3, 7)],
)  # fmt: skip
def test_pida_matches_the_printed_formula(values):
    C = pidalab.PIDA(*values)
    np.testing.assert_allclose(C(POINTS), pida_formula(*values), rtol=1e-11)
    np.testing.assert_allclose(C.transfer_function()(POINTS), pida_formula(*values), rtol=1e-11)
    order = sum([math.isfinite(values[1]), values[2] > 0, 2 * (values[3] > 0)])
    assert len(C.transfer_function().den[0][0]) - 1 == order  # absent actions give no factors


@pytest.mark.parametrize("tau_d", [0.0, 0.7])
@pytest.mark.parametrize("tau_a", [0.0, 1.3])
def test_non_interactive_matches_the_printed_formula(tau_d, tau_a):
    C = pidalab.NonInteractivePIDA(-1.5, 2.5, tau_d, tau_a, alpha_d=0.1, alpha_a=0.03)
    s = POINTS  # heo2023, eq. (16)
    formula = (
        1
        + 1 / (2.5 * s)
        + tau_d * s / (0.1 * tau_d * s + 1)
        + tau_a**2 * s**2 / (2 * (0.03 * tau_a * s + 1) ** 2)
    )
    np.testing.assert_allclose(C(s), -1.5 * formula, rtol=1e-11)


@pytest.mark.parametrize("order", [2, 3, 6])
def test_high_order_matches_the_printed_formula(order):
    C = pidalab.HighOrderPID([0.5, 2.0, 1.0, 0.25], filter_time=0.2, filter_order=order)
    np.testing.assert_allclose(
        C(POINTS), ideal(IdealGains(0.5, 2.0, 1.0, 0.25)) / (1 + 0.2 * POINTS) ** order, rtol=1e-11
    )


def test_series_matches_the_printed_formula():
    C = pidalab.SeriesPIDA(2.0, -0.5, 0.3, ti=4.0, filter_time=0.2, filter_order=3)
    s = POINTS
    np.testing.assert_allclose(
        C(s), (2 - 0.5 * s + 0.3 * s**2) / (0.2 * s + 1) ** 3 * (1 + 4 * s) / (4 * s), rtol=1e-11
    )


@pytest.mark.parametrize("seed", range(10))
def test_conversions_round_trip(seed):
    kp, ti, td, ta = np.random.default_rng(seed).uniform(0.1, 3.0, 4).tolist()
    gains = pidalab.PIDA(kp, ti, td, ta).gains()
    assert gains.standard() == pytest.approx((kp, ti, td, ta), rel=1e-14)
    again = pidalab.NonInteractivePIDA(*gains.non_interactive()).gains()
    assert again == pytest.approx(gains, rel=1e-13)
    series = gains.series()  # a cubic with positive coefficients always has a negative real zero
    assert pidalab.SeriesPIDA(*series, filter_time=0.1, filter_order=2).gains() == pytest.approx(
        gains, rel=1e-9
    )


@pytest.mark.parametrize(
    "form", [(2.0, 1.0, 0.25, 4.0), (0.5, 2.0, 0.0, 3.0), (1.0, 0.0, 0.0, 2.0)], ids=["pida", "pid", "pi"]
)
def test_series_round_trip_picks_the_largest_reset_time(form):
    gains = pidalab.SeriesPIDA(*form, filter_time=0.1, filter_order=2).gains()
    kp, kd, ka, ti = gains.series()
    s = POINTS
    np.testing.assert_allclose((kp + kd * s + ka * s**2) * (1 + 1 / (ti * s)), ideal(gains), rtol=1e-9)
    zeros = np.roots(np.trim_zeros([gains.ka, gains.kd, gains.kp, gains.ki], "f"))
    assert ti == pytest.approx(max(-1 / z.real for z in zeros if abs(z.imag) < 1e-9), rel=1e-9)


@pytest.mark.parametrize("C", [pidalab.PIDA(2.0, math.inf, 1.0, 0.5), *MADE], ids=lambda C: type(C).__name__)
def test_text_prints_every_form_or_the_reason(C):
    lines = str(C).splitlines()
    assert lines[0] == repr(C)
    forms = ["standard", "parallel", "non-interactive", "series"]
    assert [line.split(":")[0].strip() for line in lines[1:]] == forms
    assert all(re.search(r": +(\w+ = |no [a-z-]+ form: )", line) for line in lines[1:])


@pytest.mark.parametrize("C", MADE, ids=lambda C: type(C).__name__)
def test_gains_are_the_controller_without_its_filters(C):
    slow = 1e-6 * POINTS
    np.testing.assert_allclose(C(slow), ideal(C.gains(), slow), rtol=1e-5)


@pytest.mark.parametrize("C", MADE, ids=lambda C: type(C).__name__)
def test_repr_makes_the_same_controller_and_nothing_changes_it(C):
    assert eval(repr(C), {kind.__name__: kind for kind in GOOD} | {"inf": math.inf}) == C
    for field in dataclasses.fields(C):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(C, field.name, getattr(C, field.name))


def test_without_integral_action_the_fraction_is_the_same_controller():
    """The common s of numerator and denominator is cancelled."""
    controller = pidalab.HighOrderPID([0.0, 2.0, 3.0], filter_time=0.1, filter_order=2)
    num, den = controller.fraction()
    assert den[-1] == 1.0
    filtered = ideal(controller.gains()) / (0.1 * POINTS + 1) ** 2
    np.testing.assert_allclose(np.polyval(num, POINTS) / np.polyval(den, POINTS), filtered, rtol=1e-12)


def test_limits_are_relative_to_the_working_point():
    C = pidalab.SeriesPIDA(1.0, 0.5, 0.0, 2.0, 0.1, 2, limits=(-1.0, 3.0))
    assert C.discretise(0.1).limits == (-1.0, 3.0)
    assert C.discretise(0.1, bias=10.0).limits == (9.0, 13.0)
    assert C.discretise(0.1, limits=(-7.0, 7.0)).limits == (-7.0, 7.0)
    assert pidalab.PIDA(1.0, 2.0).discretise(0.1, bias=5.0).limits == (-np.inf, np.inf)
