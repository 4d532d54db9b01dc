"""Check the ledgers of this book, and follow the page *Keep such a ledger for your own paper*."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from paperledger import papers, read_rows
from paperledger.pages import claims
from paperledger.running import cells, pages

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "book" / "keep-a-ledger.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"```\{code-block\} \w+\n:caption: ([^\n]+)\n\n(.*?)```", PAGE, flags=re.DOTALL))
COMMANDS = [
    line for block in re.findall(r"```bash\n(.*?)```", PAGE, flags=re.DOTALL) for line in block.splitlines()
]
SAID = {
    "update": r"left to do:\n" + re.escape(re.search(r"`(doe2030\.table1\.y20: the file[^`]*)`", PAGE)[1]),
    "check": "doe2030: 4 claims, 2 reproduced, 1 holds, 1 misprint",
    "manifest": "manifest: rewritten",
    "show": r"misprint +doe2030\.table1\.y20: growth in 20 years \(Table 1\) +1\.086 +1\.8061",
    "shake": re.search(r"`(doe2030: 4 of 4 rows move)`", PAGE)[1],
}


def test_the_instructions_of_the_page_are_sufficient(tmp_path):
    ledger = tmp_path / "book" / "ledger" / "doe2030.csv"
    ledger.parent.mkdir(parents=True)
    ledger.write_text(FILES["book/ledger/doe2030.csv"], encoding="utf-8")
    (tmp_path / "growth.py").write_text(FILES["growth.py"], encoding="utf-8")
    cells = [text for name, text in FILES.items() if name.startswith("book/doe2030.ipynb")]
    code = [{"cell_type": "code", "metadata": {}, "outputs": [], "source": text} for text in cells]
    (tmp_path / "book" / "doe2030.ipynb").write_text(json.dumps({"cells": code}), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    assert [command.split()[3] for command in COMMANDS] == [*SAID]
    for command in COMMANDS:
        words = command.split()
        run = subprocess.run(
            [sys.executable, *words[1:]],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
        )
        if words[3] == "shake" and not hasattr(os, "fork"):
            assert "needs a system that can fork processes" in run.stderr
            continue
        assert re.search(SAID[words[3]], run.stdout + run.stderr), run.stdout + run.stderr
        if words[3] == "update":  # a person has to declare the verdict
            assert run.returncode == 1
            row = FILES["row doe2030.table1.y20"].strip()
            lines = ledger.read_text(encoding="utf-8").splitlines()
            ledger.write_text(
                "\n".join(row if line.startswith(row.split(",")[0]) else line for line in lines) + "\n",
                encoding="utf-8",
            )
        else:
            assert run.returncode == 0
    assert [row.verdict for row in read_rows(ledger)] == ["reproduced", "reproduced", "misprint", "holds"]


LEDGERS = ROOT / "book" / "ledger"


@pytest.mark.parametrize("paper", papers(LEDGERS))
def test_every_row_belongs_to_a_page_that_closes_the_ledger(paper):
    closing = [path for path in pages(paper, LEDGERS) if cells(path)[-1].endswith("book.close()")]
    names = {path.relative_to(ROOT / "book").with_suffix("").as_posix() for path in closing}
    rows = [row for row in read_rows(LEDGERS / f"{paper}.csv") if row.basis != "reading"]
    assert {row.page for row in rows} <= names


@pytest.mark.parametrize("paper", papers(LEDGERS))
def test_a_statement_that_fails_is_quoted(paper):
    rows = [row for row in read_rows(LEDGERS / f"{paper}.csv") if row.verdict == "fails"]
    assert [row.id for row in rows if not re.search('[“"].+[”"]', row.printed + row.note)] == []


def test_the_claims_are_those_of_the_manifest():
    """`python -m paperledger manifest` stores a reviewed change."""
    assert claims(LEDGERS).splitlines() == (LEDGERS / "manifest.csv").read_text(encoding="utf-8").splitlines()
