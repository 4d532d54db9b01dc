"""Controllers: the printed formulas at random complex frequencies, conversions there and back, and every refusal."""

import dataclasses
import math
import re

import numpy as np
import pytest

import pidalab
from pidalab.forms import IdealGains

RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=20) + 1j * RNG.normal(size=20)


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
def test_pida_is_the_printed_formula(values):
    C = pidalab.PIDA(*values)
    np.testing.assert_allclose(C(POINTS), pida_formula(*values), rtol=1e-11)
    np.testing.assert_allclose(C.transfer_function()(POINTS), pida_formula(*values), rtol=1e-11)
    order = sum([math.isfinite(values[1]), values[2] > 0, 2 * (values[3] > 0)])
    assert len(C.transfer_function().den[0][0]) - 1 == order  # factors of absent actions are left out


@pytest.mark.parametrize("tau_d", [0.0, 0.7])
@pytest.mark.parametrize("tau_a", [0.0, 1.3])
def test_non_interactive_is_the_printed_formula(tau_d, tau_a):
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
def test_high_order_is_the_printed_formula(order):
    C = pidalab.HighOrderPID([0.5, 2.0, 1.0, 0.25], filter_time=0.2, filter_order=order)
    np.testing.assert_allclose(
        C(POINTS), ideal(IdealGains(0.5, 2.0, 1.0, 0.25)) / (1 + 0.2 * POINTS) ** order, rtol=1e-11
    )


def test_series_is_the_printed_formula():
    C = pidalab.SeriesPIDA(2.0, -0.5, 0.3, ti=4.0, filter_time=0.2, filter_order=3)
    s = POINTS
    np.testing.assert_allclose(
        C(s), (2 - 0.5 * s + 0.3 * s**2) / (0.2 * s + 1) ** 3 * (1 + 4 * s) / (4 * s), rtol=1e-11
    )


