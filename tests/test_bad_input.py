"""Calls that a referee tried and that were wrong, slow or raw: each is right now, or refused with its argument named.

A right answer of a table that took seconds would show as a slow test; none of these takes a second.
"""

import math
from functools import partial

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.special import gammainc

import pidalab
from pidalab import Loop, Process, fopdt, ipdt, lags, plots, sopdt
from pidalab.rules import classical, haalman, magnitude_optimum, mrdp

P = lags(4)
L = Loop(P, 0.5)
T = np.linspace(0.0, 20.0, 201)
W = np.logspace(-1, 1, 20)
ANSWER = pidalab.step_response(L, T)
RESET = pidalab.SeriesPIDA(0.1, 0.0, 0.0, ti=1.0, filter_time=0.5, filter_order=1)


@pytest.mark.parametrize(
    ("order", "lag"), [(20, 60.0), (24, 60.0), (30, 60.0), (40, 60.0), (40, 1.0), (60, 1.0)]
)
def test_many_equal_lags_answer_as_an_incomplete_gamma_function(order, lag):
    t = np.linspace(0.0, 2 * order * lag, 401)
    assert pidalab.open_loop_step(lags(order, lag), t).y == pytest.approx(gammainc(order, t / lag), abs=1e-12)


@pytest.mark.parametrize(
    "process", [lags(30, lag=60.0), lags(60), lags(200), fopdt(1.0, 1.0, 1e6), fopdt(1.0, 1.0, 1e-7)]
)
def test_a_loop_gain_below_one_is_stable(process):
    found = pidalab.margins(Loop(process, 0.5))
    assert found.stable
    assert found.gm > 1.999
    assert found.ms < 2.001


@pytest.mark.parametrize("delay", [1e-5, 1e-6, 1e-7, 1e-12])
def test_dead_times_far_below_the_horizon_are_refused_or_sampled(delay):
    loop, t = Loop(fopdt(1.0, 1.0, delay), 0.5), np.linspace(0.0, 60.0, 61)
    with pytest.raises(ValueError, match=r"t spans .* dead times, too many to follow"):
        pidalab.step_response(loop, t)
    assert pidalab.simulate_sampled(loop, t, 1.0).y[-1] == pytest.approx(1 / 3)


def test_what_is_at_the_border_is_said():
    assert pidalab.is_stable(Loop(P, -1.0)) is False  # a pole at 0
    assert pidalab.margins(Loop(P, -1.0)).stable is False
    assert pidalab.gain_crossovers(Loop(Process([1], [1], 1), 1.0)).size == 0  # |L| is 1 all along


def test_poles_of_transfer_functions_are_infinite_without_warning():
    assert Loop(ipdt(1, 1), 0.5).L(0) == ipdt(1, 1)(0) == math.inf


def test_noise_that_is_held_longer_than_the_record_is_one_value():
    assert np.ptp(pidalab.uniform_noise(T, 1, 0, hold=1e9)) == 0


