"""Answers that other projects publish, in their tests and manuals, to questions that pidalab answers too.

An answer agrees if it is within the tolerance of the test that publishes it; where there is none, within one unit of
the last digit.
"""

import control
import numpy as np
import pytest

import pidalab

PYTHON_CONTROL = "python-control, control/tests/margin_test.py", 1.5e-3
PKG_CONTROL = "GNU Octave's pkg-control, inst/margin.m", 1e-2
CONTROL_SYSTEMS = "ControlSystems.jl, test_analysis.jl", 1e-3

s = control.tf("s")
RESONANT = (
    8.75 * (4 * s**2 + 0.4 * s + 1)
    / ((100 * s + 1) * (s**2 + 0.22 * s + 1) * (s**2 / 100 + 0.008 * s + 1))
)  # fmt: skip
CONDITIONAL = control.ss(
    [
        [-1.42119805189796, 1.0, 1.42119805189796, 0.0],
        [-1.5105265612217906, -1.4146551592967844, 1.009901951359278, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.5, 0.0],
    ],
    [[0.0], [0.0], [0.0], [0.1]],
    [[10.006246098625127, 14.146551592967842, 0.0, 0.0]],
    0.0,
)
MASSES = 100 * control.ss(
    [[0, 1, 0, 0], [-100, -2, 100, 1], [0, 0, 0, 1], [100, 1, -100, -2]], [[0], [1], [0], [0]], [1, 0, 0, 0], 0
) * control.tf([1], [0.002, 1])  # fmt: skip


THIRD_ORDER = 24 / (s**3 + 6 * s**2 + 11 * s + 6)


@pytest.mark.parametrize(
    ("source", "system", "published"),
    [
        (PYTHON_CONTROL, 1 / (s**3 + 2 * s**2 + 3 * s + 4), {"gm": 2, "wpc": 1.7321, "1/ms": 0.4170, "wms": 1.662}),
        (PYTHON_CONTROL, RESONANT, {"gm": 2.2716, "pm": 97.5941, "wpc": 10.0053, "wgc": 0.0850}),
        (PYTHON_CONTROL, RESONANT, {"1/ms": 0.5591, "wms": 9.9918}),
        (PYTHON_CONTROL, 0.01 * (10 - s) / ((2 + s) * (1 + s)), {"gm": 300, "wpc": 5.6569, "1/ms": 0.9917}),
        (PYTHON_CONTROL, 200 / (s**3 + 21 * s**2 + 20 * s), {"wpc": 4.47213595, "1/gm": 0.47619048}),
        (PKG_CONTROL, THIRD_ORDER, {"gm": 2.50, "pm": 35.43, "wpc": 3.32, "wgc": 2.06}),
        (CONTROL_SYSTEMS, CONDITIONAL, {"gm": 2.0051252, "wpc": 1.2311039, "gm_low": 0.8733648}),
        (CONTROL_SYSTEMS, MASSES, {"dm": 0.03743336128009814}),
    ],
)  # fmt: skip
def test_margins(source, system, published):
    require(pidalab.margins(pidalab.Loop(pidalab.Process.from_control(system), 1.0)), source, published)


def test_margins_of_a_sampled_loop():
    """The process of pkg-control's example behind a zero-order hold."""
    proportional = pidalab.HighOrderPID([0.0, 1.0], 1e-9, 1).discretise(0.3)
    loop = pidalab.Loop(pidalab.Process.from_control(THIRD_ORDER), proportional)
    require(pidalab.margins(loop), PKG_CONTROL, {"gm": 1.41, "pm": 18.60, "wpc": 2.48, "wgc": 2.04})


def require(found, source, published):
    for key, number in published.items():
        value = 1 / getattr(found, key[2:]) if key.startswith("1/") else getattr(found, key)
        assert value == pytest.approx(number, abs=source[1]), (source, key)


@pytest.mark.parametrize(
    ("num", "den", "published"),
    [
        ([-1, 1], [1, 1, 1], {"overshoot": 20.840, "undershoot": 28.0, "peak": 1.208}),
        ([1, 5, 5], [1, 1.65, 5, 6.5, 2], {"settling_time": 27.9762, "overshoot": 7.4915, "peak": 2.6873}),
    ],
)  # fmt: skip
def test_step_information(num, den, published):
    """python-control's timeresp_test.py, the second by MathWorks. Times read off a coarse grid are left out."""
    final = num[-1] / den[-1]
    response = pidalab.open_loop_step(pidalab.Process(num, den), np.linspace(0.0, 60.0, 60_001))
    for key, number in published.items():
        value = getattr(response, key)(**({} if key.startswith("peak") else {"final": final}))
        assert value == pytest.approx(number, rel=5e-3), key


def test_a_loop_with_dead_time():
    """Of ControlSystems.jl: 2 exp(-s)/s with unit feedback, a polynomial from dead time to dead time."""
    t = np.linspace(0.0, 3.0, 301)
    y = pidalab.step_response(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 1.0), t).y
    expected = 2 * np.maximum(t - 1, 0) - 2 * np.maximum(t - 2, 0) ** 2
    assert y == pytest.approx(expected, abs=1e-12)
