"""Compare margins with closed forms, python-control and the oracle, including loops for which a grid could fail."""

import math
from dataclasses import FrozenInstanceError
from functools import reduce

import control
import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab import PIDA, Loop, Process, margins, unstable_poles
from pidalab.robustness.axis import SENSITIVITY, Axis
from pidalab.robustness.in_z import axis_of


@pytest.mark.parametrize("damping", [0.01, 0.3, 0.5])
def test_gain_that_just_touches_one(damping):
    """The peak of |L| is 1.0001. Both crossovers lie between two grid points, and still determine the delay margin."""
    peak = 1 / (2 * damping * math.sqrt(1 - damping**2))
    loop = Loop(pidalab.sopdt(1.0001 / peak, 1.0, damping, 0.3), 1.0)
    result = margins(loop)
    x = np.roots([1.0, 4 * damping**2 - 2, 1 - (1.0001 / peak) ** 2])  # |L| = 1 is a quadratic in w^2
    np.testing.assert_allclose(result.gain_crossovers, np.sort(np.sqrt(x)), rtol=1e-7)
    later = Process(loop.process.num, loop.process.den, 0.3 + 1.0005 * result.dm)
    assert unstable_poles(Loop(later, 1.0)) > 0


def test_margins_of_an_unstable_loop():
    """L = 2 e^(-s)/s is real and negative at pi/2 and 5 pi/2, with moduli 4/pi and 4/(5 pi)."""
    result = margins(Loop(pidalab.ipdt(1.0, 1.0), 2.0))
    assert not result.stable
    assert result.unstable_poles == 2
    assert (result.gm, result.gm_low) == pytest.approx((5 * np.pi / 4, np.pi / 4))
    assert result.gain_crossovers == pytest.approx([2.0])
    assert result.phase_crossovers[:2] == pytest.approx([np.pi / 2, 5 * np.pi / 2])
    assert result.pm == pytest.approx(np.degrees(2.0) - 90)
    assert "unstable, 2 poles" in str(result)


@pytest.mark.parametrize(
    "loop",
    [
        Loop(pidalab.lags(3), PIDA(2.0, 3.0, 0.6)),
        Loop(Process([2.0], [1.0, -1.0]), PIDA(2.0, 5.0)),
        Loop(pidalab.sopdt(1.0, 1.0, 0.1, 0.0), PIDA(0.1, 1.0)),
    ],
    ids=["lags", "unstable-process", "resonance"],
)
def test_disk_margin_matches_python_control(loop):
    w = np.geomspace(0.03, 30.0, 30_001)
    alpha, gain, phase = control.disk_margins(control.tf(*loop.open_loop), w)
    disk = margins(loop).disk
    assert disk == pytest.approx(alpha, rel=1e-6)
    assert 20 * np.log10((2 + disk) / (2 - disk)) == pytest.approx(gain, rel=1e-6)
    assert np.degrees(2 * np.arctan(disk / 2)) == pytest.approx(phase, rel=1e-6)


def drawn_loop(rng):
    """Draw one to three lags with dead time, under a PIDA controller with N and M up to 500."""
    lags = reduce(np.convolve, ([lag, 1.0] for lag in rng.uniform(0.1, 3.0, rng.integers(1, 4))))
    kp, (n, m) = 10 ** rng.uniform(-1.5, 0.5), 10 ** rng.uniform(0.5, 2.7, 2)
    controller = PIDA(kp, rng.uniform(0.3, 4.0), rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.4), n, m)
    return Loop(Process([1.0], lags, rng.uniform(0.05, 2.0)), controller)


def test_margins_of_loops_with_fast_filters():
    """Some of 150 loops have |L| above 1 while the dead time turns the phase a million times.

    Each turn adds two poles, so except for a few the number of poles is twice the number of turns.
    """
    rng, loud = np.random.default_rng(5), 0
    for _ in range(150):
        loop = drawn_loop(rng)
        result = margins(loop)
        assert result.stable == pidalab.is_stable(loop) == (pidalab.unstable_poles(loop) == 0)
        assert result.ms >= 1 / abs(1 + loop.L(1j * max(result.wms, 1e-6))) * (1 - 1e-6)
        turns = loop.process.delay * result.gain_crossovers.max(initial=0.0) / (2 * np.pi)
        if turns > 1e5:
            assert result.unstable_poles == pytest.approx(2 * turns, rel=0.1)
            assert math.isnan(result.gm) or result.gm > 1
            loud += 1
    assert loud >= 3


