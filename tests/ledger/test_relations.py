"""Relations, conventions, and the text that keeps them."""

import subprocess
import sys
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from pidalab.ledger import CONVENTIONS, Evidence, LedgerError, every, some
from pidalab.ledger.conventions import IDENTITY, factor

INF = float("inf")


@pytest.mark.parametrize(
    ("left", "relation", "right", "text", "verdict"),
    [
        (10.82, "<=", 10, "10.82000000 <= 10", "fails"),
        (np.float64(2.5), ">", np.int64(2), "2.500000000 > 2", "holds"),
        (3, "==", np.int32(3), "3 == 3", "holds"),
        (3, "!=", 3, "3 != 3", "fails"),
        (1e-17, "<", 2.0, "0.000000000000 < 2.000000000", "holds"),  # no noise is kept
        (1.5e-20, "<", 2e-20, "1.500000000e-20 < 2.000000000e-20", "holds"),
        (-3e7, ">=", -INF, "-30000000.00 >= -inf", "holds"),
        (INF, "<", 4.0, "inf < 4.000000000", "fails"),
        (1.0, "<", 1.0 + 1e-14, "1.000000000 < 1.000000000", "fails"),  # what is written decides
    ],
)
def test_a_relation_is_kept_with_its_digits(left, relation, right, text, verdict):
    evidence = Evidence.of(left, relation, right)
    assert str(evidence) == text
    assert Evidence.parse(text) == evidence
    assert evidence.verdict == verdict


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((True, "<", 2), "found True"),
        ((float("nan"), "<", 2), "expected a number"),
        (("1", "<", 2), "expected a number"),
        ((1, "=", 2), "unknown relation '='"),
        ((1.0, "within", 2.0), "'within' needs a convention"),
        ((1.0, "==", 1.0), "'==' is for integers"),
        ((1.0, "within", 2.0, "alike"), "unknown convention 'alike'; one of similar, slightly"),
        ((1.0, "<", 2.0, "similar"), "the convention 'similar' goes with 'within', found '<'"),
        ((1.0, "<", INF, "much"), "needs finite numbers"),
    ],
)
def test_what_cannot_be_compared(arguments, message):
    convention = arguments[3] if len(arguments) > 3 else None
    with pytest.raises(LedgerError, match=message):
        Evidence.of(*arguments[:3], convention=convention)


def test_evidence_stays_as_it_was_judged():
    evidence = Evidence.of(1.0, "<", 2.0)
    with pytest.raises(FrozenInstanceError):
        evidence.right = "0"


@pytest.mark.parametrize(
    "text", ["", "holds", "1 < ", "1 < x", "1 ~ 2", "1 < 2 | ", "nan < 2", "1 < 2 extra"]
)
def test_unreadable_evidence(text):
    with pytest.raises(LedgerError):
        Evidence.parse(text)


@pytest.mark.parametrize(
    ("name", "left", "relation", "right", "verdict"),
    [
        ("similar", 1.0, "within", 1.1, "holds"),
        ("similar", 1.0, "within", 1.12, "fails"),
        ("similar", 1.0, "within", -1.0, "fails"),
        ("slightly", 1.0, "<", 1.05, "holds"),
        ("slightly", 1.0, "<", 1.0, "fails"),
        ("slightly", 1.05, "<", 1.0, "fails"),
        ("slightly", 1.0, "<", 1.2, "fails"),
        ("clearly", 1.0, ">", 0.8, "holds"),
        ("clearly", 1.0, ">", 0.81, "fails"),
        ("clearly", 0.5, ">", 1.0, "fails"),
        ("much", 1.0, "<", 2.0, "holds"),
        ("much", 1.0, "<", 1.99, "fails"),
        ("much", 0.0, "<", 1.99, "holds"),
        ("negligible", 0.1, "<", 1.0, "holds"),
        ("negligible", 0.11, "<", 1.0, "fails"),
        ("settled", 0.02, "<=", 1.0, "holds"),
        ("settled", -0.021, "<=", 1.0, "fails"),
        ("settled", 0.02, ">", 1.0, "fails"),
        ("settled", 0.03, ">", 1.0, "holds"),
        ("identical", 0.01, "<=", -1.0, "holds"),
        ("identical", 0.011, "<=", 1.0, "fails"),
    ],
)
def test_conventions(name, left, relation, right, verdict):
    evidence = Evidence.of(left, relation, right, convention=name)
    assert evidence.verdict == verdict
    assert Evidence.parse(str(evidence)).verdict == verdict
    assert Evidence.parse(str(evidence)).convention == name


