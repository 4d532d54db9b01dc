"""Derive verdicts of printed numbers and of statements."""

import numpy as np
import pytest

from paperledger import Evidence, LedgerError, Relation, derive
from paperledger.verdicts import agrees, read_number, same_text, show, write

INF = float("inf")


@pytest.mark.parametrize("text", ["12 %", "", " 1", "1,5", "5.", "−3", "inf", "1e", "1_000", "٣"])
def test_only_plain_numbers_are_read(text):
    with pytest.raises(LedgerError, match="not a plain number"):
        read_number(text)


@pytest.mark.parametrize(
    ("fresh", "stored", "same"),
    [
        ("1.309812346", "1.309812345", True),  # one unit in the last stored place
        ("1.309812347", "1.309812345", False),
        ("9.999999995", "9.999999990", True),  # never tighter than 1e-9
        ("9.999999999", "10.00000000", True),
        ("1.310000000", "1.31", False),  # fewer digits would hide drift
        ("1.31", "1.32", True),  # a page may keep three digits
        ("-1.3", "1.3", False),
    ],
)
def test_drift_of_a_number(fresh, stored, same):
    assert agrees(fresh, stored) is same


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("1.500000000 < 2.000000000", "1.500000001 < 2.000000000", True),
        ("1.500000000 < 2.000000000", "1.500000003 < 2.000000000", False),
        ("1.500000000 < 2.000000000", "1.500000000 <= 2.000000000", False),
        ("3.1 < 4.2", "3.100000000 < 4.200000000", False),  # fewer digits would hide drift
        ("3 < 4 | worst of 2 cases: a", "3 < 4", False),
        ("3 < 4 | worst of 2 cases: a; ratio 0.74", "3 < 4 | worst of 3 cases: a; ratio 0.74", False),
        ("3 < 4 | worst of 2 cases: a; ratio 0.74", "3 < 4 | worst of 2 cases: a; ratio 0.75", True),
    ],
)
def test_drift_of_evidence(old, new, same):
    assert same_text(old, new) is same


@pytest.mark.parametrize(
    ("value", "floor", "stored"),
    [
        (8.0, -10, "8.000000000"),
        (-3e-18, -11, "0.00000000000"),  # the noise of a computed zero is dropped
        (1234567890123.0, 2, "1.234567890e+12"),
        (1.5e-8, -19, "1.500000000e-8"),
    ],
)
def test_stored_digits_show_the_precision(value, floor, stored):
    assert write(value, floor) == stored


@pytest.mark.parametrize(
    ("printed", "computed", "shown"),
    [
        ("1.30", "1.300000000", "1.3000"),
        ("8", "8.024999999", "8.02"),
        ("1e-3", "0.001024999999", "0.00102"),
        ("12", "0.001234567890", "0.00123"),  # legible, although far below the printed digits
        ("0.382", "0.38", "0.38"),  # no digit that is not stored
        ("0.0", "0.00000000000", "0.000"),
    ],
)
def test_shown_number_has_two_guard_digits(printed, computed, shown):
    assert show(printed, computed) == shown


@pytest.mark.parametrize(
    ("printed", "computed", "note", "verdict"),
    [
        ("0.382", "0.3825", "", "reproduced"),  # a tie above the printed number agrees, …
        ("0.382", "0.3815", "", "reproduced"),  # … and a tie below
        ("0.382", "0.3825000001", "", "last-digit"),
        ("0.382", "0.38250000000001", "", "reproduced"),  # floating-point noise on a tie
        ("0.382", "0.3835", "", "last-digit"),
        ("0.382", "-0.382", "", None),
        ("1.00", "1.005", "", "reproduced"),  # in binary 1.005 lies below the tie
        ("1.01", "1.005", "", "reproduced"),
        ("1.30", "1.31", "", "last-digit"),  # a trailing zero is a printed digit
        ("120", "121", "", "last-digit"),  # so is a trailing zero of an integer
        ("1.2e2", "121", "", "reproduced"),  # with an exponent only written digits count
        ("2.00", "2.02", "Read from Fig. 3; Tolerance 1%.", "approximate"),
        ("2.00", "2.0201", "tolerance 1 %", None),
        ("-2.00", "-1.98", "tolerance 1 %", "approximate"),
        ("2.00", "2.02", "tolerance 2e-2, stated by the authors", "approximate"),
        ("2.00", "2.001", "tolerance 0.02", "approximate"),  # digits need not match
        ("2.00", "2.001", "within tolerance", "reproduced"),  # a tolerance needs a number
        ("2.00", "2.10", "tolerance 5 %", "approximate"),  # the widest allowed tolerance
        ("2.00", "2.10", "tolerance 0.1", "approximate"),
    ],
)
def test_verdict_follows_from_the_two_numbers(printed, computed, note, verdict):
    assert derive(printed, computed, note) == verdict


