"""A small ledger, complete and right, for the tests of the ledger to break."""

from pathlib import Path

import pytest

from pidalab.ledger import Entry, Evidence, Ledger, LedgerError, Row

ROWS = [
    Row("demo.t1.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced"),
    Row("demo.t1.ti", "Table 1", "integral time (s)", "2.88", "2.868000000", "last-digit"),
    Row(
        "demo.t1.td",
        "Table 1",
        "time (s)",
        "0.50",
        "0.5100000000",
        "approximate",
        note="noise: tolerance 5 %",
    ),
    Row(
        "demo.t1.ta",
        "Table 1",
        "time (s)",
        "12",
        "0.1200000000",
        "misprint",
        note="eq. (3) gives 0.12 s instead",
    ),
    Row(
        "demo.t1.tf",
        "Table 1",
        "filter",
        "0.3",
        "0.8000000000",
        "as-read",
        "from-print",
        note="a 3 may be an 8",
    ),
    Row(
        "demo.t2.ms",
        "Table 2",
        "M_s",
        "1.40",
        "1.900000000",
        "differs",
        note='they say "about", and say no more',
    ),
    Row(
        "demo.t2.iae",
        "Table 2",
        "IAE",
        "n/a",
        "",
        "not-computable",
        "reading",
        note="the seed was never published",
    ),
    Row(
        "demo.s1",
        "sec. 3",
        "statement",
        "A < B & PIDA is faster",
        "holds",
        "holds",
        evidence="3.100000000 < 4.200000000",
    ),
    Row("demo.s2", "sec. 3", "statement", "the loop is stable", "fails", "fails", evidence="2 == 0 | poles"),
    Row(
        "demo.s3",
        "sec. 3",
        "statement",
        "the oldest rule",
        "",
        "holds",
        "reading",
        note="the list of references says so",
    ),
]
NUMBERS = {
    "demo.t1.kp": 1.309812345,
    "demo.t1.ti": 2.868,
    "demo.t1.td": 0.51,
    "demo.t1.ta": 0.12,
    "demo.t1.tf": 0.8,
    "demo.t2.ms": 1.9,
}
ENTRIES = {
    **{id: Entry(value) for id, value in NUMBERS.items()},
    "demo.s1": Entry(evidence=Evidence.of(3.1, "<", 4.2)),
    "demo.s2": Entry(evidence=Evidence.of(2, "==", 0, names=("poles", ""))),
}
KP, S1 = ROWS[0], ROWS[7]


def ledger(*rows: Row) -> Ledger:
    return Ledger(Path("demo.csv"), rows or ROWS)


def hand_over(book: Ledger) -> None:
    """Everything that the demo computes, with its notes."""
    for id, value in NUMBERS.items():
        book.check(id, value, note=book.rows[id].note or None)
    book.statement("s1", 3.1, "<", 4.2)
    book.statement("s2", 2, "==", 0, left_name="poles")


def failures(call, *arguments: object, **options: object) -> list[str]:
    with pytest.raises(LedgerError) as caught:
        call(*arguments, **options)
    return str(caught.value).splitlines()


CHECKS = '''
"""Checks of the demo."""

def numbers(book):
    book.check("t1.kp", 1.3151)
    book.check({"t1.ti": 2.868, "t2.ms": 1.9})
    book.check("t1.td", 0.51, note="noise: tolerance 5 %")
    return book.table("t1")

def statements(book):
    import matplotlib.pyplot as plt
    plt.figure()
    book.check("t1.ta", 0.12, note=f"eq. (3) gives {0.12} s instead")
    book.check("t1.tf", 0.8, note="a 3 may be an 8")
    book.note("t2.ms", 'they say "about", and say no more')
    book.statement("s1", 3.1, "<", 4.2)
    book.statement("s2", 2, "==", 0, left_name="poles")

SECTIONS = (numbers, statements)
'''
