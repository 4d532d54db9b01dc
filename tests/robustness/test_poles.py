"""Compare stability and poles with polynomial roots, closed forms, the argument principle and the oracle."""

import math

import control
import numpy as np
import pytest
from engine_errors import oracle, oracle_loop
from scipy.special import lambertw

import pidalab
from pidalab import PIDA, Loop, Process, margins, unstable_poles
from pidalab.loop import open_loop


def random_loop(seed, delay=True):
    rng = np.random.default_rng(seed)
    poles = [-rng.uniform(0.05, 3.0, rng.integers(1, 4)), *[-z * w + 1j * w * np.array([1, -1]) * math.sqrt(1 - z * z)
             for z, w in zip(rng.uniform(0.002, 0.9, 2), rng.uniform(0.2, 4.0, 2), strict=True)]]  # fmt: skip
    den = np.poly(np.concatenate(poles)).real
    num = rng.normal(size=rng.integers(1, 3)) * den[-1]
    num[-1] = abs(num[-1])  # so that a low gain is stable
    process = Process(
        num * rng.choice([0.2, 1.0]) / abs(num).max(), den, delay=rng.uniform(0.05, 4.0) if delay else 0.0
    )
    return Loop(process, PIDA(*rng.uniform([0.05, 0.5, 0.0, 0.0], [0.8, 8.0, 1.0, 0.3]).tolist()))


@pytest.mark.parametrize("delay", [1e-6, 0.5, 1.0, 7.0, 1e6])
def test_critical_gain_of_integrator_and_dead_time(delay):
    critical = np.pi / 2 / delay
    assert [
        unstable_poles(Loop(pidalab.ipdt(1.0, delay), k * critical)) for k in (0.999999, 1.0, 1.000001)
    ] == [
        0,
        2,
        2,
    ]
    assert unstable_poles(Loop(pidalab.ipdt(1.0, delay), 5.01 * critical)) == 4  # next pair crosses at 5 pi/2
    assert unstable_poles(Loop(pidalab.ipdt(1.0, delay), 8.99 * critical)) == 4
    assert unstable_poles(Loop(pidalab.ipdt(-1.0, delay), critical)) == 1
    result = margins(Loop(pidalab.ipdt(1.0, delay), 0.5 / delay))
    assert (result.gm, result.pm, result.dm) == pytest.approx(
        (np.pi, np.degrees(np.pi / 2 - 0.5), (np.pi - 1) * delay)
    )
    assert (result.wgc, result.wpc) == pytest.approx((0.5 / delay, critical))


@pytest.mark.parametrize("seed", range(25))
def test_count_against_polynomial_roots_without_delay(seed):
    rng = np.random.default_rng(100 + seed)
    n = int(rng.integers(1, 8))
    num, den = rng.normal(size=rng.integers(1, n + 2)), rng.normal(size=n + 1)
    loop = Loop(Process(num, den), float(rng.normal()))
    a, b = open_loop(loop)
    assert unstable_poles(loop) == np.sum(np.roots(np.polyadd(a, b)).real > 0)


@pytest.mark.parametrize(
    ("process", "controller", "count"),
    [
        (Process([1.0], [1.0, -1.0], 0.1), control.tf([1.0, -1.0], [1.0, 1.0]), 1),
        (Process([1.0], np.poly([1.0, 2.0, -1.0]), 0.1), control.tf([0.1, -0.2], [1.0, 1.0]), 2),
        (pidalab.ipdt(1.0, 1.0), control.tf([1.0, 0.0], [1.0, 1.0]), 1),
        (Process([1.0], [1.0, 0.0, 0.0]), 1.0, 2),
        (Process([1.0], [1.0, 0.0]), 0.0, 1),
        (Process([1.0], [1.0, 0.0, 1.0], 1.0), 0.0, 2),
        (Process([1.0], np.convolve([1e4, 1.0], [1.0, 0.0, 1e8])), 0.0, 2),
        (pidalab.fopdt(1.0, 1.0, 1.0), 0.0, 0),
        (pidalab.ipdt(1.0, 1.0), PIDA(np.pi / 2, 1e9, 0.0, 0.0), 2),
    ],
    ids=["cancelled", "one-of-two-cancelled", "integrator-cancelled", "axis", "origin", "axis-no-feedback", "fast-axis",
         "no-feedback", "slow-reset-at-critical-gain"],
)  # fmt: skip
def test_cancelled_poles_and_poles_on_the_axis_count(process, controller, count):
    assert unstable_poles(Loop(process, controller)) == count


