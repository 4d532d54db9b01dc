"""Printed against computed: every number and statement of a paper, its value here, and the verdict.

A file ``book/ledger/<paper>.csv`` has one row for each claim. The checks of a paper, in ``book/checks``, hand over what
they compute; the audit page runs them section by section and closes the ledger::

    from pidalab.ledger import Ledger, checks

    book = Ledger.open("haalman2024")
    checks("haalman2024").three_points(book)   # calls book.check(id, kp), book.statement(id, a, "<", b), …
    book.table("ex1.")
    book.close()

A value, the evidence of a statement or a note that drifts from the stored one fails, and so do a verdict that no longer
follows, a declared disagreement that starts to agree, an id that is unknown or left over. A verdict is one of

* ``reproduced``, ``last-digit``, ``approximate``: these follow from the two numbers, see `derive`;
* ``holds``, ``fails``: these follow from the relation between two computed numbers that decides a statement;
* ``misprint``, ``as-read``, ``differs``, ``not-computable``: declared by a person, with the reason in the note.

The basis of a row says what it stands on: the paper's problem (``computed``), other printed results (``from-print``),
or reading alone (``reading``).

``python -m pidalab.ledger update haalman2024`` runs the checks of a paper, stores what is new and prints what changed;
``show``, ``check`` and ``readme`` print, validate and publish.
"""

from pidalab.ledger.book import Ledger
from pidalab.ledger.display import Display
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import papers, read_rows, write_rows
from pidalab.ledger.front import score_markdown, write_score
from pidalab.ledger.pages import convention_table, errata, every_row, load_all, scoreboard
from pidalab.ledger.relations import CONVENTIONS, Convention, Evidence, Relation
from pidalab.ledger.rows import Row
from pidalab.ledger.running import record, update
from pidalab.ledger.shims import checks, every, some  # old calls, until the last page has moved
from pidalab.ledger.verdicts import BASES, VERDICTS, derive

__all__ = [
    "BASES",
    "CONVENTIONS",
    "VERDICTS",
    "Convention",
    "Display",
    "Evidence",
    "Ledger",
    "LedgerError",
    "Relation",
    "Row",
    "checks",
    "convention_table",
    "derive",
    "errata",
    "every",
    "every_row",
    "load_all",
    "papers",
    "read_rows",
    "record",
    "score_markdown",
    "scoreboard",
    "some",
    "update",
    "write_rows",
    "write_score",
]
