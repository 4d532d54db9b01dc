"""A page and its ledger: what is refused, what fails, and what the messages name."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from demo_ledger import KP, NUMBERS, ROWS, S1, failures, hand_over, ledger

from paperledger import Ledger, LedgerError, Row

TABLE = [
    Row(f"demo.table1.{row}.{key}", "sec. 2, Table 1", key, "2.0", "2.000000000", "reproduced", page="demo")
    for row in ("a", "b")
    for key in ("kp", "ti")
]


class Design:
    kp = 2.0

    def ti(self):
        return 2.0


def test_a_table_knows_its_columns():
    book = Ledger(Path("demo.csv"), TABLE, words={"kp": "K_P", "a": "first"})
    frame = book.table("table1", {"a": Design(), "b": {"kp": 2.0, "ti": 2.0, "other": 1.0}})
    assert [*frame.index] == ["first", "b"]
    assert [*frame.columns] == ["K_P", "ti"]
    assert {*book.fresh} == {row.id for row in TABLE}


@pytest.mark.parametrize(
    ("records", "wrong"),
    [({"c": Design()}, "table1.c"), ({"a": {"kp": 2.0}}, "'ti'"), ({"a": Fraction(2)}, "'kp'")],
)
def test_a_table_with_a_row_or_column_that_is_not_there(records, wrong):
    with pytest.raises(LedgerError, match=wrong):
        Ledger(Path("demo.csv"), TABLE).table("table1", records)


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
    assert capsys.readouterr().out == line + "1 disagree with other print\n"


def test_a_page_owes_its_own_rows(project, capsys):
    Ledger.open("demo").close()  # the chapter owes nothing
    assert failures(Ledger.open("demo", "audit/demo").close)[0] == "demo.t1.kp: never handed over"


def test_open_searches_upward(project, monkeypatch):
    monkeypatch.chdir(project / "book" / "ledger")
    assert list(Ledger.open("demo").rows.values()) == ROWS
    assert Ledger.open("demo", folder=project / "book" / "ledger").paper == "demo"


def test_open_names_what_there_is(project, tmp_path_factory, monkeypatch):
    for name in ("manifest.csv", "removed.csv"):
        (project / "book" / "ledger" / name).write_text("", encoding="utf-8")
    with pytest.raises(LedgerError, match=r"no ledger dmeo\.csv .* there are: demo$"):
        Ledger.open("dmeo")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(LedgerError, match="no folder book/ledger"):
        Ledger.open("demo")


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
    "value", [None, "1.31", float("nan"), 1.31 + 0j, np.ones(1), [1.31], True, float("inf")]
)
def test_refused_values(value):
    (failure,) = failures(ledger().compare, {"t1.kp": value})
    assert failure.startswith("demo.t1.kp: expected a ")


def test_numbers_and_statements_do_not_mix():
    assert "a statement book.decide" in failures(ledger().compare, {"s1": 1.0})[0]
    assert "takes book.compare" in failures(ledger().decide, "t1.kp", (1.0, 2.0))[0]
    assert "its basis is reading" in failures(ledger().compare, {"t2.iae": 1.0})[0]
    assert "its basis is reading" in failures(ledger().decide, "s3", (1, 2))[0]
    assert "expected a pair (left, right), found 1.0" in failures(ledger().decide, "s1", 1.0)[0]


def test_drift_and_the_verdict_it_gives():
    assert failures(ledger().compare, {"t1.kp": 1.3098124}) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.309812400"
    ]
    assert failures(ledger().compare, {"t1.kp": 1.3151}) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.315100000",
        "demo.t1.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit",
    ]
    kept = "3.100000000 < 4.200000000 | ratio 0.74"
    assert failures(ledger().decide, "s1", (5.2, 4.2)) == [
        f"demo.s1: drifted from {kept} to 5.200000000 < 4.200000000 | ratio 1.2",
        "demo.s1: file says holds, 5.200000000 < 4.200000000 | ratio 1.2 gives fails",
    ]


def test_verdict_no_longer_follows():
    row = replace(KP, computed="1.315100000")
    wrong = "demo.t1.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit"
    assert failures(ledger(row).compare, {row.id: 1.3151}) == [wrong]
    assert row.problems() == [wrong]


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
        f"demo.x: declared {verdict} starts to agree, 1.310000000 against printed 1.31 gives reproduced",
    ]


def test_unknown_id_names_the_closest():
    (failure,) = failures(ledger().compare, {"t1.kq": 1.0})
    assert failure.startswith("demo.t1.kq: unknown id; the closest are demo.t1.kp, demo.t1.t")
    assert failures(ledger().row, "very.far.from.every.other.one") == [
        "demo.very.far.from.every.other.one: unknown id"
    ]


def test_nothing_stored_yet():
    row = replace(KP, computed="", verdict="")
    (failure,) = failures(ledger(row).compare, {row.id: 1.25})
    assert failure == "demo.t1.kp: nothing stored yet; `python -m paperledger update demo` stores it"


def test_fewer_digits_need_a_reason():
    row = replace(KP, computed="1.310", note="Fitted, so to four digits.")
    assert "why, with the word 'digits'" in failures(ledger().compare, {"t1.kp": 1.3098}, digits=4)[0]
    assert "why, with the word 'digits'" in failures(ledger().decide, "s1", (3.1, 4.2), digits=4)[0]
    ledger(row).compare({"t1.kp": 1.3098}, digits=4)


def test_what_is_swallowed_comes_back_at_the_end(project):
    book = Ledger.open("demo", page="audit/demo")
    for call in (lambda: book.compare({"t1.kp": 7.0}), lambda: book.decide("s1", (5.2, 4.2))):
        with pytest.raises(LedgerError):
            call()
    hand_over(book)
    assert [line.split(": ")[0] for line in failures(book.close)] == ["demo.t1.kp"] * 2 + ["demo.s1"] * 2
