"""Running the pages of a paper, and storing what they hand over."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import CELLS, KP, ROWS, S1, write_notebook

from paperledger import Ledger, LedgerError, load_all, read_rows, update, write_rows
from paperledger.digits import DECLARED
from paperledger.running import execute, pages

PATH = Path("book", "ledger", "demo.csv")
PAGE = Path("book", "audit", "demo.ipynb")


def test_what_cells_print_and_return(project):
    write_notebook(PAGE, "x = 2\nprint(x)\nx + 1", "%matplotlib inline\nx = 4", "x")
    assert list(execute(PAGE)) == ["2\n3", "", "4"]


def test_where_a_page_draws_is_no_matter_for_later(project, monkeypatch):
    write_notebook(PAGE, "import os\nos.environ['MPLBACKEND']")
    monkeypatch.setenv("MPLBACKEND", "svg")
    assert list(execute(PAGE)) == ["'Agg'"]
    assert os.environ["MPLBACKEND"] == "svg"


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
        declared = row.verdict if row.verdict in DECLARED else ""
        return (
            row
            if row.basis == "reading"
            else replace(row, computed="", evidence="", page="", verdict=declared)
        )

    write_rows(PATH, [blank(row) for row in ROWS])
    assert update("demo").problems == []
    fresh = read_rows(PATH)
    assert [row.verdict for row in fresh] == ["last-digit", *(row.verdict for row in ROWS[1:])]
    assert {row.page for row in fresh if row.basis != "reading"} == {"audit/demo"}


def test_update_leaves_agreeing_values_and_the_judgement_to_a_person(project):
    write_rows(PATH, [replace(KP, computed="1.315100001"), *ROWS[1:]])
    assert not any("computed" in change for change in update("demo").changes)
    write_notebook(PAGE, *[cell.replace("1.3151", "7") for cell in CELLS])
    assert "demo.t1.kp: verdict 'last-digit' -> ''" in update("demo").changes
    with pytest.raises(LedgerError, match="declare misprint, as-read or differs, with a note"):
        load_all()


def test_the_first_page_that_closes_the_ledger_owes_a_row(project):
    cells = [
        "from paperledger import Ledger\nbook = Ledger.open('demo')",
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
        "demo.s9: 'evidence' is empty",
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
        ("%%capture\nx = 1", "cell 5: a cell magic decides whether the cell runs"),
        ("try:\n    book.compare({'t1.kq': 1.0})\nexcept ValueError:\n    pass", r"demo\.t1\.kq: unknown id"),
    ],
)
def test_update_stores_nothing_when_a_cell_fails(project, line, message):
    before = PATH.read_bytes()
    write_notebook(PAGE, *CELLS[:-1], line, CELLS[-1])
    with pytest.raises((LedgerError, ZeroDivisionError), match=message):
        update("demo")
    assert PATH.read_bytes() == before


def test_pages_are_found_by_what_they_open(project):
    assert pages("demo", PATH.resolve().parent) == [PAGE.resolve()]
    with pytest.raises(LedgerError, match=r'no notebook has Ledger.open\("other"\)'):
        update("other")
    write_notebook(project / "book" / "second.ipynb", CELLS[0], CELLS[-1])
    with pytest.raises(LedgerError, match="second closes the ledger as page 'audit/demo'"):
        update("demo")


def test_an_id_that_was_removed_is_never_used_again(project):
    path = project / "book" / "ledger" / "removed.csv"
    path.write_text("id,reason\ndemo.t1.kp,one fact counted twice\n", encoding="utf-8")
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: was removed"):
        load_all()
