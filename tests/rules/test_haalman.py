"""Check the generalised Haalman rule: cancellation, and the gain that reaches Ms."""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

import pidalab
from pidalab import Loop, Process
from pidalab.rules import haalman

THIRD = Process([1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)  # haalman2024, eq. (12)
SECOND = Process([1.0], [2.062, 2.875, 1.0], delay=1.12)  # eq. (14)
MODELS = {"third": THIRD, "second": SECOND}


@pytest.fixture(scope="module")
def tuned():
    """Return controllers by (model, ms)."""
    rules = {"third": partial(haalman.pida, m=10), "second": haalman.pid}
    return {(name, ms): rules[name](MODELS[name], ms=ms) for name in MODELS for ms in (1.4, 2.0)}


KEYS = [(name, ms) for name in MODELS for ms in (1.4, 2.0)]


@pytest.mark.parametrize("key", KEYS, ids=str)
def test_times_cancel_the_poles(tuned, key):
    """Without the filters L is kp K/(ti s) e^{-Ls}, an integrator with dead time."""
    C, model, s = tuned[key], MODELS[key[0]], np.array([0.3 + 0.7j, 2.0 - 1.0j, 0.01j])
    ki, kp, kd, ka = C.gains()
    np.testing.assert_allclose(
        (ki / s + kp + kd * s + ka * s**2) * model(s), ki / s * np.exp(-model.delay * s), rtol=1e-12
    )


@pytest.mark.parametrize("key", KEYS, ids=str)
def test_gain_reaches_ms(tuned, key):
    loop = Loop(MODELS[key[0]], tuned[key])
    assert pidalab.max_sensitivity(loop)[0] == pytest.approx(key[1], rel=1e-9)
    assert pidalab.is_stable(loop)


def test_output_filter_is_twenty_times_faster_than_the_crossover(tuned):
    F = haalman.output_filter(THIRD, tuned["third", 1.4])
    assert (F.order, haalman.output_filter(SECOND, tuned["second", 1.4]).order) == (2, 1)
    assert F.time * F.wgc == pytest.approx(0.05)
    assert abs(Loop(THIRD, tuned["third", 1.4]).L(1j * F.wgc)) == pytest.approx(1.0)
    s = 0.3 + 2.0j
    assert F.transfer_function()(s) == pytest.approx(1 / (F.time * s + 1) ** 2)
    assert Loop(THIRD, tuned["third", 1.4], F).block("output_filter", s) == pytest.approx(
        1 / (F.time * s + 1) ** 2
    )


def test_integrator_with_dead_time_in_closed_form():
    """With a very fast filter L is kp K/(ti s) e^{-Ls}, so that kp L/ti depends on Ms alone."""
    x = np.linspace(0.5, 2.0, 1_000_001)  # frequency times dead time
    C = haalman.pid(SECOND, ms=1.59049, n=1e5)
    k = C.kp * SECOND.delay / C.ti
    assert np.max(1 / np.abs(1 + k / (1j * x) * np.exp(-1j * x))) == pytest.approx(1.59049, abs=1e-4)
    assert k == pytest.approx(0.5, abs=1e-4)  # as for 0.5/s e^{-s}, whose Ms is 1.590490


def test_the_ms_of_a_design_is_that_of_its_loop(tuned):
    """The output filter raises Ms. The requested value is `ms_asked`."""
    design = haalman.tune(pidalab.lags(3, delay=1.0), ms=1.4)
    assert design.ms_asked == 1.4
    assert design.ms == pidalab.margins(design.loop()).ms > 1.5
    loud = dataclasses.replace(design, controller=20.0 * design.controller)
    assert loud.ms == math.inf


@pytest.mark.parametrize("unit", [1e-6, 1e-9, 1e-10])
def test_short_lags_keep_their_digits(unit):
    """The filter time is ta/m, and ta is a time squared. For lags of 1e-9 the filter time is 3e-11 of the lags."""
    areas = []
    for lag, m in ((unit, 10), (1.0, 1e7)):  # the second filter time is 3e-8 of the lags
        process = pidalab.lags(3, lag=lag, delay=lag)
        loop = Loop(process, haalman.tune(process, ms=1.6, m=m).controller)
        areas.append(pidalab.step_response(loop, np.linspace(0.0, 40.0 * lag, 4001)).iae() / lag)
    assert areas[0] == pytest.approx(areas[1], rel=1e-6)


def test_ratio_of_the_acceleration_filter():
    assert haalman.pida(THIRD, m=10).m == haalman.tune(THIRD, m=10).controller.m == 10
    default = haalman.pida(THIRD, n=20)
    assert default.ta / default.m == pytest.approx(0.905 / (20 * 3.159))