@pytest.mark.parametrize("gain", [0.1, 0.3678, 1.0, 1.57, 1.6, 5.0, 50.0])
def test_rightmost_poles_of_an_integrator_are_lambert_w(gain):
    """s + K e^{-s} = 0 has the zeros W_k(-K)."""
    poles = pidalab.rightmost_poles(Loop(pidalab.ipdt(1.0, delay=1.0), gain), count=6)
    exact = np.array([lambertw(-gain, k) for k in range(-8, 9)])
    exact = exact[np.argsort(-exact.real)][: poles.size]
    assert np.sort_complex(poles) == pytest.approx(np.sort_complex(exact), abs=1e-12)
    assert np.all(np.diff(poles.real) < 1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_rightmost_poles_of_random_loops(seed):
    """The poles solve the characteristic equation, and their number matches the argument principle."""
    loop = random_loop(seed)
    poles = pidalab.rightmost_poles(loop, count=10)
    assert poles.size in (10, 11)
    assert np.abs(1 + loop.L(poles)) == pytest.approx(0, abs=1e-8)
    unstable = unstable_poles(loop)
    assert unstable < 10
    assert np.count_nonzero(poles.real >= 0) == unstable
    assert poles.sum().imag == pytest.approx(0, abs=1e-9)  # complex pairs are complete


def test_rightmost_poles_without_dead_time():
    loop = Loop(Process([1.0], [1.0, 2.0, 0.0]), 5.0)
    assert pidalab.rightmost_poles(loop) == pytest.approx([-1 + 2j, -1 - 2j])
    with pytest.raises(ValueError, match="at most the order of the loop, 2, found 3"):
        pidalab.rightmost_poles(loop, count=3)


def test_rightmost_poles_of_a_neutral_loop():
    """The poles right of the chain at log(0.5) are separate. The chain has no rightmost pole."""
    neutral = Loop(Process([0.5, 1.0], [1.0, 1.0], delay=1.0), 1.0)
    poles = pidalab.rightmost_poles(neutral)
    assert np.abs(1 + neutral.L(poles)) == pytest.approx(0, abs=1e-10)
    with pytest.raises(ArithmeticError, match=r"chain of poles of this neutral loop at -0\.6931"):
        pidalab.rightmost_poles(Loop(Process([1.0], [1.0], delay=1.0), 0.5))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_rightmost_poles_do_not_split_a_cluster(count):
    """A triple pole is returned whole, even if fewer poles are asked for."""
    loop = pidalab.rules.mrdp.tune(pidalab.ipdt(0.02, delay=3.0), m=0, n=0, te=0.0).loop()
    assert pidalab.rightmost_poles(loop, count) == pytest.approx([(math.sqrt(2) - 2) / 3] * 3, abs=1e-4)


@pytest.mark.parametrize("process", [pidalab.lags(4), pidalab.lags(4, delay=1.0)])
def test_a_closed_loop_pole_at_the_origin_is_unstable(process):
    """L(0) = -1."""
    assert unstable_poles(Loop(process, -1.0)) == 1
    assert not pidalab.is_stable(Loop(process, -1.0))
    assert not margins(Loop(process, -1.0)).stable


@pytest.mark.parametrize(("order", "lag"), [(5, 1.0), (20, 60.0), (30, 60.0), (60, 1.0), (100, 1.0)])
def test_many_equal_lags_without_dead_time_have_their_closed_loop_poles(order, lag):
    """The roots of (lag s + 1)^n = -k lie on a circle around -1/lag."""
    poles = pidalab.rightmost_poles(Loop(pidalab.lags(order, lag), 0.5), count=4)
    turns = np.exp(1j * np.pi * np.array([1, -1, 3, -3]) / order)
    np.testing.assert_allclose(poles * lag, 0.5 ** (1 / order) * turns - 1, atol=1e-12)


@pytest.mark.parametrize("gain", [3.162, 2.0])
def test_a_lag_that_the_controller_cancels_stays_a_pole(gain):
    """At the pole of the process, a zero of the controller, L is 0/0."""
    filter_time = 0.0033541565443812476
    loop = Loop(pidalab.fopdt(gain, 10.0, 0.0), PIDA(47.1438244290703, 10.0), control.tf(1, [filter_time, 1]))
    others = np.roots([filter_time, 1.0, 4.71438244290703 * gain])
    poles = pidalab.rightmost_poles(loop, 3)
    assert poles == pytest.approx(np.append(-0.1, sorted(others, reverse=True)), rel=1e-9)


def test_a_cluster_far_to_the_left_does_not_hide_the_others():
    """Aberth's method does not separate four poles of a filter near -333."""
    loop = Loop(pidalab.lags(8), pidalab.HighOrderPID([1 / 3, 1.0, 0.3], filter_time=0.003, filter_order=4))
    pair = pidalab.rightmost_poles(loop)
    value = loop.transfer("y", "d", pair[:1] * (1 + 1e-9))
    assert abs(value[0]) > 1e6
    assert pair.real == pytest.approx([4.90829e-04] * 2, rel=1e-5)
    with pytest.raises(
        ArithmeticError, match="the 10 rightmost poles cannot be separated from their neighbours"
    ):
        pidalab.rightmost_poles(loop, 10)


@pytest.mark.parametrize("delay", [1e-3, 1e-9])
@pytest.mark.parametrize("seed", range(6))
def test_rightmost_poles_with_hardly_any_dead_time(seed, delay):
    """The poles are those of the loop without dead time."""
    loop = random_loop(seed, delay=False)
    short = Loop(Process(loop.process.num, loop.process.den, delay * 1e-2), loop.controller)
    expected = pytest.approx(pidalab.rightmost_poles(loop, count=4), abs=1e-9 + 5 * delay, rel=1e-6 + delay)
    assert pidalab.rightmost_poles(short, count=4) == expected


@pytest.mark.parametrize("delay", [10.0, 30.0, 50.0, 300.0])
def test_rightmost_pole_of_an_unstable_process_with_long_dead_time(delay):
    """A pole of s^2 - 1 + 2 e^{-s delay} is near 1 - e^{-delay}, where the feedback is as small as rounding."""
    loop = Loop(Process([2.0], [1.0, 0.0, -1.0], delay), 1.0)
    assert pidalab.rightmost_poles(loop) == pytest.approx([1 - math.exp(-delay)], abs=1e-7)


# Compare unstable poles and limits of stability with the oracle.

CASES = oracle("margins.json")["cases"]


def changed(case, factor, extra):
    """Return the loop of a case with another gain and a longer dead time."""
    loop = oracle_loop(case)
    process = Process(loop.process.num, loop.process.den, loop.process.delay + extra)
    num, den = loop.blocks["controller"]
    return Loop(process, control.tf(factor * num, den), loop.output_filter)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_number_of_unstable_poles(case):
    assert unstable_poles(oracle_loop(case)) == case["unstable_poles"]
    for other in case["poles"]:
        assert unstable_poles(changed(case, other["factor"], other["extra"])) == other["count"], other


LIMITS = [
    pytest.param(case, limit, id=f"{case['name']}-{limit}")
    for case in CASES
    for limit in ("gm", "gm_low", "dm")
    if case["values"] and 0.0 < float(case["values"][limit]) < math.inf
]


@pytest.mark.parametrize(("case", "limit"), LIMITS)
def test_limits_of_stability(case, limit):
    """The loop is stable a millionth below the limit, and unstable a millionth above it."""
    value = float(case["values"][limit])
    if limit == "dm":
        step = 1e-6 * (case["delay"] + value)
        inside, outside = ((1.0, value + x) for x in (-step, step))
    else:
        step = 1e-6 if value > 1 else -1e-6
        inside, outside = ((value * (1 + x), 0.0) for x in (-step, step))
    assert unstable_poles(changed(case, *inside)) == 0 < unstable_poles(changed(case, *outside))