def test_crossovers_far_from_all_corner_frequencies():
    """The crossovers lie two decades below the slowest root, and six decades above the fastest root."""
    faint = margins(Loop(pidalab.fopdt(1.0, 1.0, 1.0), pidalab.HighOrderPID([1e-8, 1e-9], 0.1, 2)))
    assert faint.wgc == pytest.approx(1e-8, rel=1e-9)
    assert faint.dm == pytest.approx((np.pi / 2) / 1e-8, rel=1e-6)
    huge = Loop(Process([1e12], [1.0, 3.0, 2.0]), 1.0)
    assert pidalab.gain_crossovers(huge) == pytest.approx([1e6], rel=1e-9)


@pytest.mark.parametrize("gain", [0.5, 0.999, -0.999])
def test_neutral_loop_with_gain_below_one(gain):
    result = margins(Loop(Process([1.0], [1.0], delay=1.0), gain))  # poles at ln|gain|
    assert result.stable
    assert (result.gm, result.ms) == pytest.approx((1 / abs(gain), 1 / (1 - abs(gain))), rel=1e-9)


@pytest.mark.parametrize("gain", [1.0, -1.0, 2.0])
def test_neutral_loop_with_gain_from_one_on(gain):
    loop = Loop(Process([1.0], [1.0], delay=1.0), gain)
    assert unstable_poles(loop) == math.inf
    assert not margins(loop).stable
    assert pidalab.max_sensitivity(loop)[0] >= 1 / abs(1 - abs(gain) + 1e-300) * (1 - 1e-9)


ENDS = {
    "L(inf) = -0.5": (Process([-0.5, 1.0], [1, 1]), {"ms": 2.0, "mt": 1.0, "gm": 2.0, "wms": math.inf}),
    "|L| > 1 far out": (Process([2.0, 1.0], [1, 1]), {"ms": 0.5, "mt": 2 / 3, "gm": math.inf, "dm": 0.0}),
    "L(inf) = 0.5": (Process([0.5, 2.0], [1, 1]), {"ms": 1 / 1.5, "mt": 2 / 3, "wms": math.inf}),
    "pole at 0 for 2": (
        Process([-0.5], [1, 1]),
        {"ms": 2.0, "mt": 1.0, "gm": 2.0, "dm": math.inf, "wms": 0.0},
    ),
    "pole at 0 for half the gain": (Process([2.0], [1, -1]), {"ms": 1.0, "mt": 2.0, "gm_low": 0.5}),
    "unstable with dead time": (Process([2.0], [1, -1], 0.1), {"gm_low": 0.5, "mt": 2.0}),
    "Routh: k < 8": (Process([0.05], [1, 3, 3, 1]), {"gm": 160.0, "pm": math.inf, "dm": math.inf}),
    "Routh: k > 1e-4/0.02": (Process([1.0, 0.02, 1e-4], [1, 0, 0, 0], 1e-4), {"gm_low": 0.005}),
    "no feedback": (Process([0.0], [1, 1], 1.0), {"gm": math.inf, "pm": math.inf, "ms": 1.0, "mt": 0.0}),
}


@pytest.mark.parametrize("name", ENDS)
def test_closed_forms_at_the_ends(name):
    process, expected = ENDS[name]
    loop = Loop(process, 1.0)
    result = margins(loop)
    assert result.stable
    assert {name: getattr(result, name) for name in expected} == pytest.approx(
        expected, rel=1e-3 if "gm_low" in expected else 1e-7
    )


@pytest.mark.parametrize(
    "loop",
    [
        Loop(pidalab.fopdt(1.0, 1.0, 1.0), 0.0),
        Loop(Process([0.0], [1.0, 1.0], 1.0), 1.0),
        Loop(Process([0.05, 0.0, 0.05], [1.0, 2.0, 2.0, 1.0], 0.3), 1.0),
        Loop(pidalab.sopdt(1.0, 1.0, 0.0, 0.0), PIDA(1.0, math.inf, 1.0, 0.0)),
        Loop(pidalab.ipdt(1.0, 0.0), 1.0),
    ],
    ids=["zero-controller", "zero-process", "zeros-on-the-axis", "poles-on-the-axis", "first-order"],
)
def test_stable_loops_with_zeros_and_poles_where_a_logarithm_or_a_quotient_fails(loop):
    result = margins(loop)
    assert result.stable
    s = 1j * np.geomspace(1e-4, 1e4, 100_000)
    ms, mt = np.abs(loop.S(s)).max(), np.abs(loop.T(s)).max()
    assert (result.ms, result.mt) == pytest.approx((max(ms, 1.0), mt), rel=1e-3, abs=1e-9)


