"""One row of a ledger, what can be wrong with it, and the file that holds the rows."""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from decimal import Decimal
from pathlib import Path

from pidalab.ledger import digits, verdicts
from pidalab.ledger.errors import LedgerError, naming

FOLDER = Path("book", "ledger")
_ID = re.compile(r"[a-z0-9_-]+(\.[a-z0-9_-]+)+")


@dataclass(frozen=True)
class Row:
    """One printed number or statement of a paper, beside what was computed. All entries are strings.

    Parameters
    ----------
    id : str
        Permanent, lower case, dotted, starting with the key of the paper.
    where : str
        Where the paper prints it.
    quantity : str
        What it is, with its unit.
    printed : str
        The printed number, digit for digit; for a statement, a short paraphrase.
    computed : str, optional
        The computed number, or ``holds`` or ``fails``. Empty when not computable, or not yet computed.
    verdict : str, optional
        A key of `VERDICTS`, or empty while nobody has judged.
    note : str, optional
        Reasons, proofs, tolerances, the numbers behind a statement. Plain text.

    Examples
    --------
    >>> row = Row("demo.ex1.kp", "Table 1", "gain", printed="1.31", computed="1.309812345", verdict="reproduced")
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
    note: str = ""

    @property
    def is_number(self) -> bool:
        """Whether a number was computed, so that differences make sense."""
        return self.computed not in ("", *verdicts.STATEMENT)

    def derived(self) -> str | None:
        """Return the verdict that follows from the entries, None if they disagree; see `derive`.

        Returns
        -------
        str or None

        Raises
        ------
        LedgerError
            If an entry cannot be read.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.3151").derived()
        'last-digit'
        """
        with naming(self.id):
            return verdicts.derive(self.printed, self.computed, self.note)

    def difference(self) -> Decimal | None:
        """Return computed minus printed in units of the last printed place, None where there is no number.

        Returns
        -------
        decimal.Decimal or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.30", computed="1.3125").difference()
        Decimal('1.25')
        """
        with naming(self.id):
            return verdicts.difference(self.printed, self.computed) if self.is_number else None

    def shown(self) -> str:
        """Return the computed entry, rounded for a reader; see `show`.

        Returns
        -------
        str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.309812345").shown()
        '1.3098'
        """
        with naming(self.id):
            return digits.show(self.printed, self.computed) if self.is_number else self.computed

    def disagreement(self) -> str | None:
        """Say why the verdict does not follow from the entries, None if it does.

        Returns
        -------
        str or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.3151", "reproduced").disagreement()
        'demo.kp: file says reproduced, 1.3151 against printed 1.31 gives last-digit'
        """
        try:
            derived = self.derived()
        except LedgerError as error:
            return str(error)
        against = f"{self.computed} against printed {self.printed} gives {derived or 'no agreement'}"
        if self.verdict in verdicts.DECLARED:
            agrees = derived in verdicts.AGREEING
            return f"{self.id}: declared {self.verdict} starts to agree, {against}" if agrees else None
        if derived == self.verdict:
            return None
        advice = "" if derived else "; declare misprint or differs, with a note"
        return f"{self.id}: file says {self.verdict or 'nothing'}, {against}{advice}"

    def problems(self) -> list[str]:
        """List what is wrong with the row taken alone, one line each.

        Returns
        -------
        list of str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.9", "misprint").problems()
        ['demo.kp: misprint needs a note']
        """
        computable = self.verdict != "not-computable"
        noted = self.verdict in (*verdicts.DECLARED, *verdicts.STATEMENT)
        tests = (
            (not _ID.fullmatch(self.id), "an id is lower case and dotted, such as haalman2024.ex1.pida.kp"),
            (not self.where.strip(), "'where' is empty"),
            (not self.quantity.strip(), "'quantity' is empty"),
            (not self.printed.strip(), "'printed' is empty"),
            (
                self.verdict not in ("", *verdicts.VERDICTS),
                f"unknown verdict {self.verdict!r}; one of {', '.join(verdicts.VERDICTS)}",
            ),
            (noted and not self.note.strip(), f"{self.verdict} needs a note"),
            (
                self.verdict == "approximate" and not verdicts.sets_tolerance(self.note),
                "approximate needs a tolerance in its note, such as 'tolerance 1 %' or 'tolerance 0.02'",
            ),
            (not computable and bool(self.computed), "declared not-computable, but 'computed' is not empty"),
            (computable and not self.computed, "'computed' is empty"),
        )
        found = [f"{self.id}: {message}" for wrong, message in tests if wrong]
        disagreement = self.disagreement() if self.computed and not found else None
        return [*found, disagreement] if disagreement else found


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
    raise LedgerError(f"no folder {FOLDER.as_posix()} in {here} or above it")


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
        raise LedgerError(f"{path.name}: expected the columns {', '.join(COLUMNS)}, found {', '.join(header)}")
    for line in lines:
        if len(line) != len(COLUMNS):
            raise LedgerError(f"{path.name}: expected {len(COLUMNS)} entries, found {len(line)} in {','.join(line)!r}")
        if any("\n" in entry or "\r" in entry for entry in line):  # one row is one line, so that a diff reads well
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
    id,where,quantity,printed,computed,verdict,note
    demo.kp,Table 1,gain,1.31,,,
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(astuple(row) for row in rows)
    path.write_text(text.getvalue(), encoding="utf-8", newline="")
