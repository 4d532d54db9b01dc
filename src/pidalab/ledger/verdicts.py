"""How a computed number is judged against a printed one: pure functions of strings."""

import math
import re
from decimal import Decimal

from pidalab.ledger.digits import NUMBER, SLACK, read_number, unit
from pidalab.ledger.errors import LedgerError

VERDICTS = {
    "reproduced": "rounds to the printed digits",
    "last-digit": "one unit off in the last printed place",
    "approximate": "within the tolerance written in the note",
    "holds": "the relation of the evidence holds",
    "fails": "the relation of the evidence fails",
    "misprint": "the print contradicts itself or arithmetic, and no lost or misread character explains it",
    "as-read": "does not hold as we read it; print or reading is at fault",
    "differs": "does not agree, and nobody knows why",
    "not-computable": "something needed was never published",
}
BASES = {
    "computed": "from the paper's problem, by the library",
    "from-print": "from other printed results of the paper",
    "reading": "settled by reading; nothing can compute it",
}
DECLARED = ("misprint", "as-read", "differs", "not-computable")  # a person decides these; all others follow
STATEMENT = ("holds", "fails")
CONFIRMING = ("reproduced", "last-digit", "approximate", "holds")
AGREEING = ("reproduced", "approximate", "holds")  # a declared disagreement must give none of these

_HALF = (1 + SLACK) / 2
_TOLERANCE = re.compile(rf"\btolerance\s+({NUMBER})(\s*%)?", re.IGNORECASE | re.ASCII)


def difference(printed: str, computed: str) -> Decimal:
    """Return computed minus printed, in units of the last printed place.

    Parameters
    ----------
    printed, computed : str
        Two numbers, see `read_number`.

    Returns
    -------
    decimal.Decimal

    Examples
    --------
    >>> difference("1.30", "1.3125")
    Decimal('1.25')
    """
    number = read_number(printed)
    return (read_number(computed) - number) / unit(number)


def units_off(printed: str, computed: str) -> int:
    """By how many units of the last printed place the rounded value misses the print; a tie rounds towards the print.

    A paper may round a tie either way, so a tie never counts against it.

    Parameters
    ----------
    printed, computed : str
        Two numbers, see `read_number`.

    Returns
    -------
    int

    Examples
    --------
    >>> [units_off("0.38", computed) for computed in ("0.3849", "0.385", "0.3851", "0.395", "0.3951")]
    [0, 0, 1, 1, 2]
    """
    return max(0, math.ceil(abs(difference(printed, computed)) - _HALF))


def sets_tolerance(note: str) -> bool:
    """Tell whether a note sets a tolerance.

    Parameters
    ----------
    note : str
        Any text.

    Returns
    -------
    bool

    Examples
    --------
    >>> sets_tolerance("read from a figure, tolerance 2 %"), sets_tolerance("within tolerance")
    (True, False)
    """
    return bool(_TOLERANCE.search(note))


def tolerance(note: str, printed: Decimal) -> Decimal | None:
    """Read the tolerance in a note: ``tolerance 1 %`` of the printed number, or ``tolerance 0.02`` in its units.

    Parameters
    ----------
    note : str
        Any text; the word *tolerance* followed by a number counts, once.
    printed : decimal.Decimal
        The number that a percentage refers to.

    Returns
    -------
    decimal.Decimal or None
        The largest accepted distance, or None when the note sets no tolerance.

    Raises
    ------
    LedgerError
        If the note sets more than one, or one that is finer than the print.

    Examples
    --------
    >>> tolerance("measured with noise: tolerance 5 %", Decimal("2.0"))
    Decimal('0.10')
    """
    found = _TOLERANCE.findall(note)
    if not found:
        return None
    if len(found) > 1:
        raise LedgerError("the note sets more than one tolerance")
    size, percent = found[0]
    width = Decimal(size) * (abs(printed) / 100 if percent else 1)
    if width < unit(printed) / 2:  # a value could then round to the print and still be refused
        raise LedgerError(f"the tolerance {width} is finer than the printed digits of {printed}")
    return width


def derive(printed: str, computed: str, note: str = "") -> str | None:
    """Return the verdict that follows from the two entries.

    A note that sets a tolerance says that the digits are not expected to match: such a number is ``approximate``
    when it lies within, even if it happens to round to the print.

    Parameters
    ----------
    printed : str
        The printed number; for a statement, its words.
    computed : str
        The computed number; for a statement, ``holds`` or ``fails``.
    note : str, optional
        Looked at for a tolerance only.

    Returns
    -------
    str or None
        ``reproduced``, ``last-digit``, ``approximate``, ``holds`` or ``fails``; None when the numbers disagree, and
        somebody has to declare why.

    Raises
    ------
    LedgerError
        If an entry is not a number, or the tolerance cannot be used.

    Examples
    --------
    >>> derive("1.31", "1.3098"), derive("1.31", "1.3151"), derive("1.31", "1.4")
    ('reproduced', 'last-digit', None)
    >>> derive("1.31", "1.4", note="step times unpublished, tolerance 10 %")
    'approximate'
    """
    if computed in STATEMENT:
        return computed
    width = tolerance(note, read_number(printed))
    if width is not None:
        distance = abs(read_number(computed) - read_number(printed))
        return "approximate" if distance <= width * (1 + SLACK) else None
    return {0: "reproduced", 1: "last-digit"}.get(units_off(printed, computed))
