"""Numbers as a paper prints them, and the verdict that a computed one gives.

Printed digits are compared as decimals: ``1.005`` is a tie between ``1.00`` and ``1.01`` on paper, but not in binary.
"""

import re
from decimal import Context, Decimal
from math import isnan
from numbers import Integral
from typing import Any, SupportsFloat

DIGITS = 10  # significant digits of a stored value
WIDEST = Decimal("0.05")  # of the print: a wider tolerance would let nearly anything pass
LONGEST, LARGEST_EXPONENT = 350, 330  # characters of a number, and its power of ten: those of a double fit
DECLARED = ("misprint", "as-read", "differs", "not-computable")  # a person decides these; all others follow
VERDICTS = ("reproduced", "last-digit", "approximate", "holds", "holds-in-part", "fails", *DECLARED)
AGREEING = (
    "reproduced",
    "approximate",
    "holds",
    "holds-in-part",
)  # a declared disagreement must give none of these
BASES = ("computed", "fitted", "from-print", "reading")

_SLACK = Decimal("1e-9")  # relative; absorbs the rounding of floating-point arithmetic, nothing more
_NUMBER = r"(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?"
_SIGNED = re.compile(rf"[+-]?{_NUMBER}", re.ASCII)
_INNER = re.compile(_NUMBER, re.ASCII)
_TOLERANCE = re.compile(rf"\btolerance\s+({_NUMBER})(\s*%)?", re.IGNORECASE | re.ASCII)
_WIDE = Context(prec=700)  # room for any double beside any printed place


class LedgerError(ValueError):
    """Raised if a ledger and the computed numbers disagree; the message has one line for each finding.

    Examples
    --------
    >>> issubclass(LedgerError, ValueError)
    True
    """


def read_number(text: str) -> Decimal:
    """Read a number with its precision: the exponent of the result is that of the last written place.

    >>> read_number("1.30")
    Decimal('1.30')
    """
    if not _SIGNED.fullmatch(text):
        raise LedgerError(f"{text!r} is not a plain number such as 0.382, -8 or 1e-3")
    mantissa, _, power = text.lower().partition("e")
    if len(mantissa) > LONGEST or len(power) > len("-999") or abs(int(power or 0)) > LARGEST_EXPONENT:
        raise LedgerError(f"{text[:40]!r} is beyond double precision, or has more than {LONGEST} digits")
    return Decimal(text)


def plain(value: Any) -> int | float:
    """Turn what a page hands over, often a NumPy scalar, into an int or a float, which may be infinite."""
    scalar = value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value
    if isinstance(scalar, Integral) and not isinstance(scalar, bool):
        return int(scalar)
    real = isinstance(scalar, SupportsFloat) and not isinstance(scalar, bool) and not hasattr(scalar, "shape")
    if not real or isnan(float(scalar)):
        raise LedgerError(f"expected a number, found {value!r}")
    return float(scalar)


def exponent(number: Decimal) -> int:
    """Return the power of ten of the last written place, -2 for ``1.30``."""
    return int(number.as_tuple().exponent)


def unit(number: Decimal) -> Decimal:
    """Return one unit in the last written place, 0.01 for ``1.30``."""
    return Decimal(1).scaleb(exponent(number))


def agrees(fresh: str, stored: str) -> bool:
    """Tell whether a fresh number equals a stored one, to one unit in the last stored place or 1e-9 of it.

    A stored number with fewer digits than the fresh one does not agree, since drift would stay hidden. One less is
    allowed (9.99... and 10.0... have ten digits each), and so are ten decimals, of a computed zero.

    >>> agrees("0.3812", "0.3811"), agrees("0.3812", "0.3814"), agrees("0.3812", "0.38")
    (True, False, False)
    """
    old, new = read_number(stored), read_number(fresh)
    close = abs(new - old) <= max(unit(old), _SLACK * abs(old))
    return close and exponent(old) <= max(exponent(new) + 1, -DIGITS)


def write(value: float, floor: int, digits: int = DIGITS) -> str:
    """Write a value with its trailing zeros, so that the text says how precise it is.

    What lies below the power of ten `floor` is dropped: there is the noise of a computed zero.

    >>> write(0.5, -12), write(1.2e-17, -11), write(2.5e-7, -17, digits=3)
    ('0.5000000000', '0.00000000000', '2.50e-7')
    """
    number = Decimal(repr(value))
    return _text(number, max(number.adjusted() - digits + 1, floor))


