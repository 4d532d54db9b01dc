"""What counts as agreement."""

import pytest

from pidalab.ledger import LedgerError, derive


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
