"""Tune controllers, and check limits, doubts and refusals."""

import numpy as np
import pytest

import pidalab
from pidalab import Record, lags, tune
from pidalab.plant.fitting import fit
from pidalab.plant.tuning import perturbed_plants

THIRD = lags(3, delay=1.0)


def test_optimum_keeps_its_limits_and_notes_the_default():
    design = tune(THIRD, "PID", ms=1.5)
    margins = pidalab.margins(design.loop())
    assert margins.ms == pytest.approx(design.ms, rel=1e-6)
    assert design.ms <= 1.5 * (1 + 1e-6)
    assert design.mks <= 10.0 * (1 + 1e-6)
    assert "at most 10 at any frequency" in design.info["notes"][0]
    assert design.iae == pytest.approx(
        pidalab.load_response(design.loop(), np.linspace(0, 100, 20001)).iae(), rel=1e-4
    )


def test_sample_time_and_filter_are_part_of_the_design():
    plain, slow = tune(THIRD, "PI"), tune(THIRD, "PI", sample_time=1.0)
    assert slow.controller.gains().ki < plain.controller.gains().ki
    filtered = tune(THIRD, "PI", output_filter=pidalab.lags(1, 1.0).rational_part())
    assert pidalab.margins(filtered.loop()).ms == pytest.approx(filtered.ms, rel=1e-6)
    assert filtered.ms <= 1.6 * (1 + 1e-6)


def test_safe_design_has_a_price():
    bold, design = (tune(THIRD, "PID", spread=0.2, ms_worst=most) for most in (3.0, 2.0))
    assert bold.price == 1.0
    assert bold.ms == pytest.approx(1.6, rel=1e-6)
    assert bold.ms_worst > 2.1
    worst = max(pidalab.margins(design.loop(plant)).ms for plant in perturbed_plants(THIRD, 0.2))
    assert worst == pytest.approx(2.0, rel=1e-6)
    assert design.ms_worst == pytest.approx(worst, rel=1e-6)
    assert 1.01 < design.price == pytest.approx(design.iae / bold.iae, rel=1e-6)


@pytest.mark.parametrize(("kind", "sample_time"), [("PI", 0.5), ("PID", 0.2)])
def test_sampled_loop_has_the_requested_ms(kind, sample_time):
    design = tune(THIRD, kind, sample_time=sample_time)
    loop = pidalab.Loop(THIRD, design.controller.discretise(sample_time, "backward"))
    assert 1.6 * 0.999 <= pidalab.margins(loop).ms <= 1.6 * (1 + 1e-6)
    assert design.ms_sampled == pytest.approx(pidalab.margins(loop).ms, rel=1e-9)


def test_fit_provides_uncertainty_and_noise():
    t = np.arange(0.0, 80.0, 0.5)
    y = 2.0 * 5.0 * (1 - np.exp(-np.maximum(t - 14.0, 0.0) / 8.0)) + np.random.default_rng(0).normal(
        0, 0.1, t.size
    )
    fitted = fit(Record(t, np.where(t < 10.0, 40.0, 45.0), y), "fopdt")
    design = tune(fitted, "PI")
    assert design.ms <= 1.6 * (1 + 1e-6)
    assert design.ms < design.ms_worst
    assert "the noise of the record then moves u by at most 1 %" in design.info["notes"][0]
    with pytest.raises(ValueError, match=r"too uncertain .*; a longer record, a larger step"):
        tune(fitted, "PI", spread=0.99)


RECORD = Record(np.arange(30.0), np.arange(30) >= 9.0, np.arange(30) >= 12.0)
UNSTABLE = pidalab.Process([1.0], [1.0, -1.0], 0.2)


