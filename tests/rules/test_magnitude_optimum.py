"""Magnitude optimum: the flat real part, records, noise gains, ranking of orders, refusals."""

import math

import control
import mpmath
import numpy as np
import pytest
from scipy.special import gammainc

import pidalab
from pidalab import areas
from pidalab.rules import magnitude_optimum as mo
from pidalab.rules.magnitude_optimum import filtered_noise_gain

G1, G2 = pidalab.lags(4), pidalab.lags(2, delay=0.5)
G3 = pidalab.lags(3, delay=0.5)
TS = 0.002


def poles(*lags):
    den = np.ones(1)
    for lag in lags:
        den = np.convolve(den, [lag, 1.0])
    return den


# The principle


def real_part(process, design, w):
    s, n = mpmath.mpc(0, w), design.controller.filter_order
    top = sum(mpmath.mpf(k) * s**i for i, k in enumerate(design.gains, start=-1))
    num = mpmath.polyval(process.num[::-1].tolist(), s, asc=True)
    den = mpmath.polyval(process.den[::-1].tolist(), s, asc=True)
    lag = 1 + mpmath.mpf(design.filter_time) * s
    return mpmath.re(top * num / den * mpmath.exp(-s * mpmath.mpf(process.delay)) / lag**n)


FLAT = [G2, pidalab.Process([-0.3, 2.0], poles(2, 1, 0.5), 0.4), pidalab.sopdt(-3, 1, 0.6, 0.5)]


@pytest.mark.parametrize(("m", "n"), [(0, 0), (0, 2), (1, 1), (2, 2), (2, 5), (3, 4)])
@pytest.mark.parametrize("process", FLAT)
def test_real_part_is_flat(process, m, n):
    """Re L(jw) + 1/2 begins with w^(2m + 4): evaluated in 50 digits, without areas and without the matrix."""
    design = mo.tune(process, m, n, 0.1 if n else 0.0)
    with mpmath.workdps(50):
        far, near = (real_part(process, design, mpmath.mpf(w)) + 0.5 for w in (0.2, 0.1))
        assert math.log2(abs(far / near)) == pytest.approx(2 * m + 4, abs=0.35)


def test_closed_loop_magnitude_stays_1():
    loop = pidalab.Loop(G1, mo.tune(G1, 3, 3, 0.1).controller)
    w = np.linspace(0.01, 1.0, 50)
    assert np.abs(loop.T(1j * w)) == pytest.approx(1.0, abs=2e-3)


def test_integral_of_the_error():
    """Eq. (37), against the exact response to a step of the set point."""
    design = mo.tune(G2, 2, 3, 0.1)
    response = pidalab.step_response(pidalab.Loop(G2, design.controller), np.linspace(0, 60, 6001))
    assert response.ie() == pytest.approx(design.ie, rel=1e-9)


# From records


@pytest.mark.parametrize(("process", "lags", "delay"), [(G1, 4, 0.0), (G2, 2, 0.5)])
@pytest.mark.parametrize("length", [50, 60, 80])
def test_gains_from_a_record(process, lags, delay, length):
    """Those of Table 2 without a model, from a step recorded every 0.002, to the printed digits.

    The record has all its digits: t^8/8! makes the fourth decimal of the gains of PID_3^3 from an error of 1e-13 in y.
    """
    t = TS * np.arange(round(length / TS) + 1)
    y = gammainc(lags, np.clip(t - delay, 0, None))  # step response of equal lags
    measured = areas.from_record(t, 1.0, y, 10, start=(0.0, 0.0))
    for m in (1, 2, 3):
        design = mo.tune(measured, m, m, 0.1)
        assert design.gains == pytest.approx(mo.tune(process, m, m, 0.1).gains, abs=5e-4)
        assert 0 < max(design.uncertainty) < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_uncertainty_of_gains_is_that_of_areas_passed_on(seed):
    """One error of the areas that is fully known: its effect on the gains, by differences and as passed on."""
    values, m, n, time = areas.from_process(G2, 8), 2, 3, 0.2
    error = 1e-7 * np.random.default_rng(seed).normal(size=8)
    measured = areas.MeasuredAreas(values, np.outer(error, error), (0, 1), (0, 1), (0, 1), True, 0.0)
    up, down = (np.array(mo.tune(values + sign * error, m, n, time).gains) for sign in (0.5, -0.5))
    assert mo.tune(measured, m, n, time).uncertainty == pytest.approx(np.abs(up - down), rel=1e-4)


