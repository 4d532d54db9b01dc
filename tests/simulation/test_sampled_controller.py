"""Check automatic reset, anti-windup, quantisation and pulses of the sampled simulation."""

import json
import math
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.linalg import expm

import pidalab
from pidalab import PIDA, Loop, Process, SeriesPIDA, simulate_sampled

RECORD = json.loads((Path(__file__).parents[1] / "oracle" / "reset_loops.json").read_text(encoding="utf-8"))
CASES = {f"{case['name']}-{'load' if case['load'] else 'setpoint'}": case for case in RECORD["cases"]}


def errors_against_the_oracle(case, h):
    """Return the largest errors of y and u at the times of the oracle."""
    controller = SeriesPIDA(**case["controller"], limits=tuple(case["limits"]))
    loop = Loop(pidalab.ipdt(1.0, case["delay"]), controller, prefilter=control.tf([1.0], case["prefilter"]))
    times = np.array(RECORD["times"])
    each = round((times[1] - times[0]) / h)
    t = np.arange(each * (times.size - 1) + 1) * h
    r = simulate_sampled(loop, t, case["setpoint"], load=case["load"])
    return np.array([np.max(np.abs(r.y[::each] - case["y"])), np.max(np.abs(r.u[::each] - case["u"]))])


@pytest.mark.parametrize("name", CASES)
def test_limited_reset_approaches_the_continuous_loop(name):
    """Errors are of first order in the sample time. The oracle uses Runge-Kutta and the method of steps."""
    case = CASES[name]
    assert min(case["u"]) == pytest.approx(case["limits"][0]) or max(case["u"]) == pytest.approx(
        case["limits"][1]
    )
    coarse, middle, fine = (errors_against_the_oracle(case, h) for h in (0.01, 0.005, 0.0025))
    assert np.all(fine < 0.02)
    for first, second in ((coarse, middle), (middle, fine)):
        assert np.all((first / second > 1.8) & (first / second < 2.25)), (first, second)