@pytest.mark.parametrize(
    ("error", "message", "model", "options"),
    [
        (ValueError, "kind must be 'PI', 'PID' or 'PIDA'", THIRD, {"kind": "PIDD"}),
        (ValueError, "ms must be above 1", THIRD, {"ms": 0.9}),
        (ValueError, "kind must be 'PID' or 'PIDA'", THIRD, {"kind": "PI", "rule": "itae"}),
        (ValueError, "model must have a dead time", pidalab.ipdt(1.0, 0.0), {"rule": "mrdp"}),
        (ValueError, "noise_gain and sample_time must be given", pidalab.ipdt(1.0, 0.0), {"kind": "PI"}),
        (ValueError, "sample_time must be given with noise_gain", THIRD, {"noise_gain": 1.0}),
        (ValueError, "spread must be below 1", THIRD, {"spread": 1.0}),
        (ValueError, "sample_time must be above 0", THIRD, {"sample_time": 0.0}),
        (ValueError, "sample_time must be at most 4 for this process", THIRD, {"sample_time": 1e9}),
        (ValueError, "no stable controller of order 0", pidalab.Process([1], [1, 1, 0, 0]), {"kind": "PI"}),
        (ValueError, "too uncertain .* a smaller spread", UNSTABLE, {"kind": "PID", "spread": 0.5}),
        (TypeError, "model", 1.0, {}),
        (TypeError, r"found Record; use identification\.fit\(record\)", RECORD, {}),
    ],
)
def test_refusals(error, message, model, options):
    with pytest.raises(error, match=message):
        tune(model, **options)


@pytest.mark.parametrize(("kind", "order"), [("PI", 0), ("PID", 1), ("PIDA", 2)])
def test_filter_of_the_magnitude_optimum(kind, order):
    """The filter lags (number of derivatives + 1) add up to a tenth of the sum of lags (3) and dead time (1)."""
    found = pidalab.tune(pidalab.lags(3, delay=1.0), kind=kind, rule="magnitude optimum").controller
    assert found.filter_order == order + 1
    assert found.filter_order * found.filter_time == pytest.approx(0.1 * (3 + 1))


def test_pida_beyond_the_dynamics_of_the_model_is_refused():
    """The model has one lag, the plant three. A PID is designed, but a PIDA would act on unknown dynamics."""
    t = np.arange(0.0, 60.0, 0.1)
    y = pidalab.simulate(pidalab.Loop(lags(3), 0.0), t, load=t >= 5.0).y
    fitted = fit(Record(t, 1.0 * (t >= 5.0), y), "fopdt")
    assert fitted.incomplete
    assert tune(fitted, "PID").ms <= 1.6 * 1.001
    with pytest.raises(ValueError, match=r"the model has 1 pole\(s\)"):
        tune(fitted, "PIDA")


def first_order_fit(sampling=1.0, seed=0):
    """Return a lag of 20 with a dead time of 5, fitted to a record."""
    t = np.arange(0.0, 200.0, sampling)
    y = 2.0 * -np.expm1(-np.maximum(t - 25.0, 0.0) / 20.0)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, t.size)
    return pidalab.identification.fit(pidalab.Record(t, np.where(t < 20.0, 0.0, 1.0), y + noise), "fopdt")


@pytest.mark.filterwarnings("ignore:sample_time should be at most")
def test_too_long_sample_time_is_refused():
    fitted = first_order_fit()
    with pytest.raises(ValueError, match=r"sample_time must be at most 2[45]\.?\d* .*found 50"):
        tune(fitted, "PI", sample_time=50, rule="simc")
    assert tune(fitted, "PI", sample_time=20, rule="simc", ms_worst=9).info["ms_sampled"] > 1
    with pytest.raises(ValueError, match=r"at most 4 for this process.*63 %.*found 4\.1"):
        tune(THIRD, "PI", sample_time=4.1)
    with pytest.raises(ValueError, match=r"at most 20 for this process, 10 times.*found 21"):
        tune(pidalab.ipdt(1.0, delay=2.0), "PI", sample_time=21)


def test_sample_time_in_another_unit_is_doubted():
    said = "is it in the record's unit of time?"
    for share, doubted in ((0.005, True), (0.02, False), (1.0, False)):
        design = tune(first_order_fit(), "PI", sample_time=share, rule="simc", ms_worst=9)
        assert any(said in doubt for doubt in design.doubts) is doubted, share
