"""The border of a property, from both sides."""

import math

import pytest

from pidalab._search import border


@pytest.mark.parametrize(("inside", "outside"), [(0.0, 5.0), (-3.0, 4.0)])
def test_border_on_the_side_where_it_holds(inside, outside):
    found = border(lambda x: x < math.e, inside, outside)
    assert math.e * (1 - 2e-7) < found < math.e
    mirrored = border(lambda x: x > -math.e, -inside, -outside)
    assert mirrored == -found


def test_each_value_is_asked_once():
    asked = []
    border(lambda x: asked.append(x) or x < 1 / 3, 0.0, 1.0, share=1e-3)
    assert len(asked) == len(set(asked)) == 12
