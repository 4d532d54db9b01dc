"""Check start, modes, limits and windup of the digital controller."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from cases import CASES, STANDARD, record, reference

from pidalab import (
    PIDA,
    Loop,
    Process,
    SeriesPIDA,
    lags,
    simulate_sampled,
)
from pidalab.digital.controller import DigitalController

OPEN = Process([0.0], [1.0])  # a loop in which the controller sees the set point alone


def test_pi_controller_by_hand():
    """kp = 2, ki h = 0.25, limits -3 and 3, back-calculation by 0.5/(4 + 0.5) = 1/9."""
    k = PIDA(2.0, 4.0).discretise(0.5, limits=(-3.0, 3.0))
    k.reset(r=0.0, y=0.0)
    assert [k.step(e, 0.0) for e in (1.0, 1.0, 2.0, 2.0, 0.0)] == pytest.approx(
        [2.25, 2.5, 3.0, 3.0, 83 / 81]
    )


@pytest.mark.parametrize("name", CASES)
def test_simulation_matches_step_bit_for_bit(name):
    """The plant has a gain of 0, so that the controller sees only set point and noise."""
    k = dataclasses.replace(CASES[name], y_offset=0.0, bias=0.0)
    rows = record(k)
    t = k.sample_time * np.arange(300)
    run = simulate_sampled(Loop(OPEN, k), t, rows["setpoint"], noise=rows["measurement"])
    k.reset(r=0.0, y=0.0)
    by_step = [
        k.step(r, y) for r, y in zip(rows["setpoint"].tolist(), rows["measurement"].tolist(), strict=True)
    ]
    np.testing.assert_array_equal(run.u, by_step)


@pytest.mark.parametrize("name", CASES)
def test_another_unit_of_the_output_changes_no_control_signal(name):
    k = CASES[name]
    t, loop = k.sample_time * np.arange(400), Loop(lags(3), k)
    run = simulate_sampled(loop, t, 0.7, load=0.3)
    low, high = loop.limits
    assert np.all((run.u >= low - 1e-12) & (run.u <= high + 1e-12))
    # Gains and deadband change with the unit of the output.
    gains = tuple(path._replace(gains=tuple(g / 50.0 for g in path.gains)) for path in k.paths)
    growth = k.growth if k.from_signal else tuple(g / 50.0 for g in k.growth)
    scaled = dataclasses.replace(k, paths=gains, growth=growth, deadband=50.0 * k.deadband)
    moved, plant = (
        dataclasses.replace(scaled, y_offset=k.y_offset + 20.0),
        Process([50.0], [1.0, 3.0, 3.0, 1.0]),
    )
    np.testing.assert_allclose(simulate_sampled(Loop(plant, moved), t, 35.0, load=0.3).u, run.u, atol=1e-9)


def test_a_controller_starts_at_rest():
    for name, k in CASES.items():
        k.reset()
        y = k.y_offset + 0.4
        first = k.step(y, y)
        assert first == k.bias
        assert k.step(y, y) == pytest.approx(k.bias, abs=1e-12), name
        if k.integrates:
            k.reset(u=1.0)
            assert k.step(y + 1.0, y) == 1.0, name  # the error causes no bump
        k.reset(r=y, y=y, u=k.bias)
        again = k.step(y, y)
        assert again == pytest.approx(k.bias, abs=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_no_bump_on_the_way_back_from_manual(name):
    k = CASES[name]
    y = k.y_offset
    k.reset()
    for _ in range(30):
        k.step(y, y, manual=k.bias + 1.0)
    # A controller without integral cannot hold the signal.
    assert k.step(y, y) == pytest.approx(k.bias + 1.0 * k.integrates, abs=1e-9)


def test_manual_signals_keep_the_limits_of_range_and_rate():
    k = PIDA(1.0, 2.0).discretise(0.5, limits=(-1.0, 2.0), rate_limit=1.0)
    assert [k.step(0.0, 0.0, manual=9.0) for _ in range(6)] == [0.5, 1.0, 1.5, 2.0, 2.0, 2.0]
    assert [k.step(0.0, 0.0, manual=-9.0) for _ in range(7)] == [1.5, 1.0, 0.5, 0.0, -0.5, -1.0, -1.0]


@pytest.mark.parametrize("way", ["reset", "back-calculation", "clamping", None])
def test_tracking_prevents_windup(way):
    """A selector holds the actuator at 0.5 for a long time. When released, the controller continues from near 0.5."""
    k = PIDA(1.0, 2.0).discretise(0.1, anti_windup=way)
    k.reset(r=0.0, y=0.0)
    wanted = [k.step(0.3, 0.0, track=0.5) for _ in range(400)][-1]
    released = k.step(0.3, 0.0)
    assert abs(wanted - 0.5) < 0.35
    assert released - wanted == pytest.approx(0.3 * 0.05, abs=1e-9)


def test_reset_is_a_lag_behind_the_limited_signal():
    """Backward differences: i_k = i_{k-1} + h/(ti + h) (u_k - i_{k-1}), whatever the limits do."""
    h, ti, kp, rng = 0.1, 0.9, 0.7, np.random.default_rng(1)
    k = SeriesPIDA(kp, 0.0, 0.0, ti, 0.2, 0).discretise(h, limits=(-0.5, 0.6), rate_limit=4.0)
    k.reset(r=0.0, y=0.0)
    integral, last, cut = 0.0, 0.0, 0
    for error in rng.normal(size=300):
        u = k.step(float(error), 0.0)
        new = integral + h / (ti + h) * (u - integral)
        cut += abs(u - kp * error - new) > 1e-9
        # The signal is the sum of proportional part and lag, or a limit.
        assert (
            abs(u - kp * error - new) < 1e-12 or u in (-0.5, 0.6) or abs(u - last) == pytest.approx(4.0 * h)
        )
        integral, last = new, u
    assert 50 < cut < 290


def test_limit_of_rate_by_hand():
    k = PIDA(1.0, math.inf).discretise(0.5, rate_limit=2.0)
    k.reset(r=0.0, y=0.0)
    assert [k.step(r, 0.0) for r in (2.5, 2.5, 2.5, 0.0)] == [1.0, 2.0, 2.5, 1.5]


def test_deadband_by_hand():
    k = PIDA(2.0, math.inf).discretise(0.5, deadband=0.5)
    assert [k.step(r, 0.0) for r in (0.5, -0.5, 0.25, 1.0, -2.0)] == [0.0, 0.0, 0.0, 1.0, -3.0]


def test_weights_by_hand():
    """With b = c = 0 a step of the set point moves only the integral. The weights do not affect the measurement."""
    free = STANDARD.discretise(0.1, b=0.0, c=0.0)
    free.reset(r=0.0, y=0.0)
    ki = STANDARD.kp / STANDARD.ti * 0.1
    assert [free.step(1.0, 0.0) for _ in range(3)] == pytest.approx([ki, 2 * ki, 3 * ki])
    full = STANDARD.discretise(0.1)
    for k in (free, full):
        k.reset(r=0.0, y=0.0)
    assert [free.step(0.0, y) for y in (1.0, 0.3)] == pytest.approx([full.step(0.0, y) for y in (1.0, 0.3)])


def test_a_small_integral_adds_up_in_single_precision():
    """The increment per sample is 1e-8 of the integral. Without the carry, rounding would lose it."""
    k = PIDA(1.0, 1000.0).discretise(0.001)
    assert k.coefficients["INTEGRAL_NEW"] == pytest.approx(1e-6)
    space = {}
    exec(k.python(), space)
    space |= {name: np.float32(value) for name, value in k.coefficients.items()}
    single = space["Pida"]()
    vars(single).update(started=True, integral_part=np.float32(8.0), carry=np.float32(0.0))
    for _ in range(20000):
        single.step(np.float32(0.1), np.float32(0.0))
    assert single.integral_part.dtype == np.float32
    assert single.integral_part == pytest.approx(8.002, abs=2e-6)


def test_a_digital_controller_is_immutable_and_compares_by_its_fields():
    k = CASES["plain_pi"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        k.bias = 3.0
    assert "_states" not in repr(k)
    with pytest.raises(TypeError, match="positional"):
        DigitalController(0.1)
    again = pickle.loads(pickle.dumps(k))
    assert again == k
    k.step(1.0, 0.0)
    assert again == k  # states do not count in comparisons
    rows = record(k)
    np.testing.assert_array_equal(reference(again, rows), reference(k, rows))
    assert repr(k) == "PIDA(kp=1.3, ti=3.3, td=0.0, ta=0.0, n=10.0, m=10.0).discretise(0.1, 'backward', " + (
        "limits=(-4.0, 6.0), bias=0.5)"
    )


@pytest.mark.parametrize("method", ["backward", "tustin", "zoh"])
@pytest.mark.parametrize(
    "own",
    [PIDA(2.0, 4.0, 2.0), PIDA(1.5, math.inf, 2.0), SeriesPIDA(1.0, 0.4, 0.0, 3.0, 0.2, 2)],
    ids=["pid", "pd", "reset"],
)
def test_transfer_function_matches_steps(own, method):
    """The impulse response, summed over z^-k, is the transfer function."""
    k = own.discretise(0.1, method)
    z = np.array([1.7, -1.6 + 0.5j, 2.5j])
    k.step(0.0, 0.0)  # the controller starts at rest
    answers = np.array([k.step(0.0, -1.0 if i == 0 else 0.0) for i in range(120)])
    expected = [np.sum(answers / at ** np.arange(120)) for at in z]
    np.testing.assert_allclose(k(z), expected, rtol=1e-9)
    tf = k.transfer_function()
    np.testing.assert_allclose(tf(z), expected, rtol=1e-9)
    assert tf.dt == 0.1
    assert k(z[0]) == pytest.approx(expected[0])


PI, RESET = PIDA(2.0, 4.0), SeriesPIDA(0.5, 0.4, 0.05, 0.9, 0.2, 4)


@pytest.mark.parametrize(
    ("controller", "available"),
    [
        (None, ("reset", "back-calculation", "clamping")),
        (PI, ("clamping", "conditioning")),
        (RESET, ("reset",)),
        (PI.discretise(0.1, anti_windup="clamping"), ("clamping",)),
    ],
)
def test_anti_windup_has_the_same_options_everywhere(controller, available):
    """`discretise` (None here) and `simulate_sampled` reject the options that they cannot run."""

    def door(word):
        if controller is None:
            return PI.discretise(0.1, anti_windup=word)
        loop = Loop(lags(4), controller)
        return simulate_sampled(loop, 0.1 * np.arange(20), 1.0, anti_windup=word).u.tolist()

    assert door("none") == door(None)
    for word in ("reset", "back-calculation", "clamping", "conditioning"):
        if word in available:
            assert door(word)
        else:
            with pytest.raises(ValueError, match=f"anti_windup must be .*, found {word!r}") as refusal:
                door(word)
            assert all(repr(x) in str(refusal.value) for x in available)


def test_the_first_step_has_no_bump_and_a_primed_controller_starts_at_rest():
    k = PI.discretise(0.1, limits=(0.0, 100.0), bias=40.0, y_offset=20.0)
    assert k.step(r=22.0, y=21.0) == 40.0
    k.reset(r=20.0, y=20.0)
    run = simulate_sampled(Loop(lags(4), k), 0.1 * np.arange(3), 2.0)
    assert [k.step(22.0, 20.0 + y) - 40.0 for y in run.y] == pytest.approx(run.u.tolist())
