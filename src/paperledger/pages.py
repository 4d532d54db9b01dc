"""Show and freeze all ledgers: the pages *Scoreboard* and *Errata*, the table of scores, the manifest."""

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from paperledger import display
from paperledger.book import Ledger
from paperledger.digits import BASES, DECLARED, VERDICTS, LedgerError, read_number, tolerance
from paperledger.display import (
    KINDS,
    Cell,
    Display,
    grid,
    markup,
    number,
    score,
    score_line,
    scorebar,
    words,
)
from paperledger.rows import (
    MANIFEST,
    REMOVED,
    Row,
    book_title,
    find_folder,
    papers,
    removed,
    table,
    write_text,
)

ERRATA = {
    "misprint": (
        "Misprints",
        "What is printed contradicts another line of the same paper, or arithmetic, in a way that no lost or misread "
        "character explains. Good papers have such slips, and so has this book. The last column says what speaks "
        "against the print.",
    ),
    "as-read": (
        "As we read it",
        "Here what we read does not hold, and we cannot tell whether the print or our reading of it is at fault: some "
        "texts were read by machine, and a lost dot, sign or index is enough. The last column says what would hold.",
    ),
}
BEGIN, END = "<!-- score -->", "<!-- /score -->"
_APART = ("fitted-agrees", "fitted-disagrees", "print-agrees", "print-disagrees", "reading", "not-computable")
GROUPS = {
    "computed from the paper's problem": [kind for kind in KINDS if kind not in _APART],
    "with settings fitted to these prints": ["fitted-agrees", "fitted-disagrees"],
    "from other printed results": ["print-agrees", "print-disagrees"],
    "by reading": ["reading", "not-computable"],
}


def load_all(folder: Path | str | None = None) -> dict[str, Ledger]:
    """Open and validate every ledger of a folder.

    Parameters
    ----------
    folder : path, optional
        Folder of the csv files; by default ``book/ledger``, searched upward from the current directory.

    Returns
    -------
    dict of str to Ledger
        By key of the paper, in alphabetical order. A paper without a file is absent.

    Raises
    ------
    LedgerError
        Listing everything that is wrong with the files.

    Examples
    --------
    >>> import tempfile
    >>> load_all(tempfile.mkdtemp())
    {}
    """
    place = Path(folder) if folder is not None else find_folder()
    books = {paper: Ledger.open(paper, folder=place) for paper in papers(place)}
    problems = [problem for book in books.values() for problem in book.problems()]
    if problems:
        raise LedgerError("\n".join(problems))
    return books


def _title(book: Ledger) -> str:
    """Return the title of a paper, or its key."""
    return book_title(book.paper, book.path.parents[1]) or book.paper


def scoreboard(folder: Path | str | None = None) -> Display:
    """Show the claims of all papers by verdict and basis, with a bar for each paper.

    Parameters
    ----------
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    Display

    Raises
    ------
    LedgerError
        As in `load_all`.

    Examples
    --------
    >>> import tempfile
    >>> print(scoreboard(tempfile.mkdtemp()).text.splitlines()[-1])
    claims           0
    """
    rows = {paper: [*book.rows.values()] for paper, book in load_all(folder).items()}
    # the total first: a narrow screen shows it without scrolling
    rows = {"total": [row for part in rows.values() for row in part]} | rows
    body = [
        [words(basis), Cell(verdict, display.chip(verdict)), *(number(str(count)) for count in counts)]
        for basis in BASES
        for verdict in VERDICTS
        if any(
            counts := [
                sum((row.basis, row.verdict) == (basis, verdict) for row in part) for part in rows.values()
            ]
        )
    ]
    body.append([words(""), words("claims"), *(number(str(len(part))) for part in rows.values())])
    board = grid("scoreboard", ("basis", "verdict", *rows), body, heading=1)
    bars = [
        f"<p>{markup(paper)}</p>{scorebar(paper, score(part)).html}" for paper, part in rows.items() if part
    ]
    bars[:1] = [scorebar("all papers", score(rows["total"]), legend=True).html] * bool(bars)
    return Display(f"{''.join(bars)}\n{board.html}", board.text)


def every_row(folder: Path | str | None = None) -> Display:
    """Show every row of every ledger, each with an anchor, folded by paper, and the way to chapter and evidence.

    Parameters
    ----------
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    Display
        A terminal gets the scores; `Ledger.table` has the rows.

    Raises
    ------
    LedgerError
        As in `load_all`.

    Examples
    --------
    >>> import tempfile
    >>> every_row(tempfile.mkdtemp()).html
    ''
    """
    html, text = [], []
    for paper, book in load_all(folder).items():
        pages = {"the chapter": paper, "its evidence": f"audit/{paper}"}
        there = {
            name: page for name, page in pages.items() if (book.path.parents[1] / f"{page}.ipynb").is_file()
        }
        ways = [f'<a href="{page}.html">{name}</a>' for name, page in there.items()]
        counts = score(book.rows.values())
        html += [
            f"<h3>{markup(_title(book))}</h3>",
            f"<p>{', '.join([paper, *ways])}</p>",
            scorebar(paper, counts).html,
            f"<details><summary>All {len(book.rows)} rows</summary>",
            display.claims([*book.rows.values()], anchors=True).html,
            "</details>",
        ]
        text.append(score_line(paper, counts))
    return Display("\n".join(html), "\n".join(text))


