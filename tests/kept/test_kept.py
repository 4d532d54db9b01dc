"""Answers of the library that nobody worked out: they are what they were, or the change is seen."""

import pytest
from asked import SUBJECTS
from kept import answer, load, same


@pytest.mark.parametrize("subject", SUBJECTS)
def test_answers_are_what_they_were(subject):
    """A number that moves without a reason is a mistake; with one, `python tests/kept/kept.py` writes it down."""
    questions, before = SUBJECTS[subject](), load(subject)
    assert list(questions) == list(before)
    found = {name: answer(question) for name, question in questions.items()}
    changed = {
        name: (before[name], one) for name, one in found.items() if not same(before[name], one, subject)
    }
    assert not changed


@pytest.mark.parametrize(
    ("new", "is_same"),
    [
        ([1.0, "L = 0.25 s"], True),
        ([1.0000001, "L = 0.25 s"], True),
        ([1.00001, "L = 0.25 s"], False),
        ([1.0, "L = 0.26 s"], True),
        ([1.0, "L = 0.27 s"], False),
        ([1.0, "T = 0.25 s"], False),
        ([1.0], False),
        (["1.0", "L = 0.25 s"], False),
        ([float("nan"), "L = 0.25 s"], False),
    ],
)
def test_what_is_the_same(new, is_same):
    assert same([1.0, "L = 0.25 s"], new) is is_same
