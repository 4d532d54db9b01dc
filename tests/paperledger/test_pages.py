"""Run the pages of a paper, and check the tables of all papers, the manifest and the commands."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import CELLS, KP, ROWS, S1, write_notebook

from paperledger import (
    Ledger,
    LedgerError,
    errata,
    every_row,
    load_all,
    read_rows,
    score_markdown,
    scoreboard,
    update,
    write_rows,
    write_score,
)
from paperledger.__main__ import main
from paperledger.pages import claims, freeze
from paperledger.running import execute, pages
from paperledger.verdicts import DECLARED

PATH = Path("book", "ledger", "demo.csv")
PAGE = Path("book", "audit", "demo.ipynb")


def test_output_and_results_of_cells(project):
    write_notebook(PAGE, "x = 2\nprint(x)\nx + 1", "%matplotlib inline\nx = 4", "x")
    assert list(execute(PAGE)) == ["2\n3", "", "4"]


def test_update(project):
    result = update("demo")
    assert result.changes == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
        "demo.s1: evidence '3.100000000 < 4.200000000 | ratio 0.74' -> "
        "'3.100000000 < 4.200000000 | worst of 1 case: one; ratio 0.74'",
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


def test_update_keeps_agreeing_values_and_declares_no_verdict(project):
    write_rows(PATH, [replace(KP, computed="1.315100001"), *ROWS[1:]])
    assert not any("computed" in change for change in update("demo").changes)
    write_notebook(PAGE, *[cell.replace("1.3151", "7") for cell in CELLS])
    assert "demo.t1.kp: verdict 'last-digit' -> ''" in update("demo").changes
    with pytest.raises(LedgerError, match="declare misprint, as-read or differs, with a note"):
        load_all()


def test_a_row_belongs_to_the_first_page_that_closes_the_ledger(project):
    cells = [
        "from paperledger import Ledger\nbook = Ledger.open('demo')",
        "book.compare({'t1.ti': 2.868})",
    ]
    write_notebook(project / "book" / "demo.ipynb", *cells)
    assert not any("page" in change for change in update("demo").changes)
    write_notebook(project / "book" / "demo.ipynb", *cells, "book.close()")
    assert update("demo").changes == ["demo.t1.ti: page 'audit/demo' -> 'demo'"]


def test_update_reports_unresolved_rows(project):
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
        ("%%capture\nx = 1", "invalid syntax"),
        ("try:\n    book.compare({'t1.kq': 1.0})\nexcept ValueError:\n    pass", r"demo\.t1\.kq: unknown id"),
    ],
)
def test_update_stores_nothing_when_a_cell_fails(project, line, message):
    before = PATH.read_bytes()
    write_notebook(PAGE, *CELLS[:-1], line, CELLS[-1])
    with pytest.raises((LedgerError, ZeroDivisionError, SyntaxError), match=message):
        update("demo")
    assert PATH.read_bytes() == before


def test_pages_are_found_by_what_they_open(project):
    assert pages("demo", PATH.resolve().parent) == [PAGE.resolve()]
    with pytest.raises(LedgerError, match="other"):
        update("other")


# --- all papers -------------------------------------------------------------------------------------------------------


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
    assert len(freeze(tmp_path)) == 11
    assert freeze(tmp_path) == []
    frozen = (tmp_path / "manifest.csv").read_text(encoding="utf-8")
    write_rows(tmp_path / "demo.csv", [changed, *ROWS[1:]])
    assert len({*claims(tmp_path).splitlines()} - {*frozen.splitlines()}) == 1
    if changed.id != KP.id:
        (tmp_path / "removed.csv").write_text(f"id,reason\n{KP.id},counted twice\n", encoding="utf-8")
    assert [line[:11] for line in freeze(tmp_path)] == ["-demo.t1.kp", "+demo.t1.kp"]
    assert freeze(tmp_path) == []


def test_removing_a_claim_needs_a_reason(tmp_path):
    write_rows(tmp_path / "demo.csv", ROWS)
    freeze(tmp_path)
    frozen = (tmp_path / "manifest.csv").read_text(encoding="utf-8")
    write_rows(tmp_path / "demo.csv", ROWS[1:])
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: row missing, and removed\.csv gives no reason"):
        freeze(tmp_path)
    assert (tmp_path / "manifest.csv").read_text(encoding="utf-8") == frozen
    (tmp_path / "removed.csv").write_text("id,reason\ndemo.t1.kp, \n", encoding="utf-8")
    with pytest.raises(LedgerError, match=r"removed\.csv: no reason for demo\.t1\.kp"):
        freeze(tmp_path)
    (tmp_path / "removed.csv").write_text("id,reason\ndemo.t1.kp,one fact counted twice\n", encoding="utf-8")
    assert [line[:11] for line in freeze(tmp_path)] == ["-demo.t1.kp"]


def test_scores_of_all_papers(project):
    write_rows(project / "book" / "ledger" / "another.csv", [replace(KP, id="another.kp")])
    board = scoreboard()
    lines = [line.split("  ") for line in repr(board).splitlines()]
    shown = [[cell.strip() for cell in line if cell.strip()] for line in lines]
    assert shown[:3] == [
        ["claims", "total", "another", "demo"],
        ["all", "11", "1", "10"],
        ["computed from the paper's problem", "8", "1", "7"],
    ]
    assert ["not computable", "1", "0", "1"] in shown
    assert board.html.count('role="img"') == 3
    assert (
        '<span class="verdict-reproduced">reproduced</span></th><td class="number" data-label="total">2'
        in board.html
    )
    written = [
        line.strip("| ").replace("**", "").split(" | ") for line in score_markdown().splitlines()[2:-2]
    ]
    assert [written[0], *written[2:]] == shown


def test_errata_have_the_rows_of_one_verdict(project):
    title = "@article{demo,\n  title = {On {PIDA}},\n}\n"
    (project / "book" / "references.bib").write_text(title, encoding="utf-8")
    page = errata("misprint")
    assert "<h3>On PIDA (demo)</h3>" in page.html
    assert "eq. (3) gives" in page.html
    assert "a 3 may be an 8" not in page.html
    assert "a 3 may be an 8" in errata("as-read").html
    assert repr(page).splitlines()[1].split() == ["claim", "printed", "computed", "difference", "why"]


def test_every_row_leads_to_the_chapter_and_its_evidence(project):
    (project / "book" / "demo.ipynb").write_text('{"cells": []}', encoding="utf-8")
    page = every_row()
    assert (
        '<p>demo, <a href="demo.html">the chapter</a>, <a href="audit/demo.html">its evidence</a></p>'
        in page.html
    )
    assert "<summary>All 10 rows</summary>" in page.html
    assert page.html.count("<tr>") == 11
    assert 'id="demo-t1-kp"' in page.html
    assert 'row demo.t1.kp of the ledger of pidalab, <a href="#demo-t1-kp">' in page.html


def test_write_score_rewrites_only_its_block(project):
    page = project / "README.md"
    page.write_text("# A \\1 title\n<!-- score -->\nold\n<!-- /score -->\nafter\n", encoding="utf-8")
    assert write_score(page)
    assert page.read_text(encoding="utf-8") == f"# A \\1 title\n{score_markdown()}\nafter\n"
    assert not write_score(page)


def test_commands(project, capsys):
    page = project / "README.md"
    page.write_text("<!-- score --><!-- /score -->\n", encoding="utf-8")
    assert main(["check"]) == 0
    assert main(["show", "demo"]) == 0
    assert main(["update", "demo"]) == 0
    assert main(["readme", str(page)]) == 0
    out = capsys.readouterr().out
    assert out.count("demo: 10 claims, 1 reproduced") == 2
    assert "3 entries changed\ndemo.t1.kp: computed '1.309812345' -> '1.315100000'" in out
    assert f"{page}: rewritten" in out


def test_missing_places_of_a_new_paper_are_listed(project, capsys):
    (project / "README.md").write_text("<!-- score --><!-- /score -->\n", encoding="utf-8")
    (project / "book" / "references.bib").write_text("", encoding="utf-8")
    (project / "CITATION.cff").write_text("", encoding="utf-8")
    assert main(["new", "sixth2030"]) == 0
    assert "sixth2030: references.bib does not have '{sixth2030,'" in capsys.readouterr().out
    assert main(["update", "sixth2030"]) == 0
    title = "@article{sixth2030,\n  title = {On {PIDA}},\n}\n"
    (project / "book" / "references.bib").write_text(title, encoding="utf-8")
    main(["readme", str(project / "README.md")])
    capsys.readouterr()
    assert main(["check"]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("sixth2030: ")]
    assert said == ["sixth2030: 0 claims", "sixth2030: CITATION.cff does not have its title 'On PIDA'"]
    assert main(["new", "sixth2030"]) == main(["new", "Sixth"]) == 1


def test_failing_commands_return_1_and_explain_why(project, capsys):
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, computed="7")])
    (project / "two.md").write_text("<!-- score --><!-- /score -->\n" * 2, encoding="utf-8")
    for command in (
        ["check"],
        ["show", "nobody"],
        ["update", "nobody"],
        ["readme", "none.md"],
        ["readme", "two.md"],
    ):
        assert main(command) == 1
        assert capsys.readouterr().err


def test_commands_run_with_a_narrow_encoding(project):
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, quantity="τ, 3 ≤ κ"), *ROWS[1:]])
    environment = os.environ | {
        "PYTHONIOENCODING": "cp1252",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-m", "paperledger", "show", "demo"]
    shown = subprocess.run(command, capture_output=True, check=True, env=environment).stdout
    assert rb"\u03c4, 3 \u2264 \u03ba" in shown
