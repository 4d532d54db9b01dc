"""Check how a page uses its ledger: errors, drift, and displays."""

import json
from dataclasses import replace

import numpy as np
import pytest
from demo_ledger import KP, NUMBERS, ROWS, S1, failures, hand_over, ledger

from paperledger import Ledger, LedgerError, Row
from paperledger.display import KINDS, markup, score

TABLE = [
    Row(f"demo.table1.{key}", "sec. 2, Table 1", key, "2.0", "2.000000000", "reproduced", page="demo")
    for key in ("a.kp", "a.ti", "b.kp", "b.ti")
]


def test_the_index_links_each_printed_item_to_its_heading(tmp_path):
    (tmp_path / "ledger").mkdir()
    cell = {"cell_type": "markdown", "source": ["## Table 12\n", "### Table 1, the gains\n"]}
    (tmp_path / "demo.ipynb").write_text(json.dumps({"cells": [cell]}), encoding="utf-8")
    said = Row("demo.st", "sec. 3", "statement", "faster", "fails", "fails", page="audit/demo")
    index = Ledger(tmp_path / "ledger" / "demo.csv", [said, *TABLE]).index()
    assert [line.split("  ")[0] for line in index.text.splitlines()[1:]] == ["sec. 2, Table 1", "statements"]
    assert '<a href="#table-1-the-gains">Table 1, the gains</a></td><td class="text">all 4' in index.html
    assert '<a href="audit/demo.html">its evidence</a></td><td class="text">fails' in index.html


def test_a_whole_page(project, capsys):
    book = Ledger.open("demo", page="audit/demo")
    hand_over(book)
    book.close()
    line = "audit/demo: 8 claims, 1 reproduced, 1 last-digit, 1 approximate, 1 holds, 1 fails, 1 misprint, 1 differs, "
    assert capsys.readouterr().out == line + "1 disagree with another printed value\n"


def test_a_page_must_pass_only_its_own_rows(project, capsys):
    Ledger.open("demo").close()  # the chapter has no rows
    assert failures(Ledger.open("demo", "audit/demo").close)[0] == "demo.t1.kp: never handed over"


def test_open_searches_upward(project, monkeypatch):
    monkeypatch.chdir(project / "book" / "ledger")
    assert list(Ledger.open("demo").rows.values()) == ROWS
    assert Ledger.open("demo", folder=project / "book" / "ledger").paper == "demo"


def test_open_lists_the_existing_ledgers(project, tmp_path_factory, monkeypatch):
    for name in ("manifest.csv", "removed.csv"):
        (project / "book" / "ledger" / name).write_text("", encoding="utf-8")
    assert "there are: demo" in failures(Ledger.open, "dmeo")[0]
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert "no folder book/ledger" in failures(Ledger.open, "demo")[0]


def test_numbers_nested_by_the_parts_of_their_ids():
    table = ledger().compare(
        {"t1": {"kp": 1.309812345, "ti": 2.868, "ta": 0.12, "td": 0.51}, "t2": {"ms": 1.9}}
    )
    assert table.columns.name == "printed / computed"
    assert table.loc["t1"].to_dict() == {
        "kp": "1.31 / 1.3098",
        "ti": "2.88 / 2.8680\N{NO-BREAK SPACE}°",
        "ta": "12 / 0.120\N{NO-BREAK SPACE}*",
        "td": "0.50 / 0.5100\N{NO-BREAK SPACE}~",
        "ms": "",
    }
    assert table.loc["t2", "ms"] == "1.40 / 1.9000\N{NO-BREAK SPACE}†"
    same = ledger().compare({id.removeprefix("demo."): value for id, value in NUMBERS.items()})
    assert set(same.columns) == {"kp", "ti", "td", "ta", "tf", "ms"}


@pytest.mark.parametrize(
    ("call", "id", "value", "message"),
    [
        *(
            ("compare", "t1.kp", value, "demo.t1.kp: expected a ")
            for value in (None, "1.31", True, [1.31], np.ones(1))
        ),
        *(
            ("compare", "t1.kp", value, "demo.t1.kp: expected a ")
            for value in (float("nan"), float("inf"), 1.31j)
        ),
        ("compare", "t1.kq", 1.0, "demo.t1.kq: unknown id; the closest are demo.t1.kp, demo.t1.t"),
        ("compare", "very.far.from.every.one", 1.0, "demo.very.far.from.every.one: unknown id"),
        (
            "compare",
            "s1",
            1.0,
            "demo.s1: use book.compare for a printed number, book.decide for a statement",
        ),
        (
            "decide",
            "t1.kp",
            (1.0, 2.0),
            "demo.t1.kp: use book.compare for a printed number, book.decide for a statement",
        ),
        ("compare", "t2.iae", 1.0, "demo.t2.iae: its basis is 'reading'"),
        ("decide", "s3", (1, 2), "demo.s3: its basis is 'reading'"),
        ("decide", "s1", 1.0, "demo.s1: expected a pair (left, right), found 1.0"),
        (
            "compare",
            "new",
            1.25,
            "demo.new: no value is stored yet; `python -m paperledger update demo` stores it",
        ),
    ],
)
def test_messages(call, id, value, message):
    book = ledger(*ROWS, replace(KP, id="demo.new", computed="", verdict=""))
    arguments = ({id: value},) if call == "compare" else (id, value)
    (failure,) = failures(getattr(book, call), *arguments)
    assert failure.startswith(message)


