"""A sixth paper is added to a copy of the book, at the places that CONTRIBUTING names, and thrown away."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
import yaml
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from paperledger import Row, update, write_rows, write_score
from paperledger.pages import freeze

ROOT = Path(__file__).parents[1]
PARTS = [
    "book",
    "tests",
    "README.md",
    "CITATION.cff",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "_toc.yml",
    "pyproject.toml",
]
KEY = "example2030"
REFERENCE = f"""
@article{{{KEY},
  author = {{Example, Ada}},
  title = {{An invented rule for {{PI}} control}},
  journal = {{Journal of Examples}},
  year = {{2030}},
}}
"""
ROWS = [
    Row(f"{KEY}.table1.kp", "Table 1", "gain", "1.000"),
    Row(f"{KEY}.table1.ti", "Table 1", "integral time (s)", "2.00"),
    Row(
        f"{KEY}.sec2.faster",
        "sec. 2",
        "statement",
        "a higher M_s gives a faster response",
        relation="IAE at Ms 2.0 < IAE at Ms 1.4 | clearly",
    ),
]
CHAPTER = f"""import pidalab
from paperledger import Ledger

book = Ledger.open("{KEY}")
model = pidalab.fopdt(gain=1.0, lag=2.0, delay=1.0)
C = pidalab.rules.haalman.pi(model, ms=1.5904902)
book.compare({{"table1": {{"kp": C.kp, "ti": C.ti}}}})
book.close()"""
AUDIT = f"""import numpy as np
import pidalab
from paperledger import Ledger

book = Ledger.open("{KEY}", page="audit/{KEY}")
t, model = np.linspace(0.0, 60.0, 601), pidalab.fopdt(gain=1.0, lag=2.0, delay=1.0)
loops = {{ms: pidalab.rules.haalman.tune(model, ms, kind="PI").loop() for ms in (1.4, 2.0)}}
iae = {{ms: pidalab.load_response(loop, t).iae() for ms, loop in loops.items()}}
book.decide("sec2.faster", (iae[2.0], iae[1.4]))
book.close()"""


def places():
    """What CONTRIBUTING names in its table of places, with the new key; the library and its tests apart."""
    section = (ROOT / "CONTRIBUTING.md").read_text().split("## Add a sixth paper")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {name.replace("<key>", KEY) for row in rows for name in re.findall(r"`([^`]+)`", row)}
    return {name for name in named if not name.startswith(("src/", "tests/"))}


def state(folder):
    files = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def edit(path, change):
    old = path.read_text()
    new = change(old)
    assert new != old, path
    path.write_text(new)


def notebook(title, code):
    imports, rest = code.split("\n\n")
    setup, *calls = rest.splitlines()
    cells = [new_markdown_cell(f"# {title}"), new_code_cell(imports), new_code_cell(setup)]
    return new_notebook(cells=cells + [new_code_cell(call) for call in calls])


def with_column(text):
    """Add a column to every table that has one for each paper."""
    last = max(re.findall(r"`(\w+\d{4})` \|$", text, flags=re.MULTILINE), key=len)
    lines, inside = [], False
    for line in text.splitlines():
        inside = line.startswith("|") and (inside or line.endswith(f"`{last}` |"))
        head = line.endswith(f"`{last}` |")
        lines.append(
            line + (f" `{KEY}` |" if head else "---|" if set(line) <= set("|-:") else " – |") * inside
        )
    return "\n".join(lines) + "\n"


def with_pages(text):
    """Add both pages to the table of contents, each behind the last one of its kind."""
    contents = yaml.safe_load(text)
    chapters = [part["chapters"] for part in contents["parts"]]
    for page in (f"book/{KEY}", f"book/audit/{KEY}"):
        kind = re.compile(rf"{Path(page).parent.as_posix()}/\w+\d{{4}}")
        fitting = [part for part in chapters if any(kind.fullmatch(one["file"]) for one in part)]
        (fitting or chapters)[0].append({"file": page})
    return yaml.safe_dump(contents, sort_keys=False)


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """Return a copy of the project without the library, and what it was before the sixth paper came."""
    root = tmp_path_factory.mktemp("project")
    for part in PARTS:
        source = ROOT / part
        ignored = shutil.ignore_patterns(".*", "__pycache__")
        shutil.copytree(source, root / part, ignore=ignored) if source.is_dir() else shutil.copy(
            source, root / part
        )
    before = state(root)
    add_a_paper(root)
    return root, before


def add_a_paper(root):
    ledgers = root / "book" / "ledger"
    # the reference, and a column of the notation
    edit(root / "book" / "references.bib", lambda text: text + REFERENCE)
    edit(
        root / "CITATION.cff",
        lambda text: text + "  - type: article\n    title: An invented rule for PI control\n",
    )
    edit(root / "book" / "notation.md", with_column)
    # the claims, before anything is computed; then the pages, in the table of contents
    write_rows(ledgers / f"{KEY}.csv", ROWS)
    (root / "book" / "audit").mkdir(exist_ok=True)
    nbformat.write(notebook("An invented rule", CHAPTER), root / "book" / f"{KEY}.ipynb")
    nbformat.write(notebook("Evidence", AUDIT), root / "book" / "audit" / f"{KEY}.ipynb")
    edit(root / "_toc.yml", with_pages)
    assert update(KEY, ledgers).problems == []
    # what is generated, and what a person says
    freeze(ledgers)
    assert write_score(root / "README.md", ledgers)
    assert write_score(root / "book" / "intro.md", ledgers)
    edit(root / "CHANGELOG.md", lambda text: text + "\n* A chapter on an invented paper.\n")


def test_only_the_places_that_contributing_names(book):
    root, before = book
    after = state(root)
    touched = {name for name in after if after[name] != before.get(name)}
    assert touched == places()
    assert set(before) <= set(after)


def test_the_checks_of_the_book_accept_it(book):
    """The project's own tests, run in the copy: honesty of its pages, scores, bibliography, manifest."""
    root, _ = book
    tests = ["tests/paperledger/test_honesty.py", "tests/test_readme.py"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]
    chosen = ["-k", f"{KEY} or score or bibliography or manifest"]
    run = subprocess.run(
        [*command, *chosen], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout[-3000:]
    assert KEY not in run.stdout
    assert int(re.search(r"(\d+) passed", run.stdout).group(1)) >= 5
