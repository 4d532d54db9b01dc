"""Check the magnitude optimum: the flat real part, gains from records, and noise gains."""

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
    """Re L(jw) + 1/2 starts with w^(2m + 4). It is evaluated in 50 digits, without areas and matrix."""
    design = mo.tune(process, m, n, 0.1 if n else 0.0)
    with mpmath.workdps(50):
        far, near = (real_part(process, design, mpmath.mpf(w)) + 0.5 for w in (0.2, 0.1))
        assert math.log2(abs(far / near)) == pytest.approx(2 * m + 4, abs=0.35)


def test_integral_of_the_error():
    """Compare eq. (37) with the exact response to a step of the set point."""
    design = mo.tune(G2, 2, 3, 0.1)
    response = pidalab.step_response(pidalab.Loop(G2, design.controller), np.linspace(0, 60, 6001))
    assert response.ie() == pytest.approx(design.ie, rel=1e-9)


# From records


@pytest.mark.parametrize(("process", "lags", "delay"), [(G1, 4, 0.0), (G2, 2, 0.5)])
@pytest.mark.parametrize("length", [50, 60, 80])
def test_gains_from_a_record(process, lags, delay, length):
    """A step recorded every 0.002 gives the gains of Table 2 to the printed digits, without a model.

    The record needs all digits: because of t^8/8!, an error of 1e-13 in y changes the fourth decimal of the gains.
    """
    t = TS * np.arange(round(length / TS) + 1)
    y = gammainc(lags, np.clip(t - delay, 0, None))  # step response of equal lags
    measured = areas.from_record(t, 1.0, y, 10, start=(0.0, 0.0))
    for m in (1, 2, 3):
        design = mo.tune(measured, m, m, 0.1)
        assert design.gains == pytest.approx(mo.tune(process, m, m, 0.1).gains, abs=5e-4)
        assert 0 < max(design.uncertainty) < 1e-3


def record_areas(values, error):
    """Return measured areas with a known error."""
    covariance = np.outer(error, error)
    return areas.MeasuredAreas(values, covariance, (0, 1), (0, 1), (0, 1), True, 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_uncertainty_of_gains_follows_from_that_of_areas(seed):
    """Compare with finite differences. Gains with an uncertainty above 100 % are refused."""
    values, m, n, time = areas.from_process(G2, 8), 2, 3, 0.2
    error = 1e-7 * np.random.default_rng(seed).normal(size=8)
    up, down = (np.array(mo.tune(values + sign * error, m, n, time).gains) for sign in (0.5, -0.5))
    design = mo.tune(record_areas(values, error), m, n, time)
    assert design.uncertainty == pytest.approx(np.abs(up - down), rel=1e-4)
    share = np.max(np.array(design.uncertainty) / np.abs(design.gains))
    mo.tune(record_areas(values, 0.9 / share * error), m, n, time)
    with pytest.raises(ValueError, match="uncertain by 150 %"):
        mo.tune(record_areas(values, 1.5 / share * error), m, n, time)


def test_only_the_integral_gain_of_a_record_must_have_the_sign_of_the_process():
    slow = pidalab.Process([2.7, 1.0], [6.3, 12.5, 6.7, 1.0], 1.66)
    integral, _, derivative = mo.tune(record_areas(areas.from_process(slow, 6), np.zeros(6)), 1, 2, 0.2).gains
    assert integral > 0 > derivative
    light = pidalab.Process([1.9], [1.0, 0.1, 1.0], 0.2)
    with pytest.raises(ValueError, match=r"K_-1 = -0\.034\d* must have the sign of A_0 = 1\.9"):
        mo.tune(record_areas(areas.from_process(light, 6), np.zeros(6)), 1, 3, 0.2)


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
    """After a sampled lag with pole a, noise has the variance (1 - a)/(1 + a). The second case has a direct part."""
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


def test_the_noise_of_the_filter_is_not_that_of_the_loop():
    """By the paper's equation the filter has the requested noise gain. The loop has another one."""
    design = mo.tune_for_filter_noise(pidalab.lags(3, delay=0.5), 2, 4, 10.0, TS)
    assert 1e-3 < abs(pidalab.noise_gain(design.loop(), TS) / 10.0 - 1) < 0.1
