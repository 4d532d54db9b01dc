"""The ledger: what counts as agreement, what makes a chapter fail, and that an update touches only what it must."""

import json
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from pidalab.ledger import (
    VERDICTS,
    Ledger,
    LedgerError,
    Row,
    derive,
    errata,
    load_all,
    read_rows,
    record,
    score_markdown,
    scoreboard,
    write_rows,
    write_score,
)
from pidalab.ledger.__main__ import main
from pidalab.ledger.digits import agrees, read_number, show, store
from pidalab.ledger.notebook import update

ROWS = [
    Row("demo.t1.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced"),
    Row("demo.t1.ti", "Table 1", "integral time (s)", "2.88", "2.868000000", "last-digit"),
    Row("demo.t1.td", "Table 1", "derivative time (s)", "0.50", "0.5100000000", "approximate", "noise: tolerance 5 %"),
    Row("demo.t1.ta", "Table 1", "acceleration time (s)", "12", "0.1200000000", "misprint", "eq. (3) gives 0.12"),
    Row("demo.t2.ms", "Table 2", "M_s", "1.40", "1.900000000", "differs", 'they say "about", and no more'),
    Row("demo.t2.iae", "Table 2", "IAE", "n/a", "", "not-computable", "the noise seed was not published"),
    Row("demo.s1", "Sec. 3", "claim", "A < B & PIDA is faster", "holds", "holds", "3.1 s against 4.2 s"),
    Row("demo.s2", "Sec. 3", "claim", "the loop is stable", "fails", "fails", "two poles at 0.1"),
]
VALUES = {
    "demo.t1.kp": 1.309812345,
    "demo.t1.ti": 2.868,
    "demo.t1.td": 0.51,
    "demo.t1.ta": 0.12,
    "demo.t2.ms": 1.9,
    "demo.s1": True,
    "demo.s2": False,
}
KP = ROWS[0]


def ledger(*rows: Row) -> Ledger:
    return Ledger(Path("demo.csv"), rows or ROWS)


