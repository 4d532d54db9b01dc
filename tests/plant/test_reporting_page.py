"""What a report shows: each curve, mark and number is that of the loops, and nothing that matters is out of view."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import pidalab
from pidalab import Record, lags
from pidalab._text import KINDS
from pidalab.comparison.judging import DesignRow
from pidalab.plant.fitting import fit
from pidalab.plant.noise_curves import TradeOff, TradeOffPoint
from pidalab.plant.page import RULE_MARKERS, _lasting, trade_off_figure
from pidalab.plant.reporting import REPORT_COLUMNS, Report
from pidalab.style import LOOKS, STYLE

THIRD = lags(3, delay=1.0)


@pytest.fixture(scope="module")
def found():
    return pidalab.report(
        THIRD, ms=1.5, kinds=("PI", "PID"), rule="simc", sample_time=0.2, spread=0.15, ms_worst=9.0
    )


@pytest.fixture(scope="module")
def panels(found):
    """The axes by their place: column of the load, column of the set point, noise and Nyquist curves below."""
    figure = found.plot()
    assert figure.get_size_inches()[0] == STYLE["figure.figsize"][0]  # as wide as all others: text as large
    return np.reshape(figure.axes, (3, 2))


def kind_of(line):
    return next(kind for kind in KINDS if LOOKS[kind]["color"] == line.get_color())


def last_large(loop, simulate, end):
    """When the error is last above half a per cent of its largest value, on a grid of one's own."""
    t = np.linspace(0.0, end, 8001)
    error = np.abs(simulate(loop, t).e)
    return t[np.flatnonzero(error > 0.005 * error.max())[-1]]


def test_the_responses_are_those_of_the_loops_until_all_are_at_rest(found, panels):
    for column, simulate in enumerate((pidalab.load_response, pidalab.step_response)):
        ends = [last_large(row.design.loop(THIRD), simulate, 100.0) for row in found.rows]
        for place, name in enumerate(("y", "u")):
            lines = panels[place, column].get_lines()
            assert [kind_of(line) for line in lines] == [row.kind for row in found.rows]
            for line, row in zip(lines, found.rows, strict=True):
                t, values = line.get_data()
                response = simulate(row.design.loop(THIRD), t)
                np.testing.assert_allclose(values, getattr(response, name), atol=1e-9)
                assert t[0] == 0.0
                assert len(t) >= 500  # smooth
                assert t[-1] == pytest.approx(1.05 * max(ends), rel=0.02)  # to rest, and no further


@pytest.mark.parametrize(
    ("e", "last"), [([0, 1, 0.5, 0.006, 0.004], 3.0), ([0, -1, 0, 0, 0], 1.0), ([1, 0, 0, 0, 0], 4.0)]
)
def test_a_response_lasts_until_its_error_stays_small_and_one_without_error_to_its_end(e, last):
    assert _lasting(SimpleNamespace(t=np.arange(5.0), e=np.array(e, dtype=float))) == last


def test_the_curve_of_noise_comes_near_the_largest_gain_of_the_table(found, panels):
    ax = panels[2, 0]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    peaks = [pidalab.max_sensitivity(row.design.loop(THIRD))[1] for row in found.rows]
    for line, row in zip(ax.get_lines(), found.rows, strict=True):
        w, gain = line.get_data()
        assert kind_of(line) == row.kind
        np.testing.assert_allclose(gain, np.abs(row.design.loop(THIRD).transfer("u", "n", 1j * w)))
        assert 0.9 * row.mks < gain.max() <= row.mks * 1.001
        assert w[0] < min(peaks) / 10  # a decade to either side of all resonances, and no deserts
        assert 10 * max(peaks) < w[-1] < 100 * max(peaks)
        assert np.all(np.diff(np.log(w)) > 0)


def test_the_nyquist_curves_are_those_of_the_model_and_fainter_of_the_spread(found, panels):
    lines = panels[2, 1].get_lines()
    of_kinds, (circle, point) = lines[:-2], lines[-2:]
    assert len(of_kinds) == 2 * (8 + 1)
    for row, own in zip(found.rows, (of_kinds[:9], of_kinds[9:]), strict=True):
        *faint, main = own
        assert all(kind_of(line) == row.kind for line in own)
        loops = [*(row.design.loop(plant) for plant in found.plants), row.design.loop(THIRD)]
        for line, loop in zip(own, loops, strict=True):
            value = line.get_xdata() + 1j * line.get_ydata()
            # 1/max|1 + L| is the least distance from -1, and the curve goes by there
            ms = pidalab.max_sensitivity(loop)[0]
            assert 1 / np.min(np.abs(1 + value)) == pytest.approx(ms, rel=2e-3)
            assert np.abs(value[0]) > 1 > np.abs(value[-1])
        for line in faint:
            assert 0 < line.get_alpha() < 0.5
            assert 0 < line.get_linewidth() < 0.5 * main.get_linewidth()
        assert main.get_alpha() is None
    round_ = circle.get_xdata() + 1j * circle.get_ydata()
    np.testing.assert_allclose(np.abs(1 + round_), 1 / 1.5)
    turned = np.unwrap(np.angle(1 + round_))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi)
    assert np.abs(np.diff(turned)).max() < 0.05
    assert (point.get_xdata(), point.get_ydata()) == ([-1], [0])


