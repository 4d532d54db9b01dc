"""Three candidates side by side: measured as they are, limits kept, a page that needs no other file."""

import numpy as np
import pytest

import pidalab
from pidalab import Record, lags
from pidalab.plant.fitting import fit

THIRD = lags(3, delay=1.0)


@pytest.fixture(scope="module")
def both():
    return pidalab.report(THIRD, ms=1.5, kinds=("PI", "PID"), noise_gain=4.0, sample_time=0.2, spread=0.1)


def test_every_kind_keeps_the_limits_and_a_derivative_helps(both):
    assert [row.kind for row in both.rows] == ["PI", "PID"]
    for row in both.rows:
        assert 1.5 * 0.999 <= row.ms_sampled <= 1.5 * (1 + 1e-6) or row.ms_worst >= 2.0 * 0.999
        loop = row.design.loop(THIRD)
        assert pidalab.noise_gain(loop, 0.2) <= 4.0 * 1.001
        assert row.noise_gain == pytest.approx(pidalab.relative_noise_gain(loop))
        assert row.ms_sampled < row.ms_worst <= 2.0 * (1 + 1e-6)
    errors = [row.iae for row in both.rows]
    assert errors == sorted(errors, reverse=True)
    assert f"IAE {errors[1] / errors[0]:.2f} times" in both.verdict


def test_rows_are_what_the_loops_do(both):
    row = both.rows[1]
    loop, t = row.design.loop(THIRD), np.linspace(0.0, 100.0, 10001)
    load, found = pidalab.load_response(loop, t), pidalab.margins(loop)
    assert (row.iae, row.peak) == pytest.approx((load.iae(), np.max(np.abs(load.y))), rel=1e-3)
    assert (row.ms, row.delay_margin) == pytest.approx((found.ms, found.dm))
    assert row.overshoot == pytest.approx(pidalab.step_response(loop, t).overshoot(), abs=0.1)
    digital = pidalab.Loop(THIRD, row.design.controller.discretise(0.2))
    assert row.ms_sampled == pytest.approx(pidalab.margins(digital).ms)
    worst = max(pidalab.margins(pidalab.Loop(plant, digital.controller)).ms for plant in both.plants)
    assert row.ms_worst == pytest.approx(worst)


def test_text_table_and_page(both, tmp_path):
    page = both.html(tmp_path / "report.html", "A <plant>").read_text(encoding="utf-8")
    for text in (str(both), both._repr_html_(), page):
        assert all(kind in text for kind in ("PI", "PID"))
        assert "worst Ms" in text
    assert "A &lt;plant&gt;" in page
    assert page.count("<svg") == 1
    assert not any(word in page for word in ("<script", "src=", "@import", "url(http"))


def test_a_record_is_fitted_first_and_its_doubts_are_told():
    t = np.arange(0.0, 60.0, 0.5)
    y = np.interp(t - 10.0, t, pidalab.open_loop_step(lags(2, 3.0, delay=2.0), t).y, left=0.0)
    y[30] = np.nan
    record = Record(t, np.where(t < 10.0, 0.0, 1.0), y + np.random.default_rng(0).normal(0, 0.005, t.size))
    found = pidalab.report(record, kinds="PI", sample_time=0.5, rule="simc")
    assert found.process(0.1j) == pytest.approx(fit(record).process(0.1j))
    assert any("missing" in doubt for doubt in found.doubts)
    assert len(found.plants) == 20


def test_doubts_of_designs_are_told_once_where_they_are_alike_and_else_with_the_kind():
    found = pidalab.report(THIRD, kinds=("PI", "PID"), rule="simc", noise_gain=4.0, sample_time=0.5)
    assert found.doubts[0] == "the rule 'simc' does not know noise: noise_gain was not used"
    own = [doubt for row in found.rows for doubt in row.design.doubts if "faster than the sample" in doubt]
    assert len(own) == 1
    assert f"PID: {own[0]}" in found.doubts
    assert all(f"doubt: {doubt}" in str(found) for doubt in found.doubts)


def test_a_kind_that_the_rule_does_not_make_is_a_row_with_its_message():
    found = pidalab.report(THIRD, rule="simc")
    assert [row.applies for row in found.rows] == [True, True, False]
    assert "for the rule 'simc'" in found.rows[2].reason
    assert "for the rule 'simc'" in str(found)
    assert "for the rule &#x27;simc&#x27;" in found._repr_html_()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: pidalab.report(THIRD, kinds="PIDD"), ValueError, "kinds must be some of"),
        (lambda: pidalab.report(THIRD, kinds=()), ValueError, "kinds must be some of"),
        (lambda: pidalab.report(THIRD, ms=0.9), ValueError, "ms must be above 1"),
        (lambda: pidalab.report(THIRD, rule="best"), ValueError, "rule must be"),
        (lambda: pidalab.report(2.0), TypeError, "model"),
    ],
)
def test_refusals(call, error, message):
    with pytest.raises(error, match=message):
        call()
