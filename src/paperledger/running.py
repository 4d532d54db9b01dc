"""Run the pages of a paper, store their results, and start a new paper."""

import ast
import contextlib
import json
import re
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from paperledger.book import Ledger, recording
from paperledger.rows import MANIFEST, Row, book_title, find_folder, naming, write_rows, write_text
from paperledger.verdicts import DECLARED, LedgerError


def pages(paper: str, folder: Path) -> list[Path]:
    """Find the notebooks that open the ledger of a paper. Chapters come first, then audits."""
    opened = re.compile(rf"Ledger\.open\(\s*['\"]{re.escape(paper)}['\"]")
    notebooks = [path for path in folder.parent.rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts]
    paths = [path for path in notebooks if opened.search("\n".join(cells(path)))]
    return sorted(paths, key=lambda path: (len(path.parts), path))


def cells(path: Path) -> list[str]:
    """Read the code cells of a notebook, without IPython magics and shell commands."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [re.sub(r"(?m)^(%(?!%)|!).*$", "", source) for source in code]


def execute(path: Path) -> Iterator[str]:
    """Run the code cells of a notebook in its folder. Yield the output and the result of each cell as text.

    The cells run in this process and not in a Jupyter kernel. Therefore errors keep their types, `recording` can change
    how ledgers work, `shake` can change the results of a library, and Jupyter is not needed.
    """
    names: dict[str, Any] = {"__name__": "__main__", "display": lambda *shown: print(*shown, sep="\n")}
    here, sources = str(path.resolve().parent), cells(path)
    with contextlib.chdir(here), contextlib.ExitStack() as after:
        sys.path.insert(0, here)
        after.callback(sys.path.remove, here)
        for number, source in enumerate(sources, start=1):
            title = f"{path.name}, cell {number}"
            tree, last = ast.parse(source, title), None
            if tree.body and isinstance(tree.body[-1], ast.Expr):
                last = ast.Expression(tree.body.pop().value)  # type: ignore[attr-defined]
            with contextlib.redirect_stdout(StringIO()) as said, warnings.catch_warnings():
                warnings.filterwarnings("ignore", message=".*non-interactive.*")
                exec(compile(tree, title, "exec"), names)
                value = last and eval(compile(last, title, "eval"), names)
            yield said.getvalue() + ("" if value is None else repr(value))
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


class Update(NamedTuple):
    """Result of an update.

    Parameters
    ----------
    changes : list of str
        A line for each entry that changed, with its old and new value.
    problems : list of str
        Tasks for a person, such as verdicts to declare and ids for which no page gave a value.

    Examples
    --------
    >>> Update(changes=[], problems=["demo.kp: never handed over"]).changes
    []
    """

    changes: list[str]
    problems: list[str]


def update(paper: str, folder: Path | str | None = None) -> Update:
    """Run the pages of a paper, and store their results and verdicts.

    Stored values that still agree are kept, so a run on another machine changes nothing. Everything that a person wrote
    is also kept: order, basis, relations, notes and declared verdicts. If the numbers of a row disagree and no
    verdict is declared, its verdict becomes empty.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        Folder of the csv files, inside the folder of the notebooks. By default as in `Ledger.open`.

    Returns
    -------
    Update

    Raises
    ------
    LedgerError
        If no page opens the ledger, an id is unknown, or a value does not fit its row. Nothing is stored then.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp(), "book")
    >>> (book / "ledger").mkdir(parents=True)
    >>> write_rows(book / "ledger" / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> cell = "from paperledger import Ledger; book = Ledger.open('demo'); book.compare({'kp': 1.3098})"
    >>> page = {"cells": [{"cell_type": "code", "source": [cell]}]}
    >>> _ = (book / "demo.ipynb").write_text(json.dumps(page))
    >>> for change in update("demo", book / "ledger").changes:
    ...     print(change)
    demo.kp: computed '' -> '1.309800000'
    demo.kp: verdict '' -> 'reproduced'
    demo.kp: page '' -> 'demo'
    """
    place = find_folder(folder)
    paths = pages(paper, place)
    if not paths:
        raise LedgerError(f'no notebook has Ledger.open("{paper}")')
    books: list[Ledger] = []
    for path in paths:
        with recording() as opened:
            for _ in execute(path):
                pass
        books += [book for book in opened if book.paper == paper]
    fresh: dict[str, Row] = {}
    # If several pages pass a value for the same row, the value of a page that closed its ledger is stored.
    for book in sorted(books, key=lambda book: not book.closed):
        fresh = {id: replace(row, page=book.page) for id, row in book.fresh.items()} | fresh
    book = Ledger.open(paper, folder=place)
    new = {id: _updated(row, fresh[id]) if id in fresh else row for id, row in book.rows.items()}
    changes = [
        f"{id}: {column} {getattr(row, column)!r} -> {getattr(new[id], column)!r}"
        for id, row in book.rows.items()
        for column in ("computed", "evidence", "verdict", "page")
        if getattr(row, column) != getattr(new[id], column)
    ]
    if changes:
        write_rows(book.path, list(new.values()))
    owed = [row.id for row in new.values() if row.basis != "reading" and row.id not in fresh]
    left = Ledger.open(paper, folder=place).problems() + [f"{id}: never handed over" for id in owed]
    return Update(changes, left)


def _updated(row: Row, fresh: Row) -> Row:
    """Return a row with the results of `fresh`. Its verdict follows from them, unless a person declared a verdict."""
    with naming(row.id):
        new = replace(row, page=fresh.page) if row.same(fresh) else fresh
        return new if row.verdict in DECLARED else replace(new, verdict=new.derived() or "")


# ------------------------------------------------------------------------------------------------ a new paper


def new(paper: str, folder: Path) -> list[Path]:
    """Write a minimal ledger, chapter and audit for a new paper.

    Raises
    ------
    LedgerError
        If the key is not lower case, or if one of the files exists.
    """
    if not re.fullmatch(r"[a-z0-9_-]+", paper):
        raise LedgerError(f"key {paper!r}: expected lower-case letters, digits, - and _, such as haalman2024")
    book = folder.parent
    files = [folder / f"{paper}.csv", book / f"{paper}.ipynb", book / "audit" / f"{paper}.ipynb"]
    if there := [path.relative_to(book).as_posix() for path in files if path.exists()]:
        raise LedgerError(f"{paper}: {', '.join(there)} exists; nothing was written")
    write_rows(files[0], [])
    for path, page in zip(files[1:], ("", f', page="audit/{paper}"'), strict=True):
        title = f"# The evidence for {paper}" if page else f"# {paper}"
        opens = f'from paperledger import Ledger\n\nbook = Ledger.open("{paper}"{page})'
        path.parent.mkdir(exist_ok=True)
        write_text(path, _notebook(title, opens, "book.close()"))
    return files


def _notebook(title: str, *sources: str) -> str:
    """Return a notebook with a title and code cells."""
    title_cell = {"cell_type": "markdown", "id": "title", "metadata": {}, "source": title}
    code: dict[str, Any] = {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": []}
    cells = [title_cell, *(code | {"id": f"cell-{k}", "source": text} for k, text in enumerate(sources))]
    return json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


def missing(paper: str, folder: Path) -> list[str]:
    """List the files of a book that should name a paper but do not."""
    book = folder.parent
    places = {
        book / "references.bib": f"{{{paper},",
        book / "notation.md": f"`{paper}`",
        book.parent / "_toc.yml": f"{book.name}/{paper}\n",
        book.parent / "codecheck.yml": f"{paper}.csv",
        book.parent / "README.md": f"| {paper} |",
        folder / MANIFEST: f"\n{paper}.",
    }
    texts = {path: path.read_text(encoding="utf-8") for path in places if path.is_file()}
    gaps = [
        f"{paper}: {path.name} does not have {places[path].strip()!r}"
        for path, text in texts.items()
        if places[path] not in text and (path.name != "README.md" or "<!-- score -->" in text)
    ]
    title, citation = book_title(paper, book), book.parent / "CITATION.cff"
    if title and citation.is_file() and _letters(title) not in _letters(citation.read_text(encoding="utf-8")):
        gaps.append(f"{paper}: CITATION.cff does not have its title {title!r}")
    return gaps + [f"{paper}: no notebook opens its ledger"] * (not pages(paper, folder))


def _letters(text: str) -> str:
    """Return only the letters of a text, in lower case.

    Two files may write the same title with different capitals, dashes and subscripts.
    """
    return re.sub(r"[^a-z]", "", text.replace("ₙᵐ", "nm").lower())
