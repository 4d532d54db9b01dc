"""Tables of text: one function sets cells out in columns, for every table that is printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


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
    >>> from pidalab._table import set_out
    >>> set_out(["PI", "1.5", "20"], [5, 6, 6])
    'PI      1.5    20'
    """
    columns = enumerate(zip(cells, widths, strict=False))
    return "".join(x.ljust(width) if k < left else x.rjust(width) for k, (x, width) in columns).rstrip()
