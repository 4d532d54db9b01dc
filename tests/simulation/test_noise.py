"""Noise and what a loop makes of it: closed forms, the seed, limits that play no part, every refusal."""

import dataclasses
import math

import mpmath
import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab
from pidalab import PIDA, Loop
from pidalab.simulation.sampled import FADED, TAIL_SAMPLES

TIME = np.arange(241) * 0.05


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
    """Limits play no part; an automatic reset is an integrator."""
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
    """y = a y + (1 - a) u a sample later, u = -k (y + n): a lag of noise with the pole a - (1 - a) k."""
    process, a = pidalab.fopdt(1.0, 1.0, 0.0), math.exp(-h)
    pole, driven = a - (1 - a) * kp, (1 - a) * kp
    expected = abs(kp) * math.sqrt(1 + driven**2 / (1 - pole**2))
    for controller in (PIDA(kp, math.inf), PIDA(kp, math.inf).discretise(h)):
        assert pidalab.noise_gain(Loop(process, controller), h) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("kp", "lasting"), [(0.2, 1e9), (1.0, 1e8), (5.0, 1e7), (5.0, 1e5)])
def test_a_faint_tail_that_is_left_out_costs_what_is_said(kp, lasting):
    """A slow integral: of the pulse it keeps 1/lasting, and gives that back in `lasting` samples."""
    h = 0.05
    ki = (1 + kp) / lasting / h
    found = pidalab.noise_gain(Loop(pidalab.fopdt(1.0, 1.0, 0.0), PIDA(kp, kp / ki)), h)
    with mpmath.workdps(40):  # sum of squares of x = A x + b, u = c x + kp, by Lyapunov's equation
        a, one = mpmath.exp(-mpmath.mpf(h)), mpmath.mpf(1)
        A = mpmath.matrix([[a - (1 - a) * kp, 1 - a], [-mpmath.mpf(ki) * h, 1]])
        b, c = mpmath.matrix([-(1 - a) * kp, -mpmath.mpf(ki) * h]), [-one * kp, one]
        kron = mpmath.matrix(4, 4)
        for i, j, k, m in np.ndindex(2, 2, 2, 2):
            kron[2 * i + j, 2 * k + m] = (i == k and j == m) - A[i, k] * A[j, m]
        P = mpmath.lu_solve(kron, mpmath.matrix([b[i] * b[j] for i in (0, 1) for j in (0, 1)]))
        squares = one * kp * kp + sum(c[i] * c[j] * P[2 * i + j] for i in (0, 1) for j in (0, 1))
        low = float(1 - found / mpmath.sqrt(squares))
    assert -1e-14 <= low <= 0.5 * FADED * lasting / TAIL_SAMPLES + 1e-14
    if lasting > 1e6:
        assert low > 1e-11  # so it is left out


def test_noise_gain_without_a_process():
    """Noise comes through at once; a controller without gain passes none."""
    late = pidalab.Process([0.0], [1.0, 1.0])
    assert pidalab.noise_gain(Loop(late, 3.0), 0.1) == 3.0
    assert pidalab.noise_gain(Loop(pidalab.fopdt(1.0, 1.0, 0.5), 0.0), 0.1) == 0.0


@pytest.mark.parametrize(
    ("loop", "h", "message"),
    [
        (Loop(pidalab.lags(3), 9.0), 0.01, "found poles in the closed right half-plane"),
        (
            Loop(pidalab.lags(3), PIDA(9.0, 4.0).discretise(0.5)),
            0.5,
            "found poles on or outside the unit circle",
        ),
        (Loop(pidalab.lags(3, delay=0.1), 7.0 / 8), 0.0, "sample_time must be above 0"),
        (
            Loop(pidalab.fopdt(1.0, 1.0, 1.0), 0.5),
            3.8e-6,
            r"sample_time must be at least 3\.81e-06",
        ),
        (Loop(pidalab.lags(4), PIDA(1.5, 4.0, 1.0, 0.3)), 0.5, r"sample time must be at most .*discretise"),
    ],
    ids=["unstable", "digital", "zero", "dead-time", "filter"],
)
def test_noise_gain_complains(loop, h, message):
    with pytest.raises(ValueError, match=message):
        pidalab.noise_gain(loop, h)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"amplitude": -1.0}, r"amplitude must be at least 0, found -1\.0"),
        ({"hold": 0.07}, r"hold must be a multiple of the step of t \(0\.05\), found 0\.07"),
        ({"hold": 0.01}, r"hold must be a multiple of the step of t"),
        ({"hold": 0.0}, "hold must be above 0"),
        ({"seed": -1}, "seed must be a whole number, at least 0"),
        ({"t": [1.0, 2.0]}, "t must start at 0"),
    ],
)
def test_uniform_noise_complains(arguments, message):
    with pytest.raises(ValueError, match=message):
        pidalab.uniform_noise(**({"t": TIME, "amplitude": 1.0, "seed": 0} | arguments))


# The noise gain of sampled loops against the oracle: to 1e-9, while 1e-12 of the squares may be left out.

CASES = [case for case in oracle("sampled_loops.json")["cases"] if case["values"]["stable"]]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_noise_gain(case):
    found = pidalab.noise_gain(sampled_oracle_loop(case), case["sample_time"])
    assert found == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)


@pytest.mark.parametrize("case", [c for c in CASES if c["method"] == "zoh"], ids=lambda case: case["name"])
def test_noise_gain_of_a_continuous_controller(case):
    found = pidalab.noise_gain(sampled_oracle_loop(case, digital=False), case["sample_time"])
    assert found == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)
