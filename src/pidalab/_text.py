"""Text from outside, on its way into files that are written here: one function lets it through, whatever the file.

File names, names of columns, lines of a record, notes and the name of a controller in a JSON are text of others.
Written code, reports, tables and JSON carry such text in heads and titles. There it must stay text: no end of a
comment, no quote, no tag, no formula and no line feed may come through. Nobody needs those to know a file again, so
only a few kinds of characters pass. What is left needs no escaping in C, structured text, Python, JSON, HTML or a cell
of a table.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from typing import Final

KINDS = ("PI", "PID", "PIDA")  # of controllers, by their highest derivative
WITHOUT_ACCELERATION = KINDS[:2]
# models that rules start from, as `pidalab.rules.models` makes them of a process
STARTING_MODELS = ("process", "reaction", "first_order", "second_order", "third_order", "integrator")


MARKS: Final = ".,_-+°%"  # beside letters, digits and blanks
LONGEST_LINE: Final = 200  # characters


def comment_text(text: str, longest: int) -> str:
    """Return text as one line for a comment of written code, with the marks of an ordinary sentence.

    Without asterisk, quotation mark and backslash nothing ends a comment of C, structured text or Python.

    Examples
    --------
    >>> from pidalab._text import comment_text
    >>> comment_text("PIDA(kp=1.3, ti=3.3); Ms = 1.4 */ int x = 1;", 100)
    'PIDA(kp=1.3, ti=3.3); Ms = 1.4 / int x = 1;'
    """
    return plain_text(text, longest, MARKS + "()[]=:;/'±·–")


def plain_text(text: str, longest: int = LONGEST_LINE, marks: str = MARKS) -> str:
    """Return text from outside as one line that is safe in any file: letters, digits, blanks and ``.,_-+°%``.

    What lies between them becomes one blank, also line feeds. Use it for each text that a file, a user or a name of a
    file brought, and that goes into a file written here. Lines of our own, as far as they are made of our words and of
    numbers, need it not.

    Parameters
    ----------
    text : str
        Of anybody.
    longest : int, optional
        Characters that are kept at most; what is cut ends in three points.
    marks : str, optional
        The marks that pass.

    Returns
    -------
    str
        Without blanks at its ends; empty if nothing is left.

    Raises
    ------
    TypeError
        If text is no str.

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
    # what is cut here cannot come back below: reading a long text takes no time
    kept = unicodedata.normalize("NFC", text[: 4 * longest])
    words = "".join(x if _passes(x, marks) else " " for x in kept).split()
    line = " ".join(words)
    cut = len(line) > longest or len(text) > 4 * longest
    return line[: longest - 3].rstrip() + "..." if cut else line


def _passes(character: str, marks: str) -> bool:
    """Return True for a letter of any alphabet, a decimal digit, and one of the marks."""
    return character in marks or character.isalpha() or unicodedata.category(character) == "Nd"


def set_out(cells: Iterable[str], widths: Sequence[int], left: int = 1) -> str:
    """Return cells as a line of a table: the first ones to the left of their columns, the others to the right.

    Parameters
    ----------
    cells : iterable of str
        The line may end before the last column.
    widths : sequence of int
        Of the columns.
    left : int, optional
        How many are set to the left: names, where the others are numbers.

    Returns
    -------
    str
        Without blanks at its end.

    Examples
    --------
    >>> from pidalab._text import set_out
    >>> set_out(["PI", "1.5", "20"], [5, 6, 6])
    'PI      1.5    20'
    """
    columns = enumerate(zip(cells, widths, strict=False))
    return "".join(x.ljust(width) if k < left else x.rjust(width) for k, (x, width) in columns).rstrip()
