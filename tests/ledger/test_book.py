"""A chapter and its ledger: what is refused, what fails, and what the messages name."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from demo_ledger import KP, NUMBERS, ROWS, S1, failures, hand_over, ledger

from pidalab.ledger import Ledger, LedgerError, Row


def test_a_whole_chapter(project, capsys):
    book = Ledger.open("demo")
    hand_over(book)
    book.close()
    line = "demo: 10 claims, 1 reproduced, 1 last-digit, 1 approximate, 1 holds, 1 fails, 1 misprint, 1 differs, "
    apart = "1 disagree with other print, 1 settled by reading, 1 not computable\n"
    assert capsys.readouterr().out == line + apart


def test_open_searches_upward(project, monkeypatch):
    monkeypatch.chdir(project / "book" / "ledger")
    assert list(Ledger.open("demo").rows.values()) == ROWS
    assert Ledger.open("demo", project / "book" / "ledger").paper == "demo"


def test_open_names_what_there_is(project, tmp_path_factory, monkeypatch):
    (project / "book" / "ledger" / "manifest.csv").write_text("")
    with pytest.raises(LedgerError, match=r"no ledger dmeo\.csv .* there are: demo$"):
        Ledger.open("dmeo")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(LedgerError, match="no folder book/ledger"):
        Ledger.open("demo")


@pytest.mark.parametrize("id", ["demo.t1.kp", "t1.kp"])
@pytest.mark.parametrize("value", [np.float64(1.309812345), np.array(1.309812345), Decimal("1.309812345")])
def test_scalars_of_any_kind(id, value):
    ledger().check(id, value)


@pytest.mark.parametrize(
    "value",
    [None, "1.31", float("nan"), 1.31 + 0j, np.complex128(1.31), np.ones(1), [1.31], True, np.bool_(True)],
)
def test_refused_values(value):
    (failure,) = failures(ledger().check, "t1.kp", value)
    assert failure.startswith("demo.t1.kp: expected a number, found ")


def test_infinite_is_a_side_but_no_value():
    assert failures(ledger().check, "t1.kp", float("inf")) == [
        "demo.t1.kp: expected a finite number, found inf"
    ]
    row = replace(S1, evidence="3.100000000 < inf")
    ledger(row).statement("s1", 3.1, "<", float("inf"))


def test_numbers_and_statements_do_not_mix():
    assert "a statement is a relation" in failures(ledger().check, "s1", 1.0)[0]
    assert "a statement hands over both sides" in failures(ledger().check, "s1", True)[0]
    assert "is compared with a number" in failures(ledger().statement, "t1.kp", 1.0, "<", 2.0)[0]
    assert "its basis is reading" in failures(ledger().check, "t2.iae", 1.0)[0]
    assert "its basis is reading" in failures(ledger().statement, "s3", 1, "<", 2)[0]


def test_drift_and_the_verdict_it_gives():
    assert failures(ledger().check, "t1.kp", 1.3098124) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.309812400"
    ]
    assert failures(ledger().check, "t1.kp", 1.3151) == [
        "demo.t1.kp: drifted from 1.309812345 to 1.315100000",
        "demo.t1.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit",
    ]
    assert failures(ledger().statement, "s1", 3.2, "<", 4.2) == [
        "demo.s1: drifted from 3.100000000 < 4.200000000 to 3.200000000 < 4.200000000"
    ]
    assert failures(ledger().statement, "s1", 5.2, "<", 4.2) == [
        "demo.s1: drifted from 3.100000000 < 4.200000000 to 5.200000000 < 4.200000000",
        "demo.s1: file says holds, 5.200000000 < 4.200000000 gives fails",
    ]


def test_a_note_drifts_like_a_value():
    book = ledger(replace(S1, note="PIDA is faster by 26.2 %."))
    book.statement("s1", 3.1, "<", 4.2, note="PIDA is faster by 26.2 %.")
    (failure,) = failures(book.note, "s1", "PIDA is faster by 28.2 %.")
    assert "handed over twice" in failure
    fresh = ledger(replace(S1, note="PIDA is faster by 26.2 %."))
    assert failures(fresh.statement, "s1", 3.1, "<", 4.2, note="PIDA is faster by 28.2 %.") == [
        "demo.s1: drifted from note 'PIDA is faster by 26.2 %.' to note 'PIDA is faster by 28.2 %.'"
    ]


def test_verdict_no_longer_follows():
    row = replace(KP, computed="1.315100000")
    wrong = "demo.t1.kp: file says reproduced, 1.315100000 against printed 1.31 gives last-digit"
    assert failures(ledger(row).check, row.id, 1.3151) == [wrong]
    assert row.problems() == [wrong]
    far = replace(KP, computed="1.9").disagreement()
    assert far is not None
    assert far.endswith("gives no agreement; declare misprint, as-read or differs, with a note")


def test_noise_on_a_tie_does_not_flip_the_verdict():
    row = replace(KP, computed="1.315000000")
    ledger(row).check(row.id, np.nextafter(1.315, 2))
    ledger(row).check(row.id, 1.3150000009)
    tie = replace(S1, evidence="2.000000000 <= 2.000000000")
    ledger(tie).statement("s1", np.nextafter(2.0, 3), "<=", 2.0)


@pytest.mark.parametrize("verdict", ["misprint", "as-read", "differs"])
def test_declared_disagreement_starts_to_agree(verdict):
    row = Row("demo.x", "Table 1", "x", "1.31", "1.400000000", verdict, note="a reason of five words")
    ledger(row).check("x", 1.4)
    assert failures(ledger(row).check, "x", 1.31) == [
        "demo.x: drifted from 1.400000000 to 1.310000000",
        f"demo.x: declared {verdict} starts to agree, 1.310000000 against printed 1.31 gives reproduced",
    ]
    agreeing = replace(row, computed="1.314900000")
    message = f"demo.x: declared {verdict} starts to agree, 1.314900000 against printed 1.31 gives reproduced"
    assert agreeing.problems() == failures(ledger(agreeing).check, "x", 1.3149) == [message]


def test_declared_disagreement_by_one_digit_or_within_a_tolerance():
    row = Row("demo.x", "Table 1", "x", "1.31", "1.320000000", "misprint", note="a proof of five words")
    assert not row.problems()
    assert replace(row, note="a proof of five words; tolerance 1 %").problems()


def test_declared_statement_starts_to_agree():
    row = Row(
        "demo.s",
        "eq. (7)",
        "statement",
        "the sign is +",
        "fails",
        "misprint",
        "computed",
        "-1 > 0",
        "a pole in the right half",
    )
    assert not row.problems()
    ledger(row).statement("s", -1, ">", 0)
    found = failures(ledger(row).statement, "s", 1, ">", 0)
    assert found[1] == "demo.s: declared misprint starts to agree, 1 > 0 gives holds"


def test_unknown_id_names_the_closest():
    (failure,) = failures(ledger().check, "t1.kq", 1.0)
    assert failure.startswith("demo.t1.kq: unknown id; the closest are demo.t1.kp, demo.t1.t")
    assert failures(ledger().row, "very.far.from.every.other.one") == [
        "demo.very.far.from.every.other.one: unknown id"
    ]


def test_every_failure_of_a_call_is_listed():
    claims = {"t1.kp": 1.3151, "nope": 1.0, "t1.ti": 2.868, "t2.iae": 3.0, "t2.ms": None}
    found = [failure.split(":")[0] for failure in failures(ledger().check, claims)]
    assert found == ["demo.t1.kp", "demo.t1.kp", "demo.nope", "demo.t2.iae", "demo.t2.ms"]


def test_handed_over_twice():
    book = ledger()
    book.check("t1.kp", 1.309812345)
    book.check("demo.t1.kp", 1.309812345)
    assert failures(book.check, "t1.kp", 1.4) == ["demo.t1.kp: handed over twice, as 1.309812345 and as 1.4"]
    assert failures(book.check, "t1.ti", 2.9)  # refused, so the corrected value is the first
    book.check("t1.ti", 2.868)
    book.statement("s1", 3.1, "<", 4.2)
    assert "handed over twice" in failures(book.statement, "s1", 3.1, "<", 4.3)[0]


def test_nothing_stored_yet():
    row = replace(KP, computed="", verdict="")
    (failure,) = failures(ledger(row).check, row.id, 1.25)
    assert failure == "demo.t1.kp: nothing stored yet; `python -m pidalab.ledger update demo` stores it"


def test_close_lists_what_was_never_handed_over():
    book = ledger()
    book.check({id: value for id, value in NUMBERS.items() if not id.startswith("demo.t1.t")})
    note = "its note has numbers of no run; hand it over with the value, or by book.note"
    never = [
        "demo.t1.ti",
        "demo.t1.td",
        "demo.t1.ta",
        "demo.t1.tf",
    ]  # and not demo.t2.iae, which cannot be computed
    expected = [f"{id}: never handed over" for id in never]
    expected += [f"demo.t2.ms: {note}", "demo.s1: never handed over", "demo.s2: never handed over"]
    assert failures(book.close) == expected


def test_close_asks_for_the_numbers_of_a_reading():
    reading = ROWS[-1]
    ledger(replace(reading, note="By secs 2.1, 2.2 and eq. (3), as 2 of 3 say.")).close()
    book = ledger(replace(reading, note="The gain is 0.31."))
    assert failures(book.close)
    book.note("s3", "The gain is 0.31.")
    book.close()


def test_fewer_digits_need_a_reason():
    row = replace(KP, computed="1.310", note="Fitted, so to four digits.")
    assert "why, with the word 'digits'" in failures(ledger(row).check, "t1.kp", 1.3098, digits=4)[0]
    ledger(row).check("t1.kp", 1.3098, digits=4, note="Fitted, so to four digits.")


def test_a_coarse_identity_needs_a_reason():
    row = replace(S1, evidence="1e-08 <= 1e-07 | rounding", note="A quadrature.")
    assert "needs a note that says why" in failures(ledger(row).identity, "s1", 2e-9, 1e-7)[0]
    ledger(row).identity("s1", 2e-9, 1e-7, note="A quadrature.")
    assert "1e-08 to" not in failures(ledger(row).identity, "s1", 2e-7, 1e-7, note="A quadrature.")[1]
