"""The demo ledger as a project in a temporary folder; tests import the demo itself by name."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from demo_ledger import CHECKS, ROWS

from pidalab.ledger import write_rows


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with one ledger and its checks, seen from its root."""
    folder = tmp_path / "book" / "ledger"
    folder.mkdir(parents=True)
    write_rows(folder / "demo.csv", ROWS)
    (tmp_path / "book" / "checks").mkdir()
    (tmp_path / "book" / "checks" / "demo.py").write_text(CHECKS)
    monkeypatch.chdir(tmp_path)
    return tmp_path
