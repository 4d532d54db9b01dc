"""Check reports: limits are kept, numbers and curves match the loops, and pages need no other file."""

import re

import numpy as np
import pytest

import pidalab
from pidalab import Record, lags
from pidalab._text import KINDS
from pidalab.comparison.judging import DesignRow
from pidalab.plant.fitting import fit
from pidalab.plant.reporting import REPORT_COLUMNS, Report
from pidalab.style import LOOKS, STYLE

THIRD = lags(3, delay=1.0)


@pytest.fixture(scope="module")
def both():
    return pidalab.report(THIRD, ms=1.5, kinds=("PI", "PID"), noise_gain=4.0, sample_time=0.2, spread=0.1)


@pytest.fixture(scope="module")
def found():
    options = {"rule": "simc", "sample_time": 0.2, "spread": 0.15, "ms_worst": 9.0}
    return pidalab.report(THIRD, ms=1.5, kinds=("PI", "PID"), **options)


def report_of(*rows):
    return Report(THIRD, None, 1.5, rows, ())


def test_every_kind_keeps_the_limits_and_a_derivative_helps(both):
    assert [row.kind for row in both.rows] == ["PI", "PID"]
    for row in both.rows:
        assert 1.5 * 0.999 <= row.ms_sampled <= 1.5 * (1 + 1e-6) or row.ms_worst >= 2.0 * 0.999
        loop = row.design.loop(THIRD)
        assert pidalab.noise_gain(loop, 0.2) <= 4.0 * 1.001
        assert row.relative_noise == pytest.approx(pidalab.relative_noise_gain(loop))
        assert row.ms_sampled < row.ms_worst <= 2.0 * (1 + 1e-6)
    assert both.rows[1].iae < both.rows[0].iae


def test_rows_are_measures_of_the_loops(both):
    row = both.rows[1]
    loop, t = row.design.loop(THIRD), np.linspace(0.0, 100.0, 10001)
    load, margins = pidalab.load_response(loop, t), pidalab.margins(loop)
    assert (row.iae, row.peak) == pytest.approx((load.iae(), np.max(np.abs(load.y))), rel=1e-3)
    assert (row.ms, row.delay_margin) == pytest.approx((margins.ms, margins.dm))
    assert row.overshoot == pytest.approx(pidalab.step_response(loop, t).overshoot(), abs=0.1)
    digital = pidalab.Loop(THIRD, row.design.controller.discretise(0.2))
    assert row.ms_sampled == pytest.approx(pidalab.margins(digital).ms)
    worst = max(pidalab.margins(pidalab.Loop(plant, digital.controller)).ms for plant in both.plants)
    assert row.ms_worst == pytest.approx(worst)


def test_text_table_and_page(both, tmp_path):
    page = both.html(tmp_path / "report.html", "A <plant>").read_text(encoding="utf-8")
    for text in (str(both), both._repr_html_(), page):
        assert all(word in text for word in ("PI", "PID", "worst Ms"))
    assert ("A &lt;plant&gt;" in page, page.count("<svg")) == (True, 1)
    assert not any(word in page for word in ("<script", "src=", "@import", "url(http"))


def test_record_is_fitted_and_its_doubts_come_first():
    t = np.arange(0.0, 60.0, 0.5)
    y = np.interp(t - 10.0, t, pidalab.open_loop_step(lags(2, 3.0, delay=2.0), t).y, left=0.0)
    y[30] = np.nan
    record = Record(t, np.where(t < 10.0, 0.0, 1.0), y + np.random.default_rng(0).normal(0, 0.005, t.size))
    report = pidalab.report(record, kinds="PI", sample_time=0.5, rule="simc")
    assert report.process(0.1j) == pytest.approx(fit(record).process(0.1j))
    assert len(report.plants) == 20
    known = (*record.doubts, *report.fit.doubts)
    assert any("missing" in doubt for doubt in known)
    assert report.doubts[: len(known)] == known
    heads = dict(report.sections()[1])
    assert heads["Record"] == str(record)
    assert heads["Model"] == f"{report.process!r}\n{report.fit}"