@pytest.mark.parametrize("size", ["1 % or tolerance 2 %", "0.004", "0 %", "5.1 %", "0.11", "900 %"])
def test_unusable_tolerances(size):
    with pytest.raises(LedgerError, match="tolerance"):
        derive("2.00", "2.00", f"tolerance {size}")


# --- statements ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("left", "sign", "right", "text", "verdict"),
    [
        (10.82, "<=", 10, "10.82000000 <= 10 | ratio 1.1", "fails"),
        (np.float64(2.5), ">", np.int64(2), "2.500000000 > 2 | ratio 1.2", "holds"),
        (3, "==", np.int32(3), "3 == 3", "holds"),
        (1e-17, "<", 2.0, "0.000000000000 < 2.000000000 | ratio under 0.001", "holds"),
        (-3e7, ">=", -INF, "-30000000.00 >= -inf", "holds"),
        # The written digits decide.
        (1.0, "<", 1.0 + 1e-14, "1.000000000 < 1.000000000 | ratio 1.0", "fails"),
    ],
)
def test_evidence_is_the_inequality_with_its_digits(left, sign, right, text, verdict):
    evidence = Relation.parse(f"A {sign} B").decide((left, right))
    assert str(evidence) == text
    assert Evidence.parse(text) == evidence
    assert evidence.verdict == verdict


@pytest.mark.parametrize(
    ("relation", "cases", "message"),
    [
        ("<", (True, 2), "found True"),
        ("<", ("1", 2), "expected a number"),
        ("<", {"a": 1.0}, "expected a pair"),
        ("==", (1.0, 1.0), "'==' compares integers"),
        ("≈", (1.0, 2.0), "does not allow ''"),
        ("≈ | alike", (1.0, 2.0), "not allow 'alike'; known: similar, slightly"),
        ("< | similar", (1.0, 2.0), "does not allow 'similar'"),
        ("< | much", (1.0, INF), "finite magnitudes"),
        ("residual < 1e-9 | rounding", 1e-12, "does not allow 'rounding'"),
    ],
)
def test_what_cannot_be_compared(relation, cases, message):
    with pytest.raises(LedgerError, match=message):
        Relation.parse(relation).decide(cases)


@pytest.mark.parametrize("text", ["", "holds", "1 < ", "1 < x", "1 ~ 2", "1 < 2 | ", "nan < 2", "1 < a * 2"])
def test_unreadable_evidence(text):
    with pytest.raises(LedgerError):
        Evidence.parse(text)


@pytest.mark.parametrize(
    ("relation", "left", "right", "kept", "verdict"),
    [
        ("≈ | similar", 1.0, 1.1, "1.000000000 >= 0.9 * 1.100000000", "holds"),
        ("≈ | similar", 1.12, 1.0, "1.120000000 <= 1/0.9 * 1.000000000", "fails"),
        ("< | slightly", 1.0, 1.09, "1.000000000 >= 0.9 * 1.090000000", "holds"),
        ("< | slightly", 1.0, 1.01, "1.000000000 < 1.010000000", "holds"),
        ("< | clearly", 0.79, 1.0, "0.7900000000 < 0.8 * 1.000000000", "holds"),
        ("> | clearly", 1.0, 0.81, "1.000000000 > 1.25 * 0.8100000000", "fails"),
        ("< | much", 0.65, 1.0, "0.6500000000 < 0.5 * 1.000000000", "fails"),
        ("> | much", 2.1, 1.0, "2.100000000 > 2 * 1.000000000", "holds"),
        ("> | negligible", 9.0, 1.0, "9.000000000 > 10 * 1.000000000", "fails"),
        ("<= | identical", -0.009, 1.0, "0.009000000000 <= 0.01 * 1.000000000", "holds"),
        ("<= | settled", 0.02, 1.0, "0.02000000000 <= 0.02 * 1.000000000", "holds"),
        ("<= | settled", -0.021, 1.0, "0.02100000000 <= 0.02 * 1.000000000", "fails"),
    ],
)
def test_conventions_are_those_of_the_notation_page(relation, left, right, kept, verdict):
    evidence = Relation.parse(relation).decide((left, right))
    assert str(evidence).partition(" | ")[0] == kept
    assert evidence.verdict == verdict


