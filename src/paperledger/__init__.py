"""Compare the printed numbers and statements of papers with computed ones.

A file ``book/ledger/<paper>.csv``, the ledger of a paper, has a row for each claim. A claim is a printed number or a
statement. The notebooks about the paper compute results and pass them to the ledger::

    from paperledger import Ledger

    book = Ledger.open("haalman2024")  # in a chapter; an audit adds page="audit/haalman2024"
    book.compare({"ex1.pida": {"ti": C.ti, "td": C.td}})  # returns a table of printed and computed numbers
    book.decide("st.better.load", {"Ms 1.4": (pida, pid)})  # tests a statement by the relation in its row
    book.close()

A run raises an error if

* a value or the evidence of a statement differs from the stored one;
* a stored verdict no longer follows from the numbers;
* numbers agree although a person declared that they disagree;
* an id is unknown, or the notebook passes no value for a row whose column ``page`` names this notebook.

Verdicts are

* ``reproduced``, ``last-digit``, ``approximate``, which follow from the printed and computed number (see `derive`);
* ``holds``, ``holds-in-part``, ``fails``, which follow from the inequalities that decide a statement;
* ``misprint``, ``as-read``, ``differs``, ``not-computable``, which a person declares with the reason in the note.

The basis of a row says from what its value was computed:

* ``computed``: only from the problem as the paper states it;
* ``fitted``: from this problem, with settings that were fitted to printed numbers;
* ``from-print``: from other printed results;
* ``reading``: nothing was computed, since reading the paper decides the claim.

``python -m paperledger update haalman2024`` runs the pages of a paper, stores the results and prints the changes.
``--help`` lists the other commands.
"""

from paperledger.book import Ledger, load_all
from paperledger.display import Display
from paperledger.pages import errata, every_row, score_markdown, scoreboard, write_score
from paperledger.rows import Row, papers, read_rows, write_rows
from paperledger.running import update
from paperledger.verdicts import BASES, CONVENTIONS, VERDICTS, Evidence, LedgerError, Relation, derive

__all__ = [
    "BASES",
    "CONVENTIONS",
    "VERDICTS",
    "Display",
    "Evidence",
    "Ledger",
    "LedgerError",
    "Relation",
    "Row",
    "derive",
    "errata",
    "every_row",
    "load_all",
    "papers",
    "read_rows",
    "score_markdown",
    "scoreboard",
    "update",
    "write_rows",
    "write_score",
]
