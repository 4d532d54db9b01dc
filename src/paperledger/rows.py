"""Read, check and write the rows of a ledger: ``book/ledger/<paper>.csv``."""

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields, replace
from decimal import Decimal
from math import isfinite
from pathlib import Path

from paperledger import verdicts
from paperledger.verdicts import AGREEING, BASES, DECLARED, Evidence, LedgerError, Relation

FOLDER = Path("book", "ledger")
MANIFEST = "manifest.csv"  # the reviewed list of claims
REMOVED = "removed.csv"  # ids that must not be used again, with reasons
# An identity is a statement that a residual is only rounding error. Its tolerance may be at most:
IDENTITY = 1e-9  # without a note
ROUGHEST = 1e-6  # with a note
WORDS = 5  # least number of words in a note that justifies a verdict
_ID = re.compile(r"[a-z0-9_-]+(\.[a-z0-9_-]+)+")
_MADE = re.compile(
    r"(fit: [1-9]\d{0,8} settings? from [1-9]\d{0,8} numbers?: \w[^|]*)?(?:(?:^| \| )(page|count): \w[^|]*)?"
)


@contextmanager
def naming(id: str) -> Iterator[None]:
    """Begin the message of each LedgerError in this context with the id of a row."""
    try:
        yield
    except LedgerError as error:
        raise LedgerError(f"{id}: {error}") from None


def making(text: str) -> tuple[bool, str]:
    """Read the column ``made``. Return True if settings were fitted, and why `shake` may leave the value unchanged.

    The reason is ``page`` (a formula of the page computes the value) or ``count`` (the value is a whole number, or
    a point of a grid). It is empty if the value must change when `shake` changes the library.

    >>> making("fit: 1 setting from 7 numbers: T_F, from Table 3 | count: samples of a record")
    (True, 'count')
    """
    match = _MADE.fullmatch(text)
    if not match:
        raise LedgerError(
            f"'made' must be 'page: …', 'count: …' or 'fit: 3 settings from 7 numbers: …', found {text!r}"
        )
    return match[1] is not None, match[2] or ""


