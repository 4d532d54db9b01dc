"""Tables and bars."""

from dataclasses import replace

import pytest
from demo_ledger import KP, ROWS, S1, ledger

from paperledger import LedgerError
from paperledger.display import KINDS, markup, score


def test_table_has_the_rows_of_the_prefix():
    table = ledger().table("t1.")
    lines = repr(table).splitlines()
    assert lines[0].split() == ["verdict", "claim", "printed", "computed", "difference"]
    assert lines[1].split() == ["reproduced", "demo.t1.kp:", "gain", "(Table", "1)", "1.31", "1.3098", "+0.0"]
    assert lines[2].split()[-3:] == ["2.88", "2.8680", "-1.2"]
    assert len(lines) == 6
    assert '<td class="number" data-label="computed">1.3098</td>' in table._repr_html_()
    assert '<span class="verdict-last-digit">last-digit</span>' in table._repr_html_()
    assert repr(ledger().table("demo.t1.")) == repr(table)
    with pytest.raises(LedgerError, match=r"no id starts with t9"):
        ledger().table("t9")


def test_table_of_statements_shows_what_decides():
    table = ledger(*ROWS[7:]).table()
    lines = repr(table).splitlines()
    assert lines[0].split() == ["verdict", "claim", "evidence"]
    assert lines[1].endswith("3.100 < 4.200; A < B; ratio 0.74")
    assert lines[2].endswith("2 ≠ 0; poles = none")
    assert (
        '<td class="evidence text">3.100 &lt; 4.200 <span class="where">A &lt; B; ratio 0.74</span></td>'
        in table.html
    )
    assert '<span class="basis">by reading</span>' in table.html


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("K_-1", "<i>K</i><sub>−1</sub>"),
        ("PID_2^2, IAE_d", "PID<sub>2</sub><sup>2</sup>, IAE<sub>d</sub>"),
        ("A_(2m+3) and T_{D,m−1}", "<i>A</i><sub>2m+3</sub> and <i>T</i><sub>D,m−1</sub>"),
        ("(1 + T s)^n e^(−Ls)", "(1 + T s)<sup>n</sup> <i>e</i><sup>−Ls</sup>"),
        ("nT_F, σ_rel², τ_1o", "n<i>T</i><sub>F</sub>, <i>σ</i><sub>rel²</sub>, <i>τ</i><sub>1o</sub>"),
        ("K < 3 & y", "K &lt; 3 &amp; y"),
        ("step_response, 10^4", "step_response, 10^4"),
    ],
)
def test_names_are_typeset(text, html):
    assert markup(text) == html


def test_html_is_escaped():
    row = replace(S1, where="<i>", printed="A < B & C", note="<script>")
    html = ledger(row).table()._repr_html_()
    assert "A &lt; B &amp; C" in html
    assert "&lt;script&gt;" in html
    assert "&lt;i&gt;" in html


def test_scorebar():
    bar = ledger().scorebar()
    assert bar.html.startswith('<div class="scorebar" role="img"')
    assert 'role="img" aria-label="demo: 10 claims, 1 reproduced, ' in bar.html
    assert bar.html.count('style="width:10.00%"') == 10
    assert '<li class="verdict-misprint">misprint 1</li>' in bar.html
    assert repr(bar).startswith("demo: 10 claims, ")


def test_score_counts_rows_without_a_verdict_as_open():
    counts = score([KP, replace(KP, id="demo.new", computed="", verdict="")])
    assert list(counts) == [*KINDS, "open"]
    assert (counts["reproduced"], counts["misprint"], counts["open"]) == (1, 0, 1)
    assert "verdict-open" in ledger(replace(KP, computed="", verdict="")).table().html


def test_a_fitted_row_is_counted_apart_and_says_what_was_fitted():
    fitted = replace(KP, basis="fitted", made="fit: 2 settings from 12 numbers: T_F and K, from Table 1")
    assert score([fitted, replace(fitted, verdict="differs")])["fitted-agrees"] == 1
    table = ledger(fitted).table()
    assert "reproduced (settings fitted)" in repr(table)
    assert "2 settings from 12 numbers" in table.html