@pytest.mark.parametrize(("right", "near"), [(1.04, False), (1.07, True), (1.15, True), (1.3, False)])
def test_a_row_says_that_the_convention_decides(right, near):
    assert (
        str(Evidence.of(1.0, "within", right, convention="similar")).endswith("factor of two of the limit")
        is near
    )


def test_factors_of_equal_sizes():
    assert factor(-2.0, -2.0) == 1.0
    assert factor(2.0, -2.0) == factor(0.0, 2.0) == INF


def test_every_takes_the_worst_and_some_the_best():
    cases = {"a": (1.0, 2.0), "b": (1.9, 2.0), "c": (3.0, 9.0)}
    assert str(Evidence.of(*every(cases, "<"))) == "1.900000000 < 2.000000000 | worst of 3: b"
    assert str(Evidence.of(*some(cases, "<"))) == "3.000000000 < 9.000000000 | best of 3: c"
    violated = cases | {"d": (5.0, 4.0), "e": (8.0, 4.0)}
    assert str(Evidence.of(*every(violated, "<"))) == "8.000000000 < 4.000000000 | worst of 5: e"
    assert Evidence.of(*every({"a": (2, 2), "b": (2, 3)}, "==")).verdict == "fails"
    with pytest.raises(LedgerError, match="no cases"):
        every({}, "<")


def test_every_knows_the_convention():
    cases = {"a": (1.0, 1.02), "b": (1.0, 1.3)}
    evidence = Evidence.of(*every(cases, "within", "similar"))
    assert (evidence.right, evidence.convention) == ("1.300000000", "similar")
    slight = {"far": (1.0, 1.5), "none": (1.0, 1.0), "fine": (1.0, 1.05)}
    assert Evidence.of(*some(slight, "<", "slightly")).verdict == "holds"
    assert Evidence.of(*every(slight, "<", "slightly")).verdict == "fails"


def test_equal_cases_do_not_change_places_by_rounding():
    first = every({"a": (1.0, 2.0), "b": (1.0, 2.0 - 1e-15)}, "<")
    assert first[1].remark == "worst of 2: a"


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("1.500000000 < 2.000000000", (1.5000000009, "<", 2.0), True),
        ("1.500000000 < 2.000000000", (1.500000003, "<", 2.0), False),
        ("1.500000000 < 2.000000000", (1.5, "<=", 2.0), False),
        ("3 < 4", (3, "<", 5), False),
        ("1.500000000 < inf", (1.5, "<", INF), True),
        ("1.500000000 < inf", (1.5, "<", 1e12), False),
        ("3 < 4 | worst of 2: a", (3, "<", 4), False),
    ],
)
def test_drift_of_evidence(old, new, same):
    assert Evidence.parse(old).same(Evidence.of(*new)) is same


def test_a_residual_is_kept_to_its_decade():
    evidence = Evidence.identity(3.1e-16, 1e-9)
    assert str(evidence) == "1e-15 <= 1e-09 | rounding"
    assert evidence.same(Evidence.identity(0.0, 1e-9))
    assert not evidence.same(Evidence.identity(0.0, 1e-8))
    assert not evidence.same(Evidence.identity(2e-9, 1e-9))
    assert Evidence.identity(2e-9, 1e-9).verdict == "fails"
    assert Evidence.identity(9e-10, 1e-9).verdict == "holds"
    for residual, tolerance in ((-1.0, 1.0), (1.0, 0.0), (INF, 1.0)):
        with pytest.raises(LedgerError):
            Evidence.identity(residual, tolerance)


def test_every_convention_is_described():
    for name, convention in CONVENTIONS.items():
        assert convention.name == name
        assert convention.words
        assert convention.meaning


def test_the_notation_page_has_the_conventions():
    page = (Path(__file__).parents[2] / "book" / "notation.md").read_text(encoding="utf-8")
    for convention in CONVENTIONS.values():
        assert f"| {convention.words} | {convention.meaning} |" in page
    assert "at most 1e-9 |" in page
    assert IDENTITY == 1e-9


def test_the_ledger_knows_nothing_of_control():
    heavy = "('numpy', 'control', 'scipy')"
    script = f"import sys, pidalab.ledger; print(*(name for name in {heavy} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
