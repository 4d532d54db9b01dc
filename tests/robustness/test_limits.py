"""Check circle and Popov criterion."""

import dataclasses
import math

import control
import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab.robustness import circle, linear_part, popov, smallest_filter_time
from pidalab.robustness.limits import ends, infimum
from pidalab.rules import automatic_reset as reset

UNIT = pidalab.ipdt(1.0, delay=1.0)


def design(setting, n=4, te=0.8, **options):
    return reset.tune(UNIT, setting, n=n, filter_time=te / n, **options)


@pytest.mark.parametrize("order", range(2, 8))
def test_circle_criterion_of_equal_lags(order):
    """With ω = tan φ the real part is cos^n φ cos nφ, with the minimum at φ = π/(n + 1)."""
    result = circle(pidalab.Loop(pidalab.lags(order, lag=3.0), 0.7))
    assert result.margin == pytest.approx(1 - 0.7 * math.cos(math.pi / (order + 1)) ** (order + 1), abs=1e-12)
    assert 3 * result.frequency == pytest.approx(math.tan(math.pi / (order + 1)), rel=1e-5)


@pytest.mark.parametrize("order", range(3, 7))
def test_popov_criterion_of_equal_lags_reaches_the_limit_of_stability(order):
    limit = math.cos(math.pi / order) ** -order
    assert popov(pidalab.Loop(pidalab.lags(order), 0.999 * limit)).holds
    assert not popov(pidalab.Loop(pidalab.lags(order), 1.001 * limit)).holds


def test_popov_criterion_of_two_lags_holds_for_any_gain():
    """Re (1 + jωθ)/(1 + jω)² is positive for θ ≥ 1/2; the circle criterion ends at the gain 8."""
    assert popov(pidalab.Loop(pidalab.lags(2), 1e3)).holds
    assert [circle(pidalab.Loop(pidalab.lags(2), gain)).holds for gain in (7.99, 8.01)] == [True, False]


@pytest.mark.parametrize(("gain", "delay"), [(1.0, 1.0), (0.3, 4.0), (2.5, 0.1)])
def test_integrator_with_dead_time(gain, delay):
    """Re K e^{-jωL}/(jω) = -K sin(ωL)/ω is least at 0, where it is -K L."""
    result = circle(pidalab.Loop(pidalab.ipdt(gain, delay), 1.0))
    assert result[:2] == (pytest.approx(1 - gain * delay, rel=1e-14), 0.0)


@pytest.mark.parametrize("name", reset.SETTINGS)
@pytest.mark.parametrize(("n", "weight"), [(4, 1.0), (3, 0.5), (2, 1.0)])
def test_limit_at_zero_frequency(name, n, weight):
    """The limit is K_s (K_d - K_p (T_dp + n T_f)). Only with N = 1 is the bracket the total dead time T_d."""
    d = reset.tune(pidalab.ipdt(0.5, delay=2.0), reset.SETTINGS[name], n, filter_time=0.3, weight=weight)
    limit = 0.5 * (d.kd - d.kp * (2.0 + n * 0.3))
    assert ends(linear_part(d.loop()), 0.0)[0] == pytest.approx(limit, abs=1e-14)
    if weight == 1.0:
        assert limit == pytest.approx(d.setting.kd - d.setting.kp, abs=1e-14)


def test_a_criterion_that_holds_implies_linear_stability():
    """The sector has the gains from 0 to 1, so neither criterion may hold for an unstable loop."""
    rng = np.random.default_rng(5)
    unstable = 0
    for _ in range(40):
        kp, kd, ka, ti = rng.uniform(0, 1.5), rng.uniform(0, 1.5), rng.uniform(0, 0.5), rng.uniform(0.2, 5)
        loop = pidalab.Loop(UNIT, pidalab.SeriesPIDA(kp, kd, ka, ti, filter_time=0.1, filter_order=3))
        if not pidalab.is_stable(loop):
            unstable += 1
            part = linear_part(loop)
            assert all(infimum(part, theta)[0] < 0 for theta in (0.0, 0.1, 0.5, 1.0, 2.0))
    assert 5 < unstable < 40


