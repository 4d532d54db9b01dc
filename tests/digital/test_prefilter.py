"""Check prefilters of a digital controller."""

import math

import control
import numpy as np
import pytest
from scipy import signal

import pidalab
from pidalab import PIDA

Z = np.exp(1j * np.array([1e-4, 0.01, 0.3, 1.0, 3.0])) * np.array([1.0, 1.0, 1.0, 1.05, 0.9])
H = 0.07
FILTERS = {
    "lag": ([1.0], [0.5, 1.0]),
    "lead": ([0.8, 1.0], [0.5, 1.0]),
    "pair": ([1.0], [0.25, 0.1, 1.0]),
    "four equal lags": ([1.0], np.poly([-5.0] * 4) / 5.0**4),
    "second order": ([0.3, 0.2, 1.0], [0.25, 0.1, 1.0]),
    "far apart": ([3.0, 2.0, 1.0], np.polymul([40.0, 1.0], np.polymul([0.1, 1.0], [0.2, 0.1, 1.0]))),
    "another scale": ([6.0], [3.0, 6.0]),
}
PID = PIDA(1.3, 3.3, 0.9)


def made(name, method, h=H):
    return PID.discretise(h, method, prefilter=control.tf(*FILTERS[name])).prefilter


@pytest.mark.parametrize("name", FILTERS)
def test_methods(name):
    num, den = FILTERS[name]
    for method, s in (("backward", (1 - 1 / Z) / H), ("tustin", 2 / H * (Z - 1) / (Z + 1))):
        expected = np.polyval(num, s) / np.polyval(den, s)
        np.testing.assert_allclose(made(name, method)(Z), expected, rtol=1e-12, atol=1e-13)
    A, B, C, D, _ = signal.cont2discrete(signal.tf2ss(num, den), H, "zoh")
    expected = [(C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D).item() for z in Z]
    np.testing.assert_allclose(made(name, "zoh")(Z), expected, rtol=1e-10, atol=1e-12)
    assert [made(name, method)(1.0) for method in ("backward", "tustin", "zoh")] == [1.0] * 3


@pytest.mark.parametrize("name", FILTERS)
def test_prefilter_of_the_controller_matches_prefilter_of_the_loop(name):
    """The simulation discretises a prefilter of the loop for a held set point, as the method zoh does."""
    process, t = pidalab.lags(3, delay=0.5), H * np.arange(400)
    filters = control.tf(*FILTERS[name])
    r = np.where(t < 10.0, 1.0, -0.5)
    plain = PIDA(1.3, 3.3).discretise(H, "zoh")
    expected = pidalab.simulate_sampled(pidalab.Loop(process, plain, prefilter=filters), t, setpoint=r)
    with_prefilter = PIDA(1.3, 3.3).discretise(H, "zoh", prefilter=filters)
    run = pidalab.simulate_sampled(pidalab.Loop(process, with_prefilter), t, setpoint=r)
    np.testing.assert_allclose(run.y, expected.y, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(run.u, expected.u, rtol=1e-9, atol=1e-10)


def test_discretise_includes_the_prefilter_of_a_design():
    rule = pidalab.rules.automatic_reset
    design = rule.tune(pidalab.ipdt(1.0, delay=1.0), rule.PIDA_1, n=4, filter_time=0.2)
    h = 0.01
    t = h * np.arange(2000)
    k = design.discretise(h, "zoh", limits=(-math.inf, math.inf))
    run = pidalab.simulate_sampled(pidalab.Loop(design.model, k), t, setpoint=1.0)
    expected = pidalab.simulate_sampled(design.loop(), t, setpoint=1.0)
    np.testing.assert_allclose(run.y, expected.y, atol=1e-9)
    left = design.discretise(h, "zoh", prefilter=None, limits=(-math.inf, math.inf))
    assert left.prefilter is None
    assert "prefilter" not in repr(left)


def test_prefilter_starts_at_rest_and_runs_in_manual_mode():
    k = PIDA(1.0, math.inf).discretise(0.5, prefilter=control.tf([1.0], [0.5, 1.0]))
    assert [k.step(r, 0.0) for r in (1.0, 2.0, 2.0)] == [1.0, 1.5, 1.75]
    k.reset()
    assert [k.step(r, 0.0, m) for r, m in ((1.0, None), (2.0, 9.0), (2.0, None))] == [1.0, 9.0, 1.75]