def errata(folder: Path | str | None = None) -> Display:
    """Show misprints, and prints that do not hold as read, by verdict and paper, with the evidence.

    Parameters
    ----------
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    Display

    Raises
    ------
    LedgerError
        As in `load_all`.

    Examples
    --------
    >>> import tempfile
    >>> print(errata(tempfile.mkdtemp()).text.splitlines()[0])
    Misprints
    """
    books = load_all(folder).values()
    html, text = [], []
    for verdict, (heading, said) in ERRATA.items():
        html += [f"<h2>{heading}</h2>", f'<p class="errata-notice">{said}</p>']
        text += [heading, said]
        for book in books:
            rows = [row for row in book.rows.values() if row.verdict == verdict]
            if rows:
                cells = [[display.claim(row, unfold=False), *_follows(row), words(row.note)] for row in rows]
                found = grid("errata", ("claim", "printed, as read", "follows", "why"), cells)
                html += [f"<h3>{markup(_title(book))} ({book.paper})</h3>", found.html]
                text += [f"{_title(book)} ({book.paper})", found.text]
    return Display("\n".join(html), "\n".join(text))


def _follows(row: Row) -> Sequence[Cell]:
    if row.is_number:
        return number(row.printed), number(row.shown())
    return (display.evidence(row, span=2) if row.evidence else Cell("", "", "evidence text", 2),)


def score_markdown(folder: Path | str | None = None) -> str:
    """Return the score as a Markdown table between two comments, which `write_score` finds again.

    Parameters
    ----------
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    str

    Raises
    ------
    LedgerError
        As in `load_all`.

    Examples
    --------
    >>> import tempfile
    >>> print(score_markdown(tempfile.mkdtemp()).splitlines()[0])
    <!-- score -->
    """
    books = load_all(folder)
    columns = {paper: score(book.rows.values()) for paper, book in books.items()}
    columns["total"] = score(row for book in books.values() for row in book.rows.values())

    def line(name: str, kinds: Sequence[str], bold: str = "") -> str:
        counts = (sum(counts[kind] for kind in kinds) for counts in columns.values())
        return "| " + " | ".join(f"{bold}{entry}{bold}" for entry in (name, *counts)) + " |"

    lines = [f"| {' | '.join(['claims', *columns])} |", f"| --- |{' --: |' * len(columns)}"]
    for group, kinds in GROUPS.items():
        if not any(columns["total"][kind] for kind in kinds):
            continue
        lines.append(line(group, kinds, "**"))
        lines += [line(KINDS[kind], [kind]) for kind in kinds if columns["total"][kind]]
    return "\n".join([BEGIN, "", *lines, line("all", [*KINDS], "**"), "", END])


def write_score(path: Path | str, folder: Path | str | None = None) -> bool:
    r"""Bring the score in a Markdown file up to date.

    Parameters
    ----------
    path : path
        A file with one block from ``<!-- score -->`` to ``<!-- /score -->``.
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    bool
        Whether the file changed.

    Raises
    ------
    LedgerError
        If the file has no such block or more than one, and as in `load_all`.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "README.md").write_text("# Title\n\n<!-- score -->\n<!-- /score -->\n")
    >>> write_score(folder / "README.md", folder), write_score(folder / "README.md", folder)
    (True, False)
    """
    file = Path(path)
    try:
        parts = re.split(f"{BEGIN}.*?{END}", file.read_text(encoding="utf-8"), flags=re.DOTALL)
    except UnicodeDecodeError as error:
        raise LedgerError(f"{path}: {error}") from None
    if len(parts) != 2:
        raise LedgerError(f"{path}: expected one block from {BEGIN} to {END}, found {len(parts) - 1}")
    return _rewritten(file, score_markdown(folder).join(parts))


def _rewritten(file: Path, text: str) -> bool:
    """Write a file unless it has this text already."""
    if file.is_file() and file.read_text(encoding="utf-8") == text:
        return False
    write_text(file, text)
    return True


FROZEN = ("id", "printed", "kind", "basis", "page", "made", "relation", "tolerance", "declared")


def _frozen(row: Row) -> tuple[str, ...]:
    """Return the entries of a row that only a review may change."""
    width = tolerance(row.note, read_number(row.printed)) if row.is_number else None
    return (
        row.id,
        row.printed,
        "statement" if row.is_statement else "number",
        row.basis,
        row.page,
        row.made,
        row.relation,
        "" if width is None else f"{width.normalize():f}",
        row.verdict if row.verdict in DECLARED else "",
    )


def claims(folder: Path | str | None = None) -> str:
    """Return what every row of a folder claims, as the text of its manifest."""
    rows = [row for book in load_all(folder).values() for row in book.rows.values()]
    return table(FROZEN, map(_frozen, rows))


def freeze(folder: Path | str | None = None) -> list[str]:
    """Write the manifest, and say what changed, one line for each entry: no claim is changed or dropped unseen.

    Raises
    ------
    LedgerError
        If an id is gone and ``removed.csv`` does not say why; nothing is written then.
    """
    place = Path(folder) if folder is not None else find_folder()
    new, file = claims(place), place / MANIFEST
    old = {line["id"]: line for line in _lines(file.read_text(encoding="utf-8"))} if file.is_file() else {}
    now = {line["id"]: line for line in _lines(new)}
    reasons = removed(place)
    if lost := [
        f"{id}: is gone, and {REMOVED} does not say why" for id in old if id not in {**now, **reasons}
    ]:
        raise LedgerError("\n".join(lost))
    if not old:
        changes = [f"{len(now)} new claims"]
    else:
        changes = [f"{id}: removed: {reasons[id]}" for id in old if id not in now]
        for id, line in now.items():
            if id not in old:
                changes.append(f"{id}: new: {line['printed']}")
                continue
            was = old[id]
            changes += [
                f"{id}: {column} {was.get(column, '')!r} -> {entry!r}"
                for column, entry in line.items()
                if was.get(column, "") != entry
            ]
    rewritten = _rewritten(file, new)
    return changes or ["the order of the rows"] * rewritten


def _lines(text: str) -> list[dict[str, str]]:
    return [*csv.DictReader(text.splitlines())]