@dataclass(frozen=True)
class Row:
    """One printed number or statement of a paper with its computed value. All entries are strings.

    Parameters
    ----------
    id : str
        Permanent id: lower-case words separated by dots. The first word is the key of the paper.
    where : str
        Place in the paper.
    quantity : str
        Name of the quantity, with its unit.
    printed : str
        The printed number, digit for digit, or a paraphrase of the statement.
    computed : str, optional
        The computed number. For a statement, ``holds``, ``holds-in-part`` or ``fails``. Empty if the row is decided by
        reading the paper, or is not yet computed.
    verdict : str, optional
        One of `VERDICTS`, or empty if undecided.
    basis : str, optional
        One of `BASES`.
    page : str, optional
        The notebook that computes the value, as in `Ledger.open`. Empty if the row is decided by reading the paper.
    made : str, optional
        The settings that were fitted to printed numbers, if any, and the reason why the value need not change in
        `paperledger.shake`, if there is one.
    relation : str, optional
        The `Relation` that a statement asserts.
    evidence : str, optional
        The `Evidence` that decides a statement.
    note : str, optional
        Reasons, proofs and tolerances in plain text, without numbers that could become outdated.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
    >>> row.derived()
    'reproduced'
    >>> row.problems()
    []
    """

    id: str
    where: str
    quantity: str
    printed: str
    computed: str = ""
    verdict: str = ""
    basis: str = "computed"
    page: str = ""
    made: str = ""
    relation: str = ""
    evidence: str = ""
    note: str = ""

    @property
    def is_statement(self) -> bool:
        """True if the paper prints words, not a number. The quantity is then ``statement``."""
        return self.quantity == "statement"

    @property
    def is_number(self) -> bool:
        """True if the row has a printed and a computed number."""
        return not self.is_statement and self.computed != ""

    @property
    def found(self) -> str:
        """The computed number, or the evidence of a statement."""
        return self.evidence if self.is_statement else self.computed

    @property
    def half_unit(self) -> float:
        """Half a unit of the last printed place, the largest rounding error of the printed number.

        Raises
        ------
        LedgerError
            If the row is a statement.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.30").half_unit
        0.005
        """
        with naming(self.id):
            return float(verdicts.unit(verdicts.read_number(self.printed)) / 2)

    def derived(self) -> str | None:
        """Return the verdict that follows from the entries, or None if the numbers disagree.

        Returns
        -------
        str or None
            For a statement, the verdict of its evidence. For a number, the verdict of `derive`.

        Raises
        ------
        LedgerError
            If an entry cannot be read.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.3151").derived()
        'last-digit'
        >>> Row("demo.s", "sec. 2", "statement", "at most 10", evidence="10.82 <= 10").derived()
        'fails'
        """
        with naming(self.id):
            if self.is_statement:
                return Evidence.parse(self.evidence).verdict
            return verdicts.derive(self.printed, self.computed, self.note)

    def difference(self) -> Decimal | None:
        """Return computed minus printed in units of the last printed place, or None if a number is missing.

        Returns
        -------
        decimal.Decimal or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.30", computed="1.3125").difference()
        Decimal('1.25')
        """
        return verdicts.difference(self.printed, self.computed) if self.is_number else None

    def shown(self) -> str:
        """Return the computed entry for display. A number is rounded to two places more than the printed number.

        Returns
        -------
        str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.309812345").shown()
        '1.3098'
        """
        return verdicts.show(self.printed, self.computed) if self.is_number else self.computed

    def with_number(self, value: object, digits: int = verdicts.DIGITS) -> "Row":
        """Return the row with a computed number.

        Parameters
        ----------
        value : number
            A finite number.
        digits : int, optional
            Significant digits to keep.

        Returns
        -------
        Row

        Raises
        ------
        LedgerError
            If the value is not a finite number.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31").with_number(1.30981234567).computed
        '1.309812346'
        """
        with naming(self.id):
            number = float(verdicts.plain(value))
            if not isfinite(number):
                raise LedgerError(f"expected a finite number, found {number}")
            floor = verdicts.exponent(verdicts.read_number(self.printed)) - verdicts.DIGITS
            return replace(self, computed=verdicts.write(number, floor, digits))

    def same(self, fresh: "Row") -> bool:
        """Return True if a new row has the same numbers as this row, in the sense of `agrees`.

        Parameters
        ----------
        fresh : Row
            The row with the values of a new run.

        Returns
        -------
        bool

        Examples
        --------
        >>> from dataclasses import replace
        >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
        >>> row.same(replace(row, computed="1.309812346")), row.same(replace(row, computed="1.309900000"))
        (True, False)
        """
        if not self.found:
            return False
        if not self.is_statement:
            return verdicts.agrees(fresh.computed, self.computed)
        old, new = Evidence.parse(self.evidence), Evidence.parse(fresh.evidence)
        if Relation.parse(self.relation).is_identity and old.verdict == new.verdict == "holds":
            return old.right == new.right  # compare the tolerances, since a residual depends on the machine
        return verdicts.same_text(self.evidence, fresh.evidence)

    def disagreement(self) -> str | None:
        """Return an error message if the verdict contradicts the other entries, otherwise None.

        Returns
        -------
        str or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.3151", "reproduced").disagreement()
        'demo.kp: the file has the verdict reproduced, but 1.3151 against printed 1.31 gives last-digit'
        """
        try:
            derived = self.derived()
        except LedgerError as error:
            return str(error)
        value = self.evidence if self.is_statement else f"{self.computed} against printed {self.printed}"
        gives = f"{value} gives {derived or 'a disagreement'}"
        if self.verdict in DECLARED:
            agrees = derived in AGREEING
            return f"{self.id}: {self.verdict} is declared, but {gives}" if agrees else None
        if derived == self.verdict:
            return None
        advice = "" if derived else "; declare misprint, as-read or differs, with a note"
        return f"{self.id}: the file has the verdict {self.verdict or '(empty)'}, but {gives}{advice}"

    def problems(self) -> list[str]:
        """List the errors that can be found in this row alone, one line each.

        Returns
        -------
        list of str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.900000000", "misprint", page="demo").problems()
        ['demo.kp: misprint needs a note of at least 5 words']
        """
        lines = []
        try:
            for problem in self._malformed():
                lines.append(f"{self.id}: {problem}")
        except LedgerError as error:
            lines.append(f"{self.id}: {error}")
        disagreement = None if lines or self.basis == "reading" else self.disagreement()
        return [*lines, disagreement] if disagreement else lines

    def _malformed(self) -> Iterator[str]:
        """Yield each missing, malformed or forbidden entry. Raise an error if an entry cannot be read."""
        reading, statement = self.basis == "reading", ("relation", "evidence")
        computing = ("computed", "page", *(statement if self.is_statement else ()))
        needed = ("where", "quantity", "printed", *(() if reading else computing))
        barred = ("computed", "page", "made", *statement) if reading else statement
        if not _ID.fullmatch(self.id):
            yield "an id is lower case and dotted, such as haalman2024.ex1.pida.kp"
        if self.basis not in BASES:
            yield f"unknown basis {self.basis!r}; one of {', '.join(BASES)}"
        yield from (f"{name!r} is empty" for name in needed if not getattr(self, name).strip())
        if reading or not self.is_statement:
            kind = "the basis is reading" if reading else "the row has a number"
            yield from (f"{kind}, but {name!r} is not empty" for name in barred if getattr(self, name))
        if self.verdict == "not-computable" and not reading:
            yield "the verdict is not-computable, so the basis must be reading"
        if reading and self.verdict not in ("holds", "holds-in-part", "fails", *DECLARED):
            yield f"if the basis is reading, the verdict cannot be {self.verdict or 'empty'}"
        relation = Relation.parse(self.relation) if self.relation else None
        in_part = relation is not None and relation.parts
        if (reading or in_part or self.verdict in DECLARED) and len(self.note.split()) < WORDS:
            yield f"{'holds-in-part' if in_part else self.verdict} needs a note of at least {WORDS} words"
        if making(self.made)[0] != (self.basis == "fitted"):
            yield "'made' must have 'fit: 3 settings from 70 numbers: …' if the basis is fitted, and only then"
        if relation and relation.is_identity:
            if float(relation.right) > IDENTITY and not self.note:
                yield f"a tolerance above {IDENTITY:g} needs a note that says why"
            if float(relation.right) > ROUGHEST:
                yield f"a tolerance above {ROUGHEST:g} is too large for rounding; use another relation"
        elif relation and self.evidence:
            for inequality in Evidence.parse(self.evidence).inequalities:
                if inequality.left == inequality.right and "." in inequality.left and not inequality.factor:
                    yield f"both sides are {inequality.left}, so nothing was compared"


