"""The frozen list of claims: nothing is retyped, shortened, dropped or padded without a second, reviewed change."""

import csv
import io
from pathlib import Path

from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import MANIFEST, find_folder, papers, read_rows
from pidalab.ledger.verdicts import DECLARED

COLUMNS = ("id", "printed", "kind", "basis", "declared")


def claims(folder: Path | str | None = None) -> list[tuple[str, ...]]:
    """List what every row of a folder claims.

    Parameters
    ----------
    folder : path, optional
        Folder of the csv files; by default as in `Ledger.open`.

    Returns
    -------
    list of tuple of str
        Id, printed, ``number`` or ``statement``, basis, and the verdict if a person declared it.

    Examples
    --------
    >>> import tempfile
    >>> claims(tempfile.mkdtemp())
    []
    """
    place = Path(folder) if folder is not None else find_folder()
    return [
        (
            row.id,
            row.printed,
            "statement" if row.is_statement else "number",
            row.basis,
            row.verdict if row.verdict in DECLARED else "",
        )
        for paper in papers(place)
        for row in read_rows(place / f"{paper}.csv")
    ]


def differences(folder: Path | str | None = None) -> list[str]:
    """List where the ledgers are not what the manifest froze, one line each.

    Parameters
    ----------
    folder : path, optional
        As in `claims`.

    Returns
    -------
    list of str

    Raises
    ------
    LedgerError
        If there is no manifest, or it has other columns.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.mkdtemp()
    >>> freeze(folder)
    True
    >>> differences(folder)
    []
    """
    place = Path(folder) if folder is not None else find_folder()
    path = place / MANIFEST
    if not path.is_file():
        raise LedgerError(f"no {MANIFEST} in {place}; `python -m pidalab.ledger manifest` writes it")
    with path.open(encoding="utf-8", newline="") as file:
        header, *lines = [*csv.reader(file, strict=True)] or [[]]
    if tuple(header) != COLUMNS:
        raise LedgerError(f"{MANIFEST}: expected the columns {', '.join(COLUMNS)}, found {', '.join(header)}")
    frozen = {line[0]: line[1:] for line in lines}
    current = {claim[0]: [*claim[1:]] for claim in claims(place)}
    found = [f"{id}: is gone" for id in frozen if id not in current]
    found += [f"{id}: is new" for id in current if id not in frozen]
    found += [
        f"{id}: {column} {old!r} -> {new!r}"
        for id in frozen
        if id in current
        for column, old, new in zip(COLUMNS[1:], frozen[id], current[id], strict=True)
        if old != new
    ]
    return found


def freeze(folder: Path | str | None = None) -> bool:
    """Write the manifest; whoever reviews the change sees every claim that changed.

    Parameters
    ----------
    folder : path, optional
        As in `claims`.

    Returns
    -------
    bool
        Whether the file changed.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.mkdtemp()
    >>> freeze(folder), freeze(folder)
    (True, False)
    """
    place = Path(folder) if folder is not None else find_folder()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(claims(place))
    path = place / MANIFEST
    if path.is_file() and path.read_text(encoding="utf-8") == text.getvalue():
        return False
    path.write_text(text.getvalue(), encoding="utf-8", newline="")
    return True
