"""Simulation of held inputs: superposition, python-control, closed forms."""

import math

import control
import numpy as np
import pytest
from engine_errors import oracle, worst_error
from scipy.special import gammainc

import pidalab
from pidalab import PIDA, Loop, Process, simulate
from pidalab.simulation.exact import simulate_until_settled

LOOPS = {
    "paper": Loop(pidalab.lags(4), PIDA(1.31, 3.37, 0.938, 0.269), control.tf([1.0], [0.0164, 0.256, 1.0])),
    "delay": Loop(
        pidalab.sopdt(2.0, 1.5, 1.2, 0.73), PIDA(0.6, 3.0, 0.5, 0.1), None, control.tf([1.0], [0.5, 1.0])
    ),
    "integrating": Loop(pidalab.ipdt(1.0, 1.0), PIDA(0.4, 8.0, 0.0, 0.0)),
    "negative": Loop(Process([-2.0], [3.0, 1.0], 0.5), PIDA(-0.4, 3.0, 0.0, 0.0)),
    "unstable": Loop(pidalab.ipdt(1.0, 1.0), 2.5),
    "neutral": Loop(Process([0.4, 1.0], [1.0, 1.0], 0.7), 0.6),
}
TIME = np.linspace(0.0, 12.0, 241)


def held(seed, n=TIME.size, every=7):
    return np.repeat(np.random.default_rng(seed).normal(size=n // every + 1), every)[:n]


@pytest.mark.parametrize("name", LOOPS)
def test_held_inputs_are_superposed_steps(name):
    """Each change of a held input is a step at that sample; steps of all inputs add up."""
    inputs = {"setpoint": held(1), "load": held(2), "noise": held(3, every=1)}
    expected = np.zeros((3, TIME.size))
    for key, values in inputs.items():
        step = simulate(LOOPS[name], TIME, **{key: 1.0})
        unit = np.stack([step.y, step.u, step.area])
        for i, change in enumerate(np.diff(values, prepend=0.0)):
            if change:
                expected[:, i:] += change * unit[:, : TIME.size - i]
    r = simulate(LOOPS[name], TIME, **inputs)
    envelope = np.maximum.accumulate(np.abs(expected), axis=1) + 1.0
    assert np.max(np.abs(np.stack([r.y, r.u, r.area]) - expected) / envelope) < 1e-11
    assert (r.r.tolist(), r.d.tolist(), r.n.tolist()) == tuple(values.tolist() for values in inputs.values())


def hold_finely(values, factor):
    return np.repeat(values, factor)[: (values.size - 1) * factor + 1]


@pytest.mark.parametrize("source", ["r", "d", "n"])
def test_against_python_control_without_delay(source):
    """python-control interpolates linearly, so its input is held as short ramps: extrapolate their length to zero."""
    P, C = control.tf([1.0, 3.0], [1.0, 2.0, 4.0]), PIDA(1.5, 2.0, 0.3, 0.1)
    t = np.linspace(0.0, 8.0, 81)
    loop, F = Loop(P, C), C.transfer_function()
    to_y = {"r": control.feedback(P * F), "d": control.feedback(P, F), "n": -control.feedback(P * F)}[source]
    to_u = {"r": control.feedback(F, P), "d": -control.feedback(P * F), "n": -control.feedback(F, P)}[source]
    r = simulate(loop, t, **{{"r": "setpoint", "d": "load", "n": "noise"}[source]: held(4, t.size)})
    for system, got in ((to_y, r.y), (to_u, r.u)):
        values = held(4, t.size)
        discrete = control.ss(system).sample(t[1], "zoh")  # exact for a held input
        expected = control.forced_response(discrete, t, values).outputs
        np.testing.assert_allclose(got, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("lag", "gain", "t"),
    [(1e3, 2e4, np.arange(25.0)), (1.0, 1.1, 0.7 * np.arange(215.0))],
    ids=["slow_at_its_dead_times", "over_150_dead_times"],
)
def test_what_comes_back_once_each_dead_time(lag, gain, t):
    """The control signal comes back through the lag once more each time; fed back positively, nothing cancels."""
    k = np.arange(1, int(t[-1]) + 1)[:, None]
    expected = np.sum(gain**k * gammainc(k, np.maximum(t - k, 0.0) / lag), axis=0)
    found = simulate(Loop(pidalab.fopdt(1.0, lag, 1.0), -gain), t, setpoint=1.0)
    np.testing.assert_allclose(-found.y, expected, rtol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 1.0])
@pytest.mark.parametrize(
    ("gain", "unit"),
    [(1e-12, 1.0), (1e12, 1.0), (1.0, 1e-9), (1e6, 1e9), (1e-9, 1e-6)],
)
def test_units_of_gain_and_time_do_not_matter(gain, unit, delay):
    """A large gain made the running integral so large that a response had no end in ten minutes."""
    at, t = (-1.0, 0.0, 1.0, 2.0), np.linspace(0.0, 30.0, 31)
    answers = [
        simulate(
            Loop(Process([k], [u, 1.0], u * delay), pidalab.HighOrderPID(gains, 0.3 * u, 3)), u * t, load=1.0
        )
        for k, u in ((1.0, 1.0), (gain, unit))
        for gains in [[g * u**power / k for g, power in zip((0.2, 0.4, 0.1, 0.02), at, strict=True)]]
    ]
    np.testing.assert_allclose(answers[1].y / gain, answers[0].y, atol=1e-12)


def test_unstable_loop_with_noise_keeps_its_digits_from_the_start():
    """Growth by 1e20; each value is compared with the largest one up to its time, not up to the end."""
    t, loop = np.linspace(0.0, 160.0, 1601), Loop(pidalab.ipdt(1.0, 1.0), 2.5)
    noise = pidalab.uniform_noise(t, 0.1, seed=5)
    unit = simulate(loop, t, noise=1.0).y
    direct = np.array(
        [np.dot(np.diff(noise, prepend=0.0)[: i + 1][::-1], unit[: i + 1]) for i in range(t.size)]
    )
    y = simulate(loop, t, noise=noise).y
    envelope = np.maximum.accumulate(np.abs(direct)) + 1e-3
    assert envelope[-1] > 1e18
    assert np.max(np.abs(y - direct) / envelope) < 1e-10


@pytest.mark.parametrize(("kp", "ti", "delay"), [(0.5, 3.0, 0.7), (0.8, 4.0, 1.0), (0.2, 2.0, 3.0)])
def test_load_step_integrates_to_minus_ti_over_kp(kp, ti, delay):
    r = pidalab.load_response(
        Loop(pidalab.fopdt(1.0, 3.0, delay), PIDA(kp, ti, 0.1, 0.0)), np.linspace(0.0, 300.0, 3001)
    )
    assert r.ie(math.inf) == pytest.approx(-ti / kp, rel=1e-9)
    assert r.iae(math.inf) >= ti / kp * (1 - 1e-9)
    if kp == 0.5:
        assert r.iae(math.inf) == pytest.approx(ti / kp, rel=1e-6)  # well damped: no sign change


@pytest.mark.parametrize(
    ("loop", "y", "u"),
    [
        (Loop(pidalab.fopdt(2.0, 1.0, 0.5), PIDA(0.4, math.inf, 0.3, 0.0)), 0.8 / 1.8, 0.4 / 1.8),
        (Loop(pidalab.fopdt(2.0, 1.0, 0.5), 0.0), 0.0, 0.0),
        (Loop(Process([0.0], [1.0, 1.0], 0.5), 0.7), 0.0, 0.7),
        (Loop(Process([-1.0, 1.0], [1.0, 2.0, 1.0]), PIDA(0.5, 2.0, 0.0, 0.0)), 1.0, 1.0),
        (Loop(Process([1.0], np.convolve([1e4, 1.0], [1e-4, 1.0]), 0.1), PIDA(1e4, 1e4, 0.0, 0.0)), 1.0, 1.0),
        (Loop(pidalab.fopdt(1.0, 1.0, 1e-3), PIDA(1.0, 1.0, 0.0, 0.0)), 1.0, 1.0),
        (Loop(Process([1.0], [1.0], 1.0), 0.5), 1 / 3, 1 / 3),
    ],
    ids=["pd", "no-controller", "no-process", "rhp-zero", "spread", "tiny-delay", "neutral"],
)
def test_final_values(loop, y, u):
    r = simulate(loop, np.linspace(0.0, 200.0, 401), setpoint=1.0)
    assert (r.y[-1], r.u[-1]) == pytest.approx((y, u), abs=1e-8)


def test_nothing_returns_before_the_dead_time():
    r = pidalab.step_response(
        Loop(pidalab.fopdt(1.0, 1.0, 50.0), PIDA(0.5, 2.0, 0.0, 0.0)), np.linspace(0.0, 20.0, 41)
    )
    assert np.all(r.y == 0.0)
    np.testing.assert_allclose(
        r.u, 0.5 * (1 + r.t / 2), rtol=1e-12
    )  # the controller integrates the unit error


@pytest.mark.parametrize(("gain", "cycles"), [(0.9, 400), (0.5, 2000), (2.0, 300)])
def test_neutral_loop_over_many_dead_times(gain, cycles):
    """y jumps once a dead time: the partial sums of gain (-gain)^k."""
    y = simulate(Loop(Process([1.0], [1.0], 1.0), gain), np.arange(0.0, cycles + 0.5, 0.5), setpoint=1.0).y[
        ::2
    ]
    k = np.arange(cycles + 1)
    np.testing.assert_allclose(y, gain * (1 - (-gain) ** k) / (1 + gain), rtol=1e-9, atol=1e-12)


def test_two_samples_are_enough():
    loop = Loop(pidalab.lags(2), 1.0)
    one = simulate(loop, [0.0, 1.0], setpoint=1.0).y
    assert simulate(loop, [0.0, 1.0], setpoint=[1.0, 5.0]).y == pytest.approx(
        one
    )  # the second value acts from t = 1 on


def test_ensemble_is_simulate_row_by_row():
    noise = np.stack([held(seed, every=1) for seed in range(3)] + [np.zeros(TIME.size)])
    records = pidalab.simulate_ensemble(LOOPS["delay"], TIME, noise, setpoint=held(7), load=-0.4)
    for row, record in zip(noise, records, strict=True):
        single = simulate(LOOPS["delay"], TIME, held(7), load=-0.4, noise=row)
        for key in ("t", "r", "d", "n", "y", "u", "area"):
            np.testing.assert_allclose(getattr(record, key), getattr(single, key), atol=1e-12)


def test_signals_that_are_not_given_are_zero():
    noise = held(3, every=1)
    (record,) = pidalab.simulate_ensemble(LOOPS["delay"], TIME, noise[None])
    np.testing.assert_allclose(
        record.y, simulate(LOOPS["delay"], TIME, 0.0, load=0.0, noise=noise).y, atol=1e-12
    )
    assert not simulate(LOOPS["delay"], TIME).y.any()


def limited(low, high):
    return Loop(
        pidalab.fopdt(1.0, 1.0, 1.0), pidalab.SeriesPIDA(0.3, 0.0, 0.0, 1.0, 0.1, 1, limits=(low, high))
    )


def test_limits_are_respected_or_refused():
    free = simulate(limited(-math.inf, math.inf), TIME, setpoint=1.0)
    np.testing.assert_array_equal(simulate(limited(-1e-9, free.u.max() + 1e-9), TIME, setpoint=1.0).y, free.y)
    with pytest.raises(ValueError, match=r"the controller's limits \(-1, 0\.5\), found 0\.5.* at t = "):
        simulate(limited(-1.0, 0.5), TIME, setpoint=1.0)
    with pytest.raises(ValueError, match=r"limits \(-0\.2, 1\): u = -0\.2"):
        pidalab.simulate_ensemble(limited(-0.2, 1.0), TIME, np.zeros((2, TIME.size)), load=1.0)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"t": [0.0, 1.0, 3.0]}, ValueError, "t must be uniform"),
        ({"t": [1.0, 2.0]}, ValueError, "t must start at 0, found 1"),
        ({"t": [0.0]}, ValueError, "t must be one-dimensional with at least 2"),
        ({"t": [0.0, np.inf]}, ValueError, "t must be finite, found inf at index 1"),
        ({"setpoint": [1.0, 2.0]}, ValueError, r"setpoint must be .* as long as t \(3\), found shape \(2,\)"),
        ({"load": [[1.0, 2.0, 3.0]]}, ValueError, r"load must be .* found shape \(1, 3\)"),
        ({"noise": [0.0, np.nan, 0.0]}, ValueError, "noise must be finite, found nan at index 1"),
        ({"setpoint": np.nan}, ValueError, "setpoint must be finite, found nan"),
        ({"load": "big"}, TypeError, "load must be"),
        ({"setpoint": np.array([1j, 0, 0])}, TypeError, "setpoint must be"),
        ({"loop": Loop(Process([-1.0, 2.0], [1.0, 3.0]), 1.0)}, ValueError, "the loop is ill-posed: .* exactly -1"),
        ({"loop": Loop(Process([1.0], [1.0, -1.0], 1.0), 0.5), "t": [0.0, 2e3]}, ValueError, "leaves the range of"),
    ],
    ids=["uneven", "late", "single", "inf", "short", "shape", "nan", "nan-step", "text", "complex", "ill-posed", "big"],
)  # fmt: skip
def test_simulate_complains(arguments, error, message):
    with pytest.raises(error, match=message):
        simulate(**({"loop": LOOPS["delay"], "t": [0.0, 1.0, 2.0], "setpoint": 1.0} | arguments))


