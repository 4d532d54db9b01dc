"""Reading, storing and comparing numbers."""

import pytest

from pidalab.ledger import LedgerError
from pidalab.ledger.digits import agrees, read_number, same_text, show, store


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


@pytest.mark.parametrize(
    ("new", "same"),
    [
        ("2 of 10 exceed 3.21 by 0.31 %", True),
        ("2 of 10 exceed 3.21 by 0.32 %", True),  # a unit in the last place, as of a tie
        ("2 of 10 exceed 3.21 by 0.33 %", False),
        ("3 of 10 exceed 3.21 by 0.31 %", False),
        ("2 of 10 exceed 3.21 by -0.31 %", False),
        ("2 of 10 reach 3.21 by 0.31 %", False),
        ("2 of 10 exceed 3.2 by 0.31 %", True),
        ("2 of 10 exceed 3.21", False),
    ],
)
def test_texts_are_the_same_to_a_unit_of_their_decimals(new, same):
    assert same_text("2 of 10 exceed 3.21 by 0.31 %", new) is same