def test_output_filter_and_reset_in_the_linear_part():
    """1 + G = (1 - F_r)(1 + L), whatever stands in the loop."""
    import control

    loop = pidalab.Loop(UNIT, design(reset.PIDA_1).controller, output_filter=control.tf([1.0], [0.3, 1.0]))
    s = np.array([0.1j, 1j, 10j])
    ti = loop.controller.ti
    assert 1 + linear_part(loop)(s) == pytest.approx(ti * s / (1 + ti * s) * (1 + loop.L(s)), rel=1e-12)


def retuned(setting, n):
    return lambda filter_time: reset.tune(UNIT, setting, n=n, filter_time=filter_time).loop()


def gains_stay(setting, n):
    C = design(setting, n).controller
    return lambda filter_time: pidalab.Loop(UNIT, dataclasses.replace(C, filter_time=filter_time))


@pytest.mark.parametrize("family", [retuned, gains_stay])
@pytest.mark.parametrize("setting", [reset.PPM_PIDA, reset.PIDA_1, reset.PIDA_2], ids=lambda x: x.name)
def test_smallest_filter(family, setting):
    """The criterion holds only above the limit. The linear loop is stable with an even shorter filter."""
    loops = family(setting, 4)
    border = smallest_filter_time(loops, lambda loop: circle(loop).holds, longest=0.2)
    assert [circle(loops(x * border)).holds for x in (0.999, 1.0, 1.001, 1.2, 2.0)] == [
        False,
        True,
        True,
        True,
        True,
    ]
    assert smallest_filter_time(loops, pidalab.is_stable, longest=0.2) < border


@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_the_residue_of_an_inverse_response_is_taken_at_zero_frequency(gain):
    """P = k (1 - s/2) e^(-s/2)/(s (s + 1)) first moves the other way. A gain of 0.2/k stabilises it."""
    process = pidalab.Process([-0.5 * gain, gain], [1.0, 1.0, 0.0], 0.5)
    assert circle(pidalab.Loop(process, 0.2 / gain)).holds
    with pytest.raises(ValueError, match="positive residue"):
        circle(pidalab.Loop(process, -0.2 / gain))


@pytest.mark.parametrize("longest", [0.2, 5.0])
def test_smallest_filter_time_searches_three_decades(longest):
    """The property holds down to a known time constant."""

    def found(border):
        return smallest_filter_time(lambda filter_time: filter_time, lambda time: time >= border, longest)

    assert found(2e-3 * longest) == pytest.approx(2e-3 * longest, rel=1e-6)
    assert found(0.9e-3 * longest) == 0


def test_short_filter():
    """Around a peak of |F| of several hundred the phase makes thousands of turns."""
    loop = pidalab.Loop(UNIT, pidalab.SeriesPIDA(0.1, 0.2, 0.05, 0.5, filter_time=1e-3, filter_order=2))
    result = circle(loop)
    w = result.frequency + np.linspace(-20.0, 20.0, 400_001)
    assert result.margin == pytest.approx((1 + linear_part(loop)(1j * w).real).min(), rel=1e-6)
    assert result.margin < -20


# Compare with the oracle, to the documented digits.

FILE = oracle("limits.json")


def limited_loop(case):
    """Return the loop of a case, with its automatic reset if it has one."""
    loop = oracle_loop(case)
    return (
        pidalab.Loop(loop.process, pidalab.SeriesPIDA(**case["arguments"])) if "arguments" in case else loop
    )


@pytest.mark.parametrize("case", FILE["cases"], ids=lambda case: case["name"])
def test_circle(case):
    result, true = circle(limited_loop(case)), float(case["values"]["circle"])
    assert result.margin == pytest.approx(true, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "case", [c for c in FILE["cases"] if "popov" in c["values"]], ids=lambda c: c["name"]
)
def test_popov(case):
    """No other multiplier has a larger margin."""
    result, true = popov(limited_loop(case)), float(case["values"]["popov"])
    assert result.margin == pytest.approx(true, rel=1e-9, abs=1e-9)


def test_smallest_filter_time():
    """The filter of a derivative becomes too short. The limit is accurate to 6 digits, as documented."""
    case = FILE["filter"]
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])

    def family(time):
        kp, kd = case["kp"], case["kd"]
        return pidalab.Loop(process, control.tf([kp * time + kd, kp], [time, 1.0]))

    border = smallest_filter_time(family, pidalab.is_stable, longest=case["longest"])
    assert border == pytest.approx(float(case["filter_time"]), rel=1e-6)
