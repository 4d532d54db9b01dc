"""The ledger of one paper, as its chapter uses it, and the one function that writes to it."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from difflib import get_close_matches
from pathlib import Path
from typing import SupportsFloat, overload

import numpy as np

from pidalab.ledger import display, verdicts
from pidalab.ledger.digits import DIGITS, agrees, read_number, store
from pidalab.ledger.display import Display
from pidalab.ledger.errors import LedgerError, naming
from pidalab.ledger.rows import Row, find_folder, read_rows, write_rows

Value = float | bool


class Ledger:
    """The printed numbers and statements of one paper, each waiting for the value its chapter computes.

    Parameters
    ----------
    path : pathlib.Path
        The csv file; its stem is the key of the paper.
    rows : sequence of Row
        The rows of the file; see `Ledger.open`.

    Attributes
    ----------
    paper : str
        Key of the paper, the first part of every id.
    rows : dict of str to Row
        By id, in the order of the file.
    values : dict of str to float or bool
        What has been handed over so far.

    Examples
    --------
    >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
    >>> book.check("demo.kp", 1.309812345)
    >>> book.check("demo.kq", 1.0)
    Traceback (most recent call last):
    pidalab.ledger.errors.LedgerError: demo.kq: unknown id; the closest are demo.kp
    >>> book.close()
    demo: 1 claim, 1 reproduced
    """

    def __init__(self, path: Path, rows: Sequence[Row]) -> None:
        self.path = path
        self.paper = path.stem
        self.rows = {row.id: row for row in rows}
        self.values: dict[str, Value] = {}

    @classmethod
    def open(cls, paper: str, folder: Path | str | None = None) -> "Ledger":
        """Open the ledger of a paper.

        Parameters
        ----------
        paper : str
            Key of the paper, such as ``haalman2024``.
        folder : path, optional
            Folder of the csv files; by default ``book/ledger``, searched upward from the current directory.

        Returns
        -------
        Ledger

        Raises
        ------
        LedgerError
            If the file is missing or is no table.

        Examples
        --------
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> write_rows(folder / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
        >>> list(Ledger.open("demo", folder).rows)
        ['demo.kp']
        """
        place = Path(folder) if folder is not None else find_folder()
        path = place / f"{paper}.csv"
        if not path.is_file():
            known = ", ".join(sorted(file.stem for file in place.glob("*.csv"))) or "none"
            raise LedgerError(f"no ledger {path.name} in {place}; there are: {known}")
        return cls(path, read_rows(path))

    @overload
    def check(self, claims: str, value: Value) -> None: ...
    @overload
    def check(self, claims: Mapping[str, Value]) -> None: ...
    def check(self, claims: str | Mapping[str, Value], value: Value | None = None) -> None:
        """Hand over what the chapter computed.

        Parameters
        ----------
        claims : str or mapping of str to float or bool
            An id, or values by id.
        value : float or bool, optional
            The value that belongs to one id: a number, or for a statement whether it holds.

        Raises
        ------
        LedgerError
            Listing every value that is unknown, has drifted, no longer has the verdict of the file, agrees although
            it was declared not to, or was handed over before as something else.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.check("demo.kp", 1.3098)
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.kp: drifted from 1.309812345 to 1.309800000
        >>> book.check({"demo.kp": 1.309812345})
        """
        handed = {claims: value} if isinstance(claims, str) else claims
        failures = [failure for id, claim in handed.items() for failure in self._receive(id, claim)]
        if failures:
            raise LedgerError("\n".join(failures))

    def _receive(self, id: str, claim: object) -> list[str]:
        if id not in self.rows:
            closest = get_close_matches(id, self.rows, n=3)
            return [f"{id}: unknown id" + (f"; the closest are {', '.join(closest)}" if closest else "")]
        row = self.rows[id]
        if row.verdict == "not-computable":
            return [f"{id}: declared not-computable, but {claim!r} was handed over"]
        try:
            with naming(id):
                value = _plain(claim)
                before = self.values.get(id)
                if before is not None and not _same(value, _entry(before, row.printed, _digits(row))):
                    return [f"{id}: handed over twice, as {before!r} and as {value!r}"]
                failures = self._judge(row, value)
        except LedgerError as error:
            return [str(error)]
        if not failures:  # a refused value may be corrected and handed over again
            self.values[id] = value
        return failures

    def _judge(self, row: Row, value: Value) -> list[str]:
        """Compare a value with its row; the stored value decides the verdict, so that noise never flips one."""
        if not row.computed:
            return [f"{row.id}: nothing stored yet, `python -m pidalab.ledger update` on the notebook stores {value!r}"]
        if _same(value, row.computed):
            failures = [row.disagreement()]
        else:
            fresh = replace(row, computed=_entry(value, row.printed))
            failures = [f"{row.id}: drifted from {row.computed} to {fresh.computed}", fresh.disagreement()]
        return [failure for failure in failures if failure]

    def printed(self, id: str) -> float:
        """Return a printed number, for computations that start from what the paper prints.

        Parameters
        ----------
        id : str
            Id of a row with a number; the key of the paper may be left out.

        Returns
        -------
        float

        Raises
        ------
        LedgerError
            For an unknown id, or a statement.

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")]).printed("kp")
        1.31
        """
        full = id if id in self.rows else f"{self.paper}.{id}"
        if full not in self.rows:
            raise LedgerError(f"{id}: unknown id; the closest are {', '.join(get_close_matches(full, self.rows, n=3))}")
        with naming(full):
            return float(read_number(self.rows[full].printed))

    def missing(self) -> list[str]:
        """List the ids that were never handed over, not-computable ones excepted.

        Returns
        -------
        list of str

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.missing()
        ['demo.kp']
        >>> book.check("demo.kp", 1.309812345)
        >>> book.missing()
        []
        """
        return [id for id, row in self.rows.items() if row.verdict != "not-computable" and id not in self.values]

    def close(self) -> None:
        """End the chapter: every row must have been handed over. Prints the score.

        Raises
        ------
        LedgerError
            Listing the ids that were not.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.check("demo.kp", 1.309812345)
        >>> book.close()
        demo: 1 claim, 1 reproduced
        """
        if missing := self.missing():
            raise LedgerError("\n".join(f"{id}: never handed over" for id in missing))
        print(display.score_line(self.paper, self.score()))

    def problems(self) -> list[str]:
        """List what is wrong with the file taken alone, one line each.

        Returns
        -------
        list of str

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("other.kp", "Table 1", "gain", "1.31")]).problems()
        ['other.kp: does not start with demo.', "other.kp: 'computed' is empty"]
        """
        foreign = [id for id in self.rows if not id.startswith(f"{self.paper}.")]
        found = [f"{id}: does not start with {self.paper}." for id in foreign]
        return found + [problem for row in self.rows.values() for problem in row.problems()]

    def score(self) -> dict[str, int]:
        """Count the rows by verdict.

        Returns
        -------
        dict of str to int
            Every verdict in the order of `VERDICTS`; ``open`` last, if some rows have none yet.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")])
        >>> {verdict: count for verdict, count in book.score().items() if count}
        {'open': 1}
        """
        counts = Counter(row.verdict or "open" for row in self.rows.values())
        return {**dict.fromkeys(verdicts.VERDICTS, 0), **counts}

    def scorebar(self) -> Display:
        """Return the score as a bar with a legend.

        Returns
        -------
        Display

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.scorebar()
        demo: 1 claim, 1 reproduced
        """
        return display.scorebar(self.paper, self.score())

    def table(self, prefix: str = "") -> Display:
        """Return rows as a table, printed beside computed.

        Parameters
        ----------
        prefix : str, optional
            What the ids start with; by default the table has all rows.

        Returns
        -------
        Display

        Raises
        ------
        LedgerError
            If no id starts with `prefix`.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.table()
        claim                    printed  computed  difference  verdict
        demo.kp: gain (Table 1)  1.31     1.3098    -0.0        reproduced
        """
        rows = [row for id, row in self.rows.items() if id.startswith(prefix)]
        if not rows:
            raise LedgerError(f"{self.paper}: no id starts with {prefix}")
        return display.claims(rows)


def record(paper: str, values: Mapping[str, Value], folder: Path | str | None = None) -> list[str]:
    """Store computed values in a ledger file, and the verdicts that follow from them.

    Stored values that still agree stay as they are, and so does everything that a person wrote: order, notes and
    declared verdicts. A row whose numbers disagree without a declared reason is left without a verdict. A stored
    value with fewer digits keeps their number.

    Parameters
    ----------
    paper : str
        Key of the paper.
    values : mapping of str to float or bool
        Computed values by id.
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
    >>> for change in record("demo", {"demo.kp": 1.3098}, folder):
    ...     print(change)
    demo.kp: computed '' -> '1.309800000'
    demo.kp: verdict '' -> 'reproduced'
    """
    book = Ledger.open(paper, folder)
    unknown = [id for id in values if id not in book.rows]
    if unknown:
        raise LedgerError("\n".join(f"{id}: unknown id" for id in unknown))
    new = {id: _updated(row, values[id]) if id in values else row for id, row in book.rows.items()}
    changes = [
        f"{id}: {column} {getattr(row, column)!r} -> {getattr(new[id], column)!r}"
        for id, row in book.rows.items()
        for column in ("computed", "verdict")
        if getattr(row, column) != getattr(new[id], column)
    ]
    if changes:
        write_rows(book.path, list(new.values()))
    return changes


def _updated(row: Row, claim: Value) -> Row:
    with naming(row.id):
        value = _plain(claim)
        keep = row.computed and _same(value, row.computed)
        fresh = row if keep else replace(row, computed=_entry(value, row.printed, _digits(row)))
    return fresh if row.verdict in verdicts.DECLARED else replace(fresh, verdict=fresh.derived() or "")


def _plain(claim: object) -> Value:
    """Turn what a chapter hands over, often a NumPy scalar, into a bool or a finite float."""
    scalar = claim.item() if isinstance(claim, (np.generic, np.ndarray)) and claim.ndim == 0 else claim
    if isinstance(scalar, bool):
        return scalar
    if isinstance(scalar, SupportsFloat) and not isinstance(scalar, np.ndarray) and math.isfinite(float(scalar)):
        return float(scalar)
    raise LedgerError(f"expected a finite number or a truth value, found {claim!r}")


def _entry(value: Value, printed: str, digits: int = DIGITS) -> str:
    if isinstance(value, bool):
        return "holds" if value else "fails"
    return store(value, printed, digits)


def _digits(row: Row) -> int:
    """Significant digits to store in a row: a number stored with fewer was shortened on purpose; a zero has none."""
    stored = read_number(row.computed) if row.is_number else Decimal(0)
    return len(stored.as_tuple().digits) if stored else DIGITS


def _same(value: Value, stored: str) -> bool:
    statement = stored in verdicts.STATEMENT
    if isinstance(value, bool) is not statement:
        kind = "truth value" if statement else "number"
        raise LedgerError(f"expected a {kind} as stored, {stored}, found {value!r}")
    return value is (stored == "holds") if statement else agrees(value, stored)
