"""Nothing cheats in silence: what pages and ledgers must not do, and that each way is seen."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import KP, ROWS, S1, write_notebook
from honesty import cells, module, page

from paperledger import LedgerError, papers, read_rows, write_rows
from paperledger.pages import claims, freeze
from paperledger.running import pages

ROOT = Path(__file__).parents[2]
LEDGERS = ROOT / "book" / "ledger"
NOTEBOOKS = sorted((ROOT / "book").rglob("*.ipynb"))
HANDING = [path for path in NOTEBOOKS if any("book.close()" in source for source, _ in cells(path))]
BESIDE = sorted((ROOT / "book" / "papers").glob("*.py"))


def named(paths):
    return [pytest.param(path, id=str(path.relative_to(ROOT / "book"))) for path in paths]


# ------------------------------------------------------------------------------------------------ the book as it is


@pytest.mark.parametrize("path", named(HANDING))
def test_a_page_computes_what_it_hands_over(path):
    assert page(path) == []


@pytest.mark.parametrize("path", named(BESIDE))
def test_a_module_beside_a_page_too(path):
    assert module(path.read_text(encoding="utf-8")) == []


def test_no_output_is_masked():
    settings = [ROOT / "pyproject.toml", ROOT / "Makefile", *(ROOT / ".ci").iterdir()]
    assert [path for path in settings if "sanitize" in path.read_text(encoding="utf-8")] == []


@pytest.mark.parametrize("paper", papers(LEDGERS))
def test_chapter_and_audit_together_owe_all(paper):
    """Every row that is computed has a page, which opens this ledger, and closes it."""
    closing = [path.relative_to(ROOT / "book") for path in pages(paper, LEDGERS) if path in HANDING]
    closing = [path.with_suffix("").as_posix() for path in closing]
    rows = [row for row in read_rows(LEDGERS / f"{paper}.csv") if row.basis != "reading"]
    assert [
        f"{row.id}: no page {row.page!r} closes this ledger" for row in rows if row.page not in closing
    ] == []


@pytest.mark.parametrize("paper", papers(LEDGERS))
def test_what_fails_is_quoted(paper):
    """A statement is not said to fail without the words that were judged."""
    rows = [row for row in read_rows(LEDGERS / f"{paper}.csv") if row.verdict == "fails"]
    assert [row.id for row in rows if not re.search('[“"].+[”"]', row.printed + row.note)] == []


def test_the_claims_are_those_of_the_manifest():
    """`python -m paperledger manifest` freezes a reviewed change."""
    assert claims(LEDGERS).splitlines() == (LEDGERS / "manifest.csv").read_text(encoding="utf-8").splitlines()


# ------------------------------------------------------------------------------------------------ each cheat is seen

OPEN, CLOSE = 'book = Ledger.open("demo", page="audit/demo")', "book.close()"


@pytest.mark.parametrize(
    ("cell", "finding"),
    [
        ("kp = 1.31 if __debug__ else solve()", "asks where it runs by __debug__"),
        ("kp = solve() if sys.flags.optimize else 1.31", "asks where it runs by sys.flags"),
        ("kp = 1.31 if get_ipython() else solve()", "asks where it runs by get_ipython"),
        ('kp = 1.31 if "get_ipython" in globals() else solve()', "asks where it runs by get_ipython"),
        ("rows = csv.reader(open(book.path))", "asks where it runs by book.path"),
        ('book.decide("s", {n: (solve(n), 3) for n in ORDERS if solve(n) < 3})', "leaves cases"),
        ("kp = 1.31 if hasattr(tune, '__wrapped__') else solve()", "asks where it runs by __wrapped__"),
        ("# NBVAL_IGNORE_OUTPUT", "marker NBVAL_IGNORE_OUTPUT"),
        ("%%capture\nbook.compare({})", "a cell magic"),
        ("%%script true\nbook.compare({})", "a cell magic"),
        (OPEN, "opens not one ledger"),
    ],
)
def test_a_cheating_page_is_seen(tmp_path, cell, finding):
    found = page(write_notebook(tmp_path / "demo.ipynb", OPEN, cell, CLOSE))
    assert any(finding in line for line in found)


@pytest.mark.parametrize(
    "cell",
    [
        'book.compare({"kp": solve()})',
        'book.compare({"ti": book.printed("kp") / book.printed("ki")})',
        "book.compare({id: solve(order) for id, order in ORDERS.items()})",
        'book.compare({c: {"kp": K[c].kp} for c in cases})',
        'book.decide("s", (solve(), 10))',
        'book.decide("s", {n: (solve(n), 3) for n in ORDERS})',
        'book.decide("s", max(abs(solve() - 3.0), abs(solve(2))))',
    ],
)
def test_an_honest_page_passes(tmp_path, cell):
    assert page(write_notebook(tmp_path / "demo.ipynb", "%matplotlib inline", OPEN, cell, CLOSE)) == []


def test_tags_that_hide_and_a_missing_end_are_seen(tmp_path):
    path = write_notebook(tmp_path / "demo.ipynb", OPEN, CLOSE, tags=["raises-exception"])
    assert page(path) == ["tag raises-exception"] * 2
    assert page(write_notebook(path, OPEN, CLOSE, "print(1)")) == ["does not end with book.close()"]
    assert page(write_notebook(path, OPEN, CLOSE, tags=["hide-input"])) == []


@pytest.mark.parametrize(
    "changed",
    [
        replace(KP, printed="1.310"),
        replace(
            KP, quantity="statement", printed="a gain", relation="A < B", evidence="1 < 2", verdict="holds"
        ),
        replace(KP, basis="from-print"),
        replace(KP, basis="fitted", made="fit: 1 setting from 4 numbers: T_F, from Table 1"),
        replace(KP, made="page: gain"),
        replace(KP, page="demo"),
        replace(KP, note="noise: tolerance 5 %", verdict="approximate"),
        replace(KP, id="demo.t1.kp2"),
        replace(KP, verdict="misprint", computed="2.000000000", note="a reason of five words"),
    ],
)
def test_the_manifest_shows_what_was_changed(tmp_path, changed):
    write_rows(tmp_path / "demo.csv", ROWS)
    assert freeze(tmp_path) == ["10 new claims"]
    assert freeze(tmp_path) == []
    frozen = (tmp_path / "manifest.csv").read_text(encoding="utf-8")
    write_rows(tmp_path / "demo.csv", [changed, *ROWS[1:]])
    assert len({*claims(tmp_path).splitlines()} - {*frozen.splitlines()}) == 1
    if changed.id != KP.id:
        (tmp_path / "removed.csv").write_text(f"id,reason\n{KP.id},counted twice\n", encoding="utf-8")
    assert all(line.startswith("demo.t1.kp") for line in freeze(tmp_path))
    assert freeze(tmp_path) == []


def test_each_frozen_entry_that_changes_has_a_line(tmp_path):
    write_rows(tmp_path / "demo.csv", ROWS)
    freeze(tmp_path)
    turned = replace(S1, relation="A > B", evidence="4.200000000 > 3.100000000 | ratio 1.4")
    write_rows(tmp_path / "demo.csv", [row if row != S1 else turned for row in ROWS])
    assert freeze(tmp_path) == ["demo.s1: relation 'A < B' -> 'A > B'"]
    write_rows(tmp_path / "demo.csv", ROWS[::-1])
    assert freeze(tmp_path) == ["demo.s1: relation 'A > B' -> 'A < B'"]
    write_rows(tmp_path / "demo.csv", ROWS)
    assert freeze(tmp_path) == ["the order of the rows"]


def test_no_claim_goes_without_a_reason(tmp_path):
    write_rows(tmp_path / "demo.csv", ROWS)
    freeze(tmp_path)
    frozen = (tmp_path / "manifest.csv").read_text(encoding="utf-8")
    write_rows(tmp_path / "demo.csv", ROWS[1:])
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: is gone, and removed\.csv does not say why"):
        freeze(tmp_path)
    assert (tmp_path / "manifest.csv").read_text(encoding="utf-8") == frozen
    (tmp_path / "removed.csv").write_text("id,reason\ndemo.t1.kp, \n", encoding="utf-8")
    with pytest.raises(LedgerError, match=r"removed\.csv: no reason for demo\.t1\.kp"):
        freeze(tmp_path)
    (tmp_path / "removed.csv").write_text("id,reason\ndemo.t1.kp,one fact counted twice\n", encoding="utf-8")
    assert freeze(tmp_path) == ["demo.t1.kp: removed: one fact counted twice"]
