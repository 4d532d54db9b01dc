"""Calls that a referee tried and that raised something raw: each is refused now with its argument named."""

import math

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import pidalab
from pidalab import Loop, lags, plots
from pidalab.rules import haalman

P = lags(4)
L = Loop(P, 0.5)
T = np.linspace(0.0, 20.0, 201)
W = np.logspace(-1, 1, 20)
ANSWER = pidalab.step_response(L, T)


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
    # other numbers would have been taken in silence
    "times with a unit": (
        lambda: pidalab.step_response(L, np.arange(201).astype("timedelta64[s]")),
        r"t must be .* found timedelta64\[s\], which has a unit",
    ),
    "a list of times with a unit": (
        lambda: pidalab.step_response(L, list(np.arange(201).astype("timedelta64[s]"))),
        "t must be an array of real numbers, found list",
    ),
    "a dead time with a unit": (
        lambda: pidalab.ipdt(1.0, delay=np.timedelta64(5, "ns")),
        "delay must be a real number, found np.timedelta64",
    ),
    "what a mask hides": (
        lambda: pidalab.simulate(L, T, load=np.ma.masked_greater(T, 19.0)),
        "load must be an array of real numbers, found masked values",
    ),
    "limits in words": (
        lambda: pidalab.simulate_sampled(L, T, limits=("-1", "1")),
        r"limits must be two numbers, lower and upper, found \('-1', '1'\)",
    ),
    "a filter that is asked for": (
        lambda: Loop(P, 0.5, output_filter=True),
        "output_filter must be a number, .* found bool",
    ),
    "a final value in words": (
        lambda: pidalab.Response(T, 1.0, 0.0, 0.0, T, 0.0, final="1"),
        "final must be a real number, found '1'",
    ),
}


@pytest.mark.parametrize("call", REFUSED)
def test_refused_by_name(call):
    refused, message = REFUSED[call]
    with pytest.raises((TypeError, ValueError), match=message):
        refused()


@pytest.mark.parametrize("block", [pidalab.PIDA(2.0, 4.0, 1.0), control.tf([2.0], [3.0, 1.0]), 2.0])
def test_open_loop_step_of_any_block(block):
    record = pidalab.open_loop_step(block, T)
    same = pidalab.open_loop_step(Loop(block, 0.0).process, T)
    assert np.array_equal(record.y, same.y)
    assert record.final == same.final
