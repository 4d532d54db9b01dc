"""Compare the simulation of held inputs with superposition, python-control, closed forms and the oracle."""

import math

import control
import numpy as np
import pytest
from engine_errors import oracle, worst_error
from scipy.special import gammainc

import pidalab
from pidalab import PIDA, Loop, Process, simulate

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
    """Each change of a held input is a step. Steps of all inputs add up."""
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


@pytest.mark.parametrize("source", ["r", "d", "n"])
def test_against_python_control_without_delay(source):
    """Discretising with a zero-order hold is exact for held inputs."""
    P, C = control.tf([1.0, 3.0], [1.0, 2.0, 4.0]), PIDA(1.5, 2.0, 0.3, 0.1)
    t = np.linspace(0.0, 8.0, 81)
    loop, F = Loop(P, C), C.transfer_function()
    to_y = {"r": control.feedback(P * F), "d": control.feedback(P, F), "n": -control.feedback(P * F)}[source]
    to_u = {"r": control.feedback(F, P), "d": -control.feedback(P * F), "n": -control.feedback(F, P)}[source]
    r = simulate(loop, t, **{{"r": "setpoint", "d": "load", "n": "noise"}[source]: held(4, t.size)})
    for system, got in ((to_y, r.y), (to_u, r.u)):
        values = held(4, t.size)
        discrete = control.ss(system).sample(t[1], "zoh")
        expected = control.forced_response(discrete, t, values).outputs
        np.testing.assert_allclose(got, expected, atol=1e-8 * np.abs(expected).max())


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


def test_ensemble_is_simulate_row_by_row():
    noise = np.stack([held(seed, every=1) for seed in range(3)] + [np.zeros(TIME.size)])
    records = pidalab.simulate_ensemble(LOOPS["delay"], TIME, noise, setpoint=held(7), load=-0.4)
    for row, record in zip(noise, records, strict=True):
        single = simulate(LOOPS["delay"], TIME, held(7), load=-0.4, noise=row)
        for key in ("t", "r", "d", "n", "y", "u", "area"):
            np.testing.assert_allclose(getattr(record, key), getattr(single, key), atol=1e-12)


def test_limits_that_are_not_reached_have_no_effect():
    def limited(low, high):
        controller = pidalab.SeriesPIDA(0.3, 0.0, 0.0, 1.0, 0.1, 1, limits=(low, high))
        return Loop(pidalab.fopdt(1.0, 1.0, 1.0), controller)

    free = simulate(limited(-math.inf, math.inf), TIME, setpoint=1.0)
    np.testing.assert_array_equal(simulate(limited(-1e-9, free.u.max() + 1e-9), TIME, setpoint=1.0).y, free.y)
    with pytest.raises(ValueError, match="limits"):
        pidalab.simulate_ensemble(limited(-0.2, 1.0), TIME, np.zeros((2, TIME.size)), load=1.0)


@pytest.mark.parametrize(("order", "lag"), [(1, 1.0), (8, 1.0), (30, 60.0), (60, 1.0), (200, 0.1)])
@pytest.mark.parametrize("delay", [0.0, 0.37])
def test_a_chain_of_equal_lags_is_an_incomplete_gamma_function(order, lag, delay):
    t = np.linspace(0.0, 2.0 * order * lag, 301)
    y = pidalab.open_loop_step(pidalab.lags(order, lag=lag, delay=delay), t).y
    np.testing.assert_allclose(y, gammainc(order, np.maximum(t - delay, 0.0) / lag), atol=1e-11)


def test_a_short_dead_time_is_followed():
    """The steady state comes after 600,000 dead times. Until then the loop without dead time differs by about one."""
    t = np.linspace(0.0, 60.0, 61)
    y, bare = (
        simulate(Loop(pidalab.fopdt(1.0, 1.0, delay), 0.5), t, setpoint=1.0).y for delay in (1e-4, 0.0)
    )
    assert y[-1] == pytest.approx(1 / 3, rel=1e-10)
    np.testing.assert_allclose(y, bare, atol=1e-4)


@pytest.mark.parametrize("quick", [1e-3, 1e-5, 1e-8])
def test_a_loop_far_faster_than_its_plant_keeps_its_digits(quick):
    t = np.linspace(0.0, 60.0, 241)
    controller = PIDA(0.5 / quick, 8.0 * quick)
    # Without dead time the loop is of second order, in units of `quick`.
    a, b = 0.5 * (quick + 0.5), 0.0625
    w = np.sqrt(complex(a**2 - b))
    shape = np.cosh(w * t) + (a - 0.5) * np.sinh(w * t) / w
    y = pidalab.step_response(Loop(pidalab.fopdt(1.0, 1.0, 0.0), controller), quick * t).y
    np.testing.assert_allclose(y, 1.0 - np.exp(-a * t) * shape.real, atol=1e-11)
    # With dead time the loop is close to that of an integrator.
    y = pidalab.step_response(Loop(pidalab.fopdt(1.0, 1.0, quick), controller), quick * t).y
    integrator = Loop(pidalab.ipdt(1.0, 1.0), PIDA(0.5, 8.0))
    np.testing.assert_allclose(y, pidalab.step_response(integrator, t).y, atol=20 * quick + 1e-11)


@pytest.mark.parametrize("block", [PIDA(2.0, 4.0, 1.0), control.tf([2.0], [3.0, 1.0]), 2.0])
def test_open_loop_step_of_any_block(block):
    record = pidalab.open_loop_step(block, TIME)
    same = pidalab.open_loop_step(Loop(block, 0.0).process, TIME)
    assert np.array_equal(record.y, same.y)
    assert record.final == same.final


# The exact engine against the high-precision oracle.


@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", oracle("delay_loops.json")["cases"], ids=lambda case: case["name"])
def test_oracle(case, points):
    """Errors are at most 1e-9 of max(1, |value|) or the envelope, at times aligned with the dead time or not."""
    error, where = worst_error(case, points)
    assert error <= 1e-9, where