def test_the_circle_and_the_origin_are_in_view_and_fill_it(panels):
    ax = panels[2, 1]
    assert ax.get_aspect() == 1.0
    for (low, high), middle in ((ax.get_xlim(), -1.0), (ax.get_ylim(), 0.0)):
        for radius in (1 / 1.2, -1 / 1.2):  # of the most cautious Ms that anyone asks for
            assert low < middle + radius < high
        assert low < 0.0 < high
        assert 0.5 * (high - low) < 2 / 1.5  # half of it


def test_the_figure_names_the_kinds_where_there_are_several(found):
    (legend,) = found.plot().legends
    assert [text.get_text() for text in legend.get_texts()] == ["PI", "PID"]
    alone = Report(THIRD, None, 1.5, found.rows[:1], ())
    assert alone.plot().legends == []
    assert len(alone.plot().axes[5].get_lines()) == 3
    with pytest.raises(ValueError, match="nothing to draw"):
        Report(THIRD, None, 1.5, (DesignRow("simc", "PI", reason="no"),), ()).plot()


def traded():
    """Points and rules by hand: the limits of Ms are 1.4 and 2."""
    points = [
        TradeOffPoint(kind, ms, noise, base / noise / ms, None)
        for ms in (1.4, 2.0)
        for kind, base in (("PI", 9.0), ("PID", 5.0))
        for noise in (1.0, 2.0, 4.0)
    ]
    rules = [
        DesignRow("first", "PI", iae_load=7.0, ms=1.3, noise_gain=1.5),
        DesignRow(
            "first", "PID", iae_load=6.0, ms=1.401, noise_gain=2.5
        ),  # a thousandth above keeps the limit
        DesignRow("second", "PI", iae_load=5.0, ms=1.41, noise_gain=3.5),
        DesignRow("second", "PID", iae_load=4.0, ms=2.01, noise_gain=4.5),  # beyond both
        DesignRow("third", "PI", iae_load=3.0, ms=1.3),  # no noise gain
        DesignRow("third", "PID", reason="refused"),
    ]
    return TradeOff(THIRD, tuple(points), tuple(rules))


def test_the_trade_off_has_each_curve_and_each_rule_in_the_panel_of_the_least_limit_it_keeps():
    found = traded()
    figure = trade_off_figure(found)
    assert figure.get_size_inches()[0] == STYLE["figure.figsize"][0]
    marks = {}
    for ax, ms in zip(figure.axes, (1.4, 2.0), strict=True):
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert ax.get_title(loc="left").endswith(f"{ms:g}")
        curves = [line for line in ax.get_lines() if line.get_marker() == "None"]
        for line, kind in zip(curves, ("PI", "PID"), strict=True):
            assert kind_of(line) == line.get_label() == kind
            expected = [point for point in found.points if (point.kind, point.ms) == (kind, ms)]
            assert line.get_xdata().tolist() == [point.relative_noise_gain for point in expected]
            assert line.get_ydata().tolist() == [point.iae for point in expected]
        dots = [line for line in ax.get_lines() if line.get_marker() != "None"]
        assert all(line.get_markersize() > 2 * line.get_linewidth() for line in dots)
        assert all(line.get_linestyle() == "None" for line in dots)
        marks[ms] = [(kind_of(x), *x.get_xdata(), *x.get_ydata(), x.get_marker()) for x in dots]
    handles = dict(zip(*[[*one] for one in (["first", "second", "third"], marks_of(figure))], strict=True))
    assert marks[1.4] == [("PI", 1.5, 7.0, handles["first"]), ("PID", 2.5, 6.0, handles["first"])]
    assert marks[2.0] == [("PI", 3.5, 5.0, handles["second"])]
    assert len(set(handles.values())) == 3