def measured(process, count):
    """Areas as of a record without any error."""
    return areas.MeasuredAreas(
        areas.from_process(process, count), np.zeros((count, count)), (0, 1), (0, 1), (0, 1), True, 0.0
    )


def test_of_a_record_the_sign_of_the_integral_gain_counts_and_of_no_other():
    slow = pidalab.Process([2.7, 1.0], [6.3, 12.5, 6.7, 1.0], 1.66)
    integral, _, derivative = mo.tune(measured(slow, 6), 1, 2, 0.2).gains
    assert integral > 0 > derivative
    with pytest.raises(ValueError, match=r"K_-1 = -0\.034\d* must have the sign of A_0 = 1\.9"):
        mo.tune(measured(pidalab.Process([1.9], [1.0, 0.1, 1.0], 0.2), 6), 1, 3, 0.2)


def test_a_gain_as_uncertain_as_it_is_large_is_refused():
    """Uncertainty goes with the error of the areas: 0.9 times the gain is told, 1.5 times refused."""
    values, error = areas.from_process(G2, 8), 1e-7 * np.random.default_rng(0).normal(size=8)

    def design(times):
        covariance = np.outer(times * error, times * error)
        return mo.tune(areas.MeasuredAreas(values, covariance, (0, 1), (0, 1), (0, 1), True, 0.0), 2, 3, 0.2)

    small = design(1.0)
    share = np.max(np.array(small.uncertainty) / np.abs(small.gains))
    assert np.max(np.array(design(0.9 / share).uncertainty) / np.abs(small.gains)) == pytest.approx(0.9)
    with pytest.raises(ValueError, match="uncertain by 150 %, and 100 % is allowed"):
        design(1.5 / share)


@pytest.mark.filterwarnings("ignore::pidalab.areas.RecordWarning")
def test_uncertain_gains_are_told_and_refused():
    """Noise of 0.001: PID good to a few per cent, as it says; PID_3^3 refused."""
    t, rng = 0.01 * np.arange(3001), np.random.default_rng(2)
    y = pidalab.open_loop_step(G1, t).y
    true, errors, claimed = np.array(mo.tune(G1, 1, 1, 0.1).gains), [], []
    for _ in range(20):
        measured = areas.from_record(
            t, np.ones_like(t), y + 1e-3 * rng.normal(size=t.size), 10, start=(0.0, 0.0)
        )
        design = mo.tune(measured, 1, 1, 0.1)
        errors.append(design.gains - true)
        claimed.append(design.uncertainty)
        with pytest.raises(ValueError, match=r"the record leaves K_-?. uncertain by .* % with m = 3"):
            mo.tune(measured, 3, 3, 0.1)
    spread, claim = np.sqrt(np.mean(np.square(errors), axis=0)), np.median(claimed, axis=0)
    assert np.all(spread < 2 * claim)
    assert np.all(claim < 10 * spread)
    assert np.all(spread < 0.1 * true)


# Noise gain


def noise_gain(design, sample_time):
    n = design.controller.filter_order
    return filtered_noise_gain(design.gains, design.filter_time, n, design.static_gain, sample_time)


def test_estimate_is_met():
    for m, n in ((0, 1), (1, 2), (2, 2), (3, 6)):
        design = mo.tune_for_noise(G3, m, n, 10.0, TS)
        again = mo.filter_time(design.gains[-1], m, n, 10.0, TS)
        assert again == pytest.approx(design.filter_time, rel=1e-11)


