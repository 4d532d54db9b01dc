"""The checks of a paper: finding them, running them, and storing what they hand over."""

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from pidalab.ledger.book import Ledger
from pidalab.ledger.entries import Entry, updated
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import find_folder, papers, write_rows
from pidalab.ledger.rows import Row

PACKAGE = "pidalab_checks"  # the name under which book/checks is imported


def checks(paper: str, folder: Path | str | None = None) -> ModuleType:
    """Import the checks of a paper, ``book/checks/<paper>.py`` or a package of that name.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        Folder of the csv files, beside which the checks lie; by default as in `Ledger.open`.

    Returns
    -------
    types.ModuleType
        It has `SECTIONS`, functions that take the ledger and return what the page shows.

    Raises
    ------
    LedgerError
        If there are none.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp())
    >>> (book / "ledger").mkdir(), (book / "checks").mkdir()
    (None, None)
    >>> write_rows(book / "ledger" / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> lines = ["def gains(book):", "    book.check('kp', 1.3098)", "SECTIONS = (gains,)"]
    >>> _ = (book / "checks" / "demo.py").write_text(chr(10).join(lines))
    >>> [section.__name__ for section in checks("demo", book / "ledger").SECTIONS]
    ['gains']
    """
    ledgers = Path(folder) if folder is not None else find_folder()
    place = (ledgers.parent / "checks").resolve()
    if not has_checks(paper, ledgers):
        known = ", ".join(key for key in papers(ledgers) if has_checks(key, ledgers)) or "none"
        raise LedgerError(f"no checks of {paper} in {place}; there are: {known}")
    parent = sys.modules.get(PACKAGE)
    if parent is None or [*parent.__path__] != [
        str(place)
    ]:  # another book: forget the checks of the last one
        for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
            del sys.modules[name]
        parent = ModuleType(PACKAGE)
        parent.__path__ = [str(place)]
        sys.modules[PACKAGE] = parent
        importlib.invalidate_caches()
    return importlib.import_module(f"{PACKAGE}.{paper}")


def has_checks(paper: str, folder: Path) -> bool:
    """Tell whether a paper has checks beside a folder of ledgers.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : pathlib.Path
        Folder of the csv files.

    Returns
    -------
    bool
    """
    place = folder.parent / "checks"
    return (place / f"{paper}.py").is_file() or (place / paper / "__init__.py").is_file()


class Collector(Ledger):
    """A ledger that takes every entry as it comes, fit for its row or not yet stored."""

    def _judge(self, row: Row, entry: Entry) -> list[str]:
        return []

    def close(self) -> None:
        """Do nothing: nothing was compared."""


def _collect(paper: str, folder: Path | str | None = None) -> Collector:
    """Run the sections of a paper with a ledger that takes everything."""
    module = checks(paper, folder)
    book = Collector.open(paper, folder)
    for section in module.SECTIONS:
        section(book)
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
    return book


def run(paper: str, folder: Path | str | None = None) -> dict[str, Entry]:
    """Run the checks of a paper and return what they hand over; nothing is compared, nothing stored.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        As in `checks`.

    Returns
    -------
    dict of str to Entry
        By full id.

    Raises
    ------
    LedgerError
        If an id is unknown, or an entry does not fit its row.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp())
    >>> (book / "ledger").mkdir(), (book / "checks").mkdir()
    (None, None)
    >>> write_rows(book / "ledger" / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> lines = ["def gains(book):", "    book.check('kp', 1.3098)", "SECTIONS = (gains,)"]
    >>> _ = (book / "checks" / "demo.py").write_text(chr(10).join(lines))
    >>> run("demo", book / "ledger")["demo.kp"].value
    1.3098
    """
    return _collect(paper, folder).entries


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
    """Run the checks of a paper and store what they hand over in its ledger.

    Parameters
    ----------
    paper : str
        Key of the paper.
    folder : path, optional
        As in `checks`.

    Returns
    -------
    Update

    Raises
    ------
    LedgerError
        As in `run`; nothing is stored then.

    Examples
    --------
    >>> import tempfile
    >>> book = Path(tempfile.mkdtemp())
    >>> (book / "ledger").mkdir(), (book / "checks").mkdir()
    (None, None)
    >>> write_rows(book / "ledger" / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> lines = ["def gains(book):", "    book.check('kp', 1.3098)", "SECTIONS = (gains,)"]
    >>> _ = (book / "checks" / "demo.py").write_text(chr(10).join(lines))
    >>> update("demo", book / "ledger").changes
    ["demo.kp: computed '' -> '1.309800000'", "demo.kp: verdict '' -> 'reproduced'"]
    """
    book = _collect(paper, folder)
    changes = record(paper, book.entries, folder)
    stored = Ledger.open(paper, folder)
    stored.entries = book.entries
    return Update(changes, stored.problems() + stored.missing())


def record(paper: str, entries: Mapping[str, Entry], folder: Path | str | None = None) -> list[str]:
    """Store entries in a ledger file, and the verdicts that follow from them.

    What still agrees stays as it is, and so does everything that a person wrote: order, basis and declared verdicts. A
    row whose numbers disagree without a declared reason is left without a verdict.

    Parameters
    ----------
    paper : str
        Key of the paper.
    entries : mapping of str to Entry
        What was computed, by full id.
    folder : path, optional
        As in `Ledger.open`.

    Returns
    -------
    list of str
        One line for each entry that changed, old and new.

    Raises
    ------
    LedgerError
        If an id is unknown or a row cannot be read; nothing is written then.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> write_rows(folder / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> for change in record("demo", {"demo.kp": Entry(1.3098)}, folder):
    ...     print(change)
    demo.kp: computed '' -> '1.309800000'
    demo.kp: verdict '' -> 'reproduced'
    """
    book = Ledger.open(paper, folder)
    unknown = [id for id in entries if id not in book.rows]
    if unknown:
        raise LedgerError("\n".join(f"{id}: unknown id" for id in unknown))
    new = {id: updated(row, entries[id]) if id in entries else row for id, row in book.rows.items()}
    changes = [
        f"{id}: {column} {getattr(row, column)!r} -> {getattr(new[id], column)!r}"
        for id, row in book.rows.items()
        for column in ("computed", "evidence", "note", "verdict")
        if getattr(row, column) != getattr(new[id], column)
    ]
    if changes:
        write_rows(book.path, list(new.values()))
    return changes
