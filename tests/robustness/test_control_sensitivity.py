"""Compare the largest gain from noise to control signal with closed forms, dense grids and the oracle."""

import math

import control
import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab.robustness import max_control_sensitivity


@pytest.mark.parametrize(
    ("loop", "mks", "at"),
    [
        (
            pidalab.Loop(pidalab.fopdt(4.0, 1.0, 0.5), pidalab.PIDA(0.02, 1.0)),
            0.25,
            0.0,
        ),  # integral action: 1/P(0)
        (pidalab.Loop(pidalab.lags(1), pidalab.PIDA(2.0, math.inf, 1.0, n=10.0)), 22.0, math.inf),
        # If the plant has a zero at 0, the integral grows without bound.
        (pidalab.Loop(pidalab.Process([1.0, 0.0], [1.0, 2.0, 1.0]), pidalab.PIDA(0.5, 1.0)), math.inf, 0.0),
        # The filter integrates, and the controller does not.
        (pidalab.Loop(pidalab.lags(1), 0.2, control.tf([0.1, 1.0], [1.0, 0.0])), 1.0, 0.0),
    ],
    ids=["zero", "infinity", "zero at zero", "filter"],
)
def test_ends_of_the_axis(loop, mks, at):
    peak, where = max_control_sensitivity(loop)
    assert peak == pytest.approx(mks, rel=1e-3)
    assert where == at


DENSE = {
    # A long dead time makes many peaks. On a coarse grid another one is the highest.
    "ripples": (
        pidalab.Loop(
            pidalab.Process([0.4], [1.0], delay=8.2),
            pidalab.HighOrderPID([0.05, 1.0, 0.73], filter_time=0.14, filter_order=2),
        ),
        np.linspace(1.0, 20.0, 200_001),
    )
}
# Of thousands of peaks an early one is the highest, below the corner frequency of the lag.
for delay in (1e3, 1e5):
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, delay), pidalab.HighOrderPID([0.0, 0.3], 0.1, 1))
    DENSE[f"far longer than the lag, {delay:g}"] = loop, np.linspace(0.1, 60.0, 120_001) / delay
# |L| never falls below 0.1. An early peak, where |L| is 0.3, is the highest.
for delay in (10.0, 1e4):
    loop = pidalab.Loop(pidalab.Process([0.3, 1.0], [1.0, 1.0], delay), 0.3)
    DENSE[f"as loud far out, {delay:g}"] = loop, np.linspace(0.1, 60.0, 120_001) / delay
# A band-pass in positive feedback: L reaches -k between two grid points.
for gain in (0.5, 2.0, 8.0):
    band = control.tf([0.5 * gain, 0.0], [1.0, 0.5, 1.0])
    loop = pidalab.Loop(pidalab.Process([-1.0], [0.003, 1.0]), band)
    DENSE[f"beyond minus one, {gain:g}"] = loop, np.linspace(0.5, 2.0, 100_001)


@pytest.mark.parametrize("name", DENSE)
def test_peak_matches_a_dense_grid(name):
    loop, w = DENSE[name]
    expected = np.abs(loop.transfer("u", "n", 1j * w))
    mks, at = max_control_sensitivity(loop)
    assert expected.max() <= mks * (1 + 1e-12)
    assert mks == pytest.approx(np.abs(loop.transfer("u", "n", 1j * at)), rel=1e-9)
    assert at == pytest.approx(w[np.argmax(expected)], rel=1e-4)


# Compare the largest gain from noise to control signal with the oracle: the gain to 1e-9, its frequency to 1e-6.

CASES = [case for case in oracle("margins.json")["cases"] if case["values"].get("mks")]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_peak_of_the_control_sensitivity(case):
    mks, at = max_control_sensitivity(oracle_loop(case))
    assert mks == pytest.approx(float(case["values"]["mks"]), rel=1e-9)
    assert at == pytest.approx(float(case["values"]["wmks"]), rel=1e-6)
