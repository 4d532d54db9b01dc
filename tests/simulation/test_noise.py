"""Check noise and noise gains: the seed, closed forms and the oracle."""

import dataclasses
import math

import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab
from pidalab import PIDA, Loop


def test_noise_is_held_bounded_and_reproducible():
    t = np.arange(1000) * 0.01
    noise = pidalab.uniform_noise(t, 0.1, seed=3, hold=0.05)
    np.testing.assert_array_equal(noise, pidalab.uniform_noise(t, 0.1, seed=3, hold=0.05))
    assert np.all(noise.reshape(-1, 5) == noise[::5, None])
    assert np.unique(noise).size == 200
    assert np.abs(noise).max() <= 0.1
    assert np.std(noise) == pytest.approx(0.1 / math.sqrt(3), rel=0.1)
    assert np.any(noise != pidalab.uniform_noise(t, 0.1, seed=4, hold=0.05))
    assert not pidalab.uniform_noise(t, 0.0, seed=3).any()


def test_noise_gain_is_of_linear_loops():
    """Limits have no effect. An automatic reset counts as an integrator."""
    series = pidalab.SeriesPIDA(0.3, 0.1, 0.0, 1.5, 0.1, 2)
    loop = Loop(pidalab.ipdt(1.0, delay=0.37), series)
    limited = dataclasses.replace(loop.controller, limits=(-0.1, 0.1))
    assert pidalab.noise_gain(Loop(loop.process, limited), 0.05) == pidalab.noise_gain(loop, 0.05)
    digital = limited.discretise(0.05, "zoh", rate_limit=1.0, deadband=0.1)
    assert pidalab.noise_gain(Loop(loop.process, digital), 0.05) == pytest.approx(
        pidalab.noise_gain(loop, 0.05), rel=1e-9
    )
    linear = Loop(loop.process, loop.controller.transfer_function())
    assert pidalab.noise_gain(loop, 0.001) == pytest.approx(pidalab.noise_gain(linear, 0.001), rel=2e-3)


@pytest.mark.parametrize("kp", [0.2, 2.0, -0.5])
@pytest.mark.parametrize("h", [0.05, 0.4])
def test_noise_gain_of_a_lag_in_closed_form(kp, h):
    """With y[k + 1] = a y[k] + (1 - a) u[k] and u = -K (y + n), the loop is a lag with the pole a - (1 - a) K."""
    process, a = pidalab.fopdt(1.0, 1.0, 0.0), math.exp(-h)
    pole, driven = a - (1 - a) * kp, (1 - a) * kp
    expected = abs(kp) * math.sqrt(1 + driven**2 / (1 - pole**2))
    for controller in (PIDA(kp, math.inf), PIDA(kp, math.inf).discretise(h)):
        assert pidalab.noise_gain(Loop(process, controller), h) == pytest.approx(expected, rel=1e-9)


def test_noise_gain_without_a_process():
    """Noise passes through the controller directly, or not at all without gain."""
    late = pidalab.Process([0.0], [1.0, 1.0])
    assert pidalab.noise_gain(Loop(late, 3.0), 0.1) == 3.0
    assert pidalab.noise_gain(Loop(pidalab.fopdt(1.0, 1.0, 0.5), 0.0), 0.1) == 0.0


# Compare the noise gain of sampled loops with the oracle, to 1e-9.

CASES = [case for case in oracle("sampled_loops.json")["cases"] if case["values"]["stable"]]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_noise_gain(case):
    gain = pidalab.noise_gain(sampled_oracle_loop(case), case["sample_time"])
    assert gain == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)


@pytest.mark.parametrize("case", [c for c in CASES if c["method"] == "zoh"], ids=lambda case: case["name"])
def test_noise_gain_of_a_continuous_controller(case):
    gain = pidalab.noise_gain(sampled_oracle_loop(case, digital=False), case["sample_time"])
    assert gain == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)
