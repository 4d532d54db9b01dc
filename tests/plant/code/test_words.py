"""No word of a language or of a library is a name in code; compilers that others wrote read what is written."""

import re

import pytest
from blark.parse import parse_source_code
from cases import CASES

from pidalab.plant.code.words import FAMILIES, RESERVED, identifier

# words of the language that structured text here is made of, and its types and one function
LANGUAGE = {
    "function_block",
    "end_function_block",
    "var_input",
    "var_output",
    "var",
    "constant",
    "end_var",
    "if",
    "then",
    "else",
    "end_if",
}
LANGUAGE |= {
    "for",
    "to",
    "do",
    "end_for",
    "not",
    "and",
    "or",
    "true",
    "false",
    "bool",
    "lreal",
    "int",
    "array",
    "of",
    "abs",
}
NUMBER = re.compile(r"\d+\.\d+(?:e-?\d+)?")


def names_in(text):
    """Names in structured text, in small letters, as its compilers see them."""
    plain = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S).lower()
    return set(re.findall(r"[a-z_]\w*", NUMBER.sub("", plain))) - LANGUAGE


@pytest.mark.parametrize("name", CASES)
def test_no_name_is_a_word(name):
    found = names_in(CASES[name].structured_text("level"))
    assert {"level", "level_selftest", "setpoint", "control", "reset"} <= found
    assert found & RESERVED <= {"reset"}  # an input of blocks of the standard, which is no word
    assert not [one for one in found if FAMILIES.fullmatch(one)]
    assert not [one for one in found if "__" in one or one.endswith("_")]


def test_the_table_knows_what_stopped_compilers():
    words = "action integral reference pid ramp limit r s ld st task var_temp method interface real_to_int add_real"
    words += " move sel mux double static lambda none sizeof dint persistent tested"
    for word in words.split():
        with pytest.raises(ValueError, match=r"name must be an identifier .* found"):
            CASES["plain_pi"].structured_text(word)
        with pytest.raises(ValueError, match=r"name must be an identifier .* found"):
            CASES["plain_pi"].c(word)


@pytest.mark.parametrize(
    "name", ["target", "setpoint", "wanted", "fault", "integral_part", "t_e_s_t", "b_i_a_s", "test_control"]
)
def test_names_that_the_code_has_already(name):
    k = CASES["tustin"]
    with pytest.raises(ValueError, match="name must be an identifier"):
        k.python(name)


@pytest.mark.parametrize("name", ["pida", "level", "level_of_tank_2", "x1", "ofen", "tic_101"])
def test_names_that_serve(name):
    assert identifier(name) == name


@pytest.mark.parametrize("name", ["fed_clamping", "prefilter_tustin"])
def test_a_parser_of_twincat_reads_it(name):
    """blark, which others wrote. It is slow: two values of each array of the test serve."""
    array = r"\[0\.\.\d+\] OF (\w+) := \[\s*(\S+, \S+?),[^\]]*\]"
    text = re.sub(array, r"[0..1] OF \1 := [\2]", CASES[name].structured_text("level"))
    assert text.count("[0..1] OF") > 6
    assert parse_source_code(text).exception is None


def test_the_parser_of_twincat_refuses_a_word_of_its_own():
    text = (
        CASES["plain_pi"].structured_text("level").partition("END_FUNCTION_BLOCK")[0] + "END_FUNCTION_BLOCK"
    )
    assert parse_source_code(text).exception is None
    assert parse_source_code(text.replace("target", "reference")).exception is not None
