"""Measure the loop of a design: rows of measures, rows without measures and their reason, and tables."""

import math

import numpy as np
import pytest

import pidalab
from pidalab.comparison.judging import DesignRow, html_table, measure_row, text_table
from pidalab.rules import Design

LAGS = pidalab.lags(3, delay=1.0)
DESIGN = Design(LAGS, pidalab.PIDA(1.0, 3.0, 0.8, n=5.0))
NUMBERS = ("iae_load", "iae_setpoint", "ms", "mks", "noise_gain", "tv", "delay_margin", "peak", "overshoot")


@pytest.fixture(scope="module")
def row():
    return measure_row("mine", "PID", lambda: DESIGN, LAGS, sample_time=0.1, horizon=3.0)


def test_a_row_has_the_measures_of_its_loop(row):
    """Compare with long responses on a fine grid."""
    loop, t = DESIGN.loop(LAGS), np.linspace(0.0, 200.0, 40001)
    load, setpoint, margins = (
        pidalab.load_response(loop, t),
        pidalab.step_response(loop, t),
        pidalab.margins(loop),
    )
    assert row.iae_load == row.iae == pytest.approx(load.iae(), rel=1e-4)
    assert row.iae_setpoint == pytest.approx(setpoint.iae(), rel=1e-4)
    assert (row.ms, row.delay_margin) == pytest.approx((margins.ms, margins.dm))
    w = np.geomspace(0.01, 1e5, 20001)
    assert row.mks == pytest.approx(np.max(np.abs(loop.transfer("u", "n", 1j * w))), rel=1e-5)
    assert row.tv == pytest.approx(load.tv("u"), rel=1e-3)
    assert row.peak == pytest.approx(np.max(np.abs(load.y)), rel=1e-4)
    assert row.overshoot == pytest.approx(100 * (np.max(setpoint.y) - 1), abs=0.01)
    assert row.noise_gain == pytest.approx(pidalab.noise_gain(loop, 0.1), rel=1e-6)
    assert (row.rule, row.kind, row.design, row.reason, row.applies) == ("mine", "PID", DESIGN, "", True)
    for response, name in ((row.load, "d"), (row.setpoint, "r")):
        assert getattr(response, name)[-1] == 1.0
        assert abs(response.e[-1]) < 0.01
    assert all(math.isnan(getattr(row, name)) for name in ("iae_worst", "ms_worst", "price", "ms_sampled"))


def test_a_negative_plant_has_the_measures_of_its_mirror():
    mirror = pidalab.Process(-LAGS.num, LAGS.den, LAGS.delay)
    design = Design(mirror, pidalab.PIDA(-1.0, 3.0, 0.8, n=5.0))
    falling = measure_row("mine", "PID", lambda: design, mirror, sample_time=0.1, horizon=3.0)
    rising = measure_row("mine", "PID", lambda: DESIGN, LAGS, sample_time=0.1, horizon=3.0)
    for name in NUMBERS:
        assert getattr(falling, name) == pytest.approx(getattr(rising, name), rel=1e-6), name


def test_without_a_sample_time_the_noise_is_left_out():
    row = measure_row("mine", "PID", lambda: DESIGN, LAGS, sample_time=None, horizon=3.0)
    assert math.isnan(row.noise_gain)
    assert (row.applies, row.reason) == (True, "")


def refuse():
    raise ValueError("the rule\nasks for\n  more lags")


def test_a_refusal_and_an_unstable_loop_are_rows_without_measures():
    none = measure_row("mine", "PI", refuse, LAGS, sample_time=0.1, horizon=3.0)
    assert none == DesignRow("mine", "PI", reason="the rule asks for more lags") or math.isnan(none.ms)
    assert (none.reason, none.design, none.applies) == ("the rule asks for more lags", None, False)
    fast = Design(LAGS, pidalab.PIDA(9.0, 3.0))
    unstable = measure_row("mine", "PI", lambda: fast, LAGS, sample_time=0.1, horizon=3.0)
    assert (unstable.applies, unstable.design) == (False, fast)
    assert "unstable" in unstable.reason
    assert all(math.isnan(getattr(unstable, name)) for name in NUMBERS)


def test_an_unexpected_exception_is_raised():
    with pytest.raises(AttributeError):
        measure_row("mine", "PI", lambda: None, LAGS, sample_time=0.1, horizon=3.0)


ROWS = (
    DesignRow("first", "PI", iae_load=4.0, ms=1.23456),
    DesignRow("second", "PIDA", reason="no <such> rule"),
    DesignRow("third", "PID", iae_load=math.nan, ms=2.0, reason="why"),
)


def test_text_of_a_table():
    lines = text_table(
        ROWS, {"rule": 8, "kind": 5}, {"IAE": "iae_load", "Ms": "ms"}, 7, lambda row: row.reason
    )
    assert lines == [
        "rule    kind     IAE     Ms",
        "first   PI         4  1.235",
        "second  PIDA   no <such> rule",
        "third   PID        -      2  why",
    ]
    assert text_table(ROWS[:1], {"kind": 5}, {"Ms": "ms"}, 7) == ["          Ms", "PI     1.235"]


def test_html_of_a_table():
    html = html_table(ROWS, ("rule", "kind"), {"IAE": "iae_load", "Ms": "ms"}, lambda row: row.reason)
    heads = "".join(f"<th scope='col'>{name}</th>" for name in ("rule", "kind", "IAE", "Ms", "note"))
    assert f"<thead><tr>{heads}</tr></thead>" in html
    assert "<td>first</td><td>PI</td><td>4</td><td>1.235</td><td></td>" in html
    assert "<td>second</td><td>PIDA</td><td colspan='3'>no &lt;such&gt; rule</td>" in html
    assert "<td>third</td><td>PID</td><td>-</td><td>2</td><td>why</td>" in html
    plain = html_table(ROWS[:2], ("kind",), {"IAE": "iae_load", "Ms": "ms"})
    assert "note" not in plain
    assert "colspan='2'" in plain