COLUMNS = tuple(field.name for field in fields(Row))


def find_folder(folder: Path | str | None = None) -> Path:
    """Find the folder of ledgers, by default the nearest ``book/ledger`` from the current directory upward."""
    if folder is not None:
        return Path(folder)
    here = Path.cwd()
    for parent in (here, *here.parents):
        if (parent / FOLDER).is_dir():
            return parent / FOLDER
    raise LedgerError(
        f"no folder {FOLDER.as_posix()} in {here} or above it; create it, or use a clone of the book"
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


def book_title(paper: str, book: Path) -> str:
    """Return the title of a paper from the references of a book, or an empty text if the paper is not there."""
    path = book / "references.bib"
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    match = re.search(rf"@\w+\{{{paper},.*?\btitle\s*=\s*\{{(.*?)\}},?\n", text, re.DOTALL)
    return re.sub(r"[{}]", "", match[1]).replace("--", "–") if match else ""


def read_table(path: Path, columns: Sequence[str]) -> list[list[str]]:
    """Read a csv file. Raise an error if it has other columns, or a character that is not printable."""
    with path.open(encoding="utf-8", newline="") as file:
        try:
            header, *lines = [*csv.reader(file, strict=True)] or [[]]
        except (csv.Error, UnicodeDecodeError) as error:
            raise LedgerError(f"{path.name}: {error}") from None
    if header != [*columns]:
        wrong = f"expected the columns {', '.join(columns)}, found {', '.join(header)!r:.200}"
        raise LedgerError(f"{path.name}: {wrong}")
    for line in lines:
        if len(line) != len(columns) or not all(map(str.isprintable, line)):
            wrong = f"expected {len(columns)} entries on one line, of printable characters, found {line}"
            raise LedgerError(f"{path.name}: {wrong}")
    return lines


def removed(folder: Path) -> dict[str, str]:
    """Return the ids of removed rows with the reasons. These ids must not be used again."""
    path = folder / REMOVED
    lines = read_table(path, ("id", "reason")) if path.is_file() else []
    if bare := [id for id, reason in lines if not reason.strip()]:
        raise LedgerError(f"{REMOVED}: no reason for {', '.join(bare)}")
    return {id: reason.strip() for id, reason in lines}


def table(columns: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a csv table as text."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *lines])
    return text.getvalue()


def read_rows(path: Path) -> list[Row]:
    """Read a ledger file.

    Parameters
    ----------
    path : pathlib.Path
        The csv file.

    Returns
    -------
    list of Row
        Rows in the order of the file.

    Raises
    ------
    LedgerError
        If the columns are not those of `Row`, a line is incomplete, or an id occurs twice.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "demo.csv")
    >>> write_rows(path, [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> [row.printed for row in read_rows(path)]
    ['1.31']
    """
    lines = read_table(path, COLUMNS)
    twice = [id for id, count in Counter(line[0] for line in lines).items() if count > 1]
    if twice:
        raise LedgerError(f"{path.name}: more than one row for {', '.join(twice)}")
    return [Row(*line) for line in lines]


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write a ledger file in UTF-8.

    Parameters
    ----------
    path : pathlib.Path
        The csv file.
    rows : sequence of Row
        Rows in the order of the file.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "demo.csv")
    >>> write_rows(path, [Row("demo.kp", "Table 1", "gain", "1.31")])
    >>> print(path.read_text(encoding="utf-8"), end="")
    id,where,quantity,printed,computed,verdict,basis,page,made,relation,evidence,note
    demo.kp,Table 1,gain,1.31,,,computed,,,,,
    """
    write_text(path, table(COLUMNS, (astuple(row) for row in rows)))


def write_text(path: Path, text: str) -> bool:
    """Write a file in UTF-8, completely or not at all. Return False if the file already has this text."""
    if path.is_file() and path.read_bytes() == text.encode():
        return False
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return True
