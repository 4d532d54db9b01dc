"""All ledgers together: the pages *Scoreboard* and *Errata*, and the table of conventions."""

import re
from pathlib import Path

from pidalab.ledger.book import Ledger
from pidalab.ledger.conventions import CONVENTIONS
from pidalab.ledger.display import Cell, Display, chip, grid, markup, number, words
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import find_folder, papers
from pidalab.ledger.rows import Row
from pidalab.ledger.scores import bar, score, score_line, scorebar
from pidalab.ledger.tables import claim, evidence
from pidalab.ledger.verdicts import BASES, VERDICTS

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


def titles(folder: Path) -> dict[str, str]:
    """Read the titles of the papers from the references beside the ledgers.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the csv files; ``references.bib`` lies above it.

    Returns
    -------
    dict of str to str
        By key; empty without references.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp())
    >>> _ = (book / "references.bib").write_text("@article{demo2020,\\n  title = {On {PIDA}},\\n}")
    >>> titles(book / "ledger")
    {'demo2020': 'On PIDA'}
    """
    path = folder.parent / "references.bib"
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    entries = re.findall(r"@\w+\{(\w+),(.*?)\n\}", text, re.DOTALL)
    found = {key: re.search(r"\btitle\s*=\s*\{(.*)\},?", body) for key, body in entries}
    return {
        key: re.sub(r"[{}]", "", title.group(1)).replace("--", "–") for key, title in found.items() if title
    }


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
    books = load_all(folder)
    # the total first: a narrow screen shows it without scrolling
    rows = {"total": [row for book in books.values() for row in book.rows.values()]}
    rows |= {paper: [*book.rows.values()] for paper, book in books.items()}
    body = [_count(rows, basis, verdict) for basis in BASES for verdict in VERDICTS]
    body = [line for line in body if line[2].text != "0"]
    body.append([words(""), words("claims"), *(number(str(len(part))) for part in rows.values())])
    table = grid("scoreboard", ("basis", "verdict", *rows), body, heading=1)
    bars = scorebar("all papers", score(rows["total"])).html if rows["total"] else ""
    bars += "".join(f"<p>{markup(paper)}</p>{bar(paper, book.score())}" for paper, book in books.items())
    return Display(f"{bars}\n{table.html}", table.text)


def _count(rows: dict[str, list[Row]], basis: str, verdict: str) -> list[Cell]:
    counts = (sum(row.verdict == verdict and row.basis == basis for row in part) for part in rows.values())
    return [words(basis), Cell(verdict, chip(verdict)), *(number(str(count)) for count in counts)]


def every_row(folder: Path | str | None = None) -> Display:
    """Show every row of every ledger, folded by paper, with the way to the chapter and to its evidence.

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
    books = load_all(folder)
    place = Path(folder) if folder is not None else find_folder()
    named = titles(place)
    html, text = [], []
    for paper, book in books.items():
        pages = {"the chapter": f"{paper}", "its evidence": f"audit/{paper}"}
        ways = [
            f'<a href="{page}.html">{name}</a>'
            for name, page in pages.items()
            if (place.parent / f"{page}.ipynb").is_file()
        ]
        html += [
            f"<h3>{markup(named.get(paper, paper))}</h3>",
            f"<p>{', '.join([paper, *ways])}</p>",
            bar(paper, book.score()),
            f"<details><summary>All {len(book.rows)} rows</summary>",
            book.table().html,
            "</details>",
        ]
        text.append(score_line(paper, book.score()))
    return Display("\n".join(html), "\n".join(text))


def errata(folder: Path | str | None = None) -> Display:
    """Show where a print, or our reading of it, does not hold: by verdict and paper, each with what speaks against it.

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
    books = load_all(folder)
    place = Path(folder) if folder is not None else find_folder()
    named = titles(place)
    html, text = [], []
    for verdict, (heading, said) in ERRATA.items():
        html += [f"<h2>{heading}</h2>", f'<p class="errata-notice">{said}</p>']
        text += [heading, said]
        for paper, book in books.items():
            rows = [row for row in book.rows.values() if row.verdict == verdict]
            if rows:
                table = _corrections(rows)
                html += [f"<h3>{markup(named.get(paper, paper))} ({paper})</h3>", table.html]
                text += [f"{named.get(paper, paper)} ({paper})", table.text]
    return Display("\n".join(html), "\n".join(text))


def _corrections(rows: list[Row]) -> Display:
    """One table of rows that are printed, or read, otherwise than they follow."""

    def middle(row: Row) -> tuple[Cell, ...]:
        if row.is_number:
            return number(row.printed), number(row.shown())
        return (evidence(row, span=2) if row.evidence else Cell("", "", "evidence text", 2),)

    header = ("claim", "printed, as read", "follows", "why")
    cells = [[claim(row, row.where, unfold=False), *middle(row), words(row.note)] for row in rows]
    return grid("errata", header, cells)


def convention_table() -> Display:
    """Show what words such as *similar* and *clearly* mean in all ledgers.

    Returns
    -------
    Display

    Examples
    --------
    >>> print(convention_table().text.splitlines()[1])
    similar, about, comparable                             within 10 % of the larger
    """
    cells = [[words(entry.words), words(entry.meaning)] for entry in CONVENTIONS.values()]
    cells.append([words("the same formula, an identity"), words("a relative residual of at most 1e-9")])
    return grid("conventions", ("a paper says", "the ledger asks"), cells)