def test_a_loop_that_is_real_along_the_whole_axis_has_no_phase_crossover():
    """The imaginary part of 1/(s^2 + 1) is rounding error, whose changes of sign are not crossovers."""
    real = Loop(Process([1.0], np.convolve([1.0, 0.0, 1.0], [1.0, 0.0, 2.0])), 0.3)
    assert pidalab.phase_crossovers(real).size == 0
    assert pidalab.phase_crossovers(Loop(Process([1.0], [1.0, 0.0, 1.0]), 0.3)).size == 0


def test_equal_lags_of_high_order():
    """|L| is (1 + w^2)^(-n/2)/2 and its phase -n atan w, whatever the unit of time."""
    for order, lag in ((30, 60.0), (200, 1.0)):
        result = margins(Loop(pidalab.lags(order, lag=lag), 0.5))
        w = math.tan(math.pi / order)
        assert result.wpc == pytest.approx(w / lag, rel=1e-12)
        assert result.gm == pytest.approx(2 * (1 + w * w) ** (order / 2), rel=1e-11)


def test_a_constant_gain_of_one_has_no_crossover():
    assert pidalab.gain_crossovers(Loop(Process([1.0], [1.0], 1.0), 1.0)).size == 0
    assert pidalab.gain_crossovers(Loop(Process([-1.0, 1.0], [1.0, 1.0], 1.0), 1.0)).size == 0


def test_all_phase_crossovers_of_a_dead_time_of_many_lags():
    """L = e^(-1000 s)/(2 (s + 1)) is real and negative where 1000 w + atan(w) = (2 k + 1) pi."""
    crossovers = pidalab.margins(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 1000.0), 0.5)).phase_crossovers
    expected = (2 * np.arange(5000) + 1) * np.pi / 1000.0
    for _ in range(20):
        expected = ((2 * np.arange(5000) + 1) * np.pi - np.arctan(expected)) / 1000.0
    expected = expected[0.5 / np.hypot(1.0, expected) >= 0.1]
    np.testing.assert_allclose(crossovers, expected, rtol=1e-12)


def test_margins_are_immutable_and_compare_by_identity():
    """This holds for every result that contains arrays."""
    first, second = (margins(Loop(pidalab.lags(4), PIDA(2.0, 3.0, 1.0, 0.3))) for _ in range(2))
    with pytest.raises(FrozenInstanceError):
        first.ms = 1.0
    assert len({first, second}) == 2
    assert first != second


def test_the_axes_in_s_and_in_z_count_unstable_poles():
    """The base class cannot be instantiated."""
    process, stable, unstable = pidalab.lags(3, delay=1.0), PIDA(0.8, 3.0, 0.8, 0.3), PIDA(4.0, 3.0)
    for controller, poles in ((stable, 0), (unstable, 2)):
        for loop in (Loop(process, controller), Loop(process, controller.discretise(0.05))):
            axis = axis_of(loop)
            assert axis.encirclements(0.0, 0.0) == unstable_poles(loop) == poles
            peak, at = axis.peak(SENSITIVITY)
            assert peak == pytest.approx(
                np.abs(1 / (1 + axis.L(at * np.linspace(0.99, 1.01, 2001)))).max(), rel=1e-6
            )
    with pytest.raises(TypeError, match="abstract"):
        Axis(np.ones(1), 0.0, 0.0, 0.0)


# Compare with the oracle: values to 1e-9, the frequencies of peaks to 1e-6, since peaks are flat.

CASES = oracle("margins.json")["cases"]
HEIGHTS = ("gm", "gm_low", "pm", "dm", "ms", "mt")
PLACES = {"wgc": 1e-9, "wpc": 1e-9, "wms": 1e-6, "wmt": 1e-6}
STABLE = [case for case in CASES if not case["unstable_poles"]]


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_margins(case):
    result, true = pidalab.margins(oracle_loop(case)), case["values"]
    assert result.stable
    for name in HEIGHTS:
        assert getattr(result, name) == pytest.approx(float(true[name]), rel=1e-9), name
    for name, tolerance in PLACES.items():
        assert getattr(result, name) == pytest.approx(float(true[name]), rel=tolerance, nan_ok=True), name
    for name in {"gain_crossovers", "phase_crossovers"} & set(true):
        np.testing.assert_allclose(getattr(result, name), np.array(true[name], float), rtol=1e-9)
