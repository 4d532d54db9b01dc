"""The score on the front pages: a compact Markdown table between two comments."""

import re
from pathlib import Path

from pidalab.ledger.errors import LedgerError
from pidalab.ledger.pages import load_all
from pidalab.ledger.scores import KINDS, score

BEGIN, END = "<!-- score -->", "<!-- /score -->"
GROUPS = {
    "computed from the paper's problem": tuple(
        kind for kind in KINDS if kind not in ("print-agrees", "print-disagrees", "reading", "not-computable")
    ),
    "from other printed results": ("print-agrees", "print-disagrees"),
    "by reading": ("reading", "not-computable"),
}


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
    columns = {paper: book.score() for paper, book in books.items()}
    columns["total"] = score(row for book in books.values() for row in book.rows.values())
    lines = [["claims", *columns], ["---", *("--:" for _ in columns)]]
    for group, kinds in GROUPS.items():
        sums = [sum(counts[kind] for kind in kinds) for counts in columns.values()]
        lines.append([f"**{group}**", *(f"**{count}**" for count in sums)])
        lines += [
            [KINDS[kind], *(str(counts[kind]) for counts in columns.values())]
            for kind in kinds
            if columns["total"][kind]
        ]
    lines.append(["**all**", *(f"**{sum(counts.values())}**" for counts in columns.values())])
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
        raise LedgerError(
            f"{path}: expected one block from {BEGIN} to {END}, found {len(block.findall(old))}"
        )
    fresh = score_markdown(folder)
    new = block.sub(lambda _: fresh, old)
    if new != old:
        file.write_text(new, encoding="utf-8", newline="\n")
    return new != old
