"""What tables and bars show."""

from dataclasses import replace

import pytest
from demo_ledger import KP, S1, ledger

from pidalab.ledger import VERDICTS, LedgerError


def test_table_has_the_rows_of_the_prefix():
    table = ledger().table("demo.t1.")
    lines = repr(table).splitlines()
    assert lines[0].split("  ")[0] == "claim"
    assert lines[1].split() == ["demo.t1.kp:", "gain", "(Table", "1)", "1.31", "1.3098", "+0.0", "reproduced"]
    assert lines[2].split()[-3:] == ["2.8680", "-1.2", "last-digit"]
    assert len(lines) == 6
    assert '<td class="number">1.3098</td>' in table._repr_html_()
    assert '<span class="verdict-last-digit">last-digit</span>' in table._repr_html_()
    with pytest.raises(LedgerError, match=r"no id starts with demo\.t9"):
        ledger().table("demo.t9")


def test_html_is_escaped():
    row = replace(S1, where="<i>", quantity='a "b"', printed="A < B & C", note="<script>")
    html = ledger(row).table()._repr_html_()
    assert "A &lt; B &amp; C" in html
    assert "&lt;script&gt;" in html
    assert "&lt;i&gt;" in html
    assert "quot" in ledger(replace(row, printed='a "b"')).table().html


def test_html_is_the_same_every_time():
    assert ledger().table().html == ledger().table().html
    assert ledger().scorebar().html == ledger().scorebar().html
    assert "id=" not in ledger().table().html + ledger().scorebar().html


def test_scorebar():
    bar = ledger().scorebar()
    assert bar.html.startswith('<div class="scorebar" role="img"')
    assert 'role="img" aria-label="demo: 10 claims, 1 reproduced, ' in bar.html
    assert bar.html.count('style="width:10.00%"') == 8
    assert '<li class="verdict-misprint">misprint 1</li>' in bar.html
    assert repr(bar).startswith("demo: 10 claims, ")


def test_score_counts_rows_without_a_verdict_as_open():
    score = ledger(KP, replace(KP, id="demo.new", computed="", verdict="")).score()
    assert list(score) == [*VERDICTS, "open"]
    assert (score["reproduced"], score["misprint"], score["open"]) == (1, 0, 1)
    assert "verdict-open" in ledger(replace(KP, computed="", verdict="")).table().html


def test_table_of_an_unreadable_row_names_it():
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: '12 %'"):
        ledger(replace(KP, printed="12 %")).table()
