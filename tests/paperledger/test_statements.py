"""Relations, conventions, and the inequality that decides."""

from pathlib import Path

import numpy as np
import pytest

from paperledger import CONVENTIONS, Evidence, LedgerError, Relation
from paperledger.rows import IDENTITY

INF = float("inf")


@pytest.mark.parametrize(
    ("left", "sign", "right", "text", "verdict"),
    [
        (10.82, "<=", 10, "10.82000000 <= 10 | ratio 1.1", "fails"),
        (np.float64(2.5), ">", np.int64(2), "2.500000000 > 2 | ratio 1.2", "holds"),
        (3, "==", np.int32(3), "3 == 3", "holds"),
        (3, "==", 2, "3 == 2", "fails"),
        (1e-17, "<", 2.0, "0.000000000000 < 2.000000000 | ratio under 0.001", "holds"),  # no noise is kept
        (-3e7, ">=", -INF, "-30000000.00 >= -inf", "holds"),
        (INF, "<", 4.0, "inf < 4.000000000", "fails"),
        (1.0, "<", 1.0 + 1e-14, "1.000000000 < 1.000000000 | ratio 1.0", "fails"),  # what is written decides
    ],
)
def test_an_inequality_is_kept_with_its_digits(left, sign, right, text, verdict):
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
        ("≈", (1.0, 2.0), "≈ takes no convention ''"),
        ("==", (1.0, 1.0), "'==' is for integers"),
        ("≈ | alike", (1.0, 2.0), "≈ takes no convention 'alike'; there are similar, slightly"),
        ("< | similar", (1.0, 2.0), "< takes no convention 'similar'"),
        ("< | much", (1.0, INF), "finite magnitudes"),
        ("residual < 1e-9 | rounding", 1e-12, "< takes no convention 'rounding'; .* 'residual <= 1e-9"),
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
    ("name", "left", "sign", "right", "kept", "verdict"),
    [
        ("similar", 1.0, "≈", 1.1, "1.000000000 >= 0.9 * 1.100000000", "holds"),
        ("similar", 1.12, "≈", 1.0, "1.120000000 <= 1/0.9 * 1.000000000", "fails"),
        ("slightly", 1.0, "<", 1.09, "1.000000000 >= 0.9 * 1.090000000", "holds"),
        ("slightly", 1.0, "<", 1.01, "1.000000000 < 1.010000000", "holds"),
        ("clearly", 0.79, "<", 1.0, "0.7900000000 < 0.8 * 1.000000000", "holds"),
        ("clearly", 1.0, ">", 0.81, "1.000000000 > 1.25 * 0.8100000000", "fails"),
        ("much", 0.65, "<", 1.0, "0.6500000000 < 0.5 * 1.000000000", "fails"),
        ("much", 2.1, ">", 1.0, "2.100000000 > 2 * 1.000000000", "holds"),
        ("settled", 0.02, "<=", 1.0, "0.02000000000 <= 0.02 * 1.000000000", "holds"),
        ("settled", -0.021, "<=", 1.0, "0.02100000000 <= 0.02 * 1.000000000", "fails"),
    ],
)
def test_the_factor_of_a_convention_is_in_the_evidence(name, left, sign, right, kept, verdict):
    relation = Relation.parse(f"A {sign} B | {name}")
    evidence = relation.decide((left, right))
    assert str(evidence).partition(" | ")[0] == kept
    assert evidence.verdict == verdict


def test_every_takes_the_worst_and_some_the_best():
    cases = {"a": (1.0, 2.0), ("b", 3): (1.9, 2.0), "c | d": (3.0, 9.0)}
    every, some = Relation.parse("A < B"), Relation.parse("A < B | some")
    assert str(every.decide(cases)) == "1.900000000 < 2.000000000 | worst of 3: b, 3; ratio 0.33 to 0.95"
    assert str(some.decide(cases)) == "3.000000000 < 9.000000000 | best of 3: c / d; ratio 0.33 to 0.95"
    violated = cases | {"d": (5.0, 4.0), "e": (8.0, 4.0)}
    assert every.decide(violated).remark == "worst of 5: e; ratio 0.33 to 2.0"
    assert Relation.parse("A == B").decide({"a": (2, 2), "b": (2, 3)}).verdict == "fails"
    assert Relation.parse("≈ | similar").decide({"a": (1.0, 1.02), "b": (1.0, 1.3)}).right == "1.300000000"
    equal = every.decide({"a": (1.0, 2.0), "b": (1.0, 2.0 - 1e-15)})  # no change of places by rounding
    assert equal.remark == "worst of 2: a; ratio 0.50"


def test_the_worst_case_is_worst_relative_to_its_size():
    cases = {"large": (99.0, 100.0), "small": (0.05, 0.1), "none": (0.0, 0.0)}
    assert Relation.parse("A < B").decide(cases | {"none": (0.0, 0.1)}).remark == "worst of 3: large"
    assert Relation.parse("A <= B").decide(cases).remark == "worst of 3: none"


PARTS = {
    ("load", "Ms 1.4"): (1.0, 2.0),
    ("load", "Ms 2"): (1.5, 2.0),
    "quiet": (3.0, 2.0),
    "loud": (5.0, 2.0),
}


@pytest.mark.parametrize("declared", ["holds for: load", "fails for: quiet; loud"])
def test_a_statement_that_holds_in_part(declared):
    relation = Relation.parse(f"A < B | {declared}")
    found = relation.decide(PARTS)
    assert str(found) == (
        "1.500000000 < 2.000000000 | holds in 2 of 4: load, Ms 1.4; load, Ms 2; ratio 0.50 to 0.75 || "
        "3.000000000 < 2.000000000 | fails in 2 of 4: quiet; loud; ratio 1.5 to 2.5"
    )
    assert found.verdict == "holds-in-part"
    assert found.shown() == "1.500 < 2.000; 3.000 ≮ 2.000"
    assert Evidence.parse(str(found)) == found


@pytest.mark.parametrize(
    ("declared", "wrong"),
    [
        ("holds for: load; quiet", "quiet is declared to hold"),
        ("fails for: quiet", "loud is declared to hold"),
        ("holds for: loud", "load, Ms 1.4 is declared to fail"),
        ("holds for: lo", "no case is called lo"),
        ("rounding | fails for: load", "identity"),
    ],
)
def test_a_part_that_was_not_declared(declared, wrong):
    with pytest.raises(LedgerError, match=wrong):
        Relation.parse(f"A <= B | {declared}").decide(PARTS)


def test_a_statement_that_holds_everywhere_does_not_hold_in_part():
    with pytest.raises(LedgerError, match="one that fails"):
        Relation.parse("A < B | holds for: load").decide({"load": (1.0, 2.0)})


def test_a_residual_is_kept_to_its_decade():
    identity = Relation.parse("residual <= 1e-9 | rounding")
    assert str(identity.decide(3.1e-16)) == "1e-15 <= 1e-9"
    assert str(identity.decide({"a": 0.0, "b": -3e-12})) == "1e-11 <= 1e-9"
    assert identity.decide(9e-10).verdict == "holds"
    assert str(identity.decide(2e-9)) == "2.000000000e-9 <= 1e-9"
    assert identity.decide(2e-9).verdict == "fails"


def test_the_notation_page_has_the_conventions():
    page = (Path(__file__).parents[2] / "book" / "notation.md").read_text(encoding="utf-8")
    for convention in CONVENTIONS.values():
        assert f"| {convention.words} | {convention.meaning} |" in page
    assert "at most 1e-9 |" in page
    assert IDENTITY == 1e-9
