"""Identify models with known parameters by three points, tangent and least squares."""

import math
import warnings

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import gammainc

import pidalab
from pidalab.identification import binomial_filtered, ipdt_least_squares, ipdt_tangent, three_point
from pidalab.identification.experiments import LEVELS, _hinge, _levels_reached, _rise_time

T = np.linspace(0.0, 40.0, 4001)
FOURTH = gammainc(4, T)  # step response of 1/(s + 1)^4


def formulas(t5, t35, t85):  # haalman2024, eq. (5)
    L, tau = 1.3 * t35 - 0.29 * t85, 0.67 * (t85 - t35)
    return L, 0.598 + 0.4799 * t5 / L - 0.41 / (t5 / tau) ** 0.6, tau


def test_fourth_order_lag_against_exact_crossings():
    times = [
        brentq(lambda t, level=level: gammainc(4, t) - level, 0.0, 20.0, xtol=1e-14)
        for level in (0.05, 0.353, 0.853)
    ]
    model = three_point(T, FOURTH)
    assert model.times == pytest.approx(times, abs=1e-4)  # linear between samples 0.01 apart
    assert (model.apparent_delay, model.alpha, model.tau) == pytest.approx(formulas(*times), abs=1e-4)
    assert model.gain == pytest.approx(1.0, abs=1e-12)


def test_sampled_crossings_are_first_samples_at_or_above_the_levels():
    model = three_point(T, FOURTH, crossing="sampled")
    for time, level in zip(model.times, (0.05, 0.353, 0.853), strict=True):
        i = int(np.argmax(level <= FOURTH))
        assert time == pytest.approx(T[i], abs=1e-12)


def model_4(ratio, alpha):
    """Return haalman2024's model (4) with tau = 1 and L = ratio."""
    lag = (1 - alpha) * ratio / 2
    return pidalab.Process(
        [1.0], np.polymul([1.0, 1.0], np.polymul([lag, 1.0], [lag, 1.0])), delay=alpha * ratio
    )


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("ratio", [0.2, 0.25, 0.3, 0.45, 1.0, 3.0])
def test_three_point_warns_where_its_model_makes_an_unsafe_loop(ratio, alpha):
    """`tune` refuses a model with a warning. Any other model has nearly the Ms of the process."""
    process, t = model_4(ratio, alpha), np.linspace(0.0, 15.0 + 15.0 * ratio, 8001)
    y = pidalab.open_loop_step(process, t).y
    if (ratio, alpha) == (0.2, 0.1):
        with pytest.raises(ValueError, match="alpha"):
            three_point(t, y)
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = three_point(t, y)
    w = np.linspace(0.01, 1.0, 2000) / (model.alpha * model.apparent_delay)
    excess = np.max(np.abs(process(1j * w) / model.process(1j * w))) - 1
    assert model.excess_gain == pytest.approx(excess, abs=0.01 + 0.01 * excess)
    assert bool(caught) == (ratio < 0.3 or (ratio, alpha) in [(0.3, 0.3), (0.3, 0.6), (0.3, 0.9)])
    design = pidalab.rules.haalman.tune(model.process, ms=1.4)
    if caught:
        assert caught[0].filename == __file__
        with pytest.raises(ValueError, match="model"):
            pidalab.rules.haalman.tune(model, ms=1.4)
    else:
        assert pidalab.rules.haalman.tune(model, ms=1.4).controller == design.controller
        if ratio <= 1.0 and 0.1 < alpha < 0.9:  # where the formulas fit
            assert (model.gain, model.tau) == (pytest.approx(1.0, rel=1e-3), pytest.approx(1.0, rel=0.15))
            assert model.apparent_delay == pytest.approx(ratio, rel=0.15)
            assert np.max(np.abs(pidalab.open_loop_step(model.process, t).y - y)) < 0.04
        loop = design.loop(process)
        assert pidalab.is_stable(loop)
        assert pidalab.max_sensitivity(loop)[0] < 1.15 * design.ms