@pytest.mark.parametrize("noise", [0.1, np.zeros(241), [], [0.1, 0.2]])
def test_an_ensemble_needs_records_in_rows(noise):
    """A single record is not one record for each of its samples."""
    with pytest.raises(
        ValueError, match=r"noise must have one record in each row \(shape \(k, n\)\), found no rows"
    ):
        pidalab.simulate_ensemble(LOOPS["integrating"], TIME, noise)


@pytest.mark.parametrize(("order", "lag"), [(1, 1.0), (8, 1.0), (30, 60.0), (60, 1.0), (200, 0.1)])
@pytest.mark.parametrize("delay", [0.0, 0.37])
def test_a_chain_of_equal_lags_is_an_incomplete_gamma_function(order, lag, delay):
    t = np.linspace(0.0, 2.0 * order * lag, 301)
    y = pidalab.open_loop_step(pidalab.lags(order, lag=lag, delay=delay), t).y
    np.testing.assert_allclose(y, gammainc(order, np.maximum(t - delay, 0.0) / lag), atol=1e-11)


@pytest.mark.parametrize("delay", [1e-5, 1e-6, 1e-7, 1e-12])
def test_too_many_dead_times_are_refused(delay):
    with pytest.raises(ValueError, match=r"t spans 6e.* dead times, too many to follow"):
        simulate(Loop(pidalab.fopdt(1.0, 1.0, delay), 0.5), np.linspace(0.0, 60.0, 11), setpoint=1.0)


