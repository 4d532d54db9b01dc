"""How a value came about, as the column ``made`` of a row says it.

Two things may be said, one after the other, with `` | `` between them::

    fit: 3 settings from 70 numbers: T_F and two corrections, found by trying from Tables 3 to 6
    page: time_constant

``fit`` belongs to the basis ``fitted``, and only to it. ``page`` and ``count`` say why a value stays where it is when
the library that computes it is slightly off: a formula of the page made it, or it is a whole number or a place on a
grid, which a small change does not reach. A value that moves has no such reason.
"""

import re
from dataclasses import dataclass
from typing import Self

from paperledger.digits import LedgerError

STAYS = {
    "page": "a formula of the page made it",
    "count": "a whole number, or a place on a grid, that a small change does not reach",
}
_FIT = re.compile(r"(\d{1,9}) settings? from (\d{1,9}) numbers?: (.+)", re.ASCII)


@dataclass(frozen=True)
class Making:
    """What the column ``made`` of a row says.

    Parameters
    ----------
    settings, numbers : int
        How many settings were found by trying, and from how many printed numbers; 0, where none were.
    fitted : str
        Which settings, and from which prints.
    stays : str
        A key of `STAYS`, or empty.
    reason : str
        Which function or formula of the page, or what is counted.

    Examples
    --------
    >>> made = Making.parse("fit: 1 setting from 7 numbers: T_F, from Table 3 | count: samples of a record")
    >>> made.settings, made.numbers, made.fitted, made.stays
    (1, 7, 'T_F, from Table 3', 'count')
    """

    settings: int = 0
    numbers: int = 0
    fitted: str = ""
    stays: str = ""
    reason: str = ""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read the column.

        Parameters
        ----------
        text : str
            The column ``made``; often empty.

        Returns
        -------
        Making

        Raises
        ------
        LedgerError
            If it says something else.

        Examples
        --------
        >>> Making.parse("page: time_constant").stays
        'page'
        >>> Making.parse("page: a | count: b")
        Traceback (most recent call last):
        paperledger.digits.LedgerError: made 'page: a | count: b' gives two reasons why the value stays; one is enough
        """
        parts = [part.strip() for part in text.split(" | ")] if text else []
        said: dict[str, str] = {}
        for part in parts:
            kind, colon, words = part.partition(": ")
            if not (colon and words.strip()) or kind in said or kind not in ("fit", *STAYS):
                raise LedgerError(
                    f"made {text!r} does not read like 'page: <function>', 'count: <what is counted>' or "
                    "'fit: 3 settings from 70 numbers: <which, from which prints>'"
                )
            said[kind] = words
        fit = said.pop("fit", "")
        found = _FIT.fullmatch(fit)
        if fit and not (found and int(found[1]) and int(found[2])):
            raise LedgerError(
                f"fit {fit!r} does not read like '3 settings from 70 numbers: T_F, from Table 3'"
            )
        if len(said) > 1:
            raise LedgerError(f"made {text!r} gives two reasons why the value stays; one is enough")
        stays, reason = next(iter(said.items()), ("", ""))
        settings, numbers, fitted = found.groups() if found else (0, 0, "")
        return cls(int(settings), int(numbers), fitted, stays, reason)
