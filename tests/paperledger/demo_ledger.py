"""Provide a small correct ledger, which tests then damage."""

import csv
import json
from pathlib import Path

import pytest

from paperledger import Ledger, LedgerError, Row

TABLE = """\
demo.t1.kp,Table 1,gain,1.31,1.309812345,reproduced,computed,audit/demo,,,,
demo.t1.ti,Table 1,integral time (s),2.88,2.868000000,last-digit,computed,audit/demo,,,,
demo.t1.td,Table 1,time (s),0.50,0.5100000000,approximate,computed,audit/demo,,,,noise: tolerance 5 %
demo.t1.ta,Table 1,time (s),12,0.1200000000,misprint,computed,audit/demo,,,,eq. (3) gives 0.12 s instead
demo.t1.tf,Table 1,filter,0.3,0.8000000000,as-read,from-print,audit/demo,,,,a 3 may be an 8
demo.t2.ms,Table 2,M_s,1.40,1.900000000,differs,computed,audit/demo,,,,"they say ""about"", and say no more"
demo.t2.iae,Table 2,IAE,n/a,,not-computable,reading,,,,,the seed was never published
demo.s1,sec. 3,statement,A < B & it wins,holds,holds,computed,audit/demo,,A < B,3.100000000 < 4.200000000 | ratio 0.74,
demo.s2,sec. 3,statement,the loop is stable,fails,fails,computed,audit/demo,,poles == none,2 == 0,
demo.s3,sec. 3,statement,the oldest rule,,holds,reading,,,,,the list of references says so
"""
ROWS = [Row(*line) for line in csv.reader(TABLE.splitlines())]
NUMBERS = {
    "demo.t1.kp": 1.309812345,
    "demo.t1.ti": 2.868,
    "demo.t1.td": 0.51,
    "demo.t1.ta": 0.12,
    "demo.t1.tf": 0.8,
    "demo.t2.ms": 1.9,
}
KP, S1 = ROWS[0], ROWS[7]


def ledger(*rows: Row) -> Ledger:
    return Ledger(Path("demo.csv"), rows or ROWS, "audit/demo")


def hand_over(book: Ledger) -> None:
    """Pass all results of the demo to a ledger."""
    book.compare(NUMBERS)
    book.decide("s1", (3.1, 4.2))
    book.decide("s2", (2, 0))


def failures(call, *arguments: object, **options: object) -> list[str]:
    with pytest.raises(LedgerError) as caught:
        call(*arguments, **options)
    return str(caught.value).splitlines()


CELLS = [
    "%matplotlib inline\nfrom paperledger import Ledger\nbook = Ledger.open('demo', page='audit/demo')",
    "book.compare({'t1': {'kp': 1.3151, 'ti': 2.868, 'td': 0.51, 'ta': 0.12}})\nbook.compare({'t2.ms': 1.9})",
    "import matplotlib.pyplot as plt\nplt.figure()\nplt.show()\nbook.compare({'t1.tf': 0.8})",
    "print(book.decide('s1', {'one': (3.1, 4.2)}))\nbook.decide('s2', (2, 0))",
    "book.close()",
]


def write_notebook(path: Path, *sources: str, tags: tuple[str, ...] = ()) -> Path:
    cells = [
        {"cell_type": "code", "source": source, "metadata": {"tags": [*tags]}, "outputs": []}
        for source in sources
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"cells": cells}), encoding="utf-8")
    return path