def test_a_short_dead_time_is_followed():
    """600,000 dead times to the steady state; in between the loop without dead time is as near as that time."""
    t = np.linspace(0.0, 60.0, 61)
    y, bare = (
        simulate(Loop(pidalab.fopdt(1.0, 1.0, delay), 0.5), t, setpoint=1.0).y for delay in (1e-4, 0.0)
    )
    assert y[-1] == pytest.approx(1 / 3, rel=1e-10)
    np.testing.assert_allclose(y, bare, atol=1e-4)


@pytest.mark.parametrize("quick", [1e-3, 1e-5, 1e-8])
def test_a_loop_far_faster_than_its_plant_keeps_its_digits(quick):
    t = np.linspace(0.0, 60.0, 241)
    controller = pidalab.PIDA(0.5 / quick, 8.0 * quick)
    # without dead time a system of second order, in the loop's own time
    a, b = 0.5 * (quick + 0.5), 0.0625
    w = np.sqrt(complex(a**2 - b))
    shape = np.cosh(w * t) + (a - 0.5) * np.sinh(w * t) / w
    y = pidalab.step_response(Loop(pidalab.fopdt(1.0, 1.0, 0.0), controller), quick * t).y
    np.testing.assert_allclose(y, 1.0 - np.exp(-a * t) * shape.real, atol=1e-11)
    # with dead time what it does with an integrator, but for the plant's own return
    y = pidalab.step_response(Loop(pidalab.fopdt(1.0, 1.0, quick), controller), quick * t).y
    integrator = Loop(pidalab.ipdt(1.0, 1.0), pidalab.PIDA(0.5, 8.0))
    np.testing.assert_allclose(y, pidalab.step_response(integrator, t).y, atol=20 * quick + 1e-11)
    # and of third order
    gains = [0.002 / quick**3, 0.05 / quick**2, 0.5 / quick]
    fast = Loop(pidalab.lags(2, delay=quick), pidalab.HighOrderPID(gains, 0.1 * quick, 2))
    slow = Loop(Process([1.0], [1.0, 0.0, 0.0], 1.0), pidalab.HighOrderPID([0.002, 0.05, 0.5], 0.1, 2))
    difference = pidalab.step_response(fast, quick * t).y - pidalab.step_response(slow, t).y
    np.testing.assert_allclose(difference, 0.0, atol=40 * quick + 1e-11)