def failures(book: Ledger, *claim: object) -> list[str]:
    with pytest.raises(LedgerError) as caught:
        book.check(*claim)
    return str(caught.value).splitlines()


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with one ledger, seen from its root."""
    folder = tmp_path / "book" / "ledger"
    folder.mkdir(parents=True)
    write_rows(folder / "demo.csv", ROWS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_notebook(path: Path, *cells: str) -> Path:
    prose = {"cell_type": "markdown", "source": ["# Prose"]}
    code = [{"cell_type": "code", "source": cell.splitlines(keepends=True)} for cell in cells]
    path.write_text(json.dumps({"cells": [prose, *code]}))
    return path


# ---------------------------------------------------------------------------------------------------------- verdicts


@pytest.mark.parametrize(
    ("printed", "computed", "verdict"),
    [
        ("0.382", "0.3824999999", "reproduced"),
        ("0.382", "0.3825", "reproduced"),  # a tie counts for the print, above …
        ("0.382", "0.3815", "reproduced"),  # … and below
        ("0.382", "0.3825000001", "last-digit"),
        ("0.382", "0.38250000000001", "reproduced"),  # floating-point noise on a tie
        ("0.382", "0.3835", "last-digit"),
        ("0.382", "0.3805", "last-digit"),
        ("0.382", "0.3835000001", None),
        ("0.382", "-0.382", None),
        ("1.00", "1.005", "reproduced"),  # in binary 1.005 lies below the tie
        ("1.01", "1.005", "reproduced"),
        ("1.30", "1.304", "reproduced"),
        ("1.30", "1.31", "last-digit"),  # the trailing zero is a printed digit
        ("1.3", "1.31", "reproduced"),
        ("-0.05", "-0.0549", "reproduced"),
        ("-0.05", "-0.0551", "last-digit"),
        ("-0.05", "0.05", None),
        ("8", "8.4", "reproduced"),
        ("8", "7.5", "reproduced"),
        ("8", "9.2", "last-digit"),
        ("120", "121", "last-digit"),  # trailing zeros of an integer are digits too
        ("1.2e2", "121", "reproduced"),  # an exponent says that they are not
        ("1e-3", "0.0014", "reproduced"),
        ("1E-3", "1.6e-3", "last-digit"),
        ("+.5", "0.54", "reproduced"),
        ("0", "-0.3", "reproduced"),
        ("0.00", "0.01", "last-digit"),
        ("any words", "holds", "holds"),
        ("any words", "fails", "fails"),
    ],
)
def test_verdict_follows_from_the_two_numbers(printed, computed, verdict):
    assert derive(printed, computed) == verdict


@pytest.mark.parametrize(
    ("printed", "computed", "note", "verdict"),
    [
        ("2.00", "2.02", "tolerance 1 %", "approximate"),
        ("2.00", "2.02", "Read from Fig. 3; Tolerance 1%.", "approximate"),
        ("2.00", "2.0201", "tolerance 1 %", None),
        ("-2.00", "-1.98", "tolerance 1 %", "approximate"),
        ("2.00", "2.02", "tolerance 0.02", "approximate"),
        ("2.00", "2.02", "tolerance 2e-2, stated by the authors", "approximate"),
        ("2.00", "2.03", "tolerance 0.02.", None),
        ("2.00", "2.001", "tolerance 0.02", "approximate"),  # the digits are not expected to match
        ("2.00", "2.001", "within tolerance", "reproduced"),  # no number, no tolerance
        ("2.00", "2.001", "intolerance 5 %", "reproduced"),
    ],
)
def test_tolerance_in_the_note(printed, computed, note, verdict):
    assert derive(printed, computed, note) == verdict


@pytest.mark.parametrize("note", ["tolerance 1 % or tolerance 2 %", "tolerance 0.004", "tolerance 0 %"])
def test_unusable_tolerances(note):
    with pytest.raises(LedgerError, match="tolerance"):
        derive("2.00", "2.00", note)


@pytest.mark.parametrize(
    "text", ["12 %", "1.3 s", "", " 1", "1,5", "5.", "−3", "inf", "nan", "1e", "0x1", "1_000", "٣"]
)
def test_only_plain_numbers(text):
    with pytest.raises(LedgerError, match="not a plain number"):
        read_number(text)


@pytest.mark.parametrize(
    ("value", "stored", "same"),
    [
        (1.309812345, "1.309812345", True),
        (1.309812346, "1.309812345", True),  # one unit in the last stored place
        (1.309812347, "1.309812345", False),
        (9.876543230e9, "9876543210", False),
        (9.876543211e9, "9876543210", True),
        (0.39, "0.38", True),  # fewer digits, looser
        (0.3901, "0.38", False),
        (9.999999995, "9.999999990", True),  # never tighter than 1e-9
        (1e-17, "0.0000000000", True),
        (-1.3, "1.3", False),
    ],
)
def test_drift(value, stored, same):
    assert agrees(value, stored) is same


@pytest.mark.parametrize(
    ("value", "printed", "stored"),
    [
        (0.5, "0.50", "0.5000000000"),
        (8, "8", "8.000000000"),
        (-0.0, "0.0", "0.0000000000"),
        (-3e-18, "0.0", "0.00000000000"),
        (1 / 3, "0.33", "0.3333333333"),
        (1234567890123.0, "1e12", "1.234567890e+12"),
        (1.5e-8, "1.5e-8", "1.500000000e-8"),
        (1e300, "1", "1.000000000e+300"),
    ],
)
def test_stored_text_says_how_precise_it_is(value, printed, stored):
    assert store(value, printed) == stored
    assert agrees(float(value), stored)


@pytest.mark.parametrize(
    ("printed", "computed", "shown"),
    [
        ("1.31", "1.309812345", "1.3098"),
        ("1.30", "1.300000000", "1.3000"),
        ("8", "8.024999999", "8.02"),
        ("1e-3", "0.001024999999", "0.00102"),
        ("1.2e-7", "1.234567e-7", "1.235e-7"),
        ("38.2", "3.823456789", "3.823"),
        ("12", "0.001234567890", "0.00123"),  # legible, although far below the printed digits
        ("0.382", "0.38", "0.38"),  # no digit that is not stored
        ("0.0", "0.00000000000", "0.000"),
    ],
)
def test_shown_number_has_two_guard_digits(printed, computed, shown):
    assert show(printed, computed) == shown


# ------------------------------------------------------------------------------------------------------ a chapter


def test_a_whole_chapter(project, capsys):
    book = Ledger.open("demo")
    book.check("demo.t1.kp", 1.309812345)
    book.check({id: value for id, value in VALUES.items() if id != "demo.t1.kp"})
    book.close()
    line = "demo: 8 claims, 1 reproduced, 1 last-digit, 1 approximate, 1 holds, 1 misprint, 1 differs, 1 fails, "
    assert capsys.readouterr().out == line + "1 not-computable\n"


def test_open_searches_upward(project, monkeypatch):
    monkeypatch.chdir(project / "book" / "ledger")
    assert list(Ledger.open("demo").rows.values()) == ROWS
    assert Ledger.open("demo", project / "book" / "ledger").paper == "demo"


def test_open_names_what_there_is(project, tmp_path_factory, monkeypatch):
    with pytest.raises(LedgerError, match=r"no ledger dmeo\.csv .* there are: demo"):
        Ledger.open("dmeo")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(LedgerError, match="no folder book/ledger"):
        Ledger.open("demo")


@pytest.mark.parametrize("value", [np.float64(1.309812345), np.array(1.309812345), Decimal("1.309812345")])
def test_scalars_of_any_kind(value):
    ledger().check("demo.t1.kp", value)


@pytest.mark.parametrize("value", [True, np.bool_(True), np.array(True)])
def test_truth_values_of_any_kind(value):
    ledger().check("demo.s1", value)


@pytest.mark.parametrize(
    "value", [None, "1.31", float("nan"), float("inf"), 1.31 + 0j, np.complex128(1.31), np.ones(1), [1.31]]
)
def test_refused_values(value):
    (failure,) = failures(ledger(), "demo.t1.kp", value)
    assert failure.startswith("demo.t1.kp: expected a finite number or a truth value, found ")


def test_numbers_and_statements_do_not_mix():
    assert failures(ledger(), "demo.t1.kp", True) == [
        "demo.t1.kp: expected a number as stored, 1.309812345, found True"
    ]
    assert failures(ledger(), "demo.s1", 1.0) == ["demo.s1: expected a truth value as stored, holds, found 1.0"]


def test_drift_and_the_verdict_it_gives():
    assert failures(ledger(), "demo.t1.kp", 1.3098124) == ["demo.t1.kp: drifted from 1.309812345 to 1.309812400"]
    assert failures(ledger(), "demo.t1.kp", 1.3151) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.315100000",
        "demo.t1.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit",
    ]
    assert failures(ledger(), "demo.s1", False) == [
        "demo.s1: drifted from holds to fails",
        "demo.s1: file says holds, fails against printed A < B & PIDA is faster gives fails",
    ]


def test_verdict_no_longer_follows():
    row = replace(KP, computed="1.3151")
    wrong = "demo.t1.kp: file says reproduced, 1.3151 against printed 1.31 gives last-digit"
    assert failures(ledger(row), row.id, 1.3151) == [wrong]
    assert row.problems() == [wrong]
    far = replace(KP, computed="1.9").disagreement()
    assert far is not None
    assert far.endswith("gives no agreement; declare misprint or differs, with a note")


def test_noise_on_a_tie_does_not_flip_the_verdict():
    row = replace(KP, computed="1.315000000")
    ledger(row).check(row.id, np.nextafter(1.315, 2))
    ledger(row).check(row.id, 1.3150000009)


@pytest.mark.parametrize("verdict", ["misprint", "differs"])
def test_declared_disagreement_starts_to_agree(verdict):
    row = Row("demo.x", "Table 1", "x", "1.31", "1.400000000", verdict, "a reason")
    ledger(row).check("demo.x", 1.4)
    assert failures(ledger(row), "demo.x", 1.31) == [
        "demo.x: drifted from 1.400000000 to 1.310000000",
        f"demo.x: declared {verdict} starts to agree, 1.310000000 against printed 1.31 gives reproduced",
    ]
    agreeing = replace(row, computed="1.3149")
    message = f"demo.x: declared {verdict} starts to agree, 1.3149 against printed 1.31 gives reproduced"
    assert agreeing.problems() == failures(ledger(agreeing), "demo.x", 1.3149) == [message]


def test_declared_disagreement_by_one_digit_or_within_a_tolerance():
    row = Row("demo.x", "Table 1", "x", "1.31", "1.32", "misprint", "a proof")
    assert not row.problems()
    assert replace(row, note="a proof; tolerance 1 %").problems()


def test_declared_statement_starts_to_agree():
    row = Row("demo.s", "Eq. (7)", "sign", "the sign is +", "fails", "misprint", "the pole is at -1")
    ledger(row).check("demo.s", False)
    assert failures(ledger(row), "demo.s", True)[1].startswith("demo.s: declared misprint starts to agree, holds")


def test_unknown_id_names_the_closest():
    (failure,) = failures(ledger(), "demo.t1.kq", 1.0)
    assert failure.startswith("demo.t1.kq: unknown id; the closest are demo.t1.kp, demo.t1.t")
    assert failures(ledger(), "zzz", 1.0) == ["zzz: unknown id"]


def test_every_failure_of_a_call_is_listed():
    claims = {"demo.t1.kp": 1.3151, "demo.nope": 1.0, "demo.t1.ti": 2.868, "demo.t2.iae": 3.0, "demo.s2": True}
    found = [failure.split(":")[0] for failure in failures(ledger(), claims)]
    assert found == ["demo.t1.kp", "demo.t1.kp", "demo.nope", "demo.t2.iae", "demo.s2", "demo.s2"]


def test_handed_over_twice():
    book = ledger()
    book.check("demo.t1.kp", 1.309812345)
    book.check("demo.t1.kp", 1.309812345)
    assert failures(book, "demo.t1.kp", 1.4) == ["demo.t1.kp: handed over twice, as 1.309812345 and as 1.4"]
    assert failures(book, "demo.t1.ti", 2.9)  # refused, so the corrected value is the first
    book.check("demo.t1.ti", 2.868)
    book.check("demo.s1", True)
    assert failures(book, "demo.s1", False) == ["demo.s1: handed over twice, as True and as False"]


def test_nothing_stored_yet():
    row = replace(KP, computed="", verdict="")
    (failure,) = failures(ledger(row), row.id, 1.25)
    assert "nothing stored yet" in failure
    assert "1.25" in failure


def test_close_lists_what_was_never_handed_over():
    book = ledger()
    book.check({id: value for id, value in VALUES.items() if not id.startswith("demo.t1.t")})
    with pytest.raises(LedgerError) as caught:
        book.close()
    never = ["demo.t1.ti", "demo.t1.td", "demo.t1.ta"]  # and not demo.t2.iae, which cannot be computed
    assert str(caught.value).splitlines() == [f"{id}: never handed over" for id in never]


# ----------------------------------------------------------------------------------------------------- display


def test_table_has_the_rows_of_the_prefix():
    table = ledger().table("demo.t1.")
    lines = repr(table).splitlines()
    assert lines[0].split("  ")[0] == "claim"
    assert lines[1].split() == ["demo.t1.kp:", "gain", "(Table", "1)", "1.31", "1.3098", "+0.0", "reproduced"]
    assert lines[2].split()[-3:] == ["2.8680", "-1.2", "last-digit"]
    assert len(lines) == 5
    assert '<td class="number">1.3098</td>' in table._repr_html_()
    assert '<span class="verdict-last-digit">last-digit</span>' in table._repr_html_()
    with pytest.raises(LedgerError, match=r"no id starts with demo\.t9"):
        ledger().table("demo.t9")


def test_html_is_escaped():
    row = Row("demo.s", "<i>", 'a "b"', "A < B & C", "holds", "holds", "<script>")
    html = ledger(row).table()._repr_html_()
    assert "A &lt; B &amp; C" in html
    assert "&lt;script&gt;" in html
    assert "&lt;i&gt;" in html
    assert "quot" in ledger(replace(row, printed='a "b"')).table().html


def test_html_is_the_same_every_time():
    assert ledger().table().html == ledger().table().html
    assert ledger().scorebar().html == ledger().scorebar().html
    assert "id=" not in ledger().table().html + ledger().scorebar().html


def test_scorebar():
    bar = ledger().scorebar()
    assert bar.html.startswith('<div class="scorebar" role="img"')
    assert 'role="img" aria-label="demo: 8 claims, 1 reproduced, ' in bar.html
    assert bar.html.count('style="width:12.50%"') == 8
    assert '<li class="verdict-misprint">misprint 1</li>' in bar.html
    assert repr(bar).startswith("demo: 8 claims, ")


def test_score_counts_rows_without_a_verdict_as_open():
    score = ledger(KP, replace(KP, id="demo.new", computed="", verdict="")).score()
    assert list(score) == [*VERDICTS, "open"]
    assert (score["reproduced"], score["misprint"], score["open"]) == (1, 0, 1)
    assert "verdict-open" in ledger(replace(KP, computed="", verdict="")).table().html


def test_table_of_an_unreadable_row_names_it():
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: '12 %'"):
        ledger(replace(KP, printed="12 %")).table()


# ---------------------------------------------------------------------------------------------- files and validation


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": "demo.T1.kp"}, "lower case and dotted"),
        ({"id": "demo"}, "does not start with demo."),
        ({"id": "other.kp"}, "does not start with demo."),
        ({"where": ""}, "'where' is empty"),
        ({"quantity": " "}, "'quantity' is empty"),
        ({"printed": ""}, "'printed' is empty"),
        ({"printed": "12 %"}, "'12 %' is not a plain number"),
        ({"computed": "about 1"}, "'about 1' is not a plain number"),
        ({"computed": ""}, "'computed' is empty"),
        ({"verdict": "good"}, "unknown verdict 'good'; one of reproduced, "),
        ({"verdict": ""}, "file says nothing, .* gives reproduced"),
        ({"verdict": "approximate"}, "approximate needs a tolerance"),
        ({"verdict": "approximate", "note": "tolerance 1 %, tolerance 2 %"}, "more than one tolerance"),
        ({"verdict": "approximate", "computed": "1.4", "note": "tolerance 1 %"}, "gives no agreement"),
        ({"note": "tolerance 1 %"}, "file says reproduced, .* gives approximate"),
        ({"verdict": "misprint", "computed": "1.9"}, "misprint needs a note"),
        ({"verdict": "differs", "computed": "1.9", "note": " "}, "differs needs a note"),
        ({"verdict": "not-computable", "computed": ""}, "not-computable needs a note"),
        ({"verdict": "not-computable", "note": "unpublished"}, "'computed' is not empty"),
        ({"verdict": "holds", "computed": "holds"}, "holds needs a note"),
        ({"verdict": "holds", "computed": "fails", "note": "1 > 2"}, "file says holds, .* gives fails"),
        ({"verdict": "holds", "note": "1 > 2"}, "file says holds, .* gives reproduced"),
    ],
)
def test_validation(project, change, message):
    row = replace(KP, **change)
    write_rows(project / "book" / "ledger" / "demo.csv", [row])
    with pytest.raises(LedgerError, match=message) as caught:
        load_all()
    assert row.id in str(caught.value)


def test_validation_lists_everything(project):
    write_rows(project / "book" / "ledger" / "other.csv", ROWS[:2])
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, verdict="good", where="")])
    with pytest.raises(LedgerError) as caught:
        load_all()
    assert len(str(caught.value).splitlines()) == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the columns id, where, .* found $"),
        ("id,where\n", "expected the columns id, where, "),
        ("id,where,quantity,printed,computed,verdict,note\ndemo.a,b\n", "expected 7 entries, found 2 in 'demo.a,b'"),
        ("id,where,quantity,printed,computed,verdict,note\na,,,,,,\na,,,,,,\n", "more than one row for a"),
        ('id,where,quantity,printed,computed,verdict,note\na,,,,,,"x\ny"\n', "line break inside an entry of a"),
        ('id,where,quantity,printed,computed,verdict,note\na,,,,,,"x', "unexpected end of data"),
    ],
)
def test_unreadable_files(tmp_path, text, message):
    path = tmp_path / "demo.csv"
    path.write_text(text)
    with pytest.raises(LedgerError, match=message):
        read_rows(path)


def test_file_round_trip(tmp_path):
    path = tmp_path / "demo.csv"
    odd = replace(KP, note='comma, "quote", κ ≤ 2, a\\b, NA', where="nan")
    write_rows(path, [odd, *ROWS[1:]])
    once = path.read_bytes()
    assert read_rows(path) == [odd, *ROWS[1:]]
    write_rows(path, read_rows(path))
    assert path.read_bytes() == once
    assert b"\r" not in once


# ------------------------------------------------------------------------------------------------------- update


def test_record_fills_an_empty_ledger(project):
    blank = [
        replace(
            row, computed="", verdict=row.verdict if row.verdict in ("misprint", "differs", "not-computable") else ""
        )
        for row in ROWS
    ]
    path = project / "book" / "ledger" / "demo.csv"
    write_rows(path, blank)
    record("demo", dict(reversed(VALUES.items())))
    filled = read_rows(path)
    assert [(row.id, row.verdict, row.note) for row in filled] == [(row.id, row.verdict, row.note) for row in ROWS]
    assert load_all()["demo"].score() == ledger().score()


def test_record_leaves_agreeing_values_alone(project):
    path = project / "book" / "ledger" / "demo.csv"
    before = path.read_bytes()
    assert record("demo", {**VALUES, "demo.t1.kp": 1.3098123451, "demo.t2.ms": 1.9000000004}) == []
    assert path.read_bytes() == before


def test_record_says_what_changed_and_changes_nothing_else(project):
    path = project / "book" / "ledger" / "demo.csv"
    before = path.read_text().splitlines()
    assert record("demo", {"demo.t1.kp": 1.3151, "demo.t2.ms": 1.41, "demo.s1": False}) == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
        "demo.t2.ms: computed '1.900000000' -> '1.410000000'",
        "demo.s1: computed 'holds' -> 'fails'",
        "demo.s1: verdict 'holds' -> 'fails'",
    ]
    after = path.read_text().splitlines()
    assert [new for old, new in zip(before, after, strict=True) if new != old] == [
        "demo.t1.kp,Table 1,gain,1.31,1.315100000,last-digit,",
        'demo.t2.ms,Table 2,M_s,1.40,1.410000000,differs,"they say ""about"", and no more"',
        "demo.s1,Sec. 3,claim,A < B & PIDA is faster,fails,fails,3.1 s against 4.2 s",
    ]


def test_record_leaves_the_judgement_of_a_disagreement_to_a_person(project):
    assert record("demo", {"demo.t1.kp": 7.0})[1] == "demo.t1.kp: verdict 'reproduced' -> ''"
    with pytest.raises(LedgerError, match="declare misprint or differs, with a note"):
        load_all()


def test_record_keeps_the_number_of_digits(project):
    path = project / "book" / "ledger" / "demo.csv"
    write_rows(path, [replace(KP, computed="1.31"), replace(KP, id="demo.zero", printed="0.00", computed="0.00")])
    record("demo", {"demo.t1.kp": 1.3251, "demo.zero": 0.0123})
    assert [row.computed for row in read_rows(path)] == ["1.33", "0.01230000000"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"demo.t1.kp": 1.0, "demo.t1.kq": 2.0}, "demo.t1.kq: unknown id"),
        ({"demo.t1.kp": 1.0, "demo.t1.ti": float("nan")}, "demo.t1.ti: expected a finite number"),
        ({"demo.t1.kp": 1.0, "demo.t1.ti": True}, "demo.t1.ti: expected a number as stored"),
    ],
)
def test_record_writes_all_or_nothing(project, values, message):
    before = (project / "book" / "ledger" / "demo.csv").read_bytes()
    with pytest.raises(LedgerError, match=message):
        record("demo", values)
    assert (project / "book" / "ledger" / "demo.csv").read_bytes() == before


CHAPTER = (
    "%matplotlib inline\n%config InlineBackend.figure_formats = ['svg']",
    "from pidalab.ledger import Ledger\nbook = Ledger.open('demo')\nbook.scorebar()",
    "import matplotlib.pyplot as plt\nplt.plot([1, 2])\nplt.show()\nbook.check('demo.t1.kp', 1.3151)",
    f"book.check({ {id: value for id, value in VALUES.items() if id != 'demo.t1.kp'} })\nbook.table('demo.t1')",
    "from pathlib import Path\nassert Path('ledger').is_dir()\nbook.close()",
)


def test_update_runs_the_chapter_in_its_folder(project):
    result = update(write_notebook(Path("book", "demo.ipynb"), *CHAPTER))
    assert result.problems == []
    assert result.changes == [
        "demo.t1.kp: computed '1.309812345' -> '1.315100000'",
        "demo.t1.kp: verdict 'reproduced' -> 'last-digit'",
    ]
    assert Path.cwd() == project
    assert Ledger.open("demo").rows["demo.t1.kp"].verdict == "last-digit"


def test_update_reports_what_is_left(project):
    write_rows(project / "book" / "ledger" / "demo.csv", [*ROWS, replace(KP, id="demo.new", computed="")])
    result = update(write_notebook(Path("book", "demo.ipynb"), *CHAPTER))
    assert result.problems == ["demo.new: 'computed' is empty", "demo.new: never handed over"]


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("book.check('demo.t1.kq', 1.0)", "demo.ipynb, code cell 6: LedgerError: demo.t1.kq: unknown id; the closest"),
        ("book.check('demo.t1.kp', 9.0)", "handed over twice"),
        ("1 / 0", "code cell 6: ZeroDivisionError"),
        ("1 +", "code cell 6: .*Error"),
    ],
)
def test_update_stores_nothing_when_a_cell_fails(project, cell, message):
    before = Path("book", "ledger", "demo.csv").read_bytes()
    with pytest.raises(LedgerError, match=message):
        update(write_notebook(Path("book", "demo.ipynb"), *CHAPTER, cell))
    assert Path("book", "ledger", "demo.csv").read_bytes() == before
    Ledger.open("demo").check("demo.t1.kp", 1.309812345)  # and the real ledger is back


# --------------------------------------------------------------------------------------------- pages and commands


def test_scoreboard(project):
    write_rows(project / "book" / "ledger" / "another.csv", [replace(KP, id="another.kp")])
    board = scoreboard()
    lines = [line.split() for line in repr(board).splitlines()]
    assert lines[0] == ["verdict", "another", "demo", "total"]
    assert [line[0] for line in lines[1:]] == [*VERDICTS, "claims"]
    assert lines[1][1:] == ["1", "1", "2"]
    assert lines[-1][1:] == ["1", "8", "9"]
    assert board._repr_html_().count('role="img"') == 3


def test_errata(project):
    page = errata()
    assert "as read" in repr(page)
    assert "(demo, " in repr(page).splitlines()[-1]
    assert repr(page).endswith("12                0.120      Proof. eq. (3) gives 0.12")
    assert "demo.t2" not in page.html
    assert page.html.startswith('<p class="errata-notice">')


def test_errata_of_a_statement(project):
    row = Row("demo.s", "Eq. (7)", "sign", "the sign is +", "fails", "misprint", "the pole is at -1")
    write_rows(project / "book" / "ledger" / "demo.csv", [row])
    assert "does not hold" in errata().html


def test_markdown_score(project):
    lines = score_markdown().splitlines()
    assert lines[0] == "<!-- score -->"
    assert lines[-1] == "<!-- /score -->"
    assert lines[2] == "| verdict | demo | total |"
    assert lines[4] == "| reproduced | 1 | 1 |"
    assert lines[-3] == "| **claims** | **8** | **8** |"


def test_write_score_rewrites_only_its_block(project):
    page = project / "README.md"
    page.write_text("# A \\1 title\n<!-- score -->\nold\n<!-- /score -->\nafter\n")
    assert write_score(page)
    assert page.read_text() == f"# A \\1 title\n{score_markdown()}\nafter\n"
    assert not write_score(page)


@pytest.mark.parametrize("count", [0, 2])
def test_write_score_needs_one_block(project, count):
    page = project / "README.md"
    page.write_text("<!-- score --><!-- /score -->\n" * count)
    with pytest.raises(LedgerError, match=f"expected one block .* found {count}"):
        write_score(page)


def test_commands(project, capsys):
    page = project / "README.md"
    page.write_text("<!-- score --><!-- /score -->\n")
    notebook = write_notebook(Path("book", "demo.ipynb"), *CHAPTER)
    assert main(["check"]) == 0
    assert main(["show", "demo"]) == 0
    assert main(["update", str(notebook)]) == 0
    assert main(["readme", str(page)]) == 0
    out = capsys.readouterr().out
    assert out.count("demo: 8 claims, 1 reproduced") == 2
    assert "2 entries changed\ndemo.t1.kp: computed '1.309812345' -> '1.315100000'" in out
    assert f"{page}: rewritten" in out


def test_commands_fail_aloud(project, capsys):
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, computed="7")])
    for command in (["check"], ["show", "nobody"], ["update", "book/none.ipynb"], ["readme", "none.md"]):
        assert main(command) == 1
        assert capsys.readouterr().err