@pytest.mark.parametrize(
    ("gain", "step", "rest"), [(2.0, 1.0, 0.0), (-2.0, 1.0, 0.0), (2.0, -0.5, 7.0), (-3.0, 10.0, -100.0)]
)
def test_gain_step_size_and_rest_value(gain, step, rest):
    model, unit = three_point(T, rest + gain * step * FOURTH, step=step), three_point(T, FOURTH)
    assert model.gain == pytest.approx(gain, rel=1e-9)
    assert (model.apparent_delay, model.alpha, model.tau) == pytest.approx(
        (unit.apparent_delay, unit.alpha, unit.tau), rel=1e-9
    )


def inflection(order, lag):
    """Return slope and intercept of the tangent at the steepest point of the step response of 1/(lag s + 1)^order."""
    time = (order - 1) * lag
    slope = gammainc(order, order - 1.0)  # level at this time
    density = (order - 1.0) ** (order - 1) * np.exp(1.0 - order) / math.factorial(order - 1) / lag
    return density, time - slope / density


@pytest.mark.parametrize("order", [2, 3, 4, 8])
def test_tangent_of_equal_lags_is_its_closed_form(order):
    """The slope is too small by at most |y'''| h^2 / 6, since it is the mean over a sample near the steepest point."""
    slope, delay = inflection(order, 2.0)
    for h in (0.1, 0.05, 0.01):
        t = h * np.arange(round(60.0 / h))
        y = 3.0 * gammainc(order, np.maximum(t - 0.7, 0.0) / 2.0) + 20.0
        model = ipdt_tangent(t, y, step=1.5)
        off = h**2 / (6 * (order - 1) * 2.0**2)  # at its maximum the gamma density has f'' = -f / (order - 1)
        assert 0 <= 1 - model.num[0] / (2.0 * slope) <= 1.1 * off
        assert model.delay == pytest.approx(0.7 + delay, abs=5 * off * delay + h**2)


@pytest.mark.parametrize(
    ("rule", "options"),
    [
        *((ipdt_tangent, {"span": span}) for span in (None, 0.5, 7.0)),
        *((ipdt_least_squares, {"rise": rise}) for rise in (0.02, 0.2, 0.9)),
    ],
)
def test_an_integrator_is_identified_exactly(rule, options):
    y = 5.0 - 0.3 * np.maximum(T - 3.217, 0.0)
    model = rule(T, y, step=0.5, **options)
    assert (model.num[0], model.den.tolist()) == (pytest.approx(-0.6, rel=1e-10), [1.0, 0.0])
    assert model.delay == pytest.approx(3.217, abs=1e-9)


def test_tangent_ignores_a_steep_start_in_the_wrong_direction():
    y = FOURTH - 0.5 * (T > 0) * np.exp(-T)
    assert np.diff(y).min() < -10 * np.diff(y).max()
    model = ipdt_tangent(T, y)
    assert model.num[0] == pytest.approx(np.max(np.diff(y)) / 0.01, rel=1e-12)
    assert model.delay > 0


@pytest.mark.parametrize("order", [1, 3, 4])
def test_filtered_ramp_is_its_closed_form(order):
    """After n lags a ramp is t - n T_f plus a transient. The input is linear between samples, so any step is exact."""
    t = np.arange(0.0, 20.0, 0.25)
    lag = 0.8
    x = t / lag
    moments = sum((order - k) * x**k / math.factorial(k) for k in range(order)) * np.exp(-x)
    expected = 5.0 + 2.0 * (t - order * lag + lag * moments)
    assert binomial_filtered(t, 5.0 + 2.0 * t, lag, order) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("rule", [ipdt_tangent, ipdt_least_squares])
def test_the_change_of_a_record_counts_from_its_first_sample(rule):
    t = np.arange(40.0)
    at_once, none = np.where(t > 0, 2.0, 1.0), np.where(t == 1, 2.0, 1.0)
    assert rule(t, at_once).num[0] > 0
    with pytest.raises(ValueError, match="y must change"):
        rule(t, none)