def shorten(text: str, digits: int) -> str:
    """Round a real number for a reader; integers and infinities stay.

    >>> shorten("1.234567000", 4), shorten("12", 1), shorten("inf", 4), shorten("0.000000000000", 4)
    ('1.235', '12', 'inf', '0')
    """
    if "." not in text:
        return text
    number = read_number(text)
    if not number:
        return "0"
    place = max(number.adjusted() - digits + 1, exponent(number))
    rounded = number.quantize(Decimal(1).scaleb(place), context=_WIDE)
    return f"{rounded:f}" if -4 <= number.adjusted() < DIGITS and exponent(rounded) <= 0 else f"{rounded:e}"


def same_text(old: str, new: str) -> bool:
    """Tell whether two texts say the same: words and whole numbers exactly, decimals as `agrees` does.

    >>> same_text("worst of 2: a; ratio 0.31", "worst of 2: a; ratio 0.32"), same_text("2 of 10", "3 of 10")
    (True, False)
    """
    if _INNER.sub("", old) != _INNER.sub("", new):
        return False
    pairs = zip(_INNER.findall(old), _INNER.findall(new), strict=True)
    return all(agrees(b, a) if "." in a and "." in b else Decimal(a) == Decimal(b) for a, b in pairs)


def show(printed: str, computed: str) -> str:
    """Round a stored number for a reader: two digits more than printed, at least three in all, none invented.

    >>> show("1.31", "1.309812345"), show("1200", "0.001234567890"), show("0.382", "0.38")
    ('1.3098', '0.00123', '0.38')
    """
    number = read_number(computed)
    guarded = exponent(read_number(printed)) - 2
    legible = number.adjusted() - 2 if number else guarded
    return _text(number, max(exponent(number), min(guarded, legible)))


def _text(number: Decimal, place: int) -> str:
    rounded = number.quantize(Decimal(1).scaleb(place), context=_WIDE)
    return str(rounded).lower() if rounded else f"{abs(rounded):f}"  # never "-0" or "0e-12"


def tolerance(note: str, printed: Decimal) -> Decimal | None:
    """Read the tolerance in a note: ``tolerance 1 %`` of the printed number, or ``tolerance 0.02`` in its units.

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
    if width > max(WIDEST * abs(printed), unit(printed) / 2):
        raise LedgerError(f"the tolerance {width} is wider than 5 % of {printed}: declare why it differs")
    return width


def difference(printed: str, computed: str) -> Decimal:
    """Return computed minus printed, in units of the last printed place.

    >>> difference("1.30", "1.3125")
    Decimal('1.25')
    """
    number = read_number(printed)
    return (read_number(computed) - number) / unit(number)


def derive(printed: str, computed: str, note: str = "") -> str | None:
    """Return the verdict that follows from two numbers.

    A tie counts for the print, since a paper may round it either way. A note that sets a tolerance says that the digits
    are not expected to match: such a number is ``approximate`` when it lies within, even if it happens to round to the
    print.

    Parameters
    ----------
    printed, computed : str
        Two numbers, with the digits that they have.
    note : str, optional
        Looked at for a tolerance only: ``tolerance 1 %`` of the print, or ``tolerance 0.02`` in its units.

    Returns
    -------
    str or None
        ``reproduced``, ``last-digit`` or ``approximate``; None when the numbers disagree, and somebody has to declare
        why.

    Raises
    ------
    LedgerError
        If an entry is not a number, the note sets more than one tolerance, or one that is finer than the print or wider
        than 5 % of it.

    Examples
    --------
    >>> derive("1.31", "1.3098"), derive("1.31", "1.3151"), derive("1.31", "1.4")
    ('reproduced', 'last-digit', None)
    >>> derive("1.31", "1.36", note="step times unpublished, tolerance 5 %")
    'approximate'
    """
    number = read_number(printed)
    width = tolerance(note, number)
    if width is not None:
        return "approximate" if abs(read_number(computed) - number) <= width * (1 + _SLACK) else None
    off = abs(difference(printed, computed)) - _SLACK / 2
    return "reproduced" if off <= 0.5 else "last-digit" if off <= 1.5 else None
