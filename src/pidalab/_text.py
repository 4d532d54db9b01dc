"""Clean text from outside before it is written to files.

File names, column names and notes come from outside, and are written into the headers and titles of code, reports,
tables and JSON. They must not end a comment, or contain a quote, a tag, a formula or a line feed. Therefore only
a few kinds of characters are kept. The result needs no escaping in C, structured text, Python, JSON, HTML or a cell of
a table.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from typing import Final

KINDS = ("PI", "PID", "PIDA")  # kinds of controllers. The index is the order of the highest derivative
WITHOUT_ACCELERATION = KINDS[:2]
# Names of the models that `pidalab.rules.models` derives from a process for the rules.
STARTING_MODELS = ("process", "reaction", "first_order", "second_order", "third_order", "integrator")


MARKS: Final = ".,_-+°%"  # these are allowed in addition to letters, digits and blanks
LONGEST_LINE: Final = 200  # in characters


def comment_text(text: str, longest: int) -> str:
    """Return text as one line for a comment of written code, with usual punctuation.

    The line cannot end a comment of C, structured text or Python: it has no asterisk, quotation mark or backslash.

    Examples
    --------
    >>> from pidalab._text import comment_text
    >>> comment_text("PIDA(kp=1.3, ti=3.3); Ms = 1.4 */ int x = 1;", 100)
    'PIDA(kp=1.3, ti=3.3); Ms = 1.4 / int x = 1;'
    """
    return plain_text(text, longest, MARKS + "()[]=:;/'±·–")


def plain_text(text: str, longest: int = LONGEST_LINE, marks: str = MARKS) -> str:
    """Return text from outside as one line that is safe in any file: letters, digits, blanks and ``.,_-+°%``.

    Any sequence of other characters, line feeds included, becomes one blank.

    Parameters
    ----------
    text : str
        Text from outside.
    longest : int, optional
        Largest number of characters. A longer text is cut and ends in "...".
    marks : str, optional
        Allowed punctuation.

    Returns
    -------
    str
        The line without blanks at its ends, possibly empty.

    Raises
    ------
    TypeError
        If text is not a str.

    Examples
    --------
    >>> from pidalab._text import plain_text
    >>> plain_text("Ofen_3, 20 °C.csv")
    'Ofen_3, 20 °C.csv'
    >>> plain_text('end */ int x = 1; /* "" + <b>')
    'end int x 1 + b'
    >>> plain_text("a long line", longest=8)
    'a lon...'
    """
    if not isinstance(text, str):
        raise TypeError(f"text must be a str, found {type(text).__name__}")
    # Cut a long text first, so that the following steps are fast.
    kept = unicodedata.normalize("NFC", text[: 4 * longest])
    words = "".join(x if _passes(x, marks) else " " for x in kept).split()
    line = " ".join(words)
    cut = len(line) > longest or len(text) > 4 * longest
    return line[: longest - 3].rstrip() + "..." if cut else line


def _passes(character: str, marks: str) -> bool:
    """Return True for a letter of any alphabet, a decimal digit, or one of the marks."""
    return character in marks or character.isalpha() or unicodedata.category(character) == "Nd"


def set_out(cells: Iterable[str], widths: Sequence[int], left: int = 1) -> str:
    """Return cells as a line of a table.

    Parameters
    ----------
    cells : iterable of str
        Cells, possibly fewer than columns.
    widths : sequence of int
        Widths of the columns.
    left : int, optional
        Number of cells at the beginning of the line that are aligned left. All other cells are aligned right.

    Returns
    -------
    str
        The line without blanks at its end.

    Examples
    --------
    >>> from pidalab._text import set_out
    >>> set_out(["PI", "1.5", "20"], [5, 6, 6])
    'PI      1.5    20'
    """
    columns = enumerate(zip(cells, widths, strict=False))
    return "".join(x.ljust(width) if k < left else x.rjust(width) for k, (x, width) in columns).rstrip()
