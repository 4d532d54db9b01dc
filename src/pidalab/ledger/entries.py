"""What a chapter hands over for one row, and how it compares with what the row keeps."""

import math
from dataclasses import dataclass, replace
from decimal import Decimal

from pidalab.ledger import verdicts
from pidalab.ledger.digits import DIGITS, agrees, read_number, same_text, store
from pidalab.ledger.errors import LedgerError, naming
from pidalab.ledger.relations import Evidence
from pidalab.ledger.rows import Row


@dataclass(frozen=True)
class Entry:
    """What was computed for one row.

    Parameters
    ----------
    value : float, optional
        The number of a row that has one.
    evidence : Evidence, optional
        The relation of a statement.
    note : str, optional
        The note, with the numbers of the run.
    digits : int, optional
        Significant digits to keep.

    Examples
    --------
    >>> Entry(1.3098).value
    1.3098
    """

    value: float | None = None
    evidence: Evidence | None = None
    note: str | None = None
    digits: int = DIGITS

    @property
    def is_note(self) -> bool:
        """Whether only a note was handed over."""
        return self.value is None and self.evidence is None


def unfit(row: Row, entry: Entry) -> str | None:
    """Say why a row cannot take an entry, None if it can.

    Parameters
    ----------
    row : Row
        Of the ledger.
    entry : Entry
        Handed over for it.

    Returns
    -------
    str or None

    Examples
    --------
    >>> unfit(Row("demo.s", "sec. 2", "statement", "A is faster"), Entry(1.0))
    'demo.s: a statement is a relation, book.statement(id, left, "<", right), found 1.0'
    """
    if row.basis == "reading" and not entry.is_note:
        return f"{row.id}: its basis is reading, but something computed was handed over"
    if row.is_statement and entry.value is not None:
        return f'{row.id}: a statement is a relation, book.statement(id, left, "<", right), found {entry.value!r}'
    if not row.is_statement and entry.evidence is not None:
        return f"{row.id}: a printed number is compared with a number, book.check(id, value), found {entry.evidence}"
    if entry.value is not None and not math.isfinite(entry.value):
        return f"{row.id}: expected a finite number, found {entry.value!r}"
    if entry.digits < DIGITS and "digits" not in (entry.note or ""):
        return f"{row.id}: kept to {entry.digits} digits; the note has to say why, with the word 'digits'"
    if entry.note is not None and (not entry.note.strip() or "\n" in entry.note):
        return f"{row.id}: a note is a line of text, found {entry.note!r}"
    return None


def drift(row: Row, entry: Entry) -> list[str]:
    """List where a fresh entry is not what the row keeps, old and new.

    Parameters
    ----------
    row, entry
        As in `unfit`, which found nothing.

    Returns
    -------
    list of str

    Examples
    --------
    >>> drift(Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced"), Entry(1.3098))
    ['demo.kp: drifted from 1.309812345 to 1.309800000']
    """
    found = []
    with naming(row.id):
        if entry.value is not None and not (row.is_number and agrees(entry.value, row.computed)):
            found.append((row.computed, store(entry.value, row.printed, entry.digits)))
        if entry.evidence is not None and not (
            row.evidence and Evidence.parse(row.evidence).same(entry.evidence)
        ):
            found.append((row.evidence, str(entry.evidence)))
        if entry.note is not None and not same_text(row.note, entry.note):
            found.append((f"note {row.note!r}", f"note {entry.note!r}"))
    return [f"{row.id}: drifted from {old or 'nothing stored'} to {new}" for old, new in found]


def updated(row: Row, entry: Entry) -> Row:
    """Return the row with what is new in an entry, and the verdict that follows.

    What still agrees stays as it is, so that a second run on another machine changes nothing. A declared verdict
    stays; a number that agrees no longer, without a declared reason, is left without a verdict.

    Parameters
    ----------
    row, entry
        As in `unfit`, which found nothing.

    Returns
    -------
    Row

    Examples
    --------
    >>> updated(Row("demo.kp", "Table 1", "gain", "1.31"), Entry(1.3098)).verdict
    'reproduced'
    """
    with naming(row.id):
        fresh = row
        if entry.note is not None and not same_text(row.note, entry.note):
            fresh = replace(fresh, note=entry.note)
        if entry.value is not None:
            text = store(entry.value, row.printed, entry.digits)
            keep = row.is_number and agrees(entry.value, row.computed) and _precise(row.computed, text)
            fresh = fresh if keep else replace(fresh, computed=text)
        if entry.evidence is not None:
            keep = bool(row.evidence) and Evidence.parse(row.evidence).same(entry.evidence)
            fresh = fresh if keep else replace(fresh, evidence=str(entry.evidence))
            fresh = replace(fresh, computed=Evidence.parse(fresh.evidence).verdict)
        if entry.is_note or row.verdict in verdicts.DECLARED:
            return fresh
        return replace(fresh, verdict=fresh.derived() or "")


def _precise(old: str, new: str) -> bool:
    """Whether a stored number has as many places as a fresh one would have."""
    exponents = [Decimal(text).as_tuple().exponent for text in (old, new)]
    return exponents[0] == exponents[1] or not read_number(new)


def merged(row: Row, before: Entry, entry: Entry) -> Entry:
    """Join what was handed over in several calls; a value or a note may come twice, if it is the same.

    Parameters
    ----------
    row : Row
        Of the ledger.
    before, entry : Entry
        The earlier calls and the new one.

    Returns
    -------
    Entry

    Raises
    ------
    LedgerError
        If the same was handed over with another content.

    Examples
    --------
    >>> merged(Row("demo.kp", "Table 1", "gain", "1.31"), Entry(1.31), Entry(note="Exact.")).note
    'Exact.'
    """
    with naming(row.id):
        same = {
            "value": lambda old, new: agrees(new, store(old, row.printed)),
            "evidence": lambda old, new: old.same(new),
            "note": same_text,
        }
        joined = {}
        for name, agree in same.items():
            old, new = getattr(before, name), getattr(entry, name)
            if old is not None and new is not None and not agree(old, new):
                raise LedgerError(f"handed over twice, as {old} and as {new}")
            joined[name] = new if old is None else old
    return Entry(**joined, digits=min(before.digits, entry.digits))
