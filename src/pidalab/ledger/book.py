"""The ledger of one paper, as its pages use it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from pidalab.ledger import scores
from pidalab.ledger.digits import DIGITS, agrees, exponent, plain, read_number, store
from pidalab.ledger.display import Display
from pidalab.ledger.errors import LedgerError, naming
from pidalab.ledger.files import find_folder, papers, read_removed, read_rows
from pidalab.ledger.relations import Cases, Evidence, Relation
from pidalab.ledger.rows import Row
from pidalab.ledger.shims import OldCalls
from pidalab.ledger.tables import claims
from pidalab.ledger.verdicts import DECLARED

if TYPE_CHECKING:
    import pandas as pd

MARKS = {"last-digit": " °", "approximate": " ~", "differs": " †", "misprint": " *", "as-read": " *"}


class Ledger(OldCalls):
    """The printed numbers and statements of one paper, each waiting for what a page computes.

    An id may be given without the key of the paper: ``ex1.pida.kp`` for ``haalman2024.ex1.pida.kp``.

    Parameters
    ----------
    path : pathlib.Path
        The csv file; its stem is the key of the paper.
    rows : sequence of Row
        The rows of the file; see `Ledger.open`.
    page : str, optional
        The notebook that uses it; by default the chapter, which is called like the paper.

    Attributes
    ----------
    paper : str
        Key of the paper, the first part of every id.
    rows : dict of str to Row
        By id, in the order of the file.
    fresh : dict of str to Row
        What has been handed over so far, as rows.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
    >>> book = Ledger(Path("demo.csv"), [row])
    >>> book.compare({"kp": 1.309812345})
    printed / computed             kp
    demo                1.31 / 1.3098
    >>> book.compare({"kq": 1.0})
    Traceback (most recent call last):
    pidalab.ledger.errors.LedgerError: demo.kq: unknown id; the closest are demo.kp
    >>> book.close()
    demo: 1 claim, 1 reproduced
    """

    _recorded: ClassVar[list["Ledger"] | None] = None

    def __init__(self, path: Path, rows: Sequence[Row], page: str | None = None) -> None:
        self.path = path
        self.paper = path.stem
        self.page = page or self.paper
        self.rows = {row.id: row for row in rows}
        self.fresh: dict[str, Row] = {}
        self.closed = False
        self.records = Ledger._recorded is not None
        if Ledger._recorded is not None:
            Ledger._recorded.append(self)

    @classmethod
    def open(cls, paper: str, page: str | None = None, folder: Path | str | None = None) -> Self:
        """Open the ledger of a paper.

        Parameters
        ----------
        paper : str
            Key of the paper, such as ``haalman2024``.
        page : str, optional
            The notebook that opens it, its path below ``book`` without suffix, such as ``audit/haalman2024``; by
            default the chapter, which is called like the paper. `close` asks for the rows of this page.
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
        >>> list(Ledger.open("demo", folder=folder).rows)
        ['demo.kp']
        """
        place = Path(folder) if folder is not None else find_folder()
        path = place / f"{paper}.csv"
        if not path.is_file():
            known = ", ".join(papers(place)) or "none"
            raise LedgerError(f"no ledger {path.name} in {place}; there are: {known}")
        return cls(path, read_rows(path), page)

    def compare(self, values: Mapping[str, Any], digits: int = DIGITS) -> "pd.DataFrame":
        """Compare numbers of this run with the printed ones.

        Parameters
        ----------
        values : mapping
            Numbers nested by the parts of their ids, ``{"ex1.pida": {"ti": 4.1, "td": 1.2}}``, or by whole ids.
        digits : int, optional
            Significant digits that are determined; fewer than ten need a note that says why, with the word *digits*.

        Returns
        -------
        pandas.DataFrame
            ``printed / computed``, a row for each group and a column for each last part. Marks: ``°`` one unit off in
            the last place, ``~`` within the tolerance of the note, ``*`` misprint or as read, ``†`` differs.

        Raises
        ------
        LedgerError
            Listing every value that is unknown or no finite number, has drifted from the stored one, no longer has the
            verdict of the file, or agrees although it was declared not to.

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> book = Ledger(Path("demo.csv"), [row])
        >>> book.compare({"demo": {"kp": 1.3151}})
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.kp: drifted from 1.309812345 to 1.315100000
        demo.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit
        """
        import pandas as pd

        failures: list[str] = []
        table: dict[str, dict[str, str]] = {}
        for id, value in _flat(values):
            try:
                row, found = self._number(id, value, digits)
            except LedgerError as error:
                failures.append(str(error))
                continue
            failures += found
            group, _, key = id.rpartition(".")
            verdict = row.verdict if row.verdict in DECLARED else row.derived() or "differs"
            shown = f"{row.printed} / {row.shown()}{MARKS.get(verdict, '')}"
            table.setdefault(group or self.paper, {})[key] = shown
        if failures:
            raise LedgerError("\n".join(failures))
        frame = pd.DataFrame.from_dict(table, orient="index").fillna("")
        return frame.rename_axis(columns="printed / computed")

    def decide(self, id: str, cases: Cases, digits: int = DIGITS) -> str:
        """Decide a statement by numbers of this run; its row says what is compared, and how.

        Parameters
        ----------
        id : str
            Id of a statement.
        cases : mapping of any to pair of numbers, or pair of numbers, or number
            Left and right side by case, of which the worst decides (the best, where the relation says *some*); or both
            sides of the only case; or a residual, of an identity. ``==`` and ``!=`` take integers.
        digits : int, optional
            As in `compare`.

        Returns
        -------
        str
            The verdict and what decided it.

        Raises
        ------
        LedgerError
            If a side is no number of the kind that the relation compares, and as in `compare`.

        Examples
        --------
        >>> row = Row("demo.s", "sec. 3", "statement", "A is faster", "holds", "holds", page="demo")
        >>> row = replace(row, relation="first < second", evidence="1 < 2")
        >>> book = Ledger(Path("demo.csv"), [row])
        >>> book.decide("s", (1, 2))
        'holds: 1 < 2'
        >>> book.decide("s", (1, 3))
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.s: drifted from 1 < 2 to 1 < 3
        """
        row = self.row(id)
        with naming(row.id):
            if not row.is_statement or row.basis == "reading":
                raise LedgerError("no statement that is computed; a printed number takes book.compare")
            if not row.relation:
                raise LedgerError("its row has no relation, such as 'IAE of A < IAE of B | clearly'")
            relation = Relation.parse(row.relation)
            found = relation.decide(cases, digits)
            _enough(row, digits)
        fresh = replace(row, computed=found.verdict, evidence=str(found))
        kept, failures = self._take(row, fresh)
        if failures:
            raise LedgerError("\n".join(failures))
        decided = Evidence.parse(kept.evidence)
        if relation.is_identity and decided.verdict == "holds":  # its decade depends on the machine
            return f"holds: largest residual ≤ {relation.right}"
        return f"{decided.verdict}: {decided.shown()}" + (f" ({decided.remark})" if decided.remark else "")

    def _number(self, id: str, value: object, digits: int) -> tuple[Row, list[str]]:
        row = self.row(id)
        with naming(row.id):
            number = float(plain(value))
            if row.basis == "reading":
                raise LedgerError("its basis is reading, but something computed was handed over")
            if row.is_statement:
                raise LedgerError("a statement takes book.decide, both sides of its relation")
            if not isfinite(number):
                raise LedgerError(f"expected a finite number, found {number}")
            _enough(row, digits)
            fresh = replace(row, computed=store(number, row.printed, digits))
        return self._take(row, fresh)

    def _take(self, row: Row, fresh: Row) -> tuple[Row, list[str]]:
        """Note down what was handed over; return the row to show, and what is wrong with it."""
        with naming(row.id):
            before = self.fresh.get(row.id) if self.records else None  # else a drift is said
            if before and not same(before, fresh):
                raise LedgerError(f"handed over twice, as {before.found} and as {fresh.found}")
            agreeing = bool(row.computed) and same(row, fresh)
        failures = [] if self.records else self._failures(row, row if agreeing else fresh)
        if not failures:  # what was refused may be corrected and handed over again
            self.fresh[row.id] = fresh
        return (row if agreeing else fresh), failures

    def _failures(self, row: Row, fresh: Row) -> list[str]:
        """Compare with the file; what is stored decides the verdict, so that noise never flips one."""
        if not row.computed:
            return [f"{row.id}: nothing stored yet; `python -m pidalab.ledger update {self.paper}` stores it"]
        drifted = [] if fresh is row else [f"{row.id}: drifted from {row.found} to {fresh.found}"]
        disagreement = fresh.disagreement()
        return [*drifted, disagreement] if disagreement else drifted

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

    def owed(self) -> list[Row]:
        """Return the rows that this page has to hand over.

        Returns
        -------
        list of Row

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> [row.id for row in Ledger(Path("demo.csv"), [row]).owed()]
        ['demo.kp']
        """
        return [row for row in self.rows.values() if row.basis != "reading" and row.page == self.page]

    def close(self) -> None:
        """End a page: every row of this page must have been handed over. Prints their score.

        Raises
        ------
        LedgerError
            Listing the ids that were not.

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> Ledger(Path("demo.csv"), [row]).close()
        Traceback (most recent call last):
        pidalab.ledger.errors.LedgerError: demo.kp: never handed over
        """
        missing = [f"{row.id}: never handed over" for row in self.owed() if row.id not in self.fresh]
        if missing and not self.records:
            raise LedgerError("\n".join(missing))
        self.closed = True
        print(scores.score_line(self.page, scores.score(self.owed())))

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
        removed = read_removed(self.path.parent)
        found = [
            f"{id}: does not start with {self.paper}."
            for id in self.rows
            if not id.startswith(f"{self.paper}.")
        ]
        found += [f"{id}: was removed, and an id is never used again" for id in self.rows if id in removed]
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
        """Return the score of the paper as a bar with a legend.

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
        """Return rows of the file as a table, printed beside computed.

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


@contextmanager
def recording() -> Iterator[list[Ledger]]:
    """Let every ledger that is opened take what it is given, compared with nothing; yields these ledgers.

    Examples
    --------
    >>> with recording() as books:
    ...     book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
    ...     _ = book.compare({"kp": 1.5})
    >>> books[0].fresh["demo.kp"].computed
    '1.500000000'
    """
    Ledger._recorded = []
    try:
        yield Ledger._recorded
    finally:
        Ledger._recorded = None


def same(row: Row, fresh: Row) -> bool:
    """Tell whether a fresh row says what another one says, to one unit in its last stored place.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
    >>> same(row, replace(row, computed="1.309812346")), same(row, replace(row, computed="1.3099"))
    (True, False)
    """
    if not row.is_statement:
        return row.is_number and agrees(float(fresh.computed), row.computed)
    if not row.evidence:
        return False
    old, new = Evidence.parse(row.evidence), Evidence.parse(fresh.evidence)
    if Relation.parse(row.relation).is_identity and old.verdict == new.verdict == "holds":
        return old.right == new.right
    return old.same(new)


def updated(row: Row, fresh: Row) -> Row:
    """Return the row with what is new in a fresh one, and the verdict that follows.

    What still agrees stays as it is, so that a second run on another machine changes nothing. A declared verdict
    stays; a number that agrees no longer, without a declared reason, is left without a verdict.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31")
    >>> updated(row, replace(row, computed="1.309800000")).verdict
    'reproduced'
    """
    with naming(row.id):
        keep = bool(row.computed) and same(row, fresh) and (row.is_statement or _precise(row, fresh))
        new = replace(row, page=fresh.page) if keep else fresh
        return new if row.verdict in DECLARED else replace(new, verdict=new.derived() or "")


def _precise(row: Row, fresh: Row) -> bool:
    """Whether a stored number has as many places as a fresh one."""
    old, new = read_number(row.computed), read_number(fresh.computed)
    return exponent(old) == exponent(new) or not new


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Walk nested numbers by their ids."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _enough(row: Row, digits: int) -> None:
    if digits < DIGITS and "digits" not in row.note:
        raise LedgerError(f"kept to {digits} digits; the note has to say why, with the word 'digits'")