def test_estimate_written_out():
    assert mo.filter_time(8.0, 3, 3, 1.0, 123.0) == pytest.approx(2.0)
    assert mo.filter_time(-2.0, 1, 3, 0.5, math.pi) == pytest.approx((16 / 2 * (1 / 3 + 1 / 3)) ** (1 / 3))


def test_noise_gain_of_a_lag():
    """Noise through a sampled lag with pole a has the variance (1 - a)/(1 + a); beside it, a direct share."""
    a = math.exp(-0.1)
    loop = pidalab.Loop(pidalab.Process([0.0], [1.0]), control.tf([1.0], [1.0, 1.0]))
    assert pidalab.noise_gain(loop, 0.1) == pytest.approx(math.sqrt((1 - a) / (1 + a)), rel=1e-10)
    design = mo.tune(G2, 1, 1, 0.5)
    d, a = design.gains[2] / 0.5, math.exp(-0.05 / 0.5)
    assert noise_gain(design, 0.05) == pytest.approx(
        math.hypot(d, (1 - d) * math.sqrt((1 - a) / (1 + a))), rel=1e-12
    )


def test_exact_noise_gain():
    for m, n in ((1, 1), (2, 4), (4, 6)):
        assert noise_gain(mo.tune_for_filter_noise(G3, m, n, 7.0, TS), TS) == pytest.approx(7.0, rel=1e-10)


# Refusals


def dominant_delay():
    return pidalab.fopdt(1.0, 0.05, 1.0)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: mo.tune(G1, 30, 31, 0.01), "m must be at most 16, found 30"),
        (lambda: mo.tune(G1, 2, 1, 0.1), "n must be a whole number, at least 2, found 1"),
        (lambda: mo.tune(G1, 1, 1, 0.0), "filter_time must be above 0"),
        (
            lambda: mo.tune([1.0, 4.0, 10.0, 20.0], 1, 1, 0.1),
            r"at least 2m \+ 4 = 6 areas for m = 1, found 4",
        ),
        (lambda: mo.tune(pidalab.Process([1.0, 0.0], [1.0, 1.0]), 1, 1, 0.1), "static gain A_0 other than 0"),
        (lambda: mo.tune(pidalab.lags(1, 0.3), 2, 2, 0.1), "singular matrix"),
        (lambda: mo.tune(areas.from_process(pidalab.lags(1, 0.3), 8), 2, 2, 0.1), "ill-conditioned"),
        (lambda: mo.tune(dominant_delay(), 3, 4, 0.1), r"the loop of PID_4\^3 .* is unstable"),
        (lambda: mo.filter_time(1.0, 0, 0, 1.0, 1.0), "n must be a whole number, at least 1, found 0"),
        (lambda: mo.tune_for_noise(G1, 1, 2, 0.0, TS), "noise_gain must be above 0"),
        (
            lambda: mo.tune_for_noise(G1, 1, 1, 0.1, TS),
            "noise_gain = 0.1",
        ),
        (
            lambda: mo.tune_for_filter_noise(G1, 0, 1, 10.0, TS),
            "noise_gain = 10 gives no filter time",
        ),
    ],
)
def test_refusals(call, text):
    with pytest.raises(ValueError, match=text):
        call()


def test_the_noise_of_the_filter_is_not_that_of_the_loop():
    """The equation of the paper has the noise gain asked for; the loop has another one."""
    design = mo.tune_for_filter_noise(pidalab.lags(3, delay=0.5), 2, 4, 10.0, TS)
    assert 1e-3 < abs(pidalab.noise_gain(design.loop(), TS) / 10.0 - 1) < 0.1


def test_what_is_no_model():
    with pytest.raises(TypeError, match="model must be an array of real numbers"):
        mo.tune("lags", 1, 1, 0.1)


def test_unstable_designs_can_be_looked_at():
    design = mo.tune(areas.from_process(dominant_delay(), 10), 3, 4, 0.1)
    assert not pidalab.is_stable(pidalab.Loop(dominant_delay(), design.controller))