def test_reset_by_hand():
    """A simple loop has all parts: filter of third order, fractional dead time, limits, quanta, load and noise."""
    h, n, time, ti, quanta, limits, delay = 0.05, 160, 0.2, 0.9, (0.01, 0.004), (-0.31, 0.27), 0.123
    kp, kd, ka = 0.5, 0.4, 0.05
    rng = np.random.default_rng(3)
    r, d, noise = rng.normal(size=n).cumsum() * 0.1, 0.1 * rng.normal(size=n), 0.02 * rng.normal(size=n)
    A, b = (
        np.array([[-1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]) / time,
        np.array([1.0 / time, 0.0, 0.0]),
    )
    phi = expm(A * h)
    gamma = np.linalg.solve(A, (phi - np.eye(3)) @ b)
    x, reset, position, v, y, u = np.zeros(3), 0.0, 0.0, {}, [], []
    for k in range(n):
        y.append(position)
        measured = round((position + noise[k]) / quanta[0]) * quanta[0]
        error = r[k] - measured
        first = (x[1] - x[2]) / time
        second = ((x[0] - x[1]) / time - first) / time
        limited = min(max(kp * x[2] + kd * first + ka * second + reset, limits[0]), limits[1])
        u.append(min(max(round(limited / quanta[1]) * quanta[1], limits[0]), limits[1]))
        reset = math.exp(-h / ti) * reset + (1 - math.exp(-h / ti)) * limited
        x = phi @ x + gamma * error
        v[k] = u[k] + d[k]
        position += v.get(k - 3, 0.0) * (delay - 2 * h) + v.get(k - 2, 0.0) * (3 * h - delay)
    loop = Loop(pidalab.ipdt(1.0, delay), SeriesPIDA(kp, kd, ka, ti, time, 3, limits=limits))
    out = simulate_sampled(loop, h * np.arange(n), r, load=d, noise=noise, quanta=quanta)
    np.testing.assert_allclose(out.y, y, atol=1e-11)
    np.testing.assert_allclose(out.u, u, atol=1e-11)
    assert {limits[0], limits[1]} <= set(out.u)  # limits need not be multiples of the quantum
    assert np.sum(np.isin(out.u, limits)) < 0.9 * n


def test_limits_of_controller_and_actuator_both_hold():
    loop = Loop(pidalab.ipdt(1.0, 0.3), SeriesPIDA(0.8, 0.0, 0.0, 3.0, 0.1, 1, limits=(-1.0, 0.2)))
    t = 0.02 * np.arange(1500)
    both = simulate_sampled(loop, t, np.where(t < 15.0, 1.0, -1.0), limits=(-0.05, 0.5))
    assert (both.u.min(), both.u.max()) == (-0.05, 0.2)
    tighter = SeriesPIDA(0.8, 0.0, 0.0, 3.0, 0.1, 1, limits=(-0.05, 0.2))
    np.testing.assert_array_equal(simulate_sampled(Loop(loop.process, tighter), t, both.r).u, both.u)
    digital = Loop(loop.process, loop.controller.discretise(0.02))
    held = simulate_sampled(digital, t, both.r, limits=(-0.05, 0.5))
    assert (held.u.min(), held.u.max()) == pytest.approx((-0.05, 0.2), rel=1e-12)


# A PI controller without feedback: kp = 1, ki h = 1/4, limits -1.5 and 1.5, errors 1 six times, then -1.
WINDUP = {
    None: [1.0, 1.25, 1.5, 1.5, 1.5, 1.5, 0.5, 0.25],
    "clamping": [1.0, 1.25, 1.5, 1.5, 1.5, 1.5, -0.25, -0.5],
    "conditioning": [1.0, 1.25, 1.5, 1.5, 1.5, 1.5, 0.18359375, -0.06640625],
}


@pytest.mark.parametrize("way", WINDUP, ids=str)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_windup_by_hand(way, sign):
    loop, r = Loop(Process([0.0], [1.0]), PIDA(kp=1.0, ti=4.0)), sign * np.array([1.0] * 6 + [-1.0] * 2)
    out = simulate_sampled(loop, np.arange(8.0), r, limits=(-1.5, 1.5), anti_windup=way)
    assert out.u.tolist() == pytest.approx([sign * u for u in WINDUP[way]], abs=1e-12)


def test_conditioned_pi_controller_is_automatic_reset():
    """With equal coefficients both have the same recurrence, also at the limits."""
    h, kp, ti, limits = 0.05, 0.7, 1.5, (-0.2, 0.25)
    process, t = pidalab.ipdt(1.0, 0.4), h * np.arange(800)
    inputs = {"setpoint": 1.0, "load": np.where(t < 20.0, 0.0, 0.15)}
    reset = simulate_sampled(Loop(process, SeriesPIDA(kp, 0.0, 0.0, ti, 0.1, 0, limits=limits)), t, **inputs)
    equal = Loop(process, PIDA(kp, h / -math.expm1(-h / ti)))
    conditioned = simulate_sampled(equal, t, limits=limits, anti_windup="conditioning", **inputs)
    assert (reset.u.min(), reset.u.max()) == limits
    np.testing.assert_allclose(conditioned.u, reset.u, atol=1e-12)


def test_quantisation_by_hand():
    """An integrator has P control. 2.5 quanta are rounded to 2. The measurement has another quantum."""
    loop = Loop(pidalab.ipdt(1.0, 0.0), 0.5)
    out = simulate_sampled(loop, np.arange(5.0), 1.25, quanta=(0.0, 0.25))
    assert out.u.tolist() == [0.5, 0.5, 0.0, 0.0, 0.0]  # 2.5, 1.5 and 0.5 quanta
    assert out.y.tolist() == [0.0, 0.5, 1.0, 1.0, 1.0]
    out = simulate_sampled(loop, np.arange(4.0), 1.25, quanta=(0.4, 0.0))
    assert out.u.tolist() == pytest.approx([0.625, 0.5 * 0.45, 0.5 * 0.45, 0.5 * 0.05])


def pulses_by_hand(widths, limits, h, delay, load, wanted):
    """Return states of 1/((s + 1)(0.5 s + 1)) and the integral of its output at the samples."""
    A = np.array([[-1.0, 0.0, 0.0], [2.0, -2.0, 0.0], [0.0, 1.0, 0.0]])
    b, edges = np.array([1.0, 0.0, 0.0]), [(-1.0, 0.0)]  # times from which the input has a value
    for k, u in enumerate(wanted):
        on = (
            round((min(max(u, limits[0]), limits[1]) - limits[0]) / (limits[1] - limits[0]) * widths) / widths
        )
        edges += [(k * h + delay, limits[1] + load[k])] if on > 0 else []
        edges += [(k * h + delay + on * h, limits[0] + load[k])] if on < 1 else []
    x, now, out = np.zeros(3), 0.0, [np.zeros(3)]
    for k in range(1, len(wanted)):
        for until in [t for t, _ in edges if now < t < k * h - 1e-12] + [k * h]:
            w = [value for t, value in edges if t <= (now + until) / 2][-1]
            augmented = np.zeros((4, 4))
            augmented[:3, :3], augmented[:3, 3] = A, b * w
            x = (expm(augmented * (until - now)) @ [*x, 1.0])[:3]
            now = until
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("delay", [0.0, 0.07, 0.2, 0.47])
def test_pulses_by_hand(delay):
    """Set points and loads are random."""
    h, n, widths, limits, rng = 0.2, 40, 5, (-0.4, 1.1), np.random.default_rng(5)
    load, r = 0.3 * rng.normal(size=n), rng.uniform(-1.0, 2.0, size=n)
    plant = Process([1.0], np.convolve([1.0, 1.0], [0.5, 1.0]), delay)
    out = simulate_sampled(
        Loop(plant, 0.9), h * np.arange(n), r, load=load, limits=limits, pulse_widths=widths
    )
    states = pulses_by_hand(widths, limits, h, delay, load, 0.9 * (r - out.y))
    np.testing.assert_allclose(out.y, states[:, 1], atol=1e-9)
    np.testing.assert_allclose(out.area, states[:, 2], atol=1e-9)
    levels = np.linspace(*limits, widths + 1)
    assert np.min(np.abs(out.u[:, None] - levels), axis=1).max() < 1e-12
    assert {0, widths} < {int(np.argmin(np.abs(u - levels))) for u in out.u}
