"""The account as others read it: an outside checker, an archive, a search engine."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from demo_ledger import KP, ROWS, S1

from paperledger import load_all, write_rows
from paperledger.publishing import checkable, linked, publish, repro, review, scholarly

LEDGERS = Path(__file__).parents[2] / "book" / "ledger"
BOARD = "https://example.org/scoreboard.html"


def verified(folder):
    """What claims-cli says of each claim of a folder; it shares no code with the ledger."""
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


def test_a_page_says_its_claims_to_machines():
    paper = scholarly(
        {"title": "On PIDA </script>", "doi": "10.1/x", "author": "Ada and Bob", "year": "2030"}
    )
    text = linked([KP, S1], BOARD, "https://example.org/demo.html", paper)
    assert "</script>" not in text
    about, number, statement = json.loads(text)["@graph"]
    assert about["about"]["name"] == "On PIDA </script>"
    assert number["itemReviewed"]["appearance"] == {"@id": "https://doi.org/10.1/x"}
    assert number["url"] == f"{BOARD}#demo-t1-kp"
    assert statement["claimReviewed"] == "sec. 3: A < B & it wins"
    assert statement["reviewRating"]["alternateName"] == "holds"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.id)
def test_each_row_is_a_review(row):
    found = review(row, BOARD, {"@type": "ScholarlyArticle", "name": "On PIDA"})
    assert found["identifier"] == row.id
    assert found["reviewRating"]["alternateName"] == row.verdict
