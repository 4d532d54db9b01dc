"""Check that written code has no reserved names, and that an independent parser reads it."""

import re

import pytest
from blark.parse import parse_source_code
from cases import CASES

from pidalab.plant.code.files import FAMILIES, RESERVED, identifier

# Keywords, types and the only function in the written structured text.
WORDS = """
function_block end_function_block var_input var_output var constant end_var if then else end_if for to do end_for not
and or true false bool lreal int array of abs
"""
LANGUAGE = {*WORDS.split()}
NUMBER = re.compile(r"\d+\.\d+(?:e-?\d+)?")


def names_in(text):
    """Return the names in structured text in lower case, since compilers ignore case."""
    plain = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S).lower()
    return set(re.findall(r"[a-z_]\w*", NUMBER.sub("", plain))) - LANGUAGE


@pytest.mark.parametrize("name", CASES)
def test_no_name_is_reserved(name):
    found = names_in(CASES[name].structured_text("level"))
    assert {"level", "level_selftest", "setpoint", "control", "reset"} <= found
    assert found & RESERVED <= {"reset"}  # an input of standard blocks, not a keyword
    assert not [one for one in found if FAMILIES.fullmatch(one)]
    assert not [one for one in found if "__" in one or one.endswith("_")]


def test_reserved_words_are_refused():
    words = "action integral reference pid ramp limit r s ld st task var_temp method interface real_to_int add_real"
    words += " move sel mux double static lambda none sizeof dint persistent tested"
    for word in words.split():
        for language in ("structured_text", "c"):
            with pytest.raises(ValueError, match="name"):
                getattr(CASES["plain_pi"], language)(word)


@pytest.mark.parametrize(
    "name", ["target", "setpoint", "wanted", "fault", "integral_part", "t_e_s_t", "b_i_a_s", "test_control"]
)
def test_names_in_the_code_are_refused(name):
    k = CASES["tustin"]
    with pytest.raises(ValueError, match="name"):
        k.python(name)


def test_accepted_names():
    for name in ("pida", "level", "level_of_tank_2", "x1", "ofen", "tic_101"):
        assert identifier(name) == name


@pytest.mark.parametrize("name", ["fed_clamping", "prefilter_tustin"])
def test_blark_parses_structured_text(name):
    """The arrays of the self-test have two values, since blark is slow."""
    array = r"\[0\.\.\d+\] OF (\w+) := \[\s*(\S+, \S+?),[^\]]*\]"
    text = re.sub(array, r"[0..1] OF \1 := [\2]", CASES[name].structured_text("level"))
    assert text.count("[0..1] OF") > 6
    assert parse_source_code(text).exception is None