def test_drift_and_the_verdict_it_gives():
    assert failures(ledger().compare, {"t1.kp": 1.3098124}) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.309812400"
    ]
    assert failures(ledger().compare, {"t1.kp": 1.3151}) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.315100000",
        "demo.t1.kp: the file has the verdict reproduced, but 1.315100000 against printed 1.31 gives last-digit",
    ]
    kept = "3.100000000 < 4.200000000 | ratio 0.74"
    assert failures(ledger().decide, "s1", (5.2, 4.2)) == [
        f"demo.s1: drifted from {kept} to 5.200000000 < 4.200000000 | ratio 1.2",
        "demo.s1: the file has the verdict holds, but 5.200000000 < 4.200000000 | ratio 1.2 gives fails",
    ]


def test_noise_on_a_tie_does_not_flip_the_verdict():
    row = replace(KP, computed="1.315000000")
    for value in (np.nextafter(1.315, 2), 1.3150000009):
        assert ledger(row).compare({row.id: value}).iloc[0, 0] == "1.31 / 1.3150"
    tie = replace(S1, relation="A <= B", evidence="2.000000000 <= 2.000000000 | ratio 1.0")
    assert ledger(tie).decide("s1", (np.nextafter(2.0, 3), 2.0)) == "holds: 2.000 ≤ 2.000 (ratio 1.0)"


@pytest.mark.parametrize("verdict", ["misprint", "as-read", "differs"])
def test_declared_disagreement_starts_to_agree(verdict):
    row = Row(
        "demo.x", "Table 1", "x", "1.31", "1.400000000", verdict, page="demo", note="a reason of five words"
    )
    ledger(row).compare({"x": 1.4})
    assert failures(ledger(row).compare, {"x": 1.31}) == [
        "demo.x: drifted from 1.400000000 to 1.310000000",
        f"demo.x: {verdict} is declared, but 1.310000000 against printed 1.31 gives reproduced",
    ]


def test_fewer_digits_need_a_reason():
    row = replace(KP, computed="1.310", note="Fitted, so to four digits.")
    for call in (
        lambda book: book.compare({"t1.kp": 1.3098}, 4),
        lambda book: book.decide("s1", (3.1, 4.2), 4),
    ):
        assert "with the word 'digits'" in failures(call, ledger())[0]
    ledger(row).compare({"t1.kp": 1.3098}, digits=4)


def test_suppressed_errors_are_raised_again_by_close(project):
    book = Ledger.open("demo", page="audit/demo")
    for call in (lambda: book.compare({"t1.kp": 7.0}), lambda: book.decide("s1", (5.2, 4.2))):
        with pytest.raises(LedgerError):
            call()
    hand_over(book)
    assert [line.split(": ")[0] for line in failures(book.close)] == ["demo.t1.kp"] * 2 + ["demo.s1"] * 2


# --- displays of a page -----------------------------------------------------------------------------------------------


def test_table_has_the_rows_of_the_prefix():
    table = ledger().claims("t1.")
    lines = repr(table).splitlines()
    assert lines[0].split() == ["verdict", "claim", "printed", "computed", "difference"]
    assert lines[1].split() == ["reproduced", "demo.t1.kp:", "gain", "(Table", "1)", "1.31", "1.3098", "+0.0"]
    assert lines[2].split()[-3:] == ["2.88", "2.8680", "-1.2"]
    assert len(lines) == 6
    assert '<td class="number" data-label="computed">1.3098</td>' in table._repr_html_()
    assert '<span class="verdict-last-digit">last-digit</span>' in table._repr_html_()
    assert repr(ledger().claims("demo.t1.")) == repr(table)
    assert failures(ledger().claims, "t9") == ["demo: no id starts with t9"]


def test_table_of_statements_shows_what_decides():
    table = ledger(*ROWS[7:]).claims()
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
    html = ledger(row).claims()._repr_html_()
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
    assert list(counts) == [*KINDS]
    assert (counts["reproduced"], counts["misprint"], counts["open"]) == (1, 0, 1)
    assert "verdict-open" in ledger(replace(KP, computed="", verdict="")).claims().html


def test_a_fitted_row_is_counted_apart_and_says_what_was_fitted():
    fitted = replace(KP, basis="fitted", made="fit: 2 settings from 12 numbers: T_F and K, from Table 1")
    assert score([fitted, replace(fitted, verdict="differs")])["fitted-agrees"] == 1
    table = ledger(fitted).claims()
    assert "reproduced (settings fitted)" in repr(table)
    assert "To 12 numbers we fitted 2 settings" in table.html
