"""Numbers as a paper prints them: decimals that know their last written place.

Printed digits are compared as decimals: ``1.005`` is a tie between ``1.00`` and ``1.01`` on paper, and is not one in
binary.
"""

import re
from decimal import Context, Decimal
from math import isinf, isnan
from numbers import Integral
from typing import SupportsFloat

from pidalab.ledger.errors import LedgerError

DIGITS = 10  # significant digits of a stored value
SLACK = Decimal("1e-9")  # relative; absorbs the rounding of floating-point arithmetic, nothing more
NUMBER = r"(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?"
_SIGNED = re.compile(rf"[+-]?{NUMBER}", re.ASCII)
_INNER = re.compile(NUMBER, re.ASCII)
_WIDE = Context(prec=700)  # room for any double beside any printed place


def read_number(text: str) -> Decimal:
    """Read a number and keep its precision: the exponent of the result is that of the last printed place.

    Parameters
    ----------
    text : str
        Digits with an optional sign, decimal point and exponent. A unit belongs in the column `quantity`.

    Returns
    -------
    decimal.Decimal

    Raises
    ------
    LedgerError
        If `text` is anything else.

    Examples
    --------
    >>> read_number("1.30")
    Decimal('1.30')
    >>> read_number("12 %")
    Traceback (most recent call last):
    pidalab.ledger.errors.LedgerError: '12 %' is not a plain number such as 0.382, -8 or 1e-3
    """
    if not is_number(text):
        raise LedgerError(f"{text!r} is not a plain number such as 0.382, -8 or 1e-3")
    return Decimal(text)


def is_number(text: str) -> bool:
    """Tell whether `read_number` can read a text."""
    return bool(_SIGNED.fullmatch(text))


def plain(value: object) -> int | float:
    """Turn what a chapter hands over, often a NumPy scalar, into an int or a float.

    Parameters
    ----------
    value : object
        A real number of any kind; infinite is allowed.

    Returns
    -------
    int or float

    Raises
    ------
    LedgerError
        For a truth value, not-a-number, and all that is no real number.

    Examples
    --------
    >>> plain(2), plain(Decimal("0.5"))
    (2, 0.5)
    """
    scalar = value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value
    if isinstance(scalar, bool):
        raise LedgerError(
            f"expected a number, found {scalar}; a statement hands over both sides of its relation"
        )
    if isinstance(scalar, Integral):
        return int(scalar)
    if isinstance(scalar, SupportsFloat) and not hasattr(scalar, "shape") and not isnan(float(scalar)):
        return float(scalar)
    raise LedgerError(f"expected a number, found {value!r}")


def exponent(number: Decimal) -> int:
    """Return the power of ten of the last written place, -2 for ``1.30``."""
    return int(number.as_tuple().exponent)


def unit(number: Decimal) -> Decimal:
    """Return one unit in the last written place, 0.01 for ``1.30``."""
    return Decimal(1).scaleb(exponent(number))


def to_decimal(value: float) -> Decimal:
    """Return the shortest decimal that reads back as `value`, which is what a reader sees printed."""
    return Decimal(repr(value))


def agrees(value: float, stored: str) -> bool:
    """Tell whether a fresh value equals a stored one, to one unit in the last stored place or 1e-9 of it.

    Parameters
    ----------
    value : float
        The fresh value.
    stored : str
        The stored number. Fewer digits make the comparison looser.

    Returns
    -------
    bool

    Examples
    --------
    >>> agrees(0.3812, "0.382"), agrees(0.3805, "0.382")
    (True, False)
    """
    number = read_number(stored)
    return abs(to_decimal(value) - number) <= max(unit(number), SLACK * abs(number))


def store(value: float, printed: str, digits: int = DIGITS) -> str:
    """Write a value with its trailing zeros, so that the text says how precise it is.

    Parameters
    ----------
    value : float
        A finite number.
    printed : str
        The printed number. Digits below 1e-10 of its last place are dropped: they are the noise of a computed zero.
    digits : int, optional
        Significant digits.

    Returns
    -------
    str

    Examples
    --------
    >>> store(0.5, "0.50"), store(1.2e-17, "0.0"), store(2.5e-7, "3e-7", digits=3)
    ('0.5000000000', '0.00000000000', '2.50e-7')
    """
    number = to_decimal(value)
    return _text(number, last_place(number, printed, digits))


def last_place(number: Decimal, printed: str, digits: int = DIGITS) -> int:
    """Return the power of ten of the last place that `store` keeps."""
    return max(number.adjusted() - digits + 1, exponent(read_number(printed)) - DIGITS)


def significant(value: int | float, scale: float, digits: int = DIGITS) -> str:
    """Write one side of a relation: an integer as it is, a real number with its trailing zeros.

    Parameters
    ----------
    value : int or float
        The number.
    scale : float
        The larger magnitude of both sides. Digits below 1e-12 of it are dropped as noise.
    digits : int, optional
        Significant digits.

    Returns
    -------
    str

    Examples
    --------
    >>> significant(3, 3.0), significant(0.5, 3.0), significant(1e-17, 1.0), significant(float("inf"), 1.0)
    ('3', '0.5000000000', '0.000000000000', 'inf')
    """
    if isinstance(value, int) or isinf(value):
        return str(value)
    return _text(to_decimal(value), significant_place(to_decimal(value), to_decimal(float(scale)), digits))


def significant_place(number: Decimal, scale: Decimal, digits: int = DIGITS) -> int:
    """Return the power of ten of the last place that `significant` keeps."""
    place = number.adjusted() - digits + 1
    return max(place, scale.adjusted() - 12) if scale else place


def shorten(text: str, digits: int) -> str:
    """Round a real side of a relation to fewer digits; an integer stays.

    Parameters
    ----------
    text : str
        As `significant` wrote it.
    digits : int
        Significant digits to show.

    Returns
    -------
    str

    Examples
    --------
    >>> shorten("1.234567000", 4), shorten("12", 1), shorten("inf", 4), shorten("0.000000000000", 4)
    ('1.235', '12', 'inf', '0')
    """
    if "." not in text:
        return text
    number = read_number(text)
    rounded = number.quantize(
        Decimal(1).scaleb(max(number.adjusted() - digits + 1, exponent(number))), context=_WIDE
    )
    if not number:
        return "0"
    return f"{rounded:f}" if -4 <= number.adjusted() < DIGITS and exponent(rounded) <= 0 else f"{rounded:e}"


def same_text(old: str, new: str) -> bool:
    """Tell whether two texts say the same: words and integers exactly, decimals to one unit in the last place.

    Parameters
    ----------
    old, new : str
        The stored text and the fresh one.

    Returns
    -------
    bool

    Examples
    --------
    >>> same_text("2 of 10, by 0.31 %", "2 of 10, by 0.32 %"), same_text("2 of 10", "3 of 10")
    (True, False)
    """
    if _INNER.sub("", old) != _INNER.sub("", new):
        return False
    pairs = zip(_INNER.findall(old), _INNER.findall(new), strict=True)
    return all(a == b or ("." in a and "." in b and agrees(float(b), a)) for a, b in pairs)


def show(printed: str, computed: str) -> str:
    """Round a stored number for a reader: two digits more than printed, at least three in all, none invented.

    Parameters
    ----------
    printed, computed : str
        Two numbers, see `read_number`.

    Returns
    -------
    str

    Examples
    --------
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
