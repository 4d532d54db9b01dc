"""Running the pages of a paper, and storing what they hand over."""

from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import CELLS, KP, ROWS, S1, ledger, write_notebook

from pidalab.ledger import Ledger, LedgerError, load_all, read_rows, record, update, write_rows
from pidalab.ledger.running import opened, pages
from pidalab.ledger.verdicts import DECLARED

PATH = Path("book", "ledger", "demo.csv")
PAGE = Path("book", "audit", "demo.ipynb")


def test_record_leaves_agreeing_values_alone(project):
    before = PATH.read_bytes()
    assert record("demo", {KP.id: replace(KP, computed="1.309812346")}) == []
    assert record("demo", {S1.id: replace(S1, evidence="3.100000001 < 4.200000000 | ratio 0.74")}) == []
    assert PATH.read_bytes() == before


def test_record_leaves_the_judgement_of_a_disagreement_to_a_person(project):
    assert (
        record("demo", {KP.id: replace(KP, computed="7.000000000")})[1]
        == "demo.t1.kp: verdict 'reproduced' -> ''"
    )
    with pytest.raises(LedgerError, match="declare misprint, as-read or differs, with a note"):
        load_all()


def test_record_replaces_digits_that_hide_drift(project):
    zero = replace(KP, id="demo.zero", printed="0.00", computed="0.00")
    write_rows(PATH, [replace(KP, computed="1.31"), zero])
    record(
        "demo",
        {KP.id: replace(KP, computed="1.310100000"), zero.id: replace(zero, computed="0.001000000000")},
    )
    assert [row.computed for row in read_rows(PATH)] == ["1.310100000", "0.001000000000"]


def test_update(project):
    result = update("demo")
    assert result.changes == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
        "demo.s1: evidence '3.100000000 < 4.200000000 | ratio 0.74' -> "
        "'3.100000000 < 4.200000000 | worst of 1: one; ratio 0.74'",
    ]
    assert result.problems == []
    assert Ledger.open("demo").rows["demo.t1.kp"].verdict == "last-digit"
    assert update("demo").changes == []


def test_update_fills_an_empty_ledger(project):
    def blank(row):
        return replace(
            row, computed="", evidence="", page="", verdict=row.verdict if row.verdict in DECLARED else ""
        )

    write_rows(PATH, [row if row.basis == "reading" else blank(row) for row in ROWS])
    assert update("demo").problems == []
    assert (
        load_all()["demo"].score()
        == ledger(replace(KP, computed="1.315100000", verdict="last-digit"), *ROWS[1:]).score()
    )
    assert {row.page for row in read_rows(PATH) if row.basis != "reading"} == {"audit/demo"}


def test_the_first_page_that_closes_the_ledger_owes_a_row(project):
    cells = [
        "from pidalab.ledger import Ledger\nbook = Ledger.open('demo')",
        "book.compare({'t1.ti': 2.868})",
    ]
    write_notebook(project / "book" / "demo.ipynb", *cells)
    assert not any("page" in change for change in update("demo").changes)
    write_notebook(project / "book" / "demo.ipynb", *cells, "book.close()")
    assert update("demo").changes == ["demo.t1.ti: page 'audit/demo' -> 'demo'"]


def test_update_reports_what_is_left(project):
    write_rows(PATH, [*ROWS, replace(KP, id="demo.new", computed=""), replace(S1, id="demo.s9", evidence="")])
    assert update("demo").problems == [
        "demo.new: 'computed' is empty",
        "demo.s9: no evidence: a statement is a relation of two numbers",
        "demo.new: never handed over",
        "demo.s9: never handed over",
    ]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("book.compare({'t1.kq': 1.0})", r"demo\.t1\.kq: unknown id; the closest"),
        ("book.compare({'t1.kp': 9.0})", "handed over twice, as 1.315100000 and as 9.000000000"),
        ("book.decide('s1', (True, 3))", "expected a number"),
        ("1 / 0", "division by zero"),
    ],
)
def test_update_stores_nothing_when_a_cell_fails(project, line, message):
    before = PATH.read_bytes()
    write_notebook(PAGE, *CELLS[:-1], line, CELLS[-1])
    with pytest.raises((LedgerError, ZeroDivisionError), match=message):
        update("demo")
    assert PATH.read_bytes() == before


def test_pages_are_found_by_what_they_open(project):
    assert pages("demo") == {"audit/demo": PAGE.resolve()}
    assert opened(PAGE) == {"demo": "audit/demo"}
    with pytest.raises(LedgerError, match=r'no notebook has Ledger.open\("other"\)'):
        update("other")
    write_notebook(project / "book" / "second.ipynb", CELLS[0])
    with pytest.raises(LedgerError, match="both open demo as page 'audit/demo'"):
        pages("demo")


def test_an_id_that_was_removed_is_never_used_again(project):
    path = project / "book" / "ledger" / "removed.csv"
    path.write_text("id,reason\ndemo.t1.kp,one fact counted twice\n")
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: was removed, and an id is never used again"):
        load_all()
    path.write_text("id,reason\ndemo.gone,\n")
    with pytest.raises(LedgerError, match="expected an id and a reason in every line"):
        load_all()
