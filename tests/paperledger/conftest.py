"""Provide the demo ledger as a project in a temporary folder."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from demo_ledger import CELLS, ROWS, write_notebook

from paperledger import write_rows


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Return the root of a project with one ledger and its page. It is the working directory."""
    folder = tmp_path / "book" / "ledger"
    folder.mkdir(parents=True)
    write_rows(folder / "demo.csv", ROWS)
    write_notebook(tmp_path / "book" / "audit" / "demo.ipynb", *CELLS)
    monkeypatch.chdir(tmp_path)
    return tmp_path