@pytest.mark.parametrize(
    "C",
    [
        pidalab.PIDA(1.31, 3.37, 0.938, 0.269, n=1e9, m=1e9),
        pidalab.NonInteractivePIDA(1.5, 2.5, 0.7, 1.3, alpha_d=1e-9, alpha_a=1e-9),
        pidalab.HighOrderPID([0.5, 2.0, 1.0, 0.25], filter_time=1e-9, filter_order=2),
        pidalab.SeriesPIDA(2.0, 0.5, 0.3, ti=4.0, filter_time=1e-9, filter_order=2),
    ],
    ids=lambda C: type(C).__name__,
)
def test_gains_are_the_controller_without_its_filters(C):
    np.testing.assert_allclose(C(POINTS), ideal(C.gains()), rtol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_conversions_there_and_back(seed):
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
def test_series_there_and_back_picks_the_largest_reset_time(form):
    gains = pidalab.SeriesPIDA(*form, filter_time=0.1, filter_order=2).gains()
    kp, kd, ka, ti = gains.series()
    s = POINTS
    np.testing.assert_allclose((kp + kd * s + ka * s**2) * (1 + 1 / (ti * s)), ideal(gains), rtol=1e-9)
    zeros = np.roots(np.trim_zeros([gains.ka, gains.kd, gains.kp, gains.ki], "f"))
    assert ti == pytest.approx(max(-1 / z.real for z in zeros if abs(z.imag) < 1e-9), rel=1e-9)


@pytest.mark.parametrize(
    ("gains", "form", "message"),
    [
        ((1.0, 0.0, 1.0, 0.0), "standard", "no standard form: kp is 0"),
        ((1.0, 0.0, 1.0, 0.0), "non_interactive", "no standard form: kp is 0"),
        ((1.0, 1.0, 1.0, -2.0), "non_interactive", "no non-interactive form: .* 2 ta = -4 is negative"),
        ((1.0, -1.0, 1.0, 2.0), "non_interactive", "no non-interactive form: .* 2 ta = -4 is negative"),
        ((0.0, 1.0, 1.0, 0.0), "series", "no series form: there is no integral action"),
        ((1.0, 1.0, 1.0, 0.0), "series", "no series form: no zero is real and negative"),
        ((1.0, -3.0, 2.0, 0.0), "series", "no series form: no zero is real and negative"),
    ],
)
def test_impossible_conversions_say_why(gains, form, message):
    with pytest.raises(ValueError, match=message):
        getattr(IdealGains(*gains), form)()


def test_derivatives_beyond_the_second_have_no_pida_form():
    C = pidalab.HighOrderPID([0.5, 2.0, 1.0, 0.25, 0.1], filter_time=0.1, filter_order=3)
    with pytest.raises(ValueError, match="no PIDA form: derivatives go up to order 3"):
        C.gains()
    assert "K_3 = 0.1" in str(C)


@pytest.mark.parametrize(
    "C",
    [
        pidalab.PIDA(2.0, 4.0, 1.0, 0.5),
        pidalab.PIDA(2.0, math.inf, 1.0, 0.5),
        pidalab.NonInteractivePIDA(2.0, 4.0, 1.0, 1.0),
        pidalab.HighOrderPID([0.0, 0.0, 1.0], filter_time=0.1, filter_order=1),
        pidalab.SeriesPIDA(2.0, 1.0, 0.5, 4.0, 0.1, 2),
    ],
)
def test_str_prints_every_form_or_the_reason(C):
    lines = str(C).splitlines()
    assert lines[0] == repr(C)
    forms = ["standard", "parallel", "non-interactive", "series"]
    assert [line.split(":")[0].strip() for line in lines[1:]] == forms
    assert all(re.search(r": +(\w+ = |no [a-z-]+ form: )", line) for line in lines[1:])


@pytest.mark.parametrize(
    "C",
    [
        pidalab.PIDA(np.float64(2.0), 4.0, 1.0, 0.5),
        pidalab.HighOrderPID([0.5, 2.0], filter_time=0.1, filter_order=1),
        pidalab.SeriesPIDA(2.0, np.float64(1.0), 0.5, 4.0, 0.1, 2),
    ],
)
def test_repr_makes_the_same_controller(C):
    names = {kind.__name__: kind for kind in (pidalab.PIDA, pidalab.HighOrderPID, pidalab.SeriesPIDA)} | {
        "inf": math.inf
    }
    assert eval(repr(C), names) == C


GOOD = {
    pidalab.PIDA: {"kp": 2.0, "ti": 4.0, "td": 1.0, "ta": 0.5},
    pidalab.NonInteractivePIDA: {"kc": 2.0, "tau_i": 4.0, "tau_d": 1.0, "tau_a": 1.0},
    pidalab.HighOrderPID: {"gains": [0.5, 2.0, 1.0, 0.25], "filter_time": 0.1, "filter_order": 2},
    pidalab.SeriesPIDA: {"kp": 2.0, "kd": 1.0, "ka": 0.5, "ti": 4.0, "filter_time": 0.1, "filter_order": 2},
}
BAD = {
    pidalab.PIDA: [
        ("kp", 0.0, "kp must not be 0, found 0"),
        ("kp", math.nan, "kp must be finite, found nan"),
        ("ti", 0.0, r"ti must be above 0, found 0\.0"),
        ("ta", -1.0, r"ta must be at least 0, found -1\.0"),
        ("n", 0.0, r"n must be above 0, found 0\.0"),
    ],
    pidalab.NonInteractivePIDA: [
        ("kc", 0, "kc must not be 0"),
        ("tau_i", 0, "tau_i must be above 0, found 0"),
        ("tau_d", -1, "tau_d must be at least 0, found -1"),
        ("alpha_d", 0, "alpha_d must be above 0, found 0"),
    ],
    pidalab.HighOrderPID: [
        ("gains", [1.0], "gains must be one-dimensional with at least 2"),
        ("gains", [1.0, math.nan], "gains must be finite, found nan at index 1"),
        ("filter_order", 1, "filter_order must be a whole number, at least 2, found 1"),
        ("filter_time", 0.0, r"filter_time must be above 0 .* found 0\.0"),
    ],
    pidalab.SeriesPIDA: [
        ("ti", 0, "ti must be above 0, found 0"),
        ("kd", math.inf, "kd must be finite, found inf"),
        ("filter_time", 0, "filter_time must be above 0, found 0"),
        ("filter_order", 1, "filter_order must be a whole number, at least 2, found 1"),
        ("limits", (1.0, 0.0), r"limits must be .* lower < upper, found \(1\.0, 0\.0\)"),
    ],
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_parameters_name_the_argument(kind):
    for name, value, message in BAD[kind]:
        with pytest.raises(ValueError, match=message):
            kind(**(GOOD[kind] | {name: value}))


@pytest.mark.parametrize("name", ["kp", "ti"])
@pytest.mark.parametrize("value", ["2", "two", None, [1.0, 2.0], [[1.0, 2.0], [3.0]]], ids=repr)
def test_a_parameter_that_is_no_number(name, value):
    with pytest.raises(TypeError, match=f"{name} must be a real number, found"):
        pidalab.PIDA(**(GOOD[pidalab.PIDA] | {name: value}))


@pytest.mark.parametrize("value", [(1.0,), ("a", "b"), 1.0, None], ids=repr)
def test_limits_that_are_no_numbers(value):
    with pytest.raises(TypeError, match="limits must be two numbers, lower and upper, found"):
        pidalab.SeriesPIDA(**(GOOD[pidalab.SeriesPIDA] | {"limits": value}))


def test_reset_signal_is_a_lag_behind_the_limited_signal():
    """Against the recursion by hand, and at the end of a limited loop it is the load with its sign changed."""
    C = pidalab.SeriesPIDA(0.05, 0.24, 0.09, ti=0.42, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
    t = 0.01 * np.arange(6001)
    u = pidalab.simulate_sampled(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), C), t, setpoint=0.0, load=1.0).u
    state, expected = 0.0, []
    for value in u:
        expected.append(state)
        state += (1 - np.exp(-0.01 / 0.42)) * (value - state)
    found = C.reset_signal(u, 0.01)
    assert found == pytest.approx(expected, abs=1e-12)
    assert found[-1] == pytest.approx(-1.0, abs=1e-4)
    assert found.min() > -1.1


def test_without_integral_action_the_fraction_is_the_same_controller():
    """The s that numerator and denominator share is dropped from both, once."""
    controller = pidalab.HighOrderPID([0.0, 2.0, 3.0], filter_time=0.1, filter_order=2)
    num, den = controller.fraction()
    assert den[-1] == 1.0
    filtered = ideal(controller.gains()) / (0.1 * POINTS + 1) ** 2
    np.testing.assert_allclose(np.polyval(num, POINTS) / np.polyval(den, POINTS), filtered, rtol=1e-12)


@pytest.mark.parametrize("C", [kind(**good) for kind, good in GOOD.items()], ids=lambda C: type(C).__name__)
def test_a_controller_does_not_change(C):
    for field in dataclasses.fields(C):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(C, field.name, getattr(C, field.name))


def test_limits_of_a_controller_hold_from_its_working_point_on():
    C = pidalab.SeriesPIDA(1.0, 0.5, 0.0, 2.0, 0.1, 2, limits=(-1.0, 3.0))
    assert C.discretise(0.1).limits == (-1.0, 3.0)
    assert C.discretise(0.1, bias=10.0).limits == (9.0, 13.0)
    assert C.discretise(0.1, limits=(-7.0, 7.0)).limits == (-7.0, 7.0)
    assert pidalab.PIDA(1.0, 2.0).discretise(0.1, bias=5.0).limits == (-np.inf, np.inf)
