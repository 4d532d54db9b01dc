"""Make the outputs of all ledgers: the pages *Scoreboard* and *Errata*, the table of scores, and the manifest."""

import re
from collections.abc import Sequence
from difflib import unified_diff
from pathlib import Path

from paperledger import display
from paperledger.book import Ledger, load_all
from paperledger.display import Cell, Display
from paperledger.rows import MANIFEST, REMOVED, Row, book_title, find_folder, removed, table, write_text
from paperledger.verdicts import DECLARED, LedgerError, read_number, tolerance

BEGIN, END = "<!-- score -->", "<!-- /score -->"


def _title(book: Ledger) -> str:
    """Return the title of a paper, or its key if there is no title."""
    return book_title(book.paper, book.path.parents[1]) or book.paper


def _scores(folder: Path | str | None) -> tuple[dict[str, dict[str, int]], list[tuple[str, str, list[int]]]]:
    """Return the score of all papers and of each paper, and the lines of a table of these scores.

    A line consists of the kind of the counted rows, a label, and the counts. The kind is empty for a
    sum. The first line is the sum over all kinds. Each later sum adds the lines below it, up to the next sum. The first
    count of each line is for all papers together, so that it is visible on narrow screens.
    """
    books = {paper: [*book.rows.values()] for paper, book in load_all(folder).items()}
    scores = {"total": display.score(row for rows in books.values() for row in rows)}
    scores |= {paper: display.score(rows) for paper, rows in books.items()}

    def counts(*kinds: str) -> list[int]:
        return [sum(score[kind] for kind in kinds) for score in scores.values()]

    lines = [("", "all", counts(*display.KINDS))]
    for group, kinds in display.GROUPS.items():
        shown = [(kind, words, counts(kind)) for kind, words in kinds.items() if scores["total"][kind]]
        lines += [("", group, counts(*kinds)), *shown] if shown else []
    return scores, lines


def scoreboard(folder: Path | str | None = None) -> Display:
    """Show the claims of all papers by basis and verdict, with a bar for each paper.

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
    all     0
    """
    scores, lines = _scores(folder)
    body = []
    for kind, words, counts in lines:
        html = f'<span class="verdict-{kind}">{words}</span>' if kind else f"<strong>{words}</strong>"
        body.append([Cell(words, html), *(display.number(str(count)) for count in counts)])
    board = display.grid("scoreboard", ("claims", *scores), body)
    bars = [display.scorebar("all papers", scores.pop("total"), legend=True).html]
    for paper, score in scores.items():
        bars.append(f"<p>{display.markup(paper)}</p>{display.scorebar(paper, score).html}")
    return Display(f"{''.join(bars)}\n{board.html}", board.text)


def every_row(folder: Path | str | None = None) -> Display:
    """Show all rows, in a section for each paper with links to its chapter and audit. Each row has an anchor.

    Parameters
    ----------
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    Display
        The HTML has the rows. The text for a terminal has only the score of each paper.

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
        ways = [
            f'<a href="{page}.html">{name}</a>'
            for name, page in (("the chapter", paper), ("its evidence", f"audit/{paper}"))
            if (book.path.parents[1] / f"{page}.ipynb").is_file()
        ]
        counts = display.score(book.rows.values())
        html += [
            f"<h3>{display.markup(_title(book))}</h3>",
            f"<p>{', '.join([paper, *ways])}</p>",
            display.scorebar(paper, counts).html,
            f"<details><summary>All {len(book.rows)} rows</summary>",
            display.claims([*book.rows.values()], anchors=True).html,
            "</details>",
        ]
        text.append(display.score_line(paper, counts))
    return Display("\n".join(html), "\n".join(text))


def errata(verdict: str, folder: Path | str | None = None) -> Display:
    """Show the rows that have a given verdict, in a section for each paper, with the reasons in their notes.

    Parameters
    ----------
    verdict : str
        A verdict that a person declares, such as ``misprint`` or ``as-read``.
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
    >>> errata("misprint", tempfile.mkdtemp()).html
    ''
    """
    html, text = [], []
    for book in load_all(folder).values():
        if rows := [row for row in book.rows.values() if row.verdict == verdict]:
            title, shown = f"{_title(book)} ({book.paper})", display.claims(rows, why=True)
            html += [f"<h3>{display.markup(title)}</h3>", shown.html]
            text += [title, shown.text]
    return Display("\n".join(html), "\n".join(text))


def score_markdown(folder: Path | str | None = None) -> str:
    """Return the scores as a Markdown table between two comments, by which `write_score` finds the table.

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
    scores, lines = _scores(folder)
    rows = [["claims", *scores], ["---", *["--:"] * len(scores)]]
    for kind, words, counts in lines:
        bold = "" if kind else "**"
        rows.append([f"{bold}{entry}{bold}" for entry in (words, *counts)])
    return "\n".join([BEGIN, "", *(f"| {' | '.join(row)} |" for row in rows), "", END])


def write_score(path: Path | str, folder: Path | str | None = None) -> bool:
    r"""Update the score in a Markdown file.

    Parameters
    ----------
    path : path
        A file with a block from ``<!-- score -->`` to ``<!-- /score -->``.
    folder : path, optional
        As in `load_all`.

    Returns
    -------
    bool
        True if the file changed.

    Raises
    ------
    LedgerError
        If the file does not have exactly one such block, or if a ledger has errors.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "README.md").write_text("# Title\n\n<!-- score -->\n<!-- /score -->\n")
    >>> write_score(folder / "README.md", folder), write_score(folder / "README.md", folder)
    (True, False)
    """
    file = Path(path)
    parts = re.split(f"{BEGIN}.*?{END}", file.read_text(encoding="utf-8"), flags=re.DOTALL)
    if len(parts) != 2:
        raise LedgerError(f"{path}: expected one block from {BEGIN} to {END}, found {len(parts) - 1}")
    return write_text(file, score_markdown(folder).join(parts))


def claims(folder: Path | str | None = None) -> str:
    """Return the text of the manifest: a table with the columns `FROZEN` and a line for each row of each ledger."""
    return table(FROZEN, [_frozen(row) for book in load_all(folder).values() for row in book.rows.values()])


FROZEN = ("id", "printed", "kind", "basis", "page", "made", "relation", "tolerance", "declared")


def _frozen(row: Row) -> Sequence[str]:
    width = tolerance(row.note, read_number(row.printed)) if row.is_number else None
    kind = "statement" if row.is_statement else "number"
    declared = row.verdict if row.verdict in DECLARED else ""
    allowed = "" if width is None else f"{width.normalize():f}"
    return (row.id, row.printed, kind, row.basis, row.page, row.made, row.relation, allowed, declared)


def freeze(folder: Path | str | None = None) -> list[str]:
    """Write the manifest. Return the changed lines: an old line begins with -, and a new line with +.

    Raises
    ------
    LedgerError
        If an id of the old manifest has no row, and ``removed.csv`` gives no reason. Nothing is written then.
    """
    place = find_folder(folder)
    file, text, reasons = place / MANIFEST, claims(place), removed(place)
    old = file.read_text(encoding="utf-8") if file.is_file() else ""
    before, after = ({line.partition(",")[0] for line in version.splitlines()} for version in (old, text))
    if lost := sorted(before - after - {*reasons} - {FROZEN[0]}):
        raise LedgerError("\n".join(f"{id}: row missing, and {REMOVED} gives no reason" for id in lost))
    write_text(file, text)
    lines = list(unified_diff(old.splitlines(), text.splitlines(), lineterm="", n=0))[2:]
    return [line for line in lines if not line.startswith("@@")]
