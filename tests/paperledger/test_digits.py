"""Reading, storing and comparing numbers, and what counts as agreement."""

import pytest

from paperledger import LedgerError, derive
from paperledger.digits import agrees, read_number, same_text, show, write


@pytest.mark.parametrize(
    "text", ["12 %", "1.3 s", "", " 1", "1,5", "5.", "−3", "inf", "nan", "1e", "1_000", "٣"]
)
def test_only_plain_numbers(text):
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
        ("1.31", "1.32", True),  # a page that hands over three digits keeps three
        ("-1.3", "1.3", False),
    ],
)
def test_drift(fresh, stored, same):
    assert agrees(fresh, stored) is same


@pytest.mark.parametrize(
    ("value", "floor", "stored"),
    [
        (0.5, -12, "0.5000000000"),
        (8.0, -10, "8.000000000"),
        (-3e-18, -11, "0.00000000000"),  # no noise of a computed zero is kept
        (1234567890123.0, 2, "1.234567890e+12"),
        (1.5e-8, -19, "1.500000000e-8"),
        (1e300, -10, "1.000000000e+300"),
    ],
)
def test_stored_text_says_how_precise_it_is(value, floor, stored):
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
    ("old", "new", "same"),
    [
        ("1.500000000 < 2.000000000", "1.500000001 < 2.000000000", True),
        ("1.500000000 < 2.000000000", "1.500000003 < 2.000000000", False),
        ("1.500000000 < 2.000000000", "1.500000000 <= 2.000000000", False),
        ("3.1 < 4.2", "3.100000000 < 4.200000000", False),  # fewer digits would hide drift
        ("3 < 4 | worst of 2: a", "3 < 4", False),  # no case is dropped unseen
        ("3 < 4 | worst of 2: a; ratio 0.74", "3 < 4 | worst of 3: a; ratio 0.74", False),
        ("3 < 4 | worst of 2: a; ratio 0.74", "3 < 4 | worst of 2: a; ratio 0.75", True),
    ],
)
def test_drift_of_evidence(old, new, same):
    assert same_text(old, new) is same


@pytest.mark.parametrize(
    ("printed", "computed", "verdict"),
    [
        ("0.382", "0.3825", "reproduced"),  # a tie counts for the print, above …
        ("0.382", "0.3815", "reproduced"),  # … and below
        ("0.382", "0.3825000001", "last-digit"),
        ("0.382", "0.38250000000001", "reproduced"),  # floating-point noise on a tie
        ("0.382", "0.3835", "last-digit"),
        ("0.382", "-0.382", None),
        ("1.00", "1.005", "reproduced"),  # in binary 1.005 lies below the tie
        ("1.01", "1.005", "reproduced"),
        ("1.30", "1.31", "last-digit"),  # the trailing zero is a printed digit
        ("1.3", "1.31", "reproduced"),
        ("120", "121", "last-digit"),  # trailing zeros of an integer are digits too
        ("1.2e2", "121", "reproduced"),  # an exponent says that they are not
        ("0.00", "0.01", "last-digit"),
    ],
)
def test_verdict_follows_from_the_two_numbers(printed, computed, verdict):
    assert derive(printed, computed) == verdict


@pytest.mark.parametrize(
    ("printed", "computed", "note", "verdict"),
    [
        ("2.00", "2.02", "Read from Fig. 3; Tolerance 1%.", "approximate"),
        ("2.00", "2.0201", "tolerance 1 %", None),
        ("-2.00", "-1.98", "tolerance 1 %", "approximate"),
        ("2.00", "2.02", "tolerance 2e-2, stated by the authors", "approximate"),
        ("2.00", "2.03", "tolerance 0.02.", None),
        ("2.00", "2.001", "tolerance 0.02", "approximate"),  # the digits are not expected to match
        ("2.00", "2.001", "within tolerance", "reproduced"),  # no number, no tolerance
    ],
)
def test_tolerance_in_the_note(printed, computed, note, verdict):
    assert derive(printed, computed, note) == verdict


@pytest.mark.parametrize(
    "note",
    [
        "tolerance 1 % or tolerance 2 %",
        "tolerance 0.004",
        "tolerance 0 %",
        "tolerance 5.1 %",
        "tolerance 0.11",
        "tolerance 900 %",
    ],
)
def test_unusable_tolerances(note):
    with pytest.raises(LedgerError, match="tolerance"):
        derive("2.00", "2.00", note)


@pytest.mark.parametrize("note", ["tolerance 5 %", "tolerance 0.1"])
def test_the_widest_tolerance(note):
    assert derive("2.00", "2.10", note) == "approximate"
