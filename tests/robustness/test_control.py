"""The largest gain from noise to control signal, at the ends of the axis and between."""

import math

import control
import numpy as np
import pytest

import pidalab
from pidalab.robustness.control import max_control_sensitivity


@pytest.mark.parametrize(
    ("loop", "mks", "at"),
    [
        (
            pidalab.Loop(pidalab.fopdt(4.0, 1.0, 0.5), pidalab.PIDA(0.02, 1.0)),
            0.25,
            0.0,
        ),  # integral action: 1/P(0)
        (pidalab.Loop(pidalab.lags(1), pidalab.PIDA(2.0, math.inf, 1.0, n=10.0)), 22.0, math.inf),
        # u runs away where nothing that integrates comes through
        (pidalab.Loop(pidalab.Process([1.0, 0.0], [1.0, 2.0, 1.0]), pidalab.PIDA(0.5, 1.0)), math.inf, 0.0),
        # the filter integrates, the controller does not
        (pidalab.Loop(pidalab.lags(1), 0.2, control.tf([0.1, 1.0], [1.0, 0.0])), 1.0, 0.0),
    ],
    ids=["zero", "infinity", "zero at zero", "filter"],
)
def test_ends_of_the_axis(loop, mks, at):
    found, where = max_control_sensitivity(loop)
    assert found == pytest.approx(mks, rel=1e-3)
    assert where == at


def test_the_highest_of_many_ripples():
    """A long dead time makes many peaks, and their heights on the grid do not tell which is the highest."""
    controller = pidalab.HighOrderPID([0.05, 1.0, 0.73], filter_time=0.14, filter_order=2)
    loop = pidalab.Loop(pidalab.Process([0.4], [1.0], delay=8.2), controller)
    w = np.linspace(1.0, 20.0, 1_000_001)
    gain = np.abs(loop.transfer("u", "n", 1j * w))
    mks, at = max_control_sensitivity(loop)
    assert mks == pytest.approx(gain.max(), rel=1e-4)
    assert mks >= gain.max()
    assert at == pytest.approx(w[np.argmax(gain)], abs=1e-4)


@pytest.mark.parametrize("delay", [1e3, 1e5])
def test_a_dead_time_far_longer_than_the_lag_is_followed_only_where_it_may_matter(delay):
    """One of the first turns of thousands is the highest; the lag has not begun there."""
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, delay), pidalab.HighOrderPID([0.0, 0.3], 0.1, 1))
    w = np.linspace(0.1, 60.0, 600_001) / delay
    expected = np.abs(loop.transfer("u", "n", 1j * w))
    mks, at = max_control_sensitivity(loop)
    assert mks == pytest.approx(expected.max(), rel=1e-8)
    assert at == pytest.approx(w[np.argmax(expected)], rel=1e-3)


@pytest.mark.parametrize("delay", [10.0, 1e4])
def test_a_loop_that_stays_as_loud_is_followed_no_farther_than_it_matters(delay):
    """|L| never falls below a tenth; one of the first turns, where |L| is 0.3, is the highest."""
    loop = pidalab.Loop(pidalab.Process([0.3, 1.0], [1.0, 1.0], delay), 0.3)
    w = np.linspace(0.1, 60.0, 100_001) / delay
    expected = np.abs(loop.transfer("u", "n", 1j * w))
    mks, at = max_control_sensitivity(loop)
    assert mks == pytest.approx(expected.max(), rel=1e-6)
    assert at == pytest.approx(w[np.argmax(expected)], rel=1e-3)


@pytest.mark.parametrize("gain", [0.5, 2.0, 8.0])
def test_a_peak_beyond_minus_one_is_looked_at_closely(gain):
    """A band-pass in positive feedback: L reaches -k between two points of the grid, and |C S| is largest there."""
    process = pidalab.Process([-1.0], [0.003, 1.0])
    loop = pidalab.Loop(process, control.tf([0.5 * gain, 0.0], [1.0, 0.5, 1.0]))
    w = np.linspace(0.5, 2.0, 100_001)
    expected = np.abs(loop.transfer("u", "n", 1j * w))
    mks, at = max_control_sensitivity(loop)
    assert mks == pytest.approx(expected.max(), rel=1e-9)
    assert at == pytest.approx(w[np.argmax(expected)], rel=1e-4)
