"""Compare the gain at a given Ms and the bandwidth with closed forms and other algorithms."""

import numpy as np
import pytest
from scipy.optimize import brentq

import pidalab
from pidalab import Loop, Process, gain_for_ms


@pytest.mark.parametrize("ms", [1.2, 1.6, 2.0, 5.0])
@pytest.mark.parametrize(
    ("process", "controller"),
    [
        (pidalab.lags(4), pidalab.PIDA(1.0, 4.0, 1.0, 0.5)),
        (pidalab.fopdt(1.0, lag=1.0, delay=3.0), pidalab.PIDA(2.0, 2.0)),
        (pidalab.fopdt(-5.0, lag=1.0, delay=0.3), pidalab.PIDA(-1.0, 2.0)),
    ],
)
def test_gain_for_ms_is_the_largest_gain_with_that_ms(process, controller, ms):
    k = gain_for_ms(Loop(process, controller), ms)
    loop = Loop(process, k * controller)
    assert pidalab.is_stable(loop)
    assert pidalab.max_sensitivity(loop)[0] == pytest.approx(ms, rel=1e-9)
    assert pidalab.max_sensitivity(Loop(process, 1.01 * k * controller))[0] > ms


def test_an_unstable_plant_takes_the_larger_of_two_gains():
    """Under P control 2/(s - 1) e^{-0.1 s} needs a gain above 1/2. There Ms falls from infinity, and rises again."""
    plant = Process([2.0], [1.0, -1.0], 0.1)
    k = gain_for_ms(Loop(plant, 1.0), 1.6)
    assert pidalab.max_sensitivity(Loop(plant, k))[0] == pytest.approx(1.6, rel=1e-9)
    assert pidalab.max_sensitivity(Loop(plant, 0.99 * k))[0] < 1.6


@pytest.mark.parametrize(
    ("process", "expected"),
    [
        # At infinite frequency |S| has the peaks 1/(1 - k |P(inf)|) with dead time, and 1/(1 + k P(inf)) without.
        (Process([1.0, 0.2], [1.0, 1.0], delay=1.0), 0.5),
        (Process([-0.4, -0.2], [0.1, 1.0], delay=0.3), 0.5 / 4),
        (Process([-1.0, 1.0], [1.0, 1.0]), 0.5),  # ill-posed at k = 1
        (Process([0.5, 1.0], [1.0, 1.0], delay=2.0), None),
        (Process([1.0, 0.3, 1.0], [2.0, 1.0, 1.0], delay=0.7), None),
    ],
)
@pytest.mark.filterwarnings("error")
def test_gain_of_a_biproper_loop(process, expected):
    """Compare with the closed form if Ms lies at infinite frequency, otherwise with a search on a dense grid."""
    k = gain_for_ms(Loop(process, 1.0), 2.0)
    if expected is None:
        w = np.append(np.geomspace(1e-3, 1e3, 200_001), np.linspace(0.0, 60.0, 200_001))
        L = np.append(process(1j * w), -abs(process.num[0] / process.den[0]))
        expected = brentq(lambda k: (1 / np.abs(1 + k * L)).max() - 2.0, 1e-3, 0.999 / abs(L[-1]))
    assert k == pytest.approx(expected, rel=1e-5)
    assert pidalab.is_stable(Loop(process, k))


def test_bandwidth_in_closed_form():
    """T = 1/(tau s + 1) falls by 3 dB at sqrt(10^0.3 - 1)/tau. A static T never falls."""
    assert pidalab.bandwidth(Loop(pidalab.ipdt(1.0, delay=0.0), 0.5)) == pytest.approx(
        0.5 * np.sqrt(10**0.3 - 1), rel=1e-12
    )
    assert pidalab.bandwidth(Loop(Process([1.0], [1.0]), 0.5)) == np.inf


def test_bandwidth_of_a_loop_with_dead_time_by_a_dense_grid():
    loop = Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(0.8, 3.0, 0.8))
    w = np.linspace(1e-3, 5, 2_000_001)
    first = w[np.argmax(np.abs(loop.T(1j * w)) < 10**-0.15)]
    assert pidalab.bandwidth(loop) == pytest.approx(first, abs=5e-6)


def test_a_dead_time_of_many_lags_has_the_gain_of_a_dead_time_alone():
    """With long L, k e^(-s L)/(s + 1) has its peak of |S| near the first turn, where the lag hardly acts."""
    k = gain_for_ms(Loop(pidalab.fopdt(1.0, lag=1.0, delay=1e4), 1.0), 1.6)
    assert k == pytest.approx(1 - 1 / 1.6, rel=1e-6)
