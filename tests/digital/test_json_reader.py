"""A controller is the same after it was written and read; what is no controller is refused."""

import json

import pytest
from cases import CASES

import pidalab
from pidalab.digital import from_json


@pytest.mark.parametrize("name", CASES)
def test_every_kind_comes_back(name):
    written, read = CASES[name], from_json(CASES[name].json())
    assert read == written
    written.reset()
    for y in (0.0, 0.3, 0.9):
        assert read.step(1.0, y) == written.step(1.0, y)


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]", '{"integral": 3}', "PIDA(1, 2)"])
def test_what_is_no_controller(text):
    with pytest.raises(ValueError, match="JSON of a digital controller"):
        from_json(text)


def test_what_was_changed_by_hand():
    stored = json.loads(pidalab.PIDA(2.0, 4.0).discretise(0.5).json())
    stored["integral"]["new"] = 0.26
    with pytest.raises(ValueError, match="changed by hand"):
        from_json(json.dumps(stored))
