"""Check numbers that pages show by a second method."""

import re

import numpy as np
import pytest
from displayed import FRONTIER, OPTIMA, SAME, SHOWN, drawn, half_unit, numbers


def wrong(shown, values):
    """List the shown numbers to which those of the second method do not round."""
    if not len(shown) == len(values) > 0:
        return [f"found {len(shown)} numbers on the page, {len(values)} were expected"]
    pairs = zip(shown, values, strict=True)
    return [
        f"{text} for {value:.6g}"
        for text, value in pairs
        if abs(float(text) - value) > 1.05 * half_unit(text)
    ]


@pytest.mark.parametrize(("page", "pattern", "second_way"), SHOWN)
def test_displayed_numbers_match_a_second_method(page, pattern, second_way):
    found, values = numbers(page, pattern), second_way()
    assert wrong(found, values) == []
    for k, text in enumerate(found):  # a changed digit of any number must be noticed
        digit = re.search(r"\d(?=\D*$)", text)
        other = f"{text[: digit.start()]}{(int(digit[0]) + 5) % 10}{text[digit.end() :]}"
        assert wrong([*found[:k], other, *found[k + 1 :]], values) != []


@pytest.mark.parametrize(("one", "other"), SAME)
def test_two_places_show_the_same_number(one, other):
    first, second = numbers(*one), numbers(*other)
    assert len(first) == len(second) > 0
    for a, b in zip(first, second, strict=True):
        assert abs(float(a) - float(b)) <= 1.05 * max(half_unit(a), half_unit(b))


@pytest.mark.parametrize("path", [OPTIMA, FRONTIER], ids=lambda path: path.stem)
def test_random_optima_of_a_study_match_the_stored_values(path):
    for _ in range(3):
        plant, (*stored, noise), (*found, continuous) = drawn(path, np.random.default_rng())
        assert found == pytest.approx(stored, rel=5e-4), plant
        assert continuous == pytest.approx(noise, rel=3e-2), plant