def test_a_derivative_filter_far_faster_than_the_plant_keeps_the_digits():
    """PID on a lag answers a load as 1/(a s^2 + b s + c); a filter of 3e-11 takes no digit that can be seen."""
    kp, ti, td, t = 2.0, 4.0, 0.5, np.linspace(0.0, 10.0, 101)
    fast, slow = np.roots([1 + kp * td, 1 + kp, kp / ti])
    gone, left = np.exp(fast * t), np.exp(slow * t)
    y = (left - gone) / (slow - fast) / (1 + kp * td)
    slope = (slow * left - fast * gone) / (slow - fast) / (1 + kp * td)
    area = ((left - 1) / slow - (gone - 1) / fast) / (slow - fast) / (1 + kp * td)
    r = simulate(Loop(pidalab.lags(1), PIDA(kp, ti, td, n=2e10)), t, load=1.0)
    np.testing.assert_allclose(r.y, y, atol=1e-9)
    np.testing.assert_allclose(r.u[1:], -kp * (y + area / ti + td * slope)[1:], atol=1e-9)


def test_inside_a_dead_time_a_fast_filter_remembers_farther_than_across_it():
    """Sixteen dead times matter from one to the next, 54 in between; exact by delay terms, one by one, in 60 digits."""
    loop = Loop(pidalab.fopdt(1.0, 1.0, 0.3713), PIDA(0.1, 0.9, 0.3, 0.02))
    r = simulate(loop, np.linspace(0.0, 20.0, 10_001), setpoint=1.0, load=0.3)
    assert r.y[2987] == pytest.approx(0.657032936, abs=5e-10)


