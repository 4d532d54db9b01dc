"""Calls that a referee tried and that were wrong, slow or raw: each is right now, or refused with its argument named.

A right answer of a table that took seconds would show as a slow test; none of these takes a second.
"""

import math

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.special import gammainc

import pidalab
from pidalab import Loop, Process, fopdt, lags, plots
from pidalab.rules import haalman

P = lags(4)
L = Loop(P, 0.5)
T = np.linspace(0.0, 20.0, 201)
W = np.logspace(-1, 1, 20)
ANSWER = pidalab.step_response(L, T)


@pytest.mark.parametrize(
    ("order", "lag"), [(20, 60.0), (24, 60.0), (30, 60.0), (40, 60.0), (40, 1.0), (60, 1.0)]
)
def test_many_equal_lags_answer_as_an_incomplete_gamma_function(order, lag):
    t = np.linspace(0.0, 2 * order * lag, 401)
    assert pidalab.open_loop_step(lags(order, lag), t).y == pytest.approx(gammainc(order, t / lag), abs=1e-12)


@pytest.mark.parametrize(
    "process", [lags(30, lag=60.0), lags(60), lags(200), fopdt(1.0, 1.0, 1e5), fopdt(1.0, 1.0, 1e-7)]
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


REFUSED = {
    "S of text": (lambda: L.S("1j"), "s must be complex numbers, found '1j'"),
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
    "nyquist at infinity": (
        lambda: plots.nyquist(plt.gca(), {"a": L}, np.append(W, np.inf)),
        "frequencies must be finite, found inf at index 20",
    ),
    "a circle of no radius": (
        lambda: plots.nyquist(plt.gca(), {"a": L}, W, ms=np.inf),
        "ms must be finite and at least 1",
    ),
    "P at infinity": (lambda: P(math.inf), "s must be finite, found"),
    "a digital controller at infinity": (
        lambda: pidalab.PIDA(1, 2).discretise(0.1)(math.inf),
        r"z must be finite, found \(inf",
    ),
    "comparison of a response": (
        lambda: plots.comparison({"a": ANSWER}, {}, 10, 5),
        "clean must be a dictionary .* found Response at 'a'",
    ),
    "comparison without load": (
        lambda: plots.comparison({"a": {"setpoint": ANSWER}}, {}, 10, 5),
        r"clean\['a'\] must have 'setpoint' and 'load', 'load' is missing",
    ),
    "quietest": (lambda: pidalab.phase_crossovers(L, quietest=-1), "quietest must be above 0, found -1"),
}


@pytest.mark.parametrize("call", REFUSED)
def test_refused_by_name(call):
    refused, message = REFUSED[call]
    with pytest.raises((TypeError, ValueError), match=message):
        refused()


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