@pytest.mark.parametrize("seed", range(30))
def test_hinge_is_the_least_squares_ramp(seed):
    """Compare with a fine grid of starting times."""
    rng = np.random.default_rng(seed)
    t = 0.3 * np.arange(rng.integers(5, 40))
    y = np.cumsum(rng.normal(size=t.size)) + rng.normal(size=t.size)
    ramps = np.maximum(t - np.linspace(0.0, t[-3], 3001)[:, None], 0.0)
    slopes = ramps @ y / np.sum(ramps**2, axis=1)
    least = np.min(np.sum((y - slopes[:, None] * ramps) ** 2, axis=1))
    slope, delay = _hinge(t, y)
    assert np.sum((y - slope * np.maximum(t - delay, 0.0)) ** 2) <= least * (1 + 1e-9)


PLANT = pidalab.Process([2.3], np.convolve([20.0, 1.0], np.convolve([6.0, 1.0], [3.0, 1.0])), 8.0)


def historian(h=0.5, noise=0.0, irregular=0.0, plant=PLANT, end=220.0):
    """Return a record of a valve that moves from 40 to 47 % after 37 s. Its clock starts at 1000 s."""
    rng = np.random.default_rng(3)
    t = h * np.arange(round(end / h))
    moved = np.sort(t + irregular * h * rng.uniform(-0.5, 0.5, t.size))
    fine = 0.01 * np.arange(round((end + 1) / 0.01))
    y = np.interp(moved - 37.0, fine, pidalab.open_loop_step(plant, fine).y, left=0.0)
    return pidalab.Record(
        1000 + moved, np.where(moved < 37.0, 40.0, 47.0), 55.0 + 7.0 * y + rng.normal(0.0, noise, t.size)
    )


def fields(model):
    return model.gain, model.apparent_delay, model.alpha, model.tau


def test_a_record_gives_the_model_of_its_arrays():
    t = 0.5 * np.arange(366)
    y = pidalab.open_loop_step(PLANT, t).y
    assert fields(three_point(historian())) == pytest.approx(fields(three_point(t, y)), rel=1e-4)
    for rule in (ipdt_tangent, ipdt_least_squares):
        model, expected = rule(historian()), rule(t, y)
        assert (model.num[0], model.delay) == pytest.approx((expected.num[0], expected.delay), rel=1e-3)


def test_noise_and_irregular_times_change_the_model_little():
    messy = historian(noise=0.03, irregular=0.8)  # 0.2 % of the change
    assert fields(three_point(messy)) == pytest.approx(fields(three_point(historian())), rel=0.06)
    # The time of the step is uncertain by a sample interval, at most 0.9.
    clean, noisy = ipdt_least_squares(historian()), ipdt_least_squares(messy)
    assert noisy.num[0] == pytest.approx(clean.num[0], rel=0.03)
    assert noisy.delay == pytest.approx(clean.delay, abs=0.9)
    # Because of the curvature, a line over a third of the rise is less steep than the tangent.
    clean, noisy = ipdt_tangent(historian()), ipdt_tangent(messy)
    assert (noisy.num[0], noisy.delay) == pytest.approx((clean.num[0], clean.delay), rel=0.1)
    single = ipdt_tangent(messy, span=0.5)  # the steepest sample is noise
    assert abs(single.num[0] - clean.num[0]) > abs(noisy.num[0] - clean.num[0])


def settled(moved=0.0, first=0.04, top=1.0, count=40):
    """Return a ramp from 0 to 1. The last tenth of the samples is higher by `moved` than the tenth before."""
    tenth = count // 10
    y = np.clip(np.linspace(first - 0.06, 1.2, count), 0.0, 1.0)
    y[0], y[1], y[count // 2] = 0.0, first, top
    y[-tenth:] = 1.0
    y[-2 * tenth : -tenth] = 1.0 - moved
    y[count - 2 * tenth - 4 : count - 2 * tenth] = 1.0
    return np.arange(float(count)), y


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"moved": 0.0099}, None),
        ({"moved": 0.0101}, "y has not settled: .* it moves by 1 % of the whole change"),
        ({"first": 0.0499}, None),
        ({"first": 0.0501}, r"y already moves by 5\.01 %"),
        ({"top": 1.099}, None),
        ({"top": 1.101}, r"y overshoots by 10\.1 %, and 10 % is allowed"),
        ({"count": 30}, None),
        ({"count": 29}, "y must have at least 30 samples, found 29"),
    ],
)
@pytest.mark.parametrize(("gain", "rest"), [(1.0, 0.0), (-20.0, 300.0)])
def test_limits_of_a_step_record(options, message, gain, rest):
    t, y = settled(**options)
    if message is None:
        times, change = _levels_reached(t, rest + gain * y, "interpolated")
        assert change == pytest.approx(gain)
        assert np.interp(times, t, np.maximum.accumulate(y)) == pytest.approx(LEVELS)
    else:
        with pytest.raises(ValueError, match=message):
            _levels_reached(t, rest + gain * y, "interpolated")


