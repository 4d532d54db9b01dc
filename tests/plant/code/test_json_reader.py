"""Write and read controllers as JSON. The controller is unchanged, and edited or other files are refused."""

import copy
import json
import math
import time

import drawn
import numpy as np
import pytest
from cases import CASES
from hypothesis import given, strategies as st

import pidalab
from pidalab.digital import from_json
from pidalab.digital.controller import DigitalController
from pidalab.digital.filters import FilterChain
from pidalab.plant.code.files import checksum

PI = pidalab.PIDA(2.0, 4.0).discretise(0.5, limits=(0.0, 10.0))
FULL = CASES["prefilter_tustin"]


@pytest.mark.parametrize("name", CASES)
def test_round_trip(name):
    written, read = CASES[name], from_json(CASES[name].json(note="a note", record="r.csv", time_unit="s"))
    assert read == written
    written.reset()
    for y in (0.0, 0.3, 0.9):
        assert read.step(1.0, y) == written.step(1.0, y)


def test_order_and_number_format_do_not_matter():
    stored = json.loads(PI.json(), parse_float=lambda x: int(float(x)) if float(x).is_integer() else float(x))
    assert from_json(json.dumps(dict(reversed(stored.items())))) == PI


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[1, 2]", '{"integral": 3}', "PIDA(1, 2)", "[" * 100000, '{"a":' * 5000, "null", "9" * 5000,
     PI.json().replace("0.25", "NaN"), PI.json().replace("0.25", "1e999"), PI.json().replace("0.25", "-Infinity"),
     PI.json().replace('"method"', '"method": "zoh", "method"'), PI.json()[:-3], PI.json() + " " * 2_000_000],
)  # fmt: skip
def test_other_files_are_refused(text):
    with pytest.raises(ValueError, match=r"JSON of a digital controller"):
        from_json(text)


def places(value, at=()):
    """Yield the places of all values of a JSON, in lists of the first three."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from places(inner, (*at, name))
    elif isinstance(value, list):
        yield at
        for i, inner in enumerate(value[:3]):
            yield from places(inner, (*at, i))
    else:
        yield at


def changed(stored, at, value):
    result = copy.deepcopy(stored)
    inner = result
    for name in at[:-1]:
        inner = inner[name]
    inner[at[-1]] = value
    return result


STORED = json.loads(FULL.json())
EVIL = "p\n    open('PWNED', 'w').write('x')\n    #"
OTHERS = [-0.5, 0, 50.0, 99.0, 1e308, None, True, [], {}, [1.0, 2.0]]
OTHERS += ["zoh", "PIDA(kp=1000)", EVIL, "clamping ahead"]
WHERE = [at for at in places(STORED) if at[0] not in ("about", "version", "checksum")]


@pytest.mark.parametrize("at", WHERE, ids=lambda at: ".".join(map(str, at)))
def test_changed_field_is_refused(at, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inner = STORED
    for name in at:
        inner = inner[name]
    for value in OTHERS:
        if value == inner and isinstance(value, bool) == isinstance(inner, bool):
            continue
        text = json.dumps(changed(STORED, at, value))
        with pytest.raises(ValueError, match=r"JSON of a digital controller|changed by hand"):
            from_json(text)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("at", "value"),
    [
        (("sample_time",), True), (("method",), "euler"), (("anti_windup",), "clamping ahead"), (("controller",), 3.0),
        (("paths", 0, "gains"), [99.0]), (("paths", 0, "name"), EVIL), (("limits",), [20.0, 30.0]),
        (("working_point", "u"), 11.0), (("integral", "grows_by"), "__import__('os')"), (("integral", "acts"), 1),
        (("largest_signal",), 1e300), (("test", "control"), []), (("coefficients", "INTEGRAL_NEW"), 0.26),
        (("prefilter",), {"num": [1.0], "den": [-1.0, 1.0], "new": 1.0, "old": 0.0, "move": [[9.0]], "out": [1.0]}),
    ],
)  # fmt: skip
def test_changed_field_is_refused_with_a_right_checksum(at, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stored = changed(json.loads(PI.json()), at, value)
    stored["checksum"] = checksum(stored)
    with pytest.raises(ValueError, match=r"JSON of a digital controller|changed by hand"):
        from_json(json.dumps(stored))
    assert not list(tmp_path.iterdir())


def test_name_of_a_path_is_not_in_the_code():
    stored = changed(json.loads(PI.json()), ("paths", 0, "name"), "class")
    stored["checksum"] = checksum(stored)
    assert "class" not in from_json(json.dumps(stored)).c().replace("part 1, class", "")


def test_length_of_the_program_is_limited():
    """Otherwise a small file could make a program of fifty thousand lines."""
    stored = json.loads(PI.json())
    path = {"weight": 1.0, "new": [0.5] * 40, "old": [0.0] * 40, "gains": [1.0] * 41}
    for count, said in ((40, "at most 160 lags together, found 1600"), (4, "changed by hand")):
        stored["paths"] = [{"name": f"p{i}", **path} for i in range(count)]
        stored["checksum"] = checksum(stored)
        begun = time.process_time()
        with pytest.raises(ValueError, match=said):
            from_json(json.dumps(stored))
        assert time.process_time() - begun < 5.0


@pytest.mark.parametrize(
    ("field", "value"),
    [("bias", "0.0; x"), ("bias", math.nan), ("weights", (1.0, "c")),
     ("growth", (math.inf, 0.0)),
     ("paths", [1]), ("paths", (1,)), ("method", "*/"), ("source", 3), ("tunable", 1),
     ("prefilter", (1.0,)), ("deadband", -1.0), ("sample_time", math.inf), ("y_offset", 1e12), ("growth", (1e16, 0.0)),
     ("tracking_gain", 2.0),
     *(("paths", (FilterChain(name, 1.0, (), (), (2.0,)),))
       for name in (EVIL, "", "a b", "A", "_x", "a__b", "é", "a" * 61, 3, None, "a\n"))],
)  # fmt: skip
def test_fields_are_checked(field, value):
    fields = {one: getattr(PI, one) for one in PI.__dataclass_fields__}
    with pytest.raises((TypeError, ValueError)):
        DigitalController(**fields | {field: value})


def test_numpy_numbers_are_accepted():
    fields = {one: getattr(PI, one) for one in PI.__dataclass_fields__}
    k = DigitalController(**fields | {"bias": np.float64(1.0), "integrates": np.True_})
    assert type(k.bias) is float
    assert k.integrates is True


@drawn.cases(10)
@given(st.text(max_size=300))
def test_name_of_a_controller_stays_text(text):
    stored = json.loads(PI.json()) | {"controller": text}
    stored["checksum"] = checksum(stored)
    k = from_json(json.dumps(stored))
    assert k.source == text
    space = {}
    exec(compile(k.python("loop"), "loop.py", "exec"), space)
    assert space["selftest"]() == 0.0
    assert k.c().count("*/") == PI.c().count("*/")