REFUSED = {
    # right only by chance, or wrong in silence
    "haalman, poles on the axis": (lambda: haalman.pida(Process([1], [8, 4, 2, 1], 0.5)), "3 stable poles"),
    "sopdt 1e-200": (lambda: sopdt(1, 1e-200, 1, 1), "tau must lie between 1e-150 and 1e"),
    "sopdt 1e200": (lambda: sopdt(1, 1e200, 1, 1), "tau must lie between 1e-150 and 1e"),
    "S of text": (lambda: L.S("1j"), "s must be complex numbers, found '1j'"),
    "P of text": (lambda: P("1"), "s must be complex numbers, found '1'"),
    "a filter of order 0": (
        lambda: magnitude_optimum.tune(P, 0, 0, 1.0),
        r"filter_time must be 0 without a filter",
    ),
    "a dead time below all": (lambda: fopdt(1, 1, 1e-320), "delay must be 0, or at least 1e-150"),
    # hung, or filled the memory
    "order 60": (lambda: magnitude_optimum.tune(P, 60, 61, 0.01), "m must be at most 16, found 60"),
    "order 30": (
        lambda: magnitude_optimum.tune(lags(8, delay=1), 30, 31, 0.01),
        "m must be at most 16, found 30",
    ),
    "2000 areas": (lambda: pidalab.areas.from_process(P, 2000), "count must be at most 400, found 2000"),
    "factorials": (lambda: mrdp.tune(ipdt(1, 1), 200, 201, 0.5), "m and n must be at most 100"),
    # raw errors
    "simulate a process": (
        lambda: pidalab.simulate(P, T),
        "loop must be a pidalab.Loop, found Process; .*open_loop",
    ),
    "ensemble of a process": (
        lambda: pidalab.simulate_ensemble(P, T, [1]),
        "loop must be a pidalab.Loop, found Process",
    ),
    "filter for a transfer function": (
        lambda: haalman.output_filter(lags(3), control.tf(1, [1, 1])),
        "controller must be a PIDA, found TransferFunction",
    ),
    "nyquist of a loop": (lambda: plots.nyquist(plt.gca(), L, W), "loops must be a dictionary .* found Loop"),
    "nyquist on nothing": (lambda: plots.nyquist(None, {"a": L}, W), "ax must be one of .* found NoneType"),
    "a signal on a figure": (
        lambda: plots.signal(plt.gcf(), {"a": ANSWER}, "y"),
        "ax must be one of matplotlib's Axes, found Figure",
    ),
    "magnitude on many axes": (
        lambda: plots.magnitude(np.array([plt.gca()]), {"a": W}, W),
        "ax must be one of matplotlib's Axes, found ndarray",
    ),
    "a locus on nothing": (lambda: plots.circle_locus(None, {}, W), "ax must be one of .* found NoneType"),
    "a Popov plot on nothing": (lambda: plots.popov_plot(None, {}, W), "ax must be one of .* found NoneType"),
    "nyquist at infinity": (
        lambda: plots.nyquist(plt.gca(), {"a": L}, np.append(W, np.inf)),
        "frequencies must be finite, found inf at index 20",
    ),
    "magnitude over text": (lambda: plots.magnitude(plt.gca(), {"a": W}, "W"), "frequencies must be"),
    "a circle of no radius": (
        lambda: plots.nyquist(plt.gca(), {"a": L}, W, ms=np.inf),
        "ms must be finite and at least 1",
    ),
    "P at infinity": (lambda: P(math.inf), "s must be finite, found"),
    "S at infinity": (lambda: L.S([1.0, complex(0, math.inf)]), "s must be finite, found infj"),
    "a block at no number": (lambda: L.block("process", math.nan), r"s must be finite, found \(nan"),
    "C at infinity": (lambda: pidalab.PIDA(1, 2)(-math.inf), r"s must be finite, found \(-inf"),
    "a digital controller at infinity": (
        lambda: pidalab.PIDA(1, 2).discretise(0.1)(math.inf),
        r"z must be finite, found \(inf",
    ),
    "a digital controller at text": (
        lambda: pidalab.PIDA(1, 2).discretise(0.1)("1j"),
        "z must be complex numbers, found '1j'",
    ),
    "comparison of a response": (
        lambda: plots.comparison({"a": ANSWER}, {}, 10, 5),
        "clean must be a dictionary .* found Response at 'a'",
    ),
    "comparison without load": (
        lambda: plots.comparison({"a": {"setpoint": ANSWER}}, {}, 10, 5),
        r"clean\['a'\] must have 'setpoint' and 'load', 'load' is missing",
    ),
    "an order that is no number": (
        lambda: magnitude_optimum.gains([1.0] * 6, "1"),
        "m must be a real number",
    ),
    "one level": (
        lambda: pidalab.identification.three_point(T, ANSWER.y, levels=3),
        "levels must be three rising shares",
    ),
    "gain 1e600": (
        lambda: pidalab.margins(Loop(fopdt(1e300, 1, 1), 1e300)),
        "gain of the loop leaves the range",
    ),
    "quietest": (lambda: pidalab.phase_crossovers(L, quietest=-1), "quietest must be above 0, found -1"),
    "a double integrator has no border": (
        lambda: classical.ziegler_nichols_ultimate(Process([1], [1, 0, 0], 1)),
        "process must have a border of stability",
    ),
}


@pytest.mark.parametrize("call", REFUSED)
def test_refused_by_name(call):
    refused, message = REFUSED[call]
    with pytest.raises((TypeError, ValueError), match=message):
        refused()


def test_a_whole_number_may_be_written_as_a_float():
    areas = pidalab.areas.from_process(P, 6)
    assert magnitude_optimum.gains(areas, 1.0).tolist() == magnitude_optimum.gains(areas, 1).tolist()
    assert magnitude_optimum.tune(P, 1.0, 2, 0.1).gains == magnitude_optimum.tune(P, 1, 2, 0.1).gains


@pytest.mark.parametrize(
    ("controller", "h"),
    [
        (pidalab.PIDA(1.5, 4, 1, 0.3), 0.5),
        (pidalab.NonInteractivePIDA(1.5, 4.0, 1.0, 1.0), 0.5),
        (pidalab.HighOrderPID([0.4, 1.3, 1.0], 1e-3, 2), 0.01),
        (pidalab.SeriesPIDA(1.0, 0.5, 0.0, ti=2.0, filter_time=0.1, filter_order=1), 0.5),
    ],
    ids=lambda x: type(x).__name__,
)
def test_a_filter_faster_than_the_sample_is_refused_for_every_class(controller, h):
    loop = Loop(P, controller)
    for call in (
        lambda: pidalab.simulate_sampled(loop, h * np.arange(50.0)),
        lambda: pidalab.noise_gain(loop, h),
    ):
        with pytest.raises(ValueError, match=r"sample time must be at most .*discretise"):
            call()
    if isinstance(controller, pidalab.SeriesPIDA):
        with pytest.raises(ValueError, match=r"sample time must be at most .*discretise"):
            pidalab.portrait(loop, {"kp": [0.5, 1.0]}, h * np.arange(50.0), setpoint=1.0)


LAGGING = Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3))


@pytest.mark.parametrize(
    ("system", "s"),
    [
        (LAGGING.process, 1e200j),
        (LAGGING.process, -800.0),  # of the dead time
        (LAGGING.controller, 1e200j),
        (LAGGING.controller, [[1.0, 1e308 + 1e308j]]),
        (LAGGING.L, 1e100),
        (LAGGING.S, -1e200),
        (LAGGING.T, 1e200j),
        (partial(LAGGING.block, "controller"), 1e200j),
        (pidalab.robustness.linear_part(LAGGING), 1e200j),
    ],
)
def test_a_frequency_beyond_the_range_of_numbers_is_refused(system, s):
    with pytest.raises(ValueError, match=r"^s is too large to evaluate this at, found .*([12]e\+|-800)"):
        system(s)


def test_a_large_frequency_is_none_too_large():
    assert LAGGING.process(1e100) == 0.0
    assert LAGGING.controller(1e60j) == pytest.approx(LAGGING.controller(1e20j))
    assert LAGGING.S(1e30j) == 1.0
