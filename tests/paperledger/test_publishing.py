"""The account as others read it: an outside checker, an archive, a search engine."""

import json
import subprocess
import sys
from pathlib import Path

import yaml
from demo_ledger import ROWS

from paperledger import load_all, write_rows
from paperledger.publishing import checkable, publish, repro

LEDGERS = Path(__file__).parents[2] / "book" / "ledger"


def verified(folder):
    """Return the verdict of claims-cli on each claim of a folder; it shares no code with the ledger."""
    command = [sys.executable, "-m", "claims", "verify", "--format", "json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return json.loads(done.stdout)["assessment"]


def test_an_outside_checker_agrees_with_every_number(tmp_path):
    """It finds those that round to their print, and refuses all others: last digits, tolerances, disagreements."""
    publish(LEDGERS, tmp_path)
    assert verified(tmp_path)["passed"]
    books = load_all(LEDGERS)
    rows = [row for book in books.values() for row in book.rows.values() if row.is_number]
    (tmp_path / "repro.yaml").write_text(json.dumps(repro(books, rows)), encoding="utf-8")
    refused = {one["subject"].partition("/")[0] for one in verified(tmp_path)["violations"]}
    ours = {row.id.replace(".", "-") for row in rows} - {row.id.replace(".", "-") for row in checkable(rows)}
    within = {
        row.id.replace(".", "-") for row in rows if row.verdict == "approximate"
    }  # some round to the print, too
    assert refused - within == ours - within
    assert len(rows) > 500


def test_the_bundle_is_whole(tmp_path):
    ledgers = tmp_path / "ledger"
    ledgers.mkdir()
    write_rows(ledgers / "demo.csv", ROWS)
    out = tmp_path / "out"
    files = {path.relative_to(out).as_posix() for path in publish(ledgers, out)}
    assert files == {"ledger/demo.csv", "repro.yaml"}
    assert [
        claim["evidence"][0]["reported"]
        for claim in yaml.safe_load((out / "repro.yaml").read_text(encoding="utf-8"))["claims"]
    ] == ["1.31"]
