"""The ledger of one paper, as its chapter uses it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Self, SupportsFloat, overload

from pidalab.ledger import scores
from pidalab.ledger.conventions import IDENTITY
from pidalab.ledger.digits import DIGITS, plain, read_number
from pidalab.ledger.display import Display
from pidalab.ledger.entries import Entry, drift, merged, unfit, updated
from pidalab.ledger.errors import LedgerError, naming
from pidalab.ledger.files import find_folder, papers, read_rows
from pidalab.ledger.relations import Evidence, Number
from pidalab.ledger.rows import Row
from pidalab.ledger.tables import claims

_REFERENCE = re.compile(r"\b(?:[Ss]ecs?|[Ff]igs?|[Ee]qs?|[Tt]ables?)\.? \d[\d.]*(?:(?:,| and| to) \d[\d.]*)*")
_DECIMAL = re.compile(r"\d\.\d")


class Ledger:
    """The printed numbers and statements of one paper, each waiting for the value its chapter computes.

    An id may be given without the key of the paper: ``ex1.pida.kp`` for ``haalman2024.ex1.pida.kp``.

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
    entries : dict of str to Entry
        What has been handed over so far.

    Examples
    --------
    >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
    >>> book.check("kp", 1.309812345)
    >>> book.check("kq", 1.0)
    Traceback (most recent call last):
    pidalab.ledger.errors.LedgerError: demo.kq: unknown id; the closest are demo.kp
    >>> book.close()
    demo: 1 claim, 1 reproduced
    """

    def __init__(self, path: Path, rows: Sequence[Row]) -> None:
        self.path = path
        self.paper = path.stem
        self.rows = {row.id: row for row in rows}
        self.entries: dict[str, Entry] = {}

    @classmethod
    def open(cls, paper: str, folder: Path | str | None = None) -> Self:
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
        >>> from pidalab.ledger import write_rows
        >>> write_rows(folder / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
        >>> list(Ledger.open("demo", folder).rows)
        ['demo.kp']
        """
        place = Path(folder) if folder is not None else find_folder()
        path = place / f"{paper}.csv"
        if not path.is_file():
            known = ", ".join(papers(place)) or "none"
            raise LedgerError(f"no ledger {path.name} in {place}; there are: {known}")
        return cls(path, read_rows(path))

    @overload
    def check(
        self, claims: str, value: SupportsFloat, *, note: str | None = None, digits: int = DIGITS
    ) -> None: ...
    @overload
    def check(
        self, claims: Mapping[str, SupportsFloat], *, note: str | None = None, digits: int = DIGITS
    ) -> None: ...
    def check(
        self,
        claims: str | Mapping[str, SupportsFloat],
        value: SupportsFloat | None = None,
        *,
        note: str | None = None,
        digits: int = DIGITS,
    ) -> None:
        """Hand over numbers that the chapter computed.

        Parameters
        ----------
        claims : str or mapping of str to float
            An id, or values by id.
        value : float, optional
            The value that belongs to one id.
        note : str, optional
            The note of each of these rows, with numbers of this run.
        digits : int, optional
            Significant digits to keep; fewer than ten need a note that says why, with the word *digits*.

        Raises
        ------
        LedgerError
            Listing every value that is unknown, has drifted, no longer has the verdict of the file, agrees although
            it was declared not to, or was handed over before as something else.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.check("kp", 1.3098)
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.kp: drifted from 1.309812345 to 1.309800000
        >>> book.check({"kp": 1.309812345})
        """
        handed = {claims: value} if isinstance(claims, str) else claims
        failures = []
        for id, claim in handed.items():
            try:
                with naming(self.full(id)):
                    number = float(plain(claim))
            except LedgerError as error:
                failures.append(str(error))
            else:
                failures += self._receive(id, Entry(number, note=note, digits=digits))
        _report(failures)

    def statement(
        self,
        id: str,
        left: Number,
        relation: str,
        right: Number,
        *,
        note: str | None = None,
        left_name: str = "",
        right_name: str = "",
        convention: str | None = None,
        digits: int = DIGITS,
    ) -> None:
        """Hand over the relation that decides a statement; it ``holds`` or ``fails`` by its numbers.

        Parameters
        ----------
        id : str
            Id of a statement.
        left : int or float
            Left side, computed; infinite is allowed where no convention is asked. Integers stay exact.
        relation : str
            One of ``< <= > >= == != within``. ``==`` and ``!=`` are for integers, ``within`` needs a convention. A
            statement about many takes the three from `every` or `some`.
        right : int or float
            Right side, likewise.
        note : str, optional
            The note of the row, with numbers of this run.
        left_name : str, optional
            What the left side is.
        right_name : str, optional
            What the right side is.
        convention : str, optional
            A key of `CONVENTIONS` that says what *similar*, *clearly* or *much* mean.
        digits : int, optional
            As in `check`.

        Raises
        ------
        LedgerError
            If a side is no number, the relation is not for such numbers, and as in `check`.

        Examples
        --------
        >>> row = Row("demo.s", "sec. 3", "statement", "A is faster", "holds", "holds", evidence="1 < 2")
        >>> book = Ledger(Path("demo.csv"), [row])
        >>> book.statement("s", 1, "<", 3)
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.s: drifted from 1 < 2 to 1 < 3
        """
        with naming(self.full(id)):
            evidence = Evidence.of(
                left, relation, right, names=(left_name, right_name), convention=convention, digits=digits
            )
        _report(self._receive(id, Entry(evidence=evidence, note=note, digits=digits)))

    def identity(
        self, id: str, residual: float, tolerance: float = IDENTITY, *, note: str | None = None
    ) -> None:
        """Hand over the largest residual of two formulas that a statement calls the same.

        Only the decade of the residual is kept, and compared as still below the tolerance: rounding differs from
        machine to machine.

        Parameters
        ----------
        id : str
            Id of a statement.
        residual : float
            Largest relative deviation.
        tolerance : float, optional
            What it has to stay below; more than 1e-9 needs a note that says why.
        note : str, optional
            The note of the row, with numbers of this run.

        Raises
        ------
        LedgerError
            If a number is negative or not finite, and as in `check`.

        Examples
        --------
        >>> kept = "1e-15 <= 1e-09 | rounding"
        >>> row = Row("demo.s", "eq. (7)", "statement", "(7) is (3)", "holds", "holds", evidence=kept)
        >>> Ledger(Path("demo.csv"), [row]).identity("s", 3.1e-16)
        """
        with naming(self.full(id)):
            evidence = Evidence.identity(residual, tolerance)
            if tolerance > IDENTITY and not note:
                raise LedgerError(
                    f"a tolerance of {tolerance:g}, above {IDENTITY:g}, needs a note that says why"
                )
        _report(self._receive(id, Entry(evidence=evidence, note=note)))

    def note(self, id: str, text: str) -> None:
        """Hand over the note of a row, with numbers of this run; a row settled by reading hands over nothing else.

        Parameters
        ----------
        id : str
            Id of a row.
        text : str
            One line of plain text.

        Raises
        ------
        LedgerError
            If the note has drifted.

        Examples
        --------
        >>> row = Row("demo.s", "sec. 1", "statement", "the oldest", "", "not-computable", "reading", note="A survey.")
        >>> Ledger(Path("demo.csv"), [row]).note("s", "A survey.")
        """
        _report(self._receive(id, Entry(note=text)))

    def full(self, id: str) -> str:
        """Return an id with the key of the paper.

        Parameters
        ----------
        id : str
            With or without the key.

        Returns
        -------
        str

        Examples
        --------
        >>> Ledger(Path("demo.csv"), []).full("ex1.kp")
        'demo.ex1.kp'
        """
        return id if id.startswith(f"{self.paper}.") else f"{self.paper}.{id}"

    def row(self, id: str) -> Row:
        """Return a row, to read what is printed and how precisely.

        Parameters
        ----------
        id : str
            Id of a row.

        Returns
        -------
        Row

        Raises
        ------
        LedgerError
            For an unknown id.

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")]).row("kp").half_unit
        0.005
        """
        full = self.full(id)
        if full not in self.rows:
            closest = get_close_matches(full, self.rows, n=3)
            raise LedgerError(
                f"{full}: unknown id" + (f"; the closest are {', '.join(closest)}" if closest else "")
            )
        return self.rows[full]

    def printed(self, id: str) -> float:
        """Return a printed number, for computations that start from what the paper prints.

        Parameters
        ----------
        id : str
            Id of a row with a number.

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
        row = self.row(id)
        with naming(row.id):
            return float(read_number(row.printed))

    def _receive(self, id: str, entry: Entry) -> list[str]:
        try:
            row = self.row(id)
            if failure := unfit(row, entry):
                return [failure]
            joined = merged(row, self.entries[row.id], entry) if row.id in self.entries else entry
            failures = self._judge(row, entry)
        except LedgerError as error:
            return [str(error)]
        if not failures:  # what was refused may be corrected and handed over again
            self.entries[row.id] = joined
        return failures

    def _judge(self, row: Row, entry: Entry) -> list[str]:
        """Compare an entry with its row; what is stored decides the verdict, so that noise never flips one."""
        if not entry.is_note and not row.computed:
            return [f"{row.id}: nothing stored yet; `python -m pidalab.ledger update {self.paper}` stores it"]
        failures = drift(row, entry)
        fresh = updated(row, entry) if failures else row
        disagreement = None if entry.is_note else replace(fresh, verdict=row.verdict).disagreement()
        return [*failures, disagreement] if disagreement else failures

    def missing(self) -> list[str]:
        """List what was never handed over: values of all rows but those settled by reading, and notes beside values.

        Returns
        -------
        list of str
            One line for each.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.missing()
        ['demo.kp: never handed over']
        >>> book.check("kp", 1.309812345)
        >>> book.missing()
        []
        """
        found = []
        for id, row in self.rows.items():
            entry = self.entries.get(id, Entry())
            if row.basis != "reading" and entry.is_note:
                found.append(f"{id}: never handed over")
            elif entry.note is None and _needs_a_run(row):
                found.append(
                    f"{id}: its note has numbers of no run; hand it over with the value, or by book.note"
                )
        return found

    def close(self) -> None:
        """End the chapter: every row must have been handed over. Prints the score.

        Raises
        ------
        LedgerError
            Listing the ids that were not.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.check("kp", 1.309812345)
        >>> book.close()
        demo: 1 claim, 1 reproduced
        """
        if missing := self.missing():
            raise LedgerError("\n".join(missing))
        print(scores.score_line(self.paper, self.score()))

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
        """Count the rows, by verdict where the paper's problem decides, apart where print or reading does.

        Returns
        -------
        dict of str to int
            Every key of `scores.KINDS` in its order; ``open`` last, if some rows have no verdict yet.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")])
        >>> {kind: count for kind, count in book.score().items() if count}
        {'open': 1}
        """
        return scores.score(self.rows.values())

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
        return scores.scorebar(self.paper, self.score())

    def table(self, prefix: str = "") -> Display:
        """Return rows as a table, printed beside computed.

        Parameters
        ----------
        prefix : str, optional
            What the ids start with, the key of the paper apart; by default the table has all rows.

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
        verdict     claim                    printed  computed  difference
        reproduced  demo.kp: gain (Table 1)  1.31     1.3098    -0.0
        """
        rows = [row for id, row in self.rows.items() if id.startswith((prefix, f"{self.paper}.{prefix}"))]
        if not rows:
            raise LedgerError(f"{self.paper}: no id starts with {prefix}")
        return claims(rows)


def _needs_a_run(row: Row) -> bool:
    """Whether the note of a row has to be handed over: beside a value always, else if it has a decimal number."""
    return bool(row.note if row.basis != "reading" else _DECIMAL.search(_REFERENCE.sub("", row.note)))


def _report(failures: Sequence[str]) -> None:
    if failures:
        raise LedgerError("\n".join(failures))
