"""Storing what the pages of a paper compute: their cells run with a ledger that takes everything."""

import ast
import contextlib
import json
import os
import re
import sys
import warnings
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from pidalab.ledger.book import Ledger, recording, updated
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import find_folder, write_rows
from pidalab.ledger.rows import Row

_MAGIC = re.compile(r"(?m)^[%!].*$")


def pages(paper: str, folder: Path | str | None = None) -> dict[str, Path]:
    """Find the notebooks that open a ledger, by the name under which they open it.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        Folder of the csv files, beside which the notebooks lie; by default as in `Ledger.open`.

    Returns
    -------
    dict of str to pathlib.Path
        In alphabetical order of the files, chapters before audits.

    Raises
    ------
    LedgerError
        If two notebooks use one name.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp())
    >>> (book / "ledger").mkdir()
    >>> pages("demo", book / "ledger")
    {}
    """
    ledgers = Path(folder) if folder is not None else find_folder()
    found: dict[str, Path] = {}
    notebooks = [path for path in ledgers.parent.rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts]
    for path in sorted(notebooks, key=lambda path: (len(path.parts), path)):
        name = opened(path).get(paper)
        if name in found:
            raise LedgerError(f"{path} and {found[name]} both open {paper} as page {name!r}")
        if name is not None:
            found[name] = path
    return found


def cells(path: Path) -> list[str]:
    """Read the code cells of a notebook, magics left out."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [_MAGIC.sub("", "".join(cell["source"])) for cell in code]


def opened(path: Path) -> dict[str, str]:
    """Read which ledgers a notebook opens: names of pages by paper."""
    source = "\n".join(cells(path))
    if "Ledger" not in source:
        return {}
    found = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("Ledger.open") and node.args:
            paper, *rest = (_text(part) for part in node.args)
            words = {word.arg: _text(word.value) for word in node.keywords}
            found[paper] = words.get("page") or next(iter(rest), "") or paper
    return found


def _text(node: ast.expr) -> str:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ast.unparse(node)


def run(path: Path) -> list[Ledger]:
    """Run the code cells of a notebook, as it stands in its folder, and return its ledgers with what they were given.

    Parameters
    ----------
    path : pathlib.Path
        A notebook.

    Returns
    -------
    list of Ledger
        Nothing was compared, nothing is stored.

    Raises
    ------
    LedgerError
        If an id is unknown, or what is handed over does not fit its row.
    """
    os.environ["MPLBACKEND"] = "Agg"
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].switch_backend("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    here = str(path.resolve().parent)
    with recording() as books, contextlib.chdir(here), contextlib.redirect_stdout(StringIO()):
        sys.path.insert(0, here)
        try:
            for number, source in enumerate(cells(path), start=1):
                with warnings.catch_warnings():
                    warnings.filterwarnings("ignore", message=".*non-interactive.*")
                    exec(compile(source, f"{path.name}, cell {number}", "exec"), names)
        finally:
            sys.path.remove(here)
            if "matplotlib.pyplot" in sys.modules:
                sys.modules["matplotlib.pyplot"].close("all")
    return books


class Update(NamedTuple):
    """What an update did to a ledger.

    Parameters
    ----------
    changes : list of str
        One line for each entry that changed, old and new.
    problems : list of str
        What is left for a person: verdicts to declare, ids never handed over.

    Examples
    --------
    >>> Update(changes=[], problems=["demo.kp: never handed over"]).changes
    []
    """

    changes: list[str]
    problems: list[str]


def update(paper: str, folder: Path | str | None = None) -> Update:
    """Run the pages of a paper and store what they hand over.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        As in `pages`.

    Returns
    -------
    Update

    Raises
    ------
    LedgerError
        If no page opens the ledger, and as in `run`; nothing is stored then.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp(), "book")
    >>> (book / "ledger").mkdir(parents=True)
    >>> write_rows(book / "ledger" / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> cell = "from pidalab.ledger import Ledger; book = Ledger.open('demo'); book.compare({'kp': 1.3098})"
    >>> page = {"cells": [{"cell_type": "code", "source": [cell]}]}
    >>> _ = (book / "demo.ipynb").write_text(json.dumps(page))
    >>> update("demo", book / "ledger").changes[0]
    "demo.kp: computed '' -> '1.309800000'"
    """
    found = pages(paper, folder)
    if not found:
        raise LedgerError(f'no notebook has Ledger.open("{paper}")')
    books = [book for path in found.values() for book in run(path) if book.paper == paper]
    fresh: dict[str, Row] = {}
    for book in sorted(books, key=lambda book: not book.closed):  # the first that closes it owes a row
        fresh = {id: replace(row, page=book.page) for id, row in book.fresh.items()} | fresh
    changes = record(paper, fresh, folder)
    book = Ledger.open(paper, folder=folder)
    owed = [id for id, row in book.rows.items() if row.basis != "reading" and id not in fresh]
    return Update(changes, book.problems() + [f"{id}: never handed over" for id in owed])


def record(paper: str, fresh: Mapping[str, Row], folder: Path | str | None = None) -> list[str]:
    """Store fresh rows in a ledger file, and the verdicts that follow from them.

    What still agrees stays as it is, and so does everything that a person wrote: order, basis, relations, notes and
    declared verdicts. A row whose numbers disagree without a declared reason is left without a verdict.

    Parameters
    ----------
    paper : str
        Key of the paper.
    fresh : mapping of str to Row
        Rows as a page handed them over, by full id.
    folder : path, optional
        As in `Ledger.open`.

    Returns
    -------
    list of str
        One line for each entry that changed, old and new.

    Examples
    --------
    >>> import tempfile
    >>> folder, row = Path(tempfile.mkdtemp()), Row("demo.kp", "Table 1", "gain", "1.31")
    >>> write_rows(folder / "demo.csv", [row])
    >>> for change in record("demo", {"demo.kp": replace(row, computed="1.309800000")}, folder):
    ...     print(change)
    demo.kp: computed '' -> '1.309800000'
    demo.kp: verdict '' -> 'reproduced'
    """
    book = Ledger.open(paper, folder=folder)
    new = {id: updated(row, fresh[id]) if id in fresh else row for id, row in book.rows.items()}
    changes = [
        f"{id}: {column} {getattr(row, column)!r} -> {getattr(new[id], column)!r}"
        for id, row in book.rows.items()
        for column in ("computed", "evidence", "verdict", "page")
        if getattr(row, column) != getattr(new[id], column)
    ]
    if changes:
        write_rows(book.path, list(new.values()))
    return changes
