"""Scoreboard, errata, the score of the README, and the commands."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import pytest
from demo_ledger import KP, ROWS

from paperledger import (
    LedgerError,
    errata,
    every_row,
    score_markdown,
    scoreboard,
    write_rows,
    write_score,
)
from paperledger.__main__ import main


def test_scoreboard(project):
    write_rows(project / "book" / "ledger" / "another.csv", [replace(KP, id="another.kp")])
    board = scoreboard()
    lines = [line.split() for line in repr(board).splitlines()]
    assert lines[0] == ["basis", "verdict", "total", "another", "demo"]
    assert lines[1] == ["computed", "reproduced", "2", "1", "1"]
    assert ["from-print", "as-read", "1", "0", "1"] in lines
    assert ["reading", "not-computable", "1", "0", "1"] in lines
    assert lines[-1] == ["claims", "11", "1", "10"]
    assert sum(int(line[2]) for line in lines[1:-1]) == 11
    assert board._repr_html_().count('role="img"') == 3
    headings = re.findall(r'<th scope="row"[^>]*>(.*?)</th>', board._repr_html_())
    assert [re.sub("<.*?>", "", one) for one in headings] == [line[-4] for line in lines[1:]]


def test_errata_keeps_misprints_and_readings_apart(project):
    (project / "book" / "references.bib").write_text(
        "@article{demo,\n  title = {On {PIDA}},\n}\n", encoding="utf-8"
    )
    page = errata()
    misprints, readings = page.html.split("<h2>")[1:]
    assert "eq. (3) gives" in misprints
    assert "a 3 may be an 8" in readings
    assert "demo.t2" not in page.text
    assert page.html.count("<h3>On PIDA (demo)</h3>") == 2
    lines = repr(page).splitlines()
    assert "—" not in page.html  # a misprint that nothing computed shows has no line for it
    assert lines[4].split()[-10:-6] == ["(Table", "1)", "12", "0.120"]


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
    assert 'row demo.t1.kp of the account of pidalab, <a href="#demo-t1-kp">' in page.html


def test_markdown_score(project):
    lines = score_markdown().splitlines()
    assert lines[0] == "<!-- score -->"
    assert lines[-1] == "<!-- /score -->"
    assert lines[2] == "| claims | demo | total |"
    assert lines[4] == "| **computed from the paper's problem** | **7** | **7** |"
    assert lines[5] == "| reproduced | 1 | 1 |"
    assert "| **by reading** | **2** | **2** |" in lines
    assert lines[-3] == "| **all** | **10** | **10** |"


def test_write_score_rewrites_only_its_block(project):
    page = project / "README.md"
    page.write_text("# A \\1 title\n<!-- score -->\nold\n<!-- /score -->\nafter\n", encoding="utf-8")
    assert write_score(page)
    assert page.read_text(encoding="utf-8") == f"# A \\1 title\n{score_markdown()}\nafter\n"
    assert not write_score(page)


@pytest.mark.parametrize("count", [0, 2])
def test_write_score_needs_one_block(project, count):
    page = project / "README.md"
    page.write_text("<!-- score --><!-- /score -->\n" * count, encoding="utf-8")
    with pytest.raises(LedgerError, match=f"expected one block .* found {count}"):
        write_score(page)


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


def test_a_new_paper_says_what_it_lacks(project, capsys):
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


def test_commands_fail_aloud(project, capsys):
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, computed="7")])
    for command in (["check"], ["show", "nobody"], ["update", "nobody"], ["readme", "none.md"]):
        assert main(command) == 1
        assert capsys.readouterr().err


def test_the_manifest_command_prints_what_changed(project, capsys):
    assert main(["manifest"]) == 0
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, printed="1.310"), *ROWS[1:]])
    assert main(["manifest"]) == 0
    assert "demo.t1.kp: printed '1.31' -> '1.310'" in capsys.readouterr().out
    assert main(["manifest"]) == 0
    assert capsys.readouterr().out == "manifest: up to date\n"


def test_what_an_encoding_lacks_stops_no_command(project):
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, quantity="τ, 3 ≤ κ"), *ROWS[1:]])
    environment = os.environ | {
        "PYTHONIOENCODING": "cp1252",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-m", "paperledger", "show", "demo"]
    shown = subprocess.run(command, capture_output=True, check=True, env=environment).stdout
    assert rb"\u03c4, 3 \u2264 \u03ba" in shown
