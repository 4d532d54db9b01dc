"""Compare margins of sampled loops with python-control, closed forms and the oracle."""

import dataclasses
import math

import control
import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab
from pidalab import PIDA, Loop, Process, SeriesPIDA, fopdt, ipdt, lags, margins, unstable_poles

H = 0.25
LOOPS = {
    "chain": (lags(4, delay=0.5), PIDA(1.31, 3.37, 0.938, 0.269)),
    "integrating": (ipdt(1.0, 1.0), PIDA(0.4, 8.0)),
    "unstable plant": (Process([1.0], [1.0, -0.2], 0.5), PIDA(1.2, 8.0)),
    "reset": (lags(2, delay=0.25), SeriesPIDA(0.8, 0.5, 0.0, 1.5, 0.2, 2)),
    "no dead time": (lags(3), PIDA(2.0, 4.0, 1.0)),
    "proportional": (fopdt(1.0, 2.0, 2.0), PIDA(1.5, math.inf)),
}


def closed_loop(process, k):
    """Return the closed-loop poles by python-control, for a dead time of whole samples."""
    plant = control.c2d(control.tf(process.num, process.den), H, "zoh")
    late = control.tf([1.0], np.eye(1, round(process.delay / H) + 1)[0], H)
    chain = plant * late * k.transfer_function()
    num, den = chain.num[0][0], chain.den[0][0]
    return np.roots(np.polyadd(num, den))


def times(k, gain):
    """Return the digital controller with its gain multiplied."""
    paths = tuple(path._replace(gains=tuple(gain * each for each in path.gains)) for path in k.paths)
    growth = k.growth if k.from_signal else tuple(gain * each for each in k.growth)
    return dataclasses.replace(k, paths=paths, growth=growth)


@pytest.mark.parametrize("gain", [0.2, 1.0, 2.0, 3.0, 8.0])
@pytest.mark.parametrize("name", LOOPS)
def test_poles_outside_the_unit_circle(name, gain):
    process, controller = LOOPS[name]
    k = times(controller.discretise(H), gain)
    expected = int(np.sum(np.abs(closed_loop(process, k)) > 1))
    assert unstable_poles(Loop(process, k)) == expected
    assert margins(Loop(process, k)).stable == (expected == 0)


@pytest.mark.parametrize("gain", [0.5, 1.5, 2.0, -0.5])
def test_every_margin_of_a_sampled_lag_in_closed_form(gain):
    """A held 1/(s + 1) has L = K (1 - a)/(z - a) with a = e^-h. S and T are largest at an end."""
    h = 0.8
    a = math.exp(-h)
    b = gain * (1 - a)
    result = margins(Loop(fopdt(1.0, 1.0, 0.0), PIDA(gain, math.inf).discretise(h)))
    end = math.pi / h
    real = {0.0: gain, end: -b / (1 + a)}  # values of L at frequencies where L is real
    gm, wpc = min((-1 / x, w) for w, x in real.items() if x < 0)
    assert (result.gm, result.wpc) == pytest.approx((gm, wpc), rel=1e-9)
    assert result.gm_low == 0.0
    assert result.phase_crossovers == pytest.approx([end] if gain > 0 else [])
    peaks = [
        max((abs(f(x)), w) for w, x in real.items()) for f in (lambda x: 1 / (1 + x), lambda x: x / (1 + x))
    ]
    assert (result.ms, result.wms, result.mt, result.wmt) == pytest.approx((*peaks[0], *peaks[1]), rel=1e-9)
    cosine = (1 + a * a - b * b) / (2 * a)
    if abs(cosine) < 1:
        wgc = math.acos(cosine) / h
        turn = math.pi + float(np.angle(b / (np.exp(1j * wgc * h) - a)))
        assert result.gain_crossovers == pytest.approx([wgc])
        assert (result.wgc, result.pm, result.dm) == pytest.approx((wgc, math.degrees(turn), turn / wgc))
    else:
        assert result.gain_crossovers.size == 0
        assert (result.pm, result.dm) == (math.inf, math.inf)
        assert math.isnan(result.wgc)


@pytest.mark.parametrize("gain", [0.3, 0.7])
def test_gain_margins_of_an_unstable_sampled_plant(gain):
    """The loop of 1/(s - p) is stable for gains from p to the gain with a pole at z = -1."""
    p, h = 0.2, 0.5
    k = PIDA(gain, math.inf).discretise(h)
    result = margins(Loop(Process([1.0], [1.0, -p]), k))
    assert (result.gm_low, result.gm) == pytest.approx((p / gain, p / gain / math.tanh(0.5 * p * h)))
    assert margins(Loop(Process([1.0], [1.0, -p], 0.3), k)).gm_low == pytest.approx(p / gain)


# Compare with the oracle: values to 1e-9, the frequencies of peaks to 1e-6, since peaks are flat.

CASES = oracle("sampled_loops.json")["cases"]
STABLE = [case for case in CASES if case["values"]["stable"]]
PLACES = {"wgc": 1e-9, "wpc": 1e-9, "wms": 1e-6, "wmt": 1e-6}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_stability(case):
    assert pidalab.is_stable(sampled_oracle_loop(case)) == case["values"]["stable"]


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_margins(case):
    result, true = pidalab.margins(sampled_oracle_loop(case)), case["values"]["margins"]
    for name in ("gm", "gm_low", "pm", "dm", "ms", "mt"):
        assert getattr(result, name) == pytest.approx(float(true[name]), rel=1e-9), name
    for name, tolerance in PLACES.items():
        assert getattr(result, name) == pytest.approx(float(true[name]), rel=tolerance, nan_ok=True), name
    for name in ("gain_crossovers", "phase_crossovers"):
        np.testing.assert_allclose(getattr(result, name), np.array(true[name], float), rtol=1e-9)
