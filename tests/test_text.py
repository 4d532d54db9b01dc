"""Check that text from outside keeps letters and digits, and loses all marks of languages."""

import re
import unicodedata

import pytest
from hypothesis import given, strategies as st

from pidalab._text import LONGEST_LINE, MARKS, plain_text


@given(st.text(max_size=3 * LONGEST_LINE))
def test_only_letters_digits_blanks_and_a_few_marks_pass(text):
    plain = plain_text(text)
    assert len(plain) <= LONGEST_LINE
    assert plain == " ".join(plain.split())
    assert all(x in MARKS + " " or x.isalpha() or unicodedata.category(x) == "Nd" for x in plain)
    plain.encode()  # there are no lone surrogates
    assert plain_text(plain) == plain


@given(st.text("*/(\"'\\<>&;:=?#@`$\n\r\t\0\x1b\u2028\u202e\ud800 {}[]|~^!", min_size=1))
def test_marks_of_languages_do_not_pass(text):
    assert plain_text(text) == ""


@pytest.mark.parametrize("text", ['*"""/', '"*/""', "*\\/", "(*)", "*\n/", "*\u200b/", "?\u200d?/"])
def test_removing_characters_joins_no_marks(text):
    assert not re.search(r"[*/\"()?\\]", plain_text(f"a{text}b"))


@pytest.mark.parametrize(
    "text", ["Ofen_3, 20 °C.csv", "loop-1 +5 % 2024.txt", "Prüfstand Nº1", "温度 计.csv"]
)
def test_ordinary_names_are_unchanged(text):
    assert plain_text(text) == text


def test_long_texts_are_cut_quickly():
    assert plain_text("a" * 10**8) == "a" * (LONGEST_LINE - 3) + "..."
    assert plain_text("b" * LONGEST_LINE) == "b" * LONGEST_LINE
    with pytest.raises(TypeError, match="text must be a str, found bytes"):
        plain_text(b"bytes")