def test_doubts_name_the_kinds_that_they_concern(found):
    report = pidalab.report(THIRD, kinds=("PI", "PID"), rule="simc", noise_gain=4.0, sample_time=0.5)
    assert report.doubts[0] == "the rule 'simc' ignores noise: noise_gain was not used"
    (own,) = [doubt for row in report.rows for doubt in row.design.doubts if "a filter of" in doubt]
    assert f"PID: {own}" in report.doubts
    assert all(f"doubt: {doubt}" in str(report) for doubt in report.doubts)
    plain, missing = (
        found.rows,
        [row._replace(reason="no noise", relative_noise=np.nan) for row in found.rows],
    )
    assert "no noise" in report_of(*missing).doubts
    assert "PI: no noise" in report_of(missing[0], plain[1]).doubts


def test_kind_that_the_rule_does_not_make_has_its_message():
    report = pidalab.report(THIRD, rule="simc")
    assert [row.applies for row in report.rows] == [True, True, False]
    assert "for the rule 'simc'" in report.rows[2].reason
    assert "for the rule 'simc'" in str(report)
    assert "for the rule &#x27;simc&#x27;" in report._repr_html_()


@pytest.mark.parametrize(
    ("error", "argument", "model", "options"),
    [
        (ValueError, "kinds", THIRD, {"kinds": "PIDD"}),
        (ValueError, "kinds", THIRD, {"kinds": ()}),
        (ValueError, "ms", THIRD, {"ms": 0.9}),
        (ValueError, "rule", THIRD, {"rule": "best"}),
        (TypeError, "model", 2.0, {}),
    ],
)
def test_refusals(error, argument, model, options):
    with pytest.raises(error, match=argument):
        pidalab.report(model, **options)


@pytest.fixture(scope="module")
def panels(found):
    """Return the axes of load, set point, noise and Nyquist curves."""
    figure = found.plot()
    assert figure.get_size_inches()[0] == STYLE["figure.figsize"][0]
    return np.reshape(figure.axes, (3, 2))


def kind_of(line):
    return next(kind for kind in KINDS if LOOKS[kind]["color"] == line.get_color())


def last_large(loop, simulate):
    """Return the last time at which the error is above half a per cent of its largest value."""
    t = np.linspace(0.0, 100.0, 8001)
    error = np.abs(simulate(loop, t).e)
    return t[np.flatnonzero(error > 0.005 * error.max())[-1]]


def test_responses_are_drawn_until_all_are_at_rest(found, panels):
    for column, simulate in enumerate((pidalab.load_response, pidalab.step_response)):
        end = 1.05 * max(last_large(row.design.loop(THIRD), simulate) for row in found.rows)
        for place, name in enumerate(("y", "u")):
            for line, row in zip(panels[place, column].get_lines(), found.rows, strict=True):
                t, values = line.get_data()
                assert kind_of(line) == row.kind
                np.testing.assert_allclose(
                    values, getattr(simulate(row.design.loop(THIRD), t), name), atol=1e-9
                )
                assert (t[0], t.size >= 500) == (0.0, True)
                assert t[-1] == pytest.approx(end, rel=0.02)


def test_noise_curve_reaches_the_largest_gain(found, panels):
    ax = panels[2, 0]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    for line, row in zip(ax.get_lines(), found.rows, strict=True):
        w, gain = line.get_data()
        assert kind_of(line) == row.kind
        np.testing.assert_allclose(gain, np.abs(row.design.loop(THIRD).transfer("u", "n", 1j * w)))
        assert 0.9 * row.mks < gain.max() <= row.mks * 1.001
        peak = pidalab.max_sensitivity(row.design.loop(THIRD))[1]
        assert w[0] < peak / 10 < 10 * peak < w[-1]


