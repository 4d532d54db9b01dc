"""Check model reduction: printed models, exact models, and ultimate frequencies in closed form."""

import math

import numpy as np
import pytest

import pidalab
from pidalab.reduction import to_fopdt, to_sopdt, ultimate_frequency

EXAMPLES = {  # heo2023, (17) to (19)
    1: pidalab.lags(3, delay=0.2),
    2: pidalab.lags(5),
    3: pidalab.Process([1.0], np.convolve([9.0, 2.4, 1.0], [1.0, 1.0]), delay=0.5),
}
RESONANT = pidalab.Process([1.0], np.convolve([1.0, 0.02, 1.0], [0.5, 1.0]), delay=0.01)
FIRST = {1: (3.589, 1.254), 2: (3.725, 2.649), 3: (3.540, 4.038)}  # tau, theta; Tables 4 to 6
SECOND = {1: (1.490, 0.585, 0.876), 2: (2.046, 1.556, 0.863), 3: (3.098, 1.381, 0.413)}  # tau, theta, xi

DIFFERENT = [  # stable, of many kinds
    *EXAMPLES.values(),
    pidalab.lags(8, lag=0.3, gain=-2.0, delay=1.0),
    pidalab.Process([-0.5, 1.0], [1.0, 3.0, 3.0, 1.0]),
    pidalab.Process([-0.5, 1.0], [1.0, 3.0, 3.0, 1.0], delay=3.0),
    pidalab.Process([2.0, 1.0], [1.0, 3.0, 3.0, 1.0], delay=0.5),
    pidalab.Process([3.0], [4.0, 10.0, 4.0], delay=1e-3),
]


@pytest.mark.parametrize("k", EXAMPLES)
def test_printed_models(k):
    """Check all 24 parameters of Tables 4, 5 and 6."""
    first, second = to_fopdt(EXAMPLES[k]), to_sopdt(EXAMPLES[k])
    assert (round(first.tau, 3), round(first.delay, 3)) == FIRST[k]
    assert (round(second.tau, 3), round(second.delay, 3), round(second.damping, 3)) == SECOND[k]


@pytest.mark.parametrize("gain", [1.0, -3.0])
@pytest.mark.parametrize("tau", [1e-3, 400.0])
@pytest.mark.parametrize(
    ("damping", "ratio"), [(0.0625, 0.5), (0.3, 0.1), (0.7, 2.0), (1.0, 1.0), (2.0, 0.1), (6.0, 5.0)]
)
def test_a_second_order_model_is_returned_as_it_is(gain, tau, damping, ratio):
    model = to_sopdt(pidalab.sopdt(gain, tau, damping, ratio * tau))
    assert model[:4] == pytest.approx((gain, tau, damping, ratio * tau), rel=1e-7)


@pytest.mark.parametrize("gain", [1.0, -3.0])
@pytest.mark.parametrize(("tau", "delay"), [(1.0, 0.01), (2.0, 1.0), (1e-3, 0.1), (50.0, 20.0)])
def test_a_first_order_model_is_returned_as_it_is(gain, tau, delay):
    model = to_fopdt(pidalab.fopdt(gain, tau, delay))
    assert model[:3] == pytest.approx((gain, tau, delay), rel=1e-8)


@pytest.mark.parametrize("process", DIFFERENT)
def test_the_model_keeps_gain_and_ultimate_frequency(process):
    wu = ultimate_frequency(process)
    for model in (to_fopdt(process), to_sopdt(process)):
        assert model.wu == wu
        assert model.process.gain() == pytest.approx(process.gain(), rel=1e-14)
        assert model.delay >= 0
        assert ultimate_frequency(model.process) == pytest.approx(wu, rel=1e-9)
    assert abs(to_fopdt(process).process(1j * wu)) == pytest.approx(abs(process(1j * wu)), rel=1e-11)


@pytest.mark.parametrize("process", DIFFERENT)
def test_ultimate_frequency_is_the_first_phase_crossover(process):
    """Compare with the phase crossovers of a loop with a proportional controller."""
    loop = pidalab.Loop(process, 1 / process.gain())
    assert ultimate_frequency(process) == pytest.approx(pidalab.phase_crossovers(loop, 1e-7)[0], rel=1e-9)


def test_ultimate_frequency_counts_whole_turns():
    """Five zeros first raise the phase to +pi. It reaches -pi at a much higher frequency."""
    num, den = np.poly([-1.0] * 5), np.poly([-20.0] * 9)
    process = pidalab.Process(num / num[-1], den / den[-1])
    wu = ultimate_frequency(process)
    assert 5 * math.atan(wu) - 9 * math.atan(wu / 20) == pytest.approx(-math.pi, abs=1e-9)
    assert pidalab.phase_crossovers(pidalab.Loop(process, 1.0))[0] < 0.5 * wu


def test_a_sharp_resonance_is_resolved():
    """The phase falls by almost pi within a hundredth of a decade."""
    wu = ultimate_frequency(RESONANT)
    phase = math.atan2(0.02 * wu, 1 - wu**2) + math.atan(0.5 * wu) + 0.01 * wu
    assert phase == pytest.approx(math.pi, abs=1e-9)
    assert wu == pytest.approx(1.02, abs=0.01)


@pytest.mark.parametrize(
    ("process", "frequency"),
    [
        (pidalab.lags(4, lag=2.0), math.tan(math.pi / 4) / 2),
        (pidalab.Process([2.0], [1.0], delay=0.5), 2 * math.pi),
        (pidalab.Process([1.0, -2.0, 1.0], [1.0, 2.0, 1.0]), 1.0),  # an all-pass of phase -4 atan(w)
        (pidalab.ipdt(-3.0, delay=0.5), math.pi),  # the integrator has turned the phase by -pi/2
        (pidalab.Process([1.0], [1.0, 2.0, 1.0, 0.0]), 1.0),
    ],
)
def test_ultimate_frequency_in_closed_form(process, frequency):
    assert ultimate_frequency(process) == pytest.approx(frequency, rel=1e-9)


def test_many_equal_lags_are_as_stable_as_the_loop_says():
    """The phase of 150 lags falls to -pi at tan(pi/150), and the areas are binomial coefficients."""
    process = pidalab.lags(150)
    assert pidalab.reduction.to_fopdt(process).wu == pytest.approx(math.tan(math.pi / 150), rel=1e-9)
    assert pidalab.areas.from_process(process, 3).tolist() == [1.0, 150.0, 11325.0]
    assert pidalab.unstable_poles(pidalab.Loop(process, 0.1)) == 0
