"""Model reduction: printed models, models returned as they are, ultimate frequencies in closed form, refusals."""

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
    """All 24 parameters of Tables 4, 5 and 6; the second-order ones are printed twice."""
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
    """Another algorithm: the crossings of the negative real axis of the loop with a proportional controller."""
    loop = pidalab.Loop(process, 1 / process.gain())
    assert ultimate_frequency(process) == pytest.approx(pidalab.phase_crossovers(loop, 1e-7)[0], rel=1e-9)


@pytest.mark.parametrize("n", [3, 4, 7, 20])
def test_ultimate_frequency_of_equal_lags(n):
    assert ultimate_frequency(pidalab.lags(n, lag=2.0)) == pytest.approx(math.tan(math.pi / n) / 2, rel=1e-9)


def test_ultimate_frequency_counts_whole_turns():
    """Five zeros turn the phase up to +pi, where L crosses the negative real axis first; -pi comes far later."""
    num, den = np.poly([-1.0] * 5), np.poly([-20.0] * 9)
    process = pidalab.Process(num / num[-1], den / den[-1])
    wu = ultimate_frequency(process)
    assert 5 * math.atan(wu) - 9 * math.atan(wu / 20) == pytest.approx(-math.pi, abs=1e-9)
    assert pidalab.phase_crossovers(pidalab.Loop(process, 1.0))[0] < 0.5 * wu


def test_a_sharp_resonance_is_not_stepped_over():
    """The phase falls by almost pi within a hundredth of a decade."""
    wu = ultimate_frequency(RESONANT)
    phase = math.atan2(0.02 * wu, 1 - wu**2) + math.atan(0.5 * wu) + 0.01 * wu
    assert phase == pytest.approx(math.pi, abs=1e-9)
    assert wu == pytest.approx(1.02, abs=0.01)


def test_dead_time_alone_and_zeros_of_any_place():
    assert ultimate_frequency(pidalab.Process([2.0], [1.0], delay=0.5)) == pytest.approx(
        2 * math.pi, rel=1e-12
    )
    all_pass = pidalab.Process([1.0, -2.0, 1.0], [1.0, 2.0, 1.0])  # phase -4 atan(w)
    assert ultimate_frequency(all_pass) == pytest.approx(1.0, rel=1e-9)
    notch = pidalab.Process(
        [0.01, 0.0, 1.0], np.convolve([1.0, 2.0, 1.0], [1.0, 1.0]), delay=0.1
    )  # zeros at 10j
    assert 3 * math.atan(w := ultimate_frequency(notch)) + 0.1 * w == pytest.approx(math.pi, abs=1e-9)


def test_ultimate_frequency_of_an_integrator():
    """With dead time alone a quarter turn is left to it; 1/(s (s + 1)^2) has the gain margin 2 at w = 1."""
    assert ultimate_frequency(pidalab.ipdt(-3.0, delay=0.5)) == pytest.approx(math.pi, rel=1e-9)
    assert ultimate_frequency(pidalab.Process([1.0], [1.0, 2.0, 1.0, 0.0])) == pytest.approx(1.0, rel=1e-9)
    with pytest.raises(ValueError, match="at most one integrator, found 2"):
        ultimate_frequency(pidalab.Process([1.0], [1.0, 0.0, 0.0], 1.0))


@pytest.mark.parametrize("reduce", [to_fopdt, to_sopdt, ultimate_frequency])
@pytest.mark.parametrize(
    ("process", "message"),
    [
        (pidalab.Process([1.0], [1.0, 0.0, 1.0], 1.0), "process must be stable, found an unstable one"),
        (pidalab.Process([1.0, 0.0], [1.0, 1.0], 1.0), "process must have a static gain other than 0"),
        (pidalab.fopdt(1.0, 1.0, 0.0), "process.*it never does"),
        (pidalab.Process([1.0, 1.0], [1.0, 3.0, 3.0, 1.0]), "process must have a phase"),
        (
            pidalab.Process([1.0, 0.0, 0.25], [1.0, 3.0, 3.0, 1.0], 1.0),
            r"it first jumps at the zero at 0\.5j",
        ),
    ],
)
def test_processes_without_ultimate_frequency(reduce, process, message):
    with pytest.raises(ValueError, match=message):
        reduce(process)


def test_processes_without_a_model():
    for reduce in (to_fopdt, to_sopdt):
        with pytest.raises(ValueError, match="process must be stable, found an integrating one"):
            reduce(pidalab.ipdt(1.0, 1.0))
    all_pass = pidalab.Process([1.0, -2.0, 1.0], [1.0, 2.0, 1.0])
    with pytest.raises(ValueError, match=r"must be below 1, found 1"):
        to_fopdt(all_pass)
    with pytest.raises(ValueError, match=r"must be below 1, found 20\.2"):
        to_fopdt(RESONANT)
    for process in (all_pass, *(pidalab.fopdt(1.0, 2.0, delay) for delay in (1e-3, 1.0, 100.0))):
        with pytest.raises(ValueError, match=r"tau wu\)\^4 must be above 0"):
            to_sopdt(process)
    hump = pidalab.Process([1.0], np.convolve([1.0, 0.3, 1.0], np.poly([-1.3, -3.0, -8.0])), delay=1.9)
    with pytest.raises(ValueError, match=r"damping\^2 .* found -0\.064"):
        to_sopdt(hump)


def test_bad_arguments():
    with pytest.raises(TypeError, match=r"process must be a pidalab\.Process, found str"):
        to_fopdt("1/(s + 1)")
    with pytest.raises(ValueError, match="points must be a whole number, at least 3, found 2"):
        to_sopdt(EXAMPLES[1], points=2)
    with pytest.raises(ValueError, match="points must be a whole number"):
        to_sopdt(EXAMPLES[1], points=9.5)


def test_many_equal_lags_are_as_stable_as_the_loop_says():
    """150 lags of 1: the phase falls to -pi at tan(pi/150), and the areas are binomial coefficients."""
    process = pidalab.lags(150)
    assert pidalab.reduction.to_fopdt(process).wu == pytest.approx(math.tan(math.pi / 150), rel=1e-9)
    assert pidalab.areas.from_process(process, 3).tolist() == [1.0, 150.0, 11325.0]
    assert pidalab.unstable_poles(pidalab.Loop(process, 0.1)) == 0
