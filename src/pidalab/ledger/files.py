"""The files that hold the rows: ``book/ledger/<paper>.csv``."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

from pidalab.ledger.errors import LedgerError
from pidalab.ledger.rows import Row

FOLDER = Path("book", "ledger")
MANIFEST = "manifest.csv"  # the frozen list of claims, beside the ledgers
REMOVED = "removed.csv"  # ids that are never used again, and why
COLUMNS = tuple(field.name for field in fields(Row))


def find_folder() -> Path:
    """Search for ``book/ledger`` in the current directory and above it.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    LedgerError
        If there is none.
    """
    here = Path.cwd()
    for parent in (here, *here.parents):
        if (parent / FOLDER).is_dir():
            return parent / FOLDER
    raise LedgerError(
        f"no folder {FOLDER.as_posix()} in {here} or above it; the ledgers come with a clone of the book, not with the "
        "installed library"
    )


def papers(folder: Path) -> list[str]:
    """List the papers that have a ledger in a folder.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the csv files.

    Returns
    -------
    list of str
        Keys in alphabetical order.

    Examples
    --------
    >>> import tempfile
    >>> papers(Path(tempfile.mkdtemp()))
    []
    """
    return sorted(file.stem for file in folder.glob("*.csv") if file.name not in (MANIFEST, REMOVED))


def read_removed(folder: Path) -> dict[str, str]:
    """Read which ids were removed, and why.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the csv files; without ``removed.csv`` nothing was.

    Returns
    -------
    dict of str to str
        Reasons by id.

    Raises
    ------
    LedgerError
        If a line has no reason, or the columns are others than ``id,reason``.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "removed.csv").write_text("id,reason\\ndemo.kp,an identity of our own algebra\\n")
    >>> read_removed(folder)
    {'demo.kp': 'an identity of our own algebra'}
    """
    path = folder / REMOVED
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        header, *lines = [*csv.reader(file, strict=True)] or [[]]
    if header != ["id", "reason"] or any(len(line) != 2 or not line[1].strip() for line in lines):
        raise LedgerError(
            f"{REMOVED}: expected an id and a reason in every line, under the heading id,reason"
        )
    return dict(line for line in lines)


def read_rows(path: Path) -> list[Row]:
    """Read a ledger file.

    Parameters
    ----------
    path : pathlib.Path
        The csv file.

    Returns
    -------
    list of Row
        In the order of the file.

    Raises
    ------
    LedgerError
        If the columns are others than those of `Row`, a line is incomplete or an id occurs twice.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "demo.csv")
    >>> write_rows(path, [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> [row.printed for row in read_rows(path)]
    ['1.31']
    """
    with path.open(encoding="utf-8", newline="") as file:
        try:
            header, *lines = [*csv.reader(file, strict=True)] or [[]]
        except csv.Error as error:
            raise LedgerError(f"{path.name}: {error}") from None
    if tuple(header) != COLUMNS:
        raise LedgerError(
            f"{path.name}: expected the columns {', '.join(COLUMNS)}, found {', '.join(header)}"
        )
    for line in lines:
        if len(line) != len(COLUMNS):
            raise LedgerError(
                f"{path.name}: expected {len(COLUMNS)} entries, found {len(line)} in {','.join(line)!r}"
            )
        if any(
            "\n" in entry or "\r" in entry for entry in line
        ):  # one row is one line, so that a diff reads well
            raise LedgerError(f"{path.name}: line break inside an entry of {line[0]}")
    twice = [id for id, count in Counter(line[0] for line in lines).items() if count > 1]
    if twice:
        raise LedgerError(f"{path.name}: more than one row for {', '.join(twice)}")
    return [Row(*line) for line in lines]


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write a ledger file: UTF-8, quotes only where needed, one line feed after each row.

    Parameters
    ----------
    path : pathlib.Path
        The csv file.
    rows : sequence of Row
        In the order to keep.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "demo.csv")
    >>> write_rows(path, [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> print(path.read_text(encoding="utf-8"), end="")
    id,where,quantity,printed,computed,verdict,basis,page,relation,evidence,note
    demo.kp,Table 1,gain,1.31,,,computed,,,,
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(astuple(row) for row in rows)
    path.write_text(text.getvalue(), encoding="utf-8", newline="")
