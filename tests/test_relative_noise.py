"""Check the relative noise gain: its scale, and that it does not depend on units."""

import math

import numpy as np
import pytest

import pidalab
from pidalab import PIDA, HighOrderPID, Loop, Process


@pytest.mark.parametrize(
    ("process", "period", "gain"),
    [
        (pidalab.lags(3), 2 * math.pi / math.sqrt(3), 8.0),
        (pidalab.ipdt(0.5, delay=1.0), 4.0, math.pi),
        # Without ultimate period, the scale follows from time constants, dead time and 1/static gain.
        (pidalab.fopdt(-2.0, 3.0, 0.0), 3.0, 0.5),
        (Process([2.0], [1.0, -0.5], 1.0), 3.0, 0.25),
        # The scale of integrators without ultimate period follows from their gain at this time.
        (Process([3.0], [2.0, 1.0, 0.0]), 2.0, 1 / 6),
        (Process([3.0], [2.0, 1.0, 0.0, 0.0], 1.0), 3.0, 1 / 27),
    ],
)
def test_noise_scale(process, period, gain):
    scale = pidalab.noise_scale(process)
    assert scale == pytest.approx((period / 100, gain))
    assert scale.period == pytest.approx(period)


@pytest.mark.parametrize(
    "process",
    [
        pidalab.lags(3, delay=1.0),
        pidalab.ipdt(0.3, delay=1.0),
        Process([1.0], [1.0, 1.0, 0.0]),
        pidalab.lags(2),
    ],
)
def test_relative_noise_gain_does_not_depend_on_units(process):
    """The units of y, u and time change by the factors a, b and c."""
    a, b, c = 40.0, 0.01, 60.0
    C = PIDA(kp=0.2, ti=4.0, td=0.7, n=2, m=10.0)
    powers = c ** np.arange(process.den.size - 1.0, -1.0, -1.0)
    num = process.num * c ** np.arange(process.num.size - 1.0, -1.0, -1.0)
    other = Process(a / b * num, process.den * powers, c * process.delay)
    scaled = PIDA(kp=C.kp * b / a, ti=c * C.ti, td=c * C.td, n=2, m=10.0)
    value = pidalab.relative_noise_gain(Loop(process, C))
    assert pidalab.relative_noise_gain(Loop(other, scaled)) == pytest.approx(value, rel=1e-9)
    scale = pidalab.noise_scale(process)
    assert value == pytest.approx(pidalab.noise_gain(Loop(process, C), scale.sample_time) / scale.gain)


def test_a_filter_faster_than_the_sample_is_run_as_backward_differences():
    process, C = pidalab.lags(3, delay=1.0), HighOrderPID([0.2, 0.5, 0.3], filter_time=1e-3, filter_order=2)
    scale = pidalab.noise_scale(process)
    digital = C.discretise(scale.sample_time, "backward")
    expected = pidalab.noise_gain(Loop(process, digital), scale.sample_time) / scale.gain
    assert pidalab.relative_noise_gain(Loop(process, C)) == pytest.approx(expected)