def marks_of(figure):
    """Markers of the legend, that of curves left out."""
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["PI", "PID", "first", "second", "third"]
    return [line.get_marker() for line in legend.get_lines() if line.get_marker() != "None"]


def test_rules_have_marks_of_their_own_and_begin_again_when_those_are_out():
    rules = tuple(DesignRow(f"{k}", "PI", iae_load=2.0, ms=1.3, noise_gain=2.0) for k in range(9))
    figure = trade_off_figure(TradeOff(THIRD, traded().points, rules))
    found = [line.get_marker() for line in figure.legends[0].get_lines() if line.get_marker() != "None"]
    assert len(set(found)) == len(RULE_MARKERS)
    assert found == [*RULE_MARKERS, *RULE_MARKERS][:9]


def test_verdict_and_table_have_the_numbers_of_the_rows(found):
    (old, new), said = found.rows, [float(x) for x in re.findall(r"\d+\.\d+", found.verdict)]
    assert said == pytest.approx(
        [new.iae / old.iae, new.noise_gain / old.noise_gain, new.ms_worst, old.ms_worst], abs=0.0051
    )
    lines = str(found).splitlines()
    assert lines[0] == f"{THIRD!r}: Ms at most 1.5"
    assert lines[1].startswith(f"PI: safe, worst Ms {old.ms_worst:.2f} with 8 plants")
    for name, x in REPORT_COLUMNS.items():
        (line,) = (
            line for line in lines if line.startswith(f"{name} ") and not line.startswith(f"{name} sampled")
        )
        assert [float(value) for value in line.split()[-2:]] == pytest.approx(
            [getattr(row, x) for row in found.rows], rel=1e-3
        )
    unknown = Report(
        THIRD, None, 1.5, tuple(row._replace(ms_worst=np.nan, price=np.nan) for row in found.rows), ()
    )
    assert "worst Ms" not in str(unknown)
    assert unknown.verdict in str(unknown)
    assert repr(found) == "Report(PI, PID; Ms at most 1.5)"


def test_a_verdict_compares_each_kind_with_the_one_before_that_applies(found):
    able, refused = found.rows[0], DesignRow("simc", "PID", reason="not for me")
    last = found.rows[1]._replace(kind="PIDA")
    text = Report(THIRD, None, 1.5, (able, refused, last), ()).verdict
    assert re.findall(r"(\w+) against (\w+)", text) == [("PIDA", "PI")]
    assert Report(THIRD, None, 1.5, (able,), ()).verdict == ""


def test_a_page_begins_with_safety_and_gains(found):
    refused = DesignRow("simc", "PIDA", reason="not for me", design=None)
    known = Report(THIRD, None, 1.5, (*found.rows, refused), found.plants)
    first, last = known.sections()
    assert [head for head, _ in first] == ["Safe?", "PI", "PID", "What each kind buys", "Doubts"]
    assert [head for head, _ in last] == ["Model"]
    texts = dict(first)
    assert texts["What each kind buys"] == known.verdict
    assert texts["PID"] == str(found.rows[1].design.controller)
    assert "PIDA: no controller, since not for me" in texts["Safe?"]
    page = known.page()
    assert page.index("Safe?") < page.index("<svg") < page.index("<details>") < page.index("<table")


def test_the_doubts_of_record_and_fit_come_first_and_the_page_has_the_record():
    t = np.arange(0.0, 60.0, 0.5)
    y = np.interp(t - 10.0, t, pidalab.open_loop_step(lags(2, 3.0, delay=2.0), t).y, left=0.0)
    y[30] = np.nan
    record = Record(t, np.where(t < 10.0, 0.0, 1.0), y + np.random.default_rng(0).normal(0, 0.005, t.size))
    fitted = fit(record, "fopdt")
    row = DesignRow("simc", "PI", ms=1.5, reason="no noise")
    made = Report(fitted.process, fitted, 1.5, (row, row._replace(kind="PID")), ())
    assert made.doubts == (*record.doubts, *fitted.doubts)
    heads = dict(made.sections()[1])
    assert heads["Record"] == str(record)
    assert heads["Model"] == f"{fitted.process!r}\n{fitted}"


def test_a_reason_of_one_kind_is_told_with_it_and_of_all_kinds_once(found):
    plain, missing = found.rows, [row._replace(reason="no noise", noise_gain=np.nan) for row in found.rows]
    assert "no noise" in Report(THIRD, None, 1.5, tuple(missing), ()).doubts
    assert "PI: no noise" in Report(THIRD, None, 1.5, (missing[0], plain[1]), ()).doubts
