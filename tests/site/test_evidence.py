"""The tables of *How we know* are counted from the files that the evidence leaves, each time the site is built."""

from pathlib import Path

import evidence
import pytest

PAGE = (Path(__file__).parents[2] / "book" / "how-we-know.md").read_text(encoding="utf-8")


def test_every_table_of_the_page_is_made_and_shown(site):
    names = evidence.MARK.findall(PAGE)
    assert len(names) == len(evidence.TABLES)
    full = evidence.filled(PAGE)
    assert "<!-- evidence" not in full
    shown = (site / "book" / "how-we-know.html").read_text(encoding="utf-8")
    assert shown.count("<table") == PAGE.count("\n|---") + len(names)


def test_an_unknown_table_is_refused():
    with pytest.raises(KeyError, match="gone"):
        evidence.filled("<!-- evidence: gone -->")
