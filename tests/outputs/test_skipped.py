"""A run that leaves tests out says so at its end."""

import shutil
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
SOURCE = """
import pytest

@pytest.fixture(scope="module")
def browser():
    pytest.skip("no browser: apt install chromium-headless-shell")

@pytest.mark.parametrize("page", ["a", "b"])
def test_page(browser, page):
    pass

def test_library():
    pytest.importorskip("not_there", reason="no not_there: pip install not-there")

def test_that_runs():
    pass
"""


def last_lines(folder, *options):
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir=.", *options]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return [line.strip("= ") for line in run.stdout.splitlines()]


def test_it_says_what_how_many_and_what_to_install(tmp_path):
    shutil.copy(TESTS / "conftest.py", tmp_path)
    (tmp_path / "test_some.py").write_text(SOURCE)
    for options in [], ["-n", "2"]:
        assert last_lines(tmp_path, *options)[-6:-1] == [
            "3 tests did not run",
            "no browser: apt install chromium-headless-shell",
            "test_some.py (2)",
            "no not_there: pip install not-there",
            "test_some.py (1)",
        ]


def test_a_whole_run_says_nothing(tmp_path):
    shutil.copy(TESTS / "conftest.py", tmp_path)
    (tmp_path / "test_some.py").write_text(SOURCE)
    assert not any("did not run" in line for line in last_lines(tmp_path, "-k", "that_runs"))