def test_nyquist_curves_of_model_and_spread_with_the_circle(found, panels):
    ax = panels[2, 1]
    lines = ax.get_lines()
    curves, (circle, point) = lines[:-2], lines[-2:]
    assert len(curves) == 2 * (8 + 1)
    for row, own in zip(found.rows, (curves[:9], curves[9:]), strict=True):
        plants = [*found.plants, THIRD]
        for line, plant in zip(own, plants, strict=True):
            value = line.get_xdata() + 1j * line.get_ydata()
            assert kind_of(line) == row.kind
            # the least distance from -1 is 1/Ms
            ms = pidalab.max_sensitivity(row.design.loop(plant))[0]
            assert 1 / np.min(np.abs(1 + value)) == pytest.approx(ms, rel=2e-3)
            assert np.abs(value[0]) > 1 > np.abs(value[-1])
            assert (line.get_alpha() or 1.0) < 0.5 or plant is THIRD
    turned = 1 + circle.get_xdata() + 1j * circle.get_ydata()
    np.testing.assert_allclose(np.abs(turned), 1 / 1.5)
    assert (point.get_xdata(), point.get_ydata(), ax.get_aspect()) == ([-1], [0], 1.0)


def test_figure_names_several_kinds(found):
    (legend,) = found.plot().legends
    assert [text.get_text() for text in legend.get_texts()] == ["PI", "PID"]
    assert report_of(found.rows[0]).plot().legends == []
    with pytest.raises(ValueError, match="nothing to draw"):
        report_of(DesignRow("simc", "PI", reason="no")).plot()


def test_verdict_and_table_have_the_numbers_of_the_rows(found):
    old, new = found.rows
    numbers = [float(x) for x in re.findall(r"\d+\.\d+", found.verdict)]
    expected = [new.iae / old.iae, new.relative_noise / old.relative_noise, new.ms_worst, old.ms_worst]
    assert numbers == pytest.approx(expected, abs=0.0051)
    lines = str(found).splitlines()
    assert lines[0] == f"{THIRD!r}: Ms at most 1.5"
    assert lines[1].startswith(f"PI: safe, worst Ms {old.ms_worst:.2f} with 8 plants")
    table = {line[:20].strip(): line.split()[-2:] for line in lines}
    for name, x in REPORT_COLUMNS.items():
        values = [getattr(row, x) for row in found.rows]
        assert [float(value) for value in table[name]] == pytest.approx(values, rel=1e-3)
    unknown = report_of(*(row._replace(ms_worst=np.nan, price=np.nan) for row in found.rows))
    assert "worst Ms" not in str(unknown)
    assert unknown.verdict in str(unknown)
    assert repr(found) == "Report(PI, PID; Ms at most 1.5)"


def test_verdict_skips_kinds_without_a_design(found):
    refused = DesignRow("simc", "PID", reason="not for me")
    text = report_of(found.rows[0], refused, found.rows[1]._replace(kind="PIDA")).verdict
    assert re.findall(r"(\w+) against (\w+)", text) == [("PIDA", "PI")]
    assert report_of(found.rows[0]).verdict == ""


def test_page_begins_with_safety_and_gains(found):
    refused = DesignRow("simc", "PIDA", reason="not for me", design=None)
    known = Report(THIRD, None, 1.5, (*found.rows, refused), found.plants)
    first, last = known.sections()
    assert [head for head, _ in first] == ["Safe?", "PI", "PID", "Gains and costs of each kind", "Doubts"]
    assert [head for head, _ in last] == ["Model"]
    texts = dict(first)
    assert texts["Gains and costs of each kind"] == known.verdict
    assert texts["PID"] == str(found.rows[1].design.controller)
    assert "PIDA: no controller, since not for me" in texts["Safe?"]
    page = known.page("A plant")
    assert page.index("Safe?") < page.index("<svg") < page.index("<details>") < page.index("<table")