def test_time_of_rise_in_closed_form():
    """The rise lasts from the last sample below 10 % to the first sample above 90 % of the final level."""
    t = 0.5 * np.arange(50.0)
    y = 3.0 - 2.0 * np.interp(np.arange(50.0), [10, 30], [0.0, 1.0])
    assert _rise_time(t, y) == pytest.approx(0.5 * (29 - 11))
    y[40] = 3.0  # a later sample that falls back has no effect
    assert _rise_time(t, y) == pytest.approx(0.5 * (29 - 11))
    # The final level is the mean of the last tenth, five samples.
    assert _rise_time(t, np.append(np.arange(45.0), [60, 70, 50, 40, 30])) == pytest.approx(0.5 * (45 - 4))
    assert _rise_time(t[:2], np.array([0.0, 1.0])) == pytest.approx(0.5)
    assert _rise_time(t[:9], np.arange(9.0)) == pytest.approx(0.5 * 8)  # the last of nine


@pytest.mark.parametrize(("share", "warns"), [(0.0099, False), (0.0101, True)])
def test_noise_above_one_per_cent_of_the_change_warns(share, warns):
    """The noise is the standard deviation before the step. The change is the mean of the last tenth."""
    t = np.arange(400.0)
    clean = 3.0 * np.interp(t, [102.0, 150.0], [0.0, 1.0])
    wobble = np.where(t < 100, np.resize([1.0, -1.0], 400), 0.0) / np.sqrt(100 / 99)
    record = pidalab.Record(t, np.where(t < 100, 0.0, 2.0), clean + 3.0 * share * wobble)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ipdt_least_squares(record)
    assert any("the noise of the record is 1 % of" in str(w.message) for w in caught) == warns


def test_the_least_squares_ramp_begins_within_the_shortest_stretch():
    """Candidate ramps end at each sample after the output was last below the share. The steepest ramp is taken."""
    t = 0.25 * np.arange(60)
    y = -1.0 + 4.0 * np.interp(t, [2.0, 3.0, 6.0], [0.0, 0.6, 1.0])
    for rise in (0.1, 0.5, 0.7):
        first = int(np.flatnonzero((y + 1) / 4 < rise)[-1]) + 1
        ramps = [_hinge(t[: end + 1], y[: end + 1] + 1) for end in range(max(first, 4), 60)]
        slope, delay = max(ramps)
        model = ipdt_least_squares(t, y, step=2.0, rise=rise)
        assert (model.num[0], model.delay) == pytest.approx((slope / 2, delay), rel=1e-12)


def test_a_record_of_five_samples_is_enough():
    t = np.arange(5.0)
    model = ipdt_least_squares(t, 2.0 * np.maximum(t - 1.5, 0.0))
    assert (model.num[0], model.delay) == pytest.approx((2.0, 1.5))


@pytest.mark.parametrize(("span", "width"), [(0.5, 1), (0.74, 1), (0.76, 2), (9.5, 19)])
def test_a_span_is_rounded_to_steps(span, width):
    """The best line through part of a parabola has the slope at the middle. The last part is the steepest."""
    t = 0.5 * np.arange(20)
    model = ipdt_tangent(t, 1.0 + t**2, span=span)
    middle = t[-1] - 0.25 * width
    assert model.num[0] == pytest.approx(2 * middle)
    delay = max(0.0, middle - np.mean(t[-1 - width :] ** 2) / (2 * middle))
    assert model.delay == pytest.approx(delay, abs=1e-12)
