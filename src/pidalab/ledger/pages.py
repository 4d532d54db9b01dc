"""All ledgers together: the pages *Scoreboard* and *Errata*, and the score of the README."""

import re
from collections import Counter
from pathlib import Path

from pidalab.ledger import display
from pidalab.ledger.book import Ledger
from pidalab.ledger.display import Display, number, words
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import find_folder, papers
from pidalab.ledger.rows import NO_EVIDENCE
from pidalab.ledger.running import has_checks
from pidalab.ledger.verdicts import VERDICTS

NOTICE = (
    "Each entry compares a paper, as read, with a computation that can be repeated here. "
    "Some of the texts were read by machine, so what looks like a misprint may be a reading error of ours. "
    "Corrections are welcome."
)
BEGIN, END = "<!-- score -->", "<!-- /score -->"


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
    books = {paper: Ledger.open(paper, place) for paper in papers(place)}
    problems = [
        problem
        for paper, book in books.items()
        for problem in book.problems()
        if has_checks(paper, place) or not problem.endswith(NO_EVIDENCE)  # its statements are still to be computed
    ]
    if problems:
        raise LedgerError("\n".join(problems))
    return books


def _scores(folder: Path | str | None) -> dict[str, dict[str, int]]:
    """Count by paper and verdict, the total last."""
    scores = {paper: book.score() for paper, book in load_all(folder).items()}
    total: Counter[str] = Counter()
    for score in scores.values():
        total.update(score)
    return {**scores, "total": {verdict: total[verdict] for verdict in VERDICTS}}


def scoreboard(folder: Path | str | None = None) -> Display:
    """Show the claims of all papers by verdict, with a bar for each paper.

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
    claims          0
    """
    scores = _scores(folder)
    rows = [
        [display.chip(verdict), *(number(str(score[verdict])) for score in scores.values())] for verdict in VERDICTS
    ]
    rows.append([words("claims"), *(number(str(sum(score.values()))) for score in scores.values())])
    table = display.grid("scoreboard", ("verdict", *scores), rows)
    bars = "".join(f"<p>{words(paper).html}</p>{display.bar(paper, score)}" for paper, score in scores.items())
    return Display(f"{bars}\n{table.html}", table.text)


def errata(folder: Path | str | None = None) -> Display:
    """Show the misprints of all papers, each with its proof.

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
    >>> print(errata(tempfile.mkdtemp()).text.splitlines()[-1])
    claim  printed, as read  should be
    """
    misprints = [
        (paper, row)
        for paper, book in load_all(folder).items()
        for row in book.rows.values()
        if row.verdict == "misprint"
    ]
    rows = [
        [
            display.claim(row, f"{paper}, {row.where}"),
            number(row.printed) if row.is_number else words(""),
            number(row.shown()) if row.is_number else words("does not hold"),
        ]
        for paper, row in misprints
    ]
    header = ("claim", "printed, as read", "should be")
    table = display.grid("errata", header, rows, [f"Proof. {row.note}" for _, row in misprints])
    return Display(f'<p class="errata-notice">{NOTICE}</p>\n{table.html}', f"{NOTICE}\n\n{table.text}")


def score_markdown(folder: Path | str | None = None) -> str:
    """Return the scoreboard as a Markdown table between two comments, which `write_score` finds again.

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
    scores = _scores(folder)
    header = ["verdict", *scores]
    rows = [[verdict, *(str(score[verdict]) for score in scores.values())] for verdict in VERDICTS]
    rows.append(["**claims**", *(f"**{sum(score.values())}**" for score in scores.values())])
    lines = [header, ["---", *("--:" for _ in header[1:])], *rows]
    return "\n".join([BEGIN, "", *("| " + " | ".join(line) + " |" for line in lines), "", END])


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
    old = file.read_text(encoding="utf-8")
    block = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    if len(block.findall(old)) != 1:
        raise LedgerError(f"{path}: expected one block from {BEGIN} to {END}, found {len(block.findall(old))}")
    score = score_markdown(folder)
    new = block.sub(lambda _: score, old)
    if new != old:
        file.write_text(new, encoding="utf-8", newline="\n")
    return new != old