@pytest.mark.parametrize("time", [1e-3, 1e-4])
def test_a_prefilter_as_fast_as_the_filter_of_the_controller_drives_it(time):
    """What is decoupled from the slow states is not what a fast prefilter drives: against one loop without it.

    The set point through a prefilter is one that rises, and so the sum of steps; each is a loop without prefilter.
    """
    process, controller = pidalab.lags(2, delay=0.5), pidalab.HighOrderPID([0.3, 0.6, 0.3], 1e-3, 2)
    t = np.linspace(0.0, 4.0, 9)
    found = simulate(Loop(process, controller, prefilter=Process([1.0], [time, 1.0])), t, setpoint=1.0)
    bare = simulate(Loop(process, controller), t, setpoint=1.0)
    fine = np.linspace(0.0, 4.0, 40_001)
    y = simulate(Loop(process, controller), fine, setpoint=1.0 - np.exp(-fine / time)).y[::5000]
    np.testing.assert_allclose(found.y, y, atol=2e-4)
    np.testing.assert_allclose(found.y[1:], bare.y[1:], atol=2e-3)
    assert np.abs(found.u).max() < 2e3


def test_a_loop_that_remembers_too_many_dead_times_is_refused():
    """|L| = 0.999 at infinite frequency: three states and 1333 dead times fill the stack of 4000."""
    loop = Loop(Process([1.0, 2.0], [1.0, 1.0], 1.0), 0.999)
    with pytest.raises(ValueError, match=r"t must span at most 1333 dead times .* found 2000; shorten t"):
        simulate(loop, np.arange(2001.0), setpoint=1.0)


