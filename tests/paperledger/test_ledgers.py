"""The ledgers of this book, and the pages that hand them over."""

import json
import re
from pathlib import Path

import pytest

from paperledger import papers, read_rows
from paperledger.pages import claims
from paperledger.running import cells, pages

ROOT = Path(__file__).parents[2]
LEDGERS = ROOT / "book" / "ledger"
MASKS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)|raises-exception|nbval-|skip-execution|remove-output")


def test_no_output_of_a_notebook_is_masked():
    """Else the run would not compare it with what is stored."""
    for path in (ROOT / "book").rglob("*.ipynb"):
        code = [
            cell
            for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
            if cell["cell_type"] == "code"
        ]
        text = "\n".join(
            "".join(cell["source"]) + " ".join(cell["metadata"].get("tags", [])) for cell in code
        )
        assert MASKS.search(text) is None, path.name
    settings = [ROOT / "pyproject.toml", ROOT / "Makefile", *(ROOT / ".ci").iterdir()]
    assert [path for path in settings if "sanitize" in path.read_text(encoding="utf-8")] == []


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
    """`python -m paperledger manifest` freezes a reviewed change."""
    assert claims(LEDGERS).splitlines() == (LEDGERS / "manifest.csv").read_text(encoding="utf-8").splitlines()
