"""The tables of *How we know* are counted from the files that the evidence leaves, each time the site is built."""

import csv
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("evidence", ROOT / "tools" / "evidence.py")
evidence = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(evidence)
PAGE = (ROOT / "book" / "how-we-know.md").read_text(encoding="utf-8")


def test_every_table_of_the_page_is_made_and_shown(site):
    names = evidence.MARK.findall(PAGE)
    assert len(names) > 4
    full = evidence.filled(PAGE)
    assert "<!-- evidence" not in full
    shown = (site / "book" / "how-we-know.html").read_text(encoding="utf-8")
    assert shown.count("<table") == PAGE.count("\n|---") + len(names)


def test_an_unknown_table_is_refused():
    with pytest.raises(KeyError, match="gone"):
        evidence.filled("<!-- evidence: gone -->")


def test_rows_that_were_seen_to_fail_are_those_that_stand_on_a_computation():
    total = [int(cell) for cell in evidence.rows().splitlines()[-1].strip("| ").split(" | ")[1:]]
    assert total[0] + total[1] == total[3]


def test_a_fault_that_a_chapter_misses_is_not_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(evidence, "CLAIMS", tmp_path)
    with (tmp_path / "faults.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerows(
            [("fault", "paper", "red rows", "one of them"), ("a", "x", 2, "x.1"), ("a", "y", 0, "stops")]
        )
    assert evidence.faults().splitlines()[-1] == "| a | x | y |"
