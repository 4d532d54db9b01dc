"""A number that a page shows is held by something else than the run that stored it."""

import re

import pytest
from displayed import SAME, SHOWN, half_unit, numbers, text_of


def wrong(shown, values):
    """List the numbers that do not round to their second values."""
    if len(shown) != len(values):
        return [f"found {len(shown)} numbers on the page, {len(values)} were expected"]
    pairs = zip(shown, values, strict=True)
    return [
        f"{text} for {value:.6g}"
        for text, value in pairs
        if abs(float(text) - value) > 1.05 * half_unit(text)
    ]


@pytest.mark.parametrize("what", SHOWN)
def test_a_displayed_number_is_computed_in_a_second_way(what):
    shown = SHOWN[what]
    found, values = numbers(shown), list(shown.others())
    assert wrong(found, values) == []
    for k, text in enumerate(found):  # whoever changes one of them is noticed
        digit = re.search(r"\d(?=\D*$)", text)
        other = f"{text[: digit.start()]}{(int(digit[0]) + 5) % 10}{text[digit.end() :]}"
        assert wrong([*found[:k], other, *found[k + 1 :]], values) != []


@pytest.mark.parametrize("what", SAME)
def test_two_places_show_the_same_number(what):
    first, second = (numbers(shown) for shown in SAME[what])
    assert len(first) == len(second) > 0
    for a, b in zip(first, second, strict=True):
        assert abs(float(a) - float(b)) <= 1.05 * max(half_unit(a), half_unit(b))


def test_every_number_is_found_in_its_page():
    shown = [*SHOWN.values(), *(one for pair in SAME.values() for one in pair)]
    assert [(one.page, one.pattern) for one in shown if not numbers(one, text_of(one.page))] == []
