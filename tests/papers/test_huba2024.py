"""Check the module of huba2024's pages: higher orders, portraits, measures and the dryer."""

import numpy as np
import pytest
from papers import huba2024 as setup

import pidalab
from pidalab.identification import ipdt_tangent
from pidalab.rules import automatic_reset as ar, mrdp


@pytest.mark.parametrize(
    ("m", "name", "real"), [(0, "PI", False), (1, "PID", False), (2, "PIDA_1", False), (2, "MRDP-PIDA", True)]
)
def test_low_orders_match_tune(m, name, real):
    """Compare loop, prefilter and reset with those of `automatic_reset.tune`, at the limits."""
    loop, design = setup.higher(m, 4, real=real), setup.DESIGNS[name]
    s = np.array([0.1j, 1j, 3 + 5j])
    np.testing.assert_allclose(loop.L(s), design.loop().L(s), rtol=1e-12)
    assert loop.automatic_reset.time == pytest.approx(design.ti, rel=1e-12)
    for step in setup.STEPS:
        run, expected = (setup.sampled(x, step, h=0.02) for x in (loop, design.loop()))
        np.testing.assert_allclose(run.y, expected.y, atol=1e-10)


@pytest.mark.parametrize("m", [3, 5])
def test_higher_orders_match_multiple_pole(m):
    """If the fastest zero is real, the loop without limits has the gains of mrdp."""
    total, numerator = 1.8, mrdp.constants(m).numerator
    gains = [c * total ** (j - 2) for j, c in enumerate(numerator[::-1])]
    parallel = pidalab.Loop(setup.plant(), pidalab.HighOrderPID(gains, 0.8 / 6, 6))
    s = np.array([0.1j, 1j, 3 + 5j])
    np.testing.assert_allclose(setup.higher(m, 6).L(s), parallel.L(s), rtol=1e-10)


def test_portrait_matches_simulated_runs():
    """Compare a setting of a portrait, and its excess in `worst`, with the response."""
    for step in setup.STEPS:
        r = setup.sampled(setup.DESIGNS["PIDA_2"].loop(), step, h=0.01)
        p = setup.portrait(setup.point(ar.PIDA_2), step, h=0.01)
        assert p.iae == pytest.approx(r.iae(), rel=1e-9)
        assert setup.worst(p, step) == pytest.approx(max(setup.excess(r, step)), rel=1e-9)
    assert setup.setting_at(setup.point(ar.PIDA_2))[3:] == pytest.approx(ar.PIDA_2[3:])


def test_excess_is_zero_for_ideal_shapes():
    for step in setup.STEPS:
        r = setup.sampled(setup.DESIGNS["PID"].loop(), step, h=0.01)
        assert setup.excess(r, step) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert setup.beyond(r, step) == 0.0


def test_dryer_gives_printed_model():
    """With the inferred filter the tangent gives the printed model. Other sensors give other filters."""
    t, filter_times = np.linspace(0, 1500, 15001), []
    for sensor in (10.0, 20.0):
        process, filter_time = setup.dryer(8.31e-4, 74.5, sensor=sensor)
        den = np.convolve(process.den, pidalab.lags(4, filter_time).den)
        y = pidalab.open_loop_step(pidalab.Process(process.num, den, process.delay), t).y
        model = ipdt_tangent(t, y)
        assert (model.num[0], model.delay) == pytest.approx((8.31e-4, 74.5), rel=1e-4)
        filter_times.append(filter_time)
    assert filter_times[1] < filter_times[0] < 19.0
    record = setup.dryer_record(process, seed=1)[1]
    assert record[0] == 0.0
    np.testing.assert_allclose(record, 0.1 * np.rint(record / 0.1), atol=1e-9)