def test_the_worst_case_decides_or_the_best_with_some():
    cases = {"a": (1.0, 2.0), ("b", 3): (1.9, 2.0), "c | d": (3.0, 9.0)}
    every, some = Relation.parse("A < B"), Relation.parse("A < B | some")
    assert (
        str(every.decide(cases))
        == "1.900000000 < 2.000000000 | worst of 3 cases: b, 3; ratio from 0.33 to 0.95"
    )
    assert (
        str(some.decide(cases))
        == "3.000000000 < 9.000000000 | best of 3 cases: c / d; ratio from 0.33 to 0.95"
    )
    violated = cases | {"d": (5.0, 4.0), "e": (8.0, 4.0)}
    assert every.decide(violated).remark == "worst of 5 cases: e; ratio from 0.33 to 2.0"
    equal = every.decide({"a": (1.0, 2.0), "b": (1.0, 2.0 - 1e-15)})  # rounding does not exchange equal cases
    assert equal.remark == "worst of 2 cases: a; ratio 0.50"
    sized = {"large": (99.0, 100.0), "small": (0.05, 0.1), "none": (0.0, 0.0)}
    assert Relation.parse("A <= B").decide(sized).remark == "worst of 3 cases: none"
    assert every.decide(sized | {"none": (0.0, 0.1)}).remark == "worst of 3 cases: large"


PARTS = {
    ("load", "Ms 1.4"): (1.0, 2.0),
    ("load", "Ms 2"): (1.5, 2.0),
    "quiet": (3.0, 2.0),
    "loud": (5.0, 2.0),
}


@pytest.mark.parametrize("declared", ["holds for: load", "fails for: quiet; loud"])
def test_a_statement_that_holds_in_part(declared):
    evidence = Relation.parse(f"A < B | {declared}").decide(PARTS)
    assert str(evidence) == (
        "1.500000000 < 2.000000000 | holds in 2 of 4 (load, Ms 1.4; load, Ms 2); ratio from 0.50 to 0.75 || "
        "3.000000000 < 2.000000000 | fails in 2 of 4 (quiet; loud); ratio from 1.5 to 2.5"
    )
    assert evidence.verdict == "holds-in-part"
    assert evidence.shown() == "1.500 < 2.000; 3.000 ≮ 2.000"
    assert Evidence.parse(str(evidence)) == evidence


@pytest.mark.parametrize(
    ("declared", "wrong"),
    [
        ("holds for: load; quiet", "quiet is declared to hold"),
        ("fails for: quiet", "loud is declared to hold"),
        ("holds for: loud", "load, Ms 1.4 is declared to fail"),
        ("holds for: lo", "no case is called lo"),
        ("rounding | fails for: load", "identity"),
        ("holds for: load; quiet; loud", "quiet is declared to hold"),
    ],
)
def test_an_undeclared_part_is_refused(declared, wrong):
    with pytest.raises(LedgerError, match=wrong):
        Relation.parse(f"A <= B | {declared}").decide(PARTS)


def test_a_residual_is_kept_to_its_decade():
    identity = Relation.parse("residual <= 1e-9 | rounding")
    assert str(identity.decide(3.1e-16)) == "1e-15 <= 1e-9"
    assert str(identity.decide({"a": 0.0, "b": -3e-12})) == "1e-11 <= 1e-9"
    assert identity.decide(9e-10).verdict == "holds"
    assert str(identity.decide(2e-9)) == "2.000000000e-9 <= 1e-9"
    assert identity.decide(2e-9).verdict == "fails"
