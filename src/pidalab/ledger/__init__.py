"""Printed against computed: every number and statement of a paper, its value here, and the verdict.

A file ``book/ledger/<paper>.csv`` has one row for each claim. A chapter opens it, hands over every value it computes,
and closes it::

    from pidalab.ledger import Ledger

    book = Ledger.open("haalman2024")
    book.check("haalman2024.ex1.pida.kp", kp)        # or a dictionary; a statement takes a truth value
    book.table("haalman2024.ex1.")
    book.close()

``check`` and ``close`` fail when a value drifts from the stored one, when the verdict in the file no longer follows,
when a declared disagreement starts to agree, and when an id is unknown or left over. A verdict is one of

* ``reproduced``, ``last-digit``, ``approximate``: these follow from the two numbers, see `derive`;
* ``holds``, ``fails``: a statement, with the numbers in the note;
* ``misprint``, ``differs``, ``not-computable``: declared by a person, with the reason in the note.

``python -m pidalab.ledger update book/haalman2024.ipynb`` stores the values of a new or changed chapter and prints what
changed; ``show``, ``check`` and ``readme`` print, validate and publish.
"""

from pidalab.ledger.book import Ledger, record
from pidalab.ledger.display import Display
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.pages import errata, load_all, score_markdown, scoreboard, write_score
from pidalab.ledger.rows import Row, read_rows, write_rows
from pidalab.ledger.verdicts import VERDICTS, derive

__all__ = [
    "VERDICTS",
    "Display",
    "Ledger",
    "LedgerError",
    "Row",
    "derive",
    "errata",
    "load_all",
    "read_rows",
    "record",
    "score_markdown",
    "scoreboard",
    "write_rows",
    "write_score",
]