def test_seven_oscillations_one_after_the_other_are_a_sum_of_modes():
    sections = [np.array([1.0, 0.6 * w, w * w]) for w in 1.0 + 0.15 * np.arange(7)]
    poles, den = np.concatenate([np.roots(one) for one in sections]), np.ones(1)
    for one in sections:
        den = np.convolve(den, one)
    t = np.linspace(0.0, 40.0, 81)
    residues = [den[-1] / (p * np.prod([p - q for q in poles if q != p])) for p in poles]
    expected = 1.0 + sum((r * np.exp(p * t)).real for r, p in zip(residues, poles, strict=True))
    assert pidalab.open_loop_step(Process([den[-1]], den), t).y == pytest.approx(expected, abs=1e-8)


# The exact engine against the high-precision oracle.


@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", oracle("delay_loops.json")["cases"], ids=lambda case: case["name"])
def test_oracle(case, points):
    """1e-9 relative to max(1, |value|) (or the running envelope) at every time, aligned with the dead time or not."""
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


# Integrals to infinity, from whatever horizon the search begins.

LOOP = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))


@pytest.mark.parametrize("horizon", [3.0, 20.0, 200.0])
def test_the_integral_does_not_depend_on_the_first_horizon(horizon):
    """Without overshoot the IAE of a load step is ti/kp."""
    response = simulate_until_settled(pidalab.load_response, LOOP, horizon)
    assert response.iae(horizon=math.inf) == pytest.approx(1.25, rel=1e-4)


def test_a_loop_that_never_settles_is_said():
    with pytest.raises(ValueError, match=rf"does not settle within {3 * 2**13:.3g}".replace("+", r"\+")):
        simulate_until_settled(pidalab.load_response, pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), 0.5), 3.0)


def test_a_first_horizon_within_the_dead_time_is_passed_over():
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 5.0), pidalab.PIDA(kp=0.2, ti=2.0))
    expected = simulate_until_settled(pidalab.load_response, loop, 100.0).iae(horizon=math.inf)
    for horizon in (1.0, 5.0, 9.9):
        assert simulate_until_settled(pidalab.load_response, loop, horizon).iae(
            horizon=math.inf
        ) == pytest.approx(expected, rel=1e-4)
    with pytest.raises(ValueError, match="horizon must be above 0, found 0"):
        simulate_until_settled(pidalab.load_response, loop, 0.0)


def test_more_dead_times_than_can_be_followed_are_said_in_the_words_of_the_loop():
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 1e-9), pidalab.PIDA(kp=0.8, ti=1.0))
    with pytest.raises(ValueError, match=r"the loop needs 2e\+10 dead times"):
        simulate_until_settled(pidalab.load_response, loop, 20.0)
