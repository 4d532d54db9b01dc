"""Define `Ledger`, with which the notebooks on a paper compare its printed results with computed ones."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from paperledger import display
from paperledger.display import Display
from paperledger.rows import Row, find_folder, naming, papers, read_rows, removed
from paperledger.verdicts import DECLARED, DIGITS, Cases, Evidence, LedgerError, Relation, read_number

if TYPE_CHECKING:
    import pandas as pd

MARKS = {"last-digit": "°", "approximate": "~", "differs": "†", "misprint": "*", "as-read": "*"}


class Ledger:
    """Printed numbers and statements of one paper, to be compared with computed ones.

    The key of the paper may be omitted in an id: ``ex1.pida.kp`` for ``haalman2024.ex1.pida.kp``.

    Parameters
    ----------
    path : pathlib.Path
        The csv file, whose stem is the key of the paper.
    rows : sequence of Row
        The rows of the file.
    page : str, optional
        The notebook that uses the ledger, by default the chapter, which is named after the paper.
    words : mapping of str to str, optional
        The paper's notation, as in `open`. It labels the table that `compare` returns.

    Attributes
    ----------
    paper : str
        Key of the paper, the first part of every id.
    rows : dict of str to Row
        Rows by id, in the order of the file.
    fresh : dict of str to Row
        Rows for which the page has passed a value so far, with the new values.
    refused : list of str
        The errors so far. `close` raises them again, so a page cannot suppress them.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
    >>> book = Ledger(Path("demo.csv"), [row])
    >>> book.compare({"kp": 1.309812345})
    printed / computed             kp
    demo                1.31 / 1.3098
    >>> book.close()
    demo: 1 claim, 1 reproduced
    >>> book.compare({"kq": 1.0})
    Traceback (most recent call last):
    paperledger.verdicts.LedgerError: demo.kq: unknown id; the closest are demo.kp
    """

    _recorded: ClassVar[list["Ledger"] | None] = None  # the list that `recording` yields
    _printed: ClassVar[Any] = staticmethod(attrgetter("printed"))  # returns the printed value of a row

    def __init__(
        self,
        path: Path,
        rows: Sequence[Row],
        page: str | None = None,
        words: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        self.paper = path.stem
        self.page = page or self.paper
        self.words = {**(words or {})}
        self.rows = {row.id: replace(row, printed=Ledger._printed(row)) for row in rows}
        self.fresh: dict[str, Row] = {}
        self.refused: list[str] = []
        self.closed = False
        self.records = Ledger._recorded is not None
        if Ledger._recorded is not None:
            Ledger._recorded.append(self)

    @classmethod
    def open(
        cls,
        paper: str,
        page: str | None = None,
        folder: Path | str | None = None,
        words: Mapping[str, str] | None = None,
    ) -> Self:
        """Open the ledger of a paper.

        Parameters
        ----------
        paper : str
            Key of the paper, such as ``haalman2024``.
        page : str, optional
            The notebook that opens the ledger, as a path below ``book`` without suffix, such as ``audit/haalman2024``.
            By default the chapter. `close` checks the rows of this page.
        folder : path, optional
            Folder of the csv files. By default ``book/ledger``, searched upward from the current directory.
        words : mapping of str to str, optional
            The paper's notation for ids or parts of ids, such as ``{"kp": "K_P", "ex1": "Example 1"}``.

        Returns
        -------
        Ledger

        Raises
        ------
        LedgerError
            If the file is missing or not a table.

        Examples
        --------
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> from paperledger import write_rows
        >>> write_rows(folder / "demo.csv", [Row("demo.kp", "Table 1", "gain", "1.31")])
        >>> list(Ledger.open("demo", folder=folder).rows)
        ['demo.kp']
        """
        place = find_folder(folder)
        path = place / f"{paper}.csv"
        if not path.is_file():
            known = ", ".join(papers(place)) or "none"
            raise LedgerError(f"no ledger {path.name} in {place}; there are: {known}")
        return cls(path, read_rows(path), page, words)

    def compare(self, values: Mapping[str, Any], digits: int = DIGITS) -> "pd.DataFrame":
        """Compare numbers of this run with the printed numbers.

        Parameters
        ----------
        values : mapping
            Numbers by id, or nested by the parts of their ids, as ``{"ex1.pida": {"ti": 4.1, "td": 1.2}}``.
        digits : int, optional
            Number of significant digits. With fewer than ten, the note of each row in `values` must contain the word
            *digits* and give the reason.

        Returns
        -------
        pandas.DataFrame
            A table with entries ``printed / computed``. The last part of an id names the column, and the parts before
            it name the row. A mark after the entry shows the verdict: ``°`` last-digit, ``~`` approximate,
            ``*`` misprint or as-read, and ``†`` differs.

        Raises
        ------
        LedgerError
            If a value is wrong. The message has a line for each wrong value. A value is wrong if its id is unknown, or
            if it is not finite, differs from the stored value, changes the verdict, or agrees with the printed number
            although a person declared a disagreement.

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> book = Ledger(Path("demo.csv"), [row])
        >>> book.compare({"demo": {"kp": 1.3151}})
        Traceback (most recent call last):
        paperledger.verdicts.LedgerError: demo.kp: drifted from 1.309812345 to 1.315100000
        demo.kp: the file has the verdict reproduced, but 1.315100000 against printed 1.31 gives last-digit
        """
        import pandas as pd

        failures: list[str] = []
        shown: dict[str, dict[str, str]] = {}
        for id, value in _flat(values):
            try:
                row = self._take(self._handed(id, False, digits).with_number(value, digits))
            except LedgerError as error:
                failures.append(str(error))
                continue
            verdict = row.verdict if row.verdict in DECLARED else row.derived() or "differs"
            group, _, key = id.rpartition(".")
            entry = f"{row.printed} / {row.shown()}\N{NO-BREAK SPACE}{MARKS.get(verdict, '')}"
            shown.setdefault(group or self.paper, {})[key] = entry.rstrip()
        if failures:
            self.refused += failures
            raise LedgerError("\n".join(failures))
        frame = pd.DataFrame.from_dict(shown, orient="index").fillna("")
        frame = frame.rename(index=self.spell, columns=self.spell)
        return frame.rename_axis(columns="printed / computed")

    def spell(self, id: str) -> str:
        """Return an id, or a part of an id, in the paper's notation.

        Parameters
        ----------
        id : str
            An id without the key of the paper, or a part of an id. A part that is not in `words` stays unchanged.

        Returns
        -------
        str

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [], words={"kp": "K_P", "ex1": "Example 1"}).spell("ex1.kp")
        'Example 1, K_P'
        """
        parts = id.split(".")
        if id in self.words or self.words.keys().isdisjoint(parts):
            return self.words.get(id, id)
        return ", ".join(self.words.get(part, part) for part in parts)

    def decide(self, id: str, cases: Cases, digits: int = DIGITS) -> str:
        """Test a statement with numbers of this run, by the relation in its row.

        Parameters
        ----------
        id : str
            Id of a statement.
        cases : mapping of any to pair of numbers, or pair of numbers, or number
            A pair (left side, right side) for each case, or a single pair. If the relation only states that a residual
            is rounding error, pass residuals instead of pairs. The worst case decides, or the best case if the relation
            contains *some*. ``==`` requires integers.
        digits : int, optional
            As in `compare`.

        Returns
        -------
        str
            The verdict and its evidence.

        Raises
        ------
        LedgerError
            As in `compare`, or if a side has the wrong type, such as a float with ``==``.

        Examples
        --------
        >>> row = Row("demo.s", "sec. 3", "statement", "A is faster", "holds", "holds", page="demo")
        >>> row = replace(row, relation="first < second", evidence="1 < 2")
        >>> book = Ledger(Path("demo.csv"), [row])
        >>> book.decide("s", (1, 2))
        'holds: 1 < 2'
        >>> book.decide("s", (1, 3))
        Traceback (most recent call last):
        paperledger.verdicts.LedgerError: demo.s: drifted from 1 < 2 to 1 < 3
        """
        try:
            row = self._handed(id, True, digits)
            with naming(row.id):
                relation = Relation.parse(row.relation)
                # If values are only recorded, as in `paperledger.shake`, a case may differ from its declared result.
                evidence = relation.decide(cases, digits, strict=not self.records)
            fresh = replace(row, computed=evidence.verdict, evidence=str(evidence))
            kept = Evidence.parse(self._take(fresh).evidence)
        except LedgerError as error:
            self.refused += str(error).splitlines()
            raise
        if relation.is_identity and kept.verdict == "holds":  # the digits depend on the machine
            return f"holds: largest residual ≤ {relation.right}"
        remark = re.sub(r"( in \d+ of \d+) .*", r"\1", kept.remark)  # without the list of cases
        return f"{kept.verdict}: {kept.shown()}" + (f" ({remark})" if remark else "")

    def _handed(self, id: str, statement: bool, digits: int) -> Row:
        """Return the row of an id, after checking that the row takes this kind of value."""
        row = self.row(id)
        if row.basis == "reading":
            raise LedgerError(f"{row.id}: its basis is 'reading', so the row takes no computed value")
        if row.is_statement != statement:
            raise LedgerError(f"{row.id}: use book.compare for a printed number, book.decide for a statement")
        if digits < DIGITS and "digits" not in row.note:
            raise LedgerError(
                f"{row.id}: only {digits} digits are kept; the note must say why, with the word 'digits'"
            )
        return row

    def _take(self, fresh: Row) -> Row:
        """Store a row with a value of this run, or raise an error if it contradicts the file. Return the row to show.

        If the rows agree, the row of the file is shown, so that rounding noise never changes a verdict. If values are
        only recorded, the file is not compared. An error is then raised only for two different values of one row.
        """
        row = self.rows[fresh.id]
        with naming(row.id):
            kept = row if row.same(fresh) else fresh
        if self.records:
            before = self.fresh.get(row.id, fresh)
            if not before.same(fresh):
                raise LedgerError(f"{row.id}: handed over twice, as {before.found} and as {fresh.found}")
        elif not row.computed:
            advice = f"`python -m paperledger update {self.paper}` stores it"
            raise LedgerError(f"{row.id}: no value is stored yet; {advice}")
        else:
            drifted = f"{row.id}: drifted from {row.found} to {fresh.found}" if kept is fresh else ""
            failures = [*filter(None, (drifted, kept.disagreement()))]
            if failures:
                raise LedgerError("\n".join(failures))
        self.fresh[row.id] = fresh
        return kept

    def row(self, id: str) -> Row:
        """Return a row.

        Parameters
        ----------
        id : str
            Id of a row, with or without the key of the paper.

        Returns
        -------
        Row

        Raises
        ------
        LedgerError
            If the id is unknown.

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")]).row("kp").half_unit
        0.005
        """
        full = id if id.startswith(f"{self.paper}.") else f"{self.paper}.{id}"
        if full not in self.rows:
            closest = ", ".join(get_close_matches(full, self.rows, n=3))
            raise LedgerError(f"{full}: unknown id" + (f"; the closest are {closest}" if closest else ""))
        return self.rows[full]

    def printed(self, id: str) -> float:
        """Return a printed number, for a computation that starts from it.

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
            If the id is unknown or belongs to a statement.

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31")]).printed("kp")
        1.31
        """
        row = self.row(id)
        with naming(row.id):
            read_number(row.printed)
        return float(row.printed)

    def _owed(self) -> list[Row]:
        """Return the rows for which this page must pass a value."""
        return [row for row in self.rows.values() if row.basis != "reading" and row.page == self.page]

    def close(self) -> None:
        """Check that the page has passed a value for each of its rows, and that no value was refused. Print the score.

        Raises
        ------
        LedgerError
            If one of the checks fails. The message has all earlier errors, and the id of each row without a value.

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> Ledger(Path("demo.csv"), [row]).close()
        Traceback (most recent call last):
        paperledger.verdicts.LedgerError: demo.kp: never handed over
        """
        missing = [f"{row.id}: never handed over" for row in self._owed() if row.id not in self.fresh]
        failures = self.refused + ([] if self.records else missing)
        if failures:
            raise LedgerError("\n".join(failures))
        self.closed = True
        print(display.score_line(self.page, display.score(self._owed())))

    def problems(self) -> list[str]:
        """List the errors that can be found in the file alone, one line each.

        Returns
        -------
        list of str

        Examples
        --------
        >>> Ledger(Path("demo.csv"), [Row("other.kp", "Table 1", "gain", "1.31", page="demo")]).problems()
        ['other.kp: does not start with demo.', "other.kp: 'computed' is empty"]
        """
        gone, start = removed(self.path.parent), f"{self.paper}."
        lines = [f"{id}: does not start with {start}" for id in self.rows if not id.startswith(start)]
        lines += [f"{id}: was removed; use an id that was never used" for id in self.rows if id in gone]
        return lines + [problem for row in self.rows.values() for problem in row.problems()]

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
        return display.scorebar(self.paper, display.score(self.rows.values()), legend=True)

    def index(self) -> Display:
        """List each printed item, such as a table, with its place in the book and the result.

        Returns
        -------
        Display
            A line for each printed item with numbers, and a line for the statements of each page. Each line links to
            the heading that names the item.

        Examples
        --------
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
        >>> Ledger(Path("demo.csv"), [row]).index()
        printed item  where        outcome
        Table 1       the chapter  reproduced
        """
        book = self.path.resolve().parents[1]
        chosen = {self.paper, *(row.page for row in self.rows.values() if row.page)}
        headings = {page: _headings(book / f"{page}.ipynb") for page in chosen}
        return display.index(self.rows.values(), self.page, headings)

    def claims(self, *prefixes: str) -> Display:
        """Return a table of rows of the file, with printed and computed numbers.

        Parameters
        ----------
        *prefixes : str
            Beginnings of ids, by default all ids.

        Returns
        -------
        Display

        Raises
        ------
        LedgerError
            If no id starts with one of the prefixes.

        Examples
        --------
        >>> book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
        >>> book.claims()
        verdict     claim                    printed  computed  difference
        reproduced  demo.kp: gain (Table 1)  1.31     1.3098    -0.0
        """
        rows = []
        for prefix in prefixes or ("",):
            starts = (prefix, f"{self.paper}.{prefix}")
            chosen = [row for id, row in self.rows.items() if id.startswith(starts)]
            if not chosen:
                raise LedgerError(f"{self.paper}: no id starts with {prefix}")
            rows += chosen
        return display.claims(rows)


@contextmanager
def recording(printed: Callable[[Row], str] = attrgetter("printed")) -> Iterator[list[Ledger]]:
    """Record values without comparing them, in all ledgers opened in this context. Yield the list of these ledgers.

    In these ledgers, ``printed(row)`` replaces the printed value of a row. By default the value does not change.

    >>> with recording() as books:
    ...     book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced")])
    ...     _ = book.compare({"kp": 1.5})
    >>> books[0].fresh["demo.kp"].computed
    '1.500000000'
    """
    before = Ledger._printed
    Ledger._recorded, Ledger._printed = [], staticmethod(printed)
    try:
        yield Ledger._recorded
    finally:
        Ledger._recorded, Ledger._printed = None, staticmethod(before)


def _headings(notebook: Path) -> list[str]:
    """Return the headings of a notebook without its title, or an empty list if the file does not exist."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"] if notebook.is_file() else []
    texts = ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    return [heading for text in texts for heading in re.findall(r"^##+ (.+)$", text, re.MULTILINE)]


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield an id and a value for each number in nested mappings."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def load_all(folder: Path | str | None = None) -> dict[str, Ledger]:
    """Open and validate every ledger of a folder.

    Parameters
    ----------
    folder : path, optional
        As in `Ledger.open`.

    Returns
    -------
    dict of str to Ledger
        Ledgers by key of the paper, in alphabetical order.

    Raises
    ------
    LedgerError
        If a file has errors. The message has the errors of all files.

    Examples
    --------
    >>> import tempfile
    >>> load_all(tempfile.mkdtemp())
    {}
    """
    place = find_folder(folder)
    books = {paper: Ledger.open(paper, folder=place) for paper in papers(place)}
    problems = [problem for book in books.values() for problem in book.problems()]
    if problems:
        raise LedgerError("\n".join(problems))
    return books
