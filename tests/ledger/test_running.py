"""Running the checks of a paper, and storing what they hand over."""

from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import CHECKS, ENTRIES, KP, ROWS, S1, failures, ledger

from pidalab.ledger import (
    Entry,
    Evidence,
    Ledger,
    LedgerError,
    checks,
    load_all,
    read_rows,
    record,
    run,
    update,
    write_rows,
)
from pidalab.ledger.verdicts import DECLARED

PATH = Path("book", "ledger", "demo.csv")


def test_record_fills_an_empty_ledger(project):
    blank = [
        row
        if row.basis == "reading"
        else replace(row, computed="", evidence="", verdict=row.verdict if row.verdict in DECLARED else "")
        for row in ROWS
    ]
    write_rows(PATH, blank)
    record("demo", dict(reversed(ENTRIES.items())))
    assert read_rows(PATH) == ROWS
    assert load_all()["demo"].score() == ledger().score()


def test_record_leaves_agreeing_values_alone(project):
    before = PATH.read_bytes()
    near = {"demo.t1.kp": Entry(1.3098123451), "demo.s1": Entry(evidence=Evidence.of(3.1000000004, "<", 4.2))}
    assert record("demo", ENTRIES | near | {"demo.s3": Entry(note="the list of references says so")}) == []
    assert PATH.read_bytes() == before


def test_record_says_what_changed_and_changes_nothing_else(project):
    before = PATH.read_text().splitlines()
    entries = {
        "demo.t1.kp": Entry(1.3151),
        "demo.t2.ms": Entry(1.41, note="now it is 1.41 at least"),
        "demo.s1": Entry(evidence=Evidence.of(5, "<", 4)),
    }
    assert record("demo", entries) == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
        "demo.t2.ms: computed '1.900000000' -> '1.410000000'",
        "demo.t2.ms: note 'they say \"about\", and say no more' -> 'now it is 1.41 at least'",
        "demo.s1: computed 'holds' -> 'fails'",
        "demo.s1: evidence '3.100000000 < 4.200000000' -> '5 < 4'",
        "demo.s1: verdict 'holds' -> 'fails'",
    ]
    after = PATH.read_text().splitlines()
    assert [new for old, new in zip(before, after, strict=True) if new != old] == [
        "demo.t1.kp,Table 1,gain,1.31,1.315100000,last-digit,computed,,",
        "demo.t2.ms,Table 2,M_s,1.40,1.410000000,differs,computed,,now it is 1.41 at least",
        "demo.s1,sec. 3,statement,A < B & PIDA is faster,fails,fails,computed,5 < 4,",
    ]


def test_record_leaves_the_judgement_of_a_disagreement_to_a_person(project):
    assert record("demo", {"demo.t1.kp": Entry(7.0)})[1] == "demo.t1.kp: verdict 'reproduced' -> ''"
    with pytest.raises(LedgerError, match="declare misprint, as-read or differs, with a note"):
        load_all()


def test_record_replaces_digits_that_hide_drift(project):
    write_rows(
        PATH, [replace(KP, computed="1.31"), replace(KP, id="demo.zero", printed="0.00", computed="0.00")]
    )
    record("demo", {"demo.t1.kp": Entry(1.3101), "demo.zero": Entry(0.001)})
    assert [row.computed for row in read_rows(PATH)] == ["1.310100000", "0.001000000000"]
    record("demo", {"demo.t1.kp": Entry(1.3251, note="Four digits: fitted.", digits=4)})
    assert read_rows(PATH)[0].computed == "1.325"


def test_record_knows_the_ids(project):
    before = PATH.read_bytes()
    with pytest.raises(LedgerError, match=r"demo\.t1\.kq: unknown id"):
        record("demo", {"demo.t1.kp": Entry(1.0), "demo.t1.kq": Entry(2.0)})
    assert PATH.read_bytes() == before


def test_run_collects_and_compares_nothing(project):
    before = PATH.read_bytes()
    outcome = run("demo")
    assert outcome["demo.t1.kp"].value == 1.3151
    assert str(outcome["demo.s1"].evidence) == "3.100000000 < 4.200000000"
    assert outcome["demo.t2.ms"] == Entry(1.9, note='they say "about", and say no more')
    assert PATH.read_bytes() == before


def test_update(project):
    result = update("demo")
    assert result.changes == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
    ]
    assert result.problems == []
    assert Ledger.open("demo").rows["demo.t1.kp"].verdict == "last-digit"


def test_update_reports_what_is_left(project):
    write_rows(PATH, [*ROWS, replace(KP, id="demo.new", computed=""), replace(S1, id="demo.s9", evidence="")])
    assert update("demo").problems == [
        "demo.new: 'computed' is empty",
        "demo.s9: no evidence: a statement is a relation of two numbers",
        "demo.new: never handed over",
        "demo.s9: never handed over",
    ]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("book.check('t1.kq', 1.0)", r"demo\.t1\.kq: unknown id; the closest"),
        ("book.check('t1.kp', 9.0)", "handed over twice"),
        ("book.statement('s1', True, '<', 3)", "expected a number"),
        ("1 / 0", "division by zero"),
    ],
)
def test_update_stores_nothing_when_a_check_fails(project, line, message):
    before = PATH.read_bytes()
    Path("book", "checks", "demo.py").write_text(
        CHECKS.replace("SECTIONS", f"def last(book):\n    {line}\n\nSECTIONS")
    )
    source = Path("book", "checks", "demo.py").read_text().replace("statements)", "statements, last)")
    Path("book", "checks", "demo.py").write_text(source)
    with pytest.raises((LedgerError, ZeroDivisionError), match=message):
        update("demo")
    assert PATH.read_bytes() == before


def test_checks_may_be_a_package(project):
    folder = Path("book", "checks", "other")
    folder.mkdir()
    (folder / "__init__.py").write_text("from .part import section\nSECTIONS = (section,)\n")
    (folder / "part.py").write_text("from .. import demo\ndef section(book):\n    return demo.SECTIONS\n")
    assert len(checks("other").SECTIONS[0](None)) == 2
    assert checks("other") is checks("other")
    assert failures(checks, "nobody")[0].endswith("there are: demo")


def test_checks_of_another_book_are_others(project, tmp_path_factory):
    first = checks("demo")
    other = tmp_path_factory.mktemp("book")
    (other / "ledger").mkdir()
    (other / "checks").mkdir()
    (other / "checks" / "demo.py").write_text("SECTIONS = ()\n")
    assert checks("demo", other / "ledger").SECTIONS == ()
    assert len(checks("demo").SECTIONS) == len(first.SECTIONS) == 2
